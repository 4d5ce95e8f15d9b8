"""A recorded drive as a source that follows a log wherever it is played: the pose is the log's.

log time  ──► pose on the driven path ──► the road laid along it
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import cos, sin

from vsensor.overlay.synth import Wish
from vsensor.profile import Profile
from vsensor.sources import Inputs
from vsensor.sources.control import SPEED, YAW_RATE
from vsensor.sources.drive import RecordedDrive
from vsensor.types import Snapshot, Tick
from vsensor.world.dead_reckoning import DrivenPath, Pose

UNKNOWN_NS = 500_000_000
"""Beyond its ends a path goes on straight, at its last speed; from so far on the sensor lacks the motion."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Followed:
    """The log's time of the next tick."""

    log_ns: int = 0


class Following:
    """The source: the drive of a log, shown where the log is played."""

    def __init__(self, drive: RecordedDrive) -> None:
        self.drive = drive

    @property
    def notes(self) -> tuple[str, ...]:
        """What was done with the drive; what is in the log, who plays it says."""
        return self.drive.notes[-1:]

    @property
    def findings(self) -> tuple[str, ...]:
        """Nothing: what is wrong with the log, who plays it says."""
        return ()

    @property
    def duration_s(self) -> float:
        """As long as the log is played."""
        return float("inf")

    def initial_state(self) -> Followed:
        """Return the state before the first tick: at the beginning of the path."""
        return Followed(log_ns=int(self.drive.drive.path.t_ns[0]))

    def placed(self, state: Followed, wish: Wish) -> Followed:
        """Return the state at the log's time of the wish."""
        return replace(state, log_ns=wish.log_ns)

    def steering(self, state: Followed) -> float | None:
        """Return None: the vehicle is the recorded one."""
        return None

    def remarks(self, state: Followed) -> tuple[str, ...]:
        """Return nothing: what is wrong with the log is in `findings`."""
        return ()

    def advance(self, state: Followed, tick: Tick, inputs: Inputs) -> tuple[Followed, Snapshot]:
        """Return the truth at the log's time of the tick."""
        pose, beyond_ns = pose_at(self.drive.drive.path, state.log_ns)
        snapshot = self.drive.seen(pose, tick.t_ns)
        if beyond_ns > UNKNOWN_NS:
            snapshot = replace(snapshot, stale=(SPEED, YAW_RATE))
        return Followed(log_ns=state.log_ns + tick.period_ns), snapshot


def pose_at(path: DrivenPath, t_ns: int) -> tuple[Pose, int]:
    """Return the pose at a time, and how far that is beyond an end of the path, ns: it goes on straight."""
    inside_ns = min(max(t_ns, int(path.t_ns[0])), int(path.t_ns[-1]))
    pose = path.at(inside_ns)
    beyond_ns = min(max(t_ns - inside_ns, -UNKNOWN_NS), UNKNOWN_NS)
    if not beyond_ns:
        return pose, 0
    metres = pose.speed_mps * beyond_ns * 1e-9
    straight = replace(
        pose,
        x_m=pose.x_m + metres * cos(pose.yaw_rad),
        y_m=pose.y_m + metres * sin(pose.yaw_rad),
        s_m=pose.s_m + metres,
        yaw_rate_radps=0.0,
        acceleration_mps2=0.0,
    )
    return straight, abs(t_ns - inside_ns)


def drive_keys(profiles: Sequence[Profile]) -> frozenset[tuple[int, bool]]:
    """Return (id, is 29-bit) of the messages that tell how the vehicle moves."""
    return frozenset(
        (plan.layout.arbitration_id, plan.layout.is_extended)
        for profile in profiles
        for plan in profile.messages
        if any(binding.quantity in (SPEED, YAW_RATE) for binding in plan.told)
    )

"""A pose that comes whole from the bus, in one message or in several that are sent together."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import cos, hypot, isfinite, nan, pi, remainder, sin

from vsensor.sources.control import ACCELERATION, SPEED, YAW, YAW_RATE, Motion, Pose, X, Y, Z
from vsensor.sources.listening import LARGEST, Listened, Listener, News
from vsensor.types import Tick
from vsensor.world.vehicle import Tilt, moved

TOGETHER_NS = 50_000_000
"""Messages of one pose come within half their cycle of each other, or this where it is not known."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Track:
    """The last two poses that came whole and their times; `parts` of the next: quantity -> (t_ns, value)."""

    pose: Pose
    t_ns: int = 0
    before: Pose | None = None
    before_ns: int = 0
    is_known: bool = False
    parts: Mapping[str, tuple[int, float]] = field(default_factory=dict[str, tuple[int, float]])


class PoseControl:
    """The pose itself comes; between two it goes on along an arc, and stands when the next one is missing.

    Speed and yaw rate are those of the bus if they come, else they follow from the last two poses.
    """

    needs = senses = (X, Y, YAW)
    wanted = (X, Y, Z, YAW, SPEED, YAW_RATE, ACCELERATION)

    def __init__(self, listener: Listener) -> None:
        self._listener = listener
        channels = [listener.channels[name] for name in self.needs]
        self._together_ns = min(channel.plan.cycle_ns // 2 or TOGETHER_NS for channel in channels)
        self._timeout_ns = min(channel.timeout_ns for channel in channels)

    def initial(self, start: Pose) -> Track:
        """Return the track of a vehicle that stands at the start."""
        return Track(pose=start)

    def advance(
        self, state: Track, listened: Listened, news: Sequence[News], tick: Tick, tilt: Tilt
    ) -> tuple[Track, Motion]:
        """Return the track with the poses that came whole, and the motion on from the last."""
        track = state
        for item in news:
            track = self._with(track, item)
        if not track.is_known:
            return track, Motion(pose=track.pose)
        is_missing = any(self._listener.is_missing(listened, name) for name in self.needs)
        speed, rate = self._rates(track, listened)
        age_s = min(max(tick.t_ns - track.t_ns, 0), self._timeout_ns + tick.period_ns) * 1e-9
        pose = track.pose
        x, y, yaw = moved(pose.x_m, pose.y_m, pose.yaw_rad, speed * age_s * tilt.run, rate * age_s)
        return track, Motion(
            pose=Pose(x_m=x, y_m=y, yaw_rad=yaw),
            z_m=self._heard(listened, Z),
            speed_mps=0.0 if is_missing else speed,
            yaw_rate_radps=0.0 if is_missing else rate,
            acceleration_mps2=_or(self._heard(listened, ACCELERATION), 0.0),
        )

    def remarks(self, state: Track) -> tuple[str, ...]:
        """Return nothing."""
        return ()

    def _with(self, track: Track, item: News) -> Track:
        """Return the track with what one frame told; a pose is taken over once all of it came together."""
        told = {name: (item.t_ns, item.values[name]) for name in self.needs if name in item.values}
        parts = {**track.parts, **told}
        parts = {name: part for name, part in parts.items() if isfinite(part[1])}
        if len(parts) < len(self.needs):
            return replace(track, parts=parts)
        times = [t for t, _ in parts.values()]
        if max(times) - min(times) > self._together_ns:
            newest = max(times)
            parts = {name: part for name, part in parts.items() if newest - part[0] <= self._together_ns}
            return replace(track, parts=parts)
        pose = Pose(x_m=parts[X][1], y_m=parts[Y][1], yaw_rad=parts[YAW][1])
        before = track.pose if track.is_known else None
        return Track(pose=pose, t_ns=max(times), before=before, before_ns=track.t_ns, is_known=True)

    def _rates(self, track: Track, listened: Listened) -> tuple[float, float]:
        """Return speed and yaw rate."""
        speed, rate = 0.0, 0.0
        gap_ns = track.t_ns - track.before_ns
        if track.before is not None and 0 < gap_ns <= self._timeout_ns:
            seconds = gap_ns * 1e-9
            turned = remainder(track.pose.yaw_rad - track.before.yaw_rad, 2 * pi)
            east, north = track.pose.x_m - track.before.x_m, track.pose.y_m - track.before.y_m
            heading = track.before.yaw_rad + turned / 2.0
            ahead = east * cos(heading) + north * sin(heading)
            if hypot(east, north) < LARGEST[SPEED] * seconds:  # else it was put elsewhere
                speed, rate = ahead / seconds, turned / seconds
        return _or(self._heard(listened, SPEED), speed), _or(self._heard(listened, YAW_RATE), rate)

    def _heard(self, listened: Listened, name: str) -> float:
        """Return a quantity that need not come, NaN while it is missing."""
        if name not in self._listener.channels or self._listener.is_missing(listened, name):
            return nan
        return listened.value(name, nan)


def _or(value: float, other: float) -> float:
    return value if isfinite(value) else other

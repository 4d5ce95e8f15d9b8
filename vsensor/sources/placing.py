"""Where on the route a pose of the map is: the foot on the lane's middle, the road under the vehicle.

------x------------>  lane's middle; the foot x at the route distance s
      |
      o  the pose, `offset_m` to the left (here negative)
"""

from dataclasses import dataclass, replace
from functools import cached_property
from math import atan2, cos, hypot, isfinite, pi, remainder, sin, tan

import numpy as np

from vsensor.sources.control import Motion
from vsensor.types import Array, EgoState, frozen
from vsensor.world.corridor import Corridor
from vsensor.world.vehicle import GRAVITY_MPS2, Tilt

FARTHEST_M = 20.0
"""From the lane's middle; farther off the vehicle has left the route, and nothing of it is seen."""

BEFORE_START_M = 20.0
FOOT_M = 1e-4
"""How near the foot is found along the lane: the next step of the search is smaller than 1e-7 m."""

STEPS = 8
SEARCH_STEP_M = 10.0
JUMP_M = 50.0
"""A pose so far from the foot last found is looked for on the whole route."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Foot:
    """The place on the route: distance, offset to the left, attitude of the road; `is_on_route`."""

    s_m: float
    offset_m: float = 0.0
    z_m: float = 0.0
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    is_on_route: bool = True

    @property
    def tilt(self) -> Tilt:
        """How the road lies under the vehicle."""
        level, pull = cos(self.pitch_rad), sin(self.roll_rad)
        return Tilt(
            run=level, turn=1.0 / (level * cos(self.roll_rad)), pull_mps2=-GRAVITY_MPS2 * level * pull
        )


class Ground:
    """Finds the foot of a pose, near the last one or, if that is far away, on the whole route."""

    def __init__(self, corridor: Corridor) -> None:
        self._corridor = corridor

    def foot(self, last: Foot, step_m: float, x_m: float, y_m: float, yaw_rad: float) -> Foot:
        """Return the foot of a pose whose foot was `last` before the vehicle drove about `step_m`."""
        found = self._near(last.s_m + step_m, x_m, y_m, yaw_rad)
        if found is None or not found.is_on_route:
            s_m = self._nearest(x_m, y_m, yaw_rad)
            elsewhere = self._near(s_m, x_m, y_m, yaw_rad) if s_m is not None else None
            found = elsewhere if elsewhere is not None and elsewhere.is_on_route else None
        if found is None:
            return Foot(s_m=last.s_m, z_m=last.z_m, is_on_route=False)
        return found

    def ego(self, foot: Foot, motion: Motion, t_ns: int) -> EgoState:
        """Return the vehicle that moves like this on the road there."""
        pose, z_m, across = motion.pose, motion.z_m, motion.lateral_mps2
        ego = EgoState(
            t_ns=t_ns,
            position_world_m=frozen((pose.x_m, pose.y_m, z_m if isfinite(z_m) else foot.z_m)),
            roll_rad=foot.roll_rad,
            pitch_rad=foot.pitch_rad,
            yaw_rad=remainder(pose.yaw_rad, 2 * pi),
            speed_mps=motion.speed_mps,
            yaw_rate_radps=motion.yaw_rate_radps,
            acceleration_mps2=motion.acceleration_mps2,
            lateral_acceleration_mps2=across
            if isfinite(across)
            else motion.speed_mps * motion.yaw_rate_radps,
        )
        return replace(ego, uneven=self._corridor.uneven(foot.s_m)) if foot.is_on_route else ego

    def _near(self, s_m: float, x_m: float, y_m: float, yaw_rad: float) -> Foot | None:
        """Return the foot by Newton's method from a distance on, None if it is not found."""
        for _ in range(STEPS):
            pose = self._corridor.pose(s_m)
            x0, y0, z0 = pose.position_world_m[0].tolist()
            roll, pitch, yaw = (float(a[0]) for a in (pose.roll_rad, pose.pitch_rad, pose.yaw_rad))
            east, north = x_m - x0, y_m - y0
            if hypot(east, north) > JUMP_M:
                return None
            across = north * cos(yaw) - east * sin(yaw)
            # The lane's left, (sin(pitch) sin(roll), cos(roll)) along and across, is not quite level.
            along = east * cos(yaw) + north * sin(yaw) - across * tan(roll) * sin(pitch)
            if abs(along) < FOOT_M:
                offset = across / cos(roll)
                return Foot(
                    s_m=s_m + along / cos(pitch),
                    offset_m=offset,
                    z_m=z0 + offset * cos(pitch) * sin(roll) - along * tan(pitch),
                    **_attitude(roll, pitch, yaw, yaw_rad),
                    is_on_route=abs(offset) <= FARTHEST_M
                    and s_m >= -BEFORE_START_M
                    and abs(remainder(yaw_rad - yaw, 2 * pi)) < pi / 2,
                )
            stretch = max(1.0 - float(pose.curvature_per_m[0]) * across, 0.2)
            s_m += along / cos(pitch) / stretch
        return None

    def _nearest(self, x_m: float, y_m: float, yaw_rad: float) -> float | None:
        """Return the distance of the nearest place that leads the same way, None if none is near."""
        s, x, y, yaw = self._whole
        apart = np.hypot(x - x_m, y - y_m)
        apart[np.cos(yaw - yaw_rad) <= 0.0] = np.inf
        k = int(apart.argmin())
        return float(s[k]) if apart[k] <= FARTHEST_M + SEARCH_STEP_M else None

    def learn(self) -> None:
        """Go over the whole route now, 10 ms a km, so that no tick has to."""
        self._whole  # noqa: B018

    @cached_property
    def _whole(self) -> tuple[Array, Array, Array, Array]:
        s = np.arange(0.0, self._corridor.lap_m, SEARCH_STEP_M)
        poses = self._corridor.poses(s)
        return s, poses.position_world_m[:, 0], poses.position_world_m[:, 1], poses.yaw_rad


def _attitude(roll: float, pitch: float, yaw: float, heading: float) -> dict[str, float]:
    """Return roll and pitch of a vehicle that heads elsewhere on the plane of the lane."""
    up = (
        cos(yaw) * sin(pitch) * cos(roll) + sin(yaw) * sin(roll),
        sin(yaw) * sin(pitch) * cos(roll) - cos(yaw) * sin(roll),
        cos(pitch) * cos(roll),
    )
    c, s = cos(heading), sin(heading)
    rise = -(c * up[0] + s * up[1]) / up[2]  # of a level metre ahead
    left_z = (up[0] * s - up[1] * c) / hypot(1.0, rise)  # left is up x forward
    return {"roll_rad": atan2(left_z, up[2]), "pitch_rad": -atan2(rise, 1.0)}

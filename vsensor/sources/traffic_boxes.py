"""The traffic of a drive as boxes that stand on the road, and where the lanes beside the driven one lie."""

from math import atan2, floor

import numpy as np

from vsensor.sources.traffic import Vehicle
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation
from vsensor.types import Array, Obstacle, frozen
from vsensor.world.corridor import Corridor, Poses

OFFSETS_KEPT = 8192
OFFSET_STEP_M = 10.0
SLOWEST_MPS = 1e-3


class LanesBeside:
    """Where the middles of lanes beside lie, linear between places 10 m apart (the map takes 0.4 ms)."""

    def __init__(self, corridor: Corridor) -> None:
        self._corridor = corridor
        self._offsets: dict[tuple[int, int], float] = {}

    def offset_m(self, lanes_left: int, s_m: float) -> float:
        """Return the offset of a lane's middle to the left of the driven one's."""
        if lanes_left == 0:
            return 0.0
        place = floor(s_m / OFFSET_STEP_M)
        here, there = self._at(lanes_left, place), self._at(lanes_left, place + 1)
        return here + (s_m / OFFSET_STEP_M - place) * (there - here)

    def _at(self, lanes_left: int, place: int) -> float:
        """Return the offset of a lane; where there is none it is where one would be."""
        key = (lanes_left, place)
        if key not in self._offsets:
            if len(self._offsets) >= OFFSETS_KEPT:
                self._offsets.clear()
            s_m = place * OFFSET_STEP_M
            beside = self._corridor.lane_beside(s_m, lanes_left)
            wanted = lanes_left * self._corridor.lane_width(s_m)
            self._offsets[key] = wanted if beside is None else float(beside.offset_m[0])
        return self._offsets[key]


class TrafficBoxes:
    """The vehicles of `[[traffic]]` on a corridor."""

    def __init__(self, corridor: Corridor, vehicles: tuple[Vehicle, ...], lanes: LanesBeside) -> None:
        self._corridor, self._vehicles, self._lanes = corridor, vehicles, lanes

    def near(
        self, t_s: float, ego_m: float, ego_mps: float, behind_m: float, ahead_m: float
    ) -> tuple[Obstacle, ...]:
        """Return those from so far behind to so far ahead of a place, as boxes or meshes on the road."""
        near = [
            (number, one, ego_m + at_m)
            for number, one in enumerate(self._vehicles)
            for at_m in one.places_m(t_s, ego_m, behind_m + one.size_m[0], ahead_m)
            if self._corridor.reaches(ego_m + at_m)
        ]
        if not near:
            return ()
        offsets, across = zip(*(self._across(one, t_s, s_m) for _, one, s_m in near), strict=True)
        poses = self._corridor.poses(np.array([s_m for *_, s_m in near]), np.array(offsets))
        half_m = np.array([0.5 * one.size_m[2] for _, one, _ in near])
        centres = frozen(poses.position_world_m + half_m[:, None] * _ups(poses))
        angles = zip(poses.roll_rad.tolist(), poses.pitch_rad.tolist(), poses.yaw_rad.tolist(), strict=True)
        found = []
        for k, ((number, one, _), angle) in enumerate(zip(near, angles, strict=True)):
            roll, pitch, yaw = angle
            if across[k] != 0.0:
                bend = 1.0 - float(poses.curvature_per_m[k]) * offsets[k]
                turn = atan2(across[k], max(one.speed_mps(t_s, ego_mps) * bend, SLOWEST_MPS))
                roll, pitch, yaw = rpy_from_rotation(
                    rotation_from_rpy(*angle) @ rotation_from_rpy(0.0, 0.0, turn)
                )
            found.append(
                Obstacle(
                    id=number,
                    centre_world_m=centres[k],
                    size_m=one.size_m,
                    roll_rad=roll,
                    pitch_rad=pitch,
                    yaw_rad=yaw,
                    mesh=one.mesh,
                )
            )
        return tuple(found)

    def _across(self, one: Vehicle, t_s: float, s_m: float) -> tuple[float, float]:
        """Return a vehicle's offset to the left of the driven lane's middle, and its speed across."""
        lanes, lanes_ps, _ = one.lanes.derivatives(t_s)
        beside_m, beside_mps, _ = one.offset.derivatives(t_s)
        low = floor(lanes)
        here = self._lanes.offset_m(low, s_m)
        if lanes == low:
            return beside_m + here, beside_mps
        width = self._lanes.offset_m(low + 1, s_m) - here
        return beside_m + here + (lanes - low) * width, beside_mps + lanes_ps * width


def _ups(poses: Poses) -> Array:
    """Return the road's normals (N, 3): the third columns of Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = (
        (f(poses.roll_rad), f(poses.pitch_rad), f(poses.yaw_rad)) for f in (np.cos, np.sin)
    )
    return np.column_stack((cy * sp * cr + sy * sr, sy * sp * cr - cy * sr, cp * cr))

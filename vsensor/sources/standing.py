"""What stands along the road: boxes and meshes that never move, placed once in the world."""

from collections import OrderedDict
from math import floor, radians
from typing import Annotated

import msgspec
import numpy as np

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.sources.shapes import Shapes, Size
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation
from vsensor.types import Obstacle, frozen
from vsensor.world.blocks import cached
from vsensor.world.corridor import Corridor

PAGE_M = 100.0
"""What is near is looked for every so many metres, so that it stays the same tuple in between."""

PAGES_KEPT = 4
ALL_UP_TO = 200
"""So few are always given all: what is built of them then lasts longer than a page."""

LARGEST_M = 1000.0  # a box: a wall, a barrier


class ObstacleConfig(Config, frozen=True, kw_only=True):
    """`[[obstacle]]`: a box or a mesh that stands along the route.

    `s_m` is the distance along the route to its centre, `offset_m` to the left of the driven lane's
    middle, `z_m` its lower side above the road; `yaw_deg` turns it to the left of the lane's direction.
    """

    s_m: Annotated[float, msgspec.Meta(ge=0, le=1e6)]
    offset_m: Annotated[float, msgspec.Meta(ge=-500, le=500)] = 0.0
    z_m: Annotated[float, msgspec.Meta(ge=-100, le=100)] = 0.0
    yaw_deg: Annotated[float, msgspec.Meta(ge=-180, le=180)] = 0.0
    size_m: Size | None = None
    mesh: str | None = None


class Standing:
    """The obstacles of a scenario in the world; the same objects for the whole run."""

    def __init__(
        self, corridor: Corridor, configs: tuple[ObstacleConfig, ...], shapes: Shapes, first_id: int = 0
    ) -> None:
        """Place them; raises ConfigError for a shape that cannot be or a place beyond the route's end."""
        self._corridor = corridor
        self._all = tuple(
            _placed(corridor, config, shapes, f"obstacle[{number}]", first_id + number)
            for number, config in enumerate(configs)
        )
        self._centres = np.array([one.centre_world_m for one in self._all]).reshape(-1, 3)
        self._reach = np.array([0.5 * float(np.linalg.norm(one.size_m)) for one in self._all])
        self._pages: OrderedDict[int, tuple[Obstacle, ...]] = OrderedDict()

    def near(self, s_m: float, view_m: float) -> tuple[Obstacle, ...]:
        """Return those that reach into the view from the route distance, and some beyond."""
        if len(self._all) <= ALL_UP_TO:
            return self._all
        page = floor(s_m / PAGE_M)
        return cached(self._pages, page, PAGES_KEPT, lambda: self._around(page * PAGE_M, view_m + PAGE_M))

    def _around(self, s_m: float, radius_m: float) -> tuple[Obstacle, ...]:
        away = np.linalg.norm(self._centres - self._corridor.pose(s_m).position_world_m[0], axis=1)
        return tuple(self._all[k] for k in (away - self._reach <= radius_m).nonzero()[0].tolist())


def _placed(corridor: Corridor, config: ObstacleConfig, shapes: Shapes, where: str, number: int) -> Obstacle:
    mesh, size_m = shapes.of(config.mesh, config.size_m, where, LARGEST_M)
    if not corridor.reaches(config.s_m):
        raise ConfigError(f"{where}.s_m = {config.s_m:g}: the route ends before that")
    pose = corridor.pose(config.s_m, config.offset_m)
    road = rotation_from_rpy(float(pose.roll_rad[0]), float(pose.pitch_rad[0]), float(pose.yaw_rad[0]))
    roll, pitch, yaw = rpy_from_rotation(road @ rotation_from_rpy(0.0, 0.0, radians(config.yaw_deg)))
    return Obstacle(
        id=number,
        centre_world_m=frozen(pose.position_world_m[0] + (config.z_m + 0.5 * size_m[2]) * road[:, 2]),
        size_m=size_m,
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        mesh=mesh,
        is_moving=False,
    )

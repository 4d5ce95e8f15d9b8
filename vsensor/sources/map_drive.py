"""A drive along a lane of a map, with traffic beside and ahead, and what stands along the road."""

from math import atan2, hypot, inf
from pathlib import Path
from typing import Annotated, Literal, Protocol

import msgspec
import numpy as np

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.sources import Inputs
from vsensor.sources.manoeuvres import ManoeuvreConfig
from vsensor.sources.shapes import Shapes
from vsensor.sources.standing import ObstacleConfig, Standing
from vsensor.sources.traffic import MPS_PER_KMH, TrafficConfig, vehicle
from vsensor.sources.traffic_boxes import LanesBeside, TrafficBoxes
from vsensor.sources.weather import Weather
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation
from vsensor.types import Array, EgoState, Environment, Scene, Snapshot, Tick, frozen
from vsensor.world.corridor import Corridor, Poses
from vsensor.world.opendrive import load_map
from vsensor.world.profiles import LinearProfile, Points, SmoothProfile
from vsensor.world.route import CorridorConfig

BEHIND_M = 20.0
LONGER_THAN_X = 1.3  # a road that turns by 60 degrees within the range is 1.2 times as long as its x


class EgoConfig(Config, frozen=True, kw_only=True):
    """`[ego]`: where the drive starts, how fast, and how far to the left of the lane's centre.

    `control`: what moves it from there: "lane" speed and offset alone, "driver" a vehicle and its driver (see
    `sources.driven`), who carries out the `manoeuvre`s, else what comes from the bus (see `sources.live`).
    """

    road: str = "auto"
    lane: int | Literal["auto"] = "auto"
    s_m: Annotated[float, msgspec.Meta(ge=0)] | None = None
    route: tuple[str, ...] = ()
    lane_type: str = "driving"
    speed_kmh: Points = 100.0
    offset_m: Points = 0.0
    control: Literal["lane", "driver", "motion", "pose", "steering", "departure"] = "lane"
    manoeuvre: tuple[ManoeuvreConfig, ...] = ()

    def corridor(self) -> CorridorConfig:
        """Return where the corridor begins and which way it goes.

        Raises ConfigError for a place on no road: with road "auto" the longest drive has its own start.
        """
        if self.road == "auto":
            for key, value in (("lane", None if self.lane == "auto" else self.lane), ("s_m", self.s_m)):
                if value is not None:
                    raise ConfigError(f"ego.{key} = {value}: which road? give ego.road too")
        return CorridorConfig(
            road=self.road,
            lane=None if self.lane == "auto" else self.lane,
            s_m=self.s_m,
            route=self.route,
            lane_type=self.lane_type,
        )


class Offsets(Protocol):
    """An offset from the lane's middle over time."""

    def derivatives(self, t_s: float) -> tuple[float, float, float]:
        """Return value, first and second time derivative at `t_s`."""
        ...


class MapDrive:
    """The source of a drive over a map; everything follows from the time alone, so the state is None."""

    def __init__(
        self,
        corridor: Corridor,
        ego: EgoConfig | None = None,
        traffic: tuple[TrafficConfig, ...] = (),
        environment: Environment | Weather | None = None,
        range_m: float = 100.0,
        obstacles: tuple[ObstacleConfig, ...] = (),
        folder: Path = Path(),
    ) -> None:
        """Compile the motion; markings are given at least up to x = `range_m`, files are meant from `folder`.

        Raises ConfigError for motion and shapes that cannot be, MapError for a start that is not on the map.
        """
        ego = ego or EgoConfig()
        self.corridor = corridor
        self._speed = LinearProfile.of(ego.speed_kmh, "ego.speed_kmh", MPS_PER_KMH)
        if min(self._speed.values) < 0.0 or max(self._speed.values) > 150.0:
            raise ConfigError("ego.speed_kmh: values from 0 to 540 km/h were expected")
        offset = SmoothProfile.of(ego.offset_m, "ego.offset_m")
        self._offset: Offsets = offset
        if max(map(abs, offset.values)) > 20.0:
            raise ConfigError("ego.offset_m: at most 20 m to either side were expected")
        shapes = Shapes(folder)
        self._lanes = LanesBeside(corridor)
        vehicles = tuple(vehicle(config, number, shapes) for number, config in enumerate(traffic))
        self._traffic = TrafficBoxes(corridor, vehicles, self._lanes)
        self._standing = Standing(corridor, obstacles, shapes, first_id=len(traffic))
        self.weather = Weather.of(environment)
        self._view_m = LONGER_THAN_X * range_m + BEHIND_M

    @classmethod
    def load(
        cls,
        path: Path,
        ego: EgoConfig,
        traffic: tuple[TrafficConfig, ...],
        environment: Environment | Weather,
        range_m: float,
        obstacles: tuple[ObstacleConfig, ...] = (),
        folder: Path = Path(),
    ) -> "MapDrive":
        """Load the map and find the start; raises MapError, ConfigError."""
        corridor = Corridor(load_map(path), ego.corridor())
        return cls(corridor, ego, traffic, environment, range_m, obstacles, folder)

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the drive begins."""
        place = self.corridor.start
        return (f"drive from road {place.road_id}, lane {place.lane_id}",)

    @property
    def findings(self) -> tuple[str, ...]:
        """What was found in the map, as sentences."""
        return tuple(self.corridor.road_map.warnings)

    @property
    def duration_s(self) -> float:
        """Time until the road ends; infinite on a closed circuit or if the vehicle never gets there."""
        length_m = self.corridor.length_m
        if length_m == inf or self._speed.integral(self._speed.times_s[-1]) > length_m:
            return inf if length_m == inf else self._time_at(length_m)
        last = self._speed.values[-1]
        driven_m = self._speed.integral(self._speed.times_s[-1])
        return self._speed.times_s[-1] + (length_m - driven_m) / last if last > 0.0 else inf

    def _time_at(self, length_m: float) -> float:
        low, high = 0.0, self._speed.times_s[-1]
        for _ in range(60):
            middle = (low + high) / 2.0
            low, high = (middle, high) if self._speed.integral(middle) < length_m else (low, middle)
        return high

    def initial_state(self) -> None:
        """Return the state, which is nothing."""
        return None

    def advance(self, state: None, tick: Tick, inputs: Inputs) -> tuple[None, Snapshot | None]:
        """Return the truth at `tick.t_ns`; None once the road has ended."""
        t_s = tick.t_ns * 1e-9
        s_m = self._speed.integral(t_s)
        if not self.corridor.reaches(s_m):
            return None, None
        return None, Snapshot(t_ns=tick.t_ns, ego=self._ego(tick.t_ns, t_s, s_m), scene=self.scene(t_s, s_m))

    def remarks(self, state: None) -> tuple[str, ...]:
        """Return nothing: what is wrong is known before."""
        return ()

    def scene(self, t_s: float, s_m: float) -> Scene:
        """Return what is near the distance `s_m` at a time."""
        view = s_m - BEHIND_M, s_m + self._view_m
        return Scene(
            markings=self.corridor.markings_window(*view),
            surface=self.corridor.surface_window(*view),
            ground=self.corridor.ground_window(*view),
            obstacles=self._traffic.near(t_s, s_m, self._speed.value(t_s), BEHIND_M, self._view_m)
            + self._standing.near(s_m, self._view_m),
            environment=self.weather.at(t_s),
        )

    def lane_offset(self, lanes_left: int, s_m: float) -> float:
        """Return where the middle of a lane beside lies, to the left of the driven one's."""
        return self._lanes.offset_m(lanes_left, s_m)

    def start(self) -> EgoState:
        """Return the vehicle at the start, standing."""
        ego = self._ego(0, 0.0, 0.0)
        return EgoState(
            t_ns=0,
            position_world_m=ego.position_world_m,
            roll_rad=ego.roll_rad,
            pitch_rad=ego.pitch_rad,
            yaw_rad=ego.yaw_rad,
            speed_mps=0.0,
        )

    def speed_mps(self, t_s: float) -> float:
        """Return the speed that the scenario gives at a time."""
        return self._speed.value(t_s)

    def ego(self, t_s: float) -> EgoState:
        """Return the vehicle at a time, wherever the road ends."""
        return self._ego(round(t_s * 1e9), t_s, self._speed.integral(t_s))

    def drift(self, offset: Offsets) -> None:
        """Let the vehicle's offset from the lane's middle be another one."""
        self._offset = offset

    def _ego(self, t_ns: int, t_s: float, s_m: float) -> EgoState:
        """Return the ego's pose: the lane's plus the offset, its heading turned into the path's direction.

        The foot point moves at v along the lane, the vehicle at d = v (1 - curvature o) along it and o'
        across it; the heading leaves the lane's by atan2(o', d).
        """
        offset, across, across_rate = self._offset.derivatives(t_s)
        foot_speed, foot_rate = self._speed.value(t_s), self._speed.slope(t_s)
        step_m = 0.05
        poses = self.corridor.poses(np.array([s_m, s_m + step_m]), np.array([offset, offset]))
        curvature, ahead = poses.curvature_per_m.tolist()
        along = foot_speed * (1.0 - curvature * offset)
        curvature_rate = (ahead - curvature) / step_m * foot_speed
        along_rate = foot_rate * (1.0 - curvature * offset) - foot_speed * (
            curvature_rate * offset + curvature * across
        )
        speed = hypot(along, across)
        turn = turn_rate = 0.0
        if speed > 1e-3:
            turn = atan2(across, along)
            turn_rate = (across_rate * along - across * along_rate) / speed**2
        yaw_rate = curvature * foot_speed + turn_rate
        roll, pitch, yaw = _turned(poses, turn)
        return EgoState(
            t_ns=t_ns,
            position_world_m=frozen(poses.position_world_m[0]),
            roll_rad=roll,
            pitch_rad=pitch,
            yaw_rad=yaw,
            speed_mps=speed,
            yaw_rate_radps=yaw_rate,
            acceleration_mps2=(along * along_rate + across * across_rate) / speed
            if speed > 1e-3
            else foot_rate,
            lateral_acceleration_mps2=speed * yaw_rate,
            uneven=self.corridor.uneven(s_m),
        )


def _turned(poses: Poses, turn_rad: float) -> tuple[float, float, float]:
    """Return roll, pitch, yaw of the first pose, turned about the road's normal."""
    angles = _angles(poses, 0)
    if turn_rad == 0.0:
        return angles
    rotation: Array = rotation_from_rpy(*angles) @ rotation_from_rpy(0.0, 0.0, turn_rad)
    return rpy_from_rotation(rotation)


def _angles(poses: Poses, row: int) -> tuple[float, float, float]:
    return float(poses.roll_rad[row]), float(poses.pitch_rad[row]), float(poses.yaw_rad[row])

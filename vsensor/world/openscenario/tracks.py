"""The ways that entities drive: corridors along lanes, shared by all who are on the same lane of a road.

Where a track begins, `track_starts` says.
"""

from collections import OrderedDict
from dataclasses import replace
from math import atan2, pi, remainder

import numpy as np

from vsensor.errors import StoryError
from vsensor.types import Array
from vsensor.world.blocks import cached
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive.network import Place
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.openscenario.action_data import Position
from vsensor.world.openscenario.locate import Locator
from vsensor.world.openscenario.paths import Path, PathRun, made_path
from vsensor.world.openscenario.spots import OwnFrom, RoadSpot, Spot, Track, lane_at, section_number
from vsensor.world.openscenario.track_starts import TrackStarts
from vsensor.world.route import DRIVABLE, CorridorConfig

CORRIDORS_KEPT = 512
PATHS_KEPT = 64

OFF_ROAD = {"none", "sidewalk", "walking", "curb", "median", "tram", "rail"}
"""Lane types that are no road for OffroadCondition and for where a vehicle may start."""


class Tracks:
    """Makes corridors as they are asked for, and finds places on them."""

    def __init__(self, road_map: RoadMap, config: CorridorConfig | None = None) -> None:
        self.road_map = road_map
        self._config = config or CorridorConfig()
        self._corridors: OrderedDict[Track, Corridor] = OrderedDict()
        self._paths: OrderedDict[object, Path] = OrderedDict()
        self._starts = TrackStarts(road_map)
        self.locator = Locator(road_map)
        self.fixed: dict[Position, Spot] = {}

    def corridor(self, track: Track) -> Corridor:
        """Return the corridor of a track; raises MapError for a route that the links do not allow."""
        return cached(self._corridors, track, CORRIDORS_KEPT, lambda: self._made(track))

    def _made(self, track: Track) -> Corridor:
        road = self.road_map.road(track.road)
        number = section_number(self.road_map, track.road, track.s_m)
        lane = road.sections[number].lanes[track.lane]
        against = road.direction(track.lane, reversed_lane=lane.reversed) != track.direction
        config = CorridorConfig(
            road=track.road,
            lane=track.lane,
            s_m=track.s_m,
            route=track.route,
            spacing_m=self._config.spacing_m,
            lateral_m=self._config.lateral_m,
            against=against,
        )
        return Corridor(self.road_map, config, dict(track.groups), track.first_group)

    def path(self, run: PathRun) -> Path:
        """Return the curve of a trajectory."""
        key = run.points, run.times_s, run.clothoid
        return cached(self._paths, key, PATHS_KEPT, lambda: made_path(run))

    def lane_spot(
        self,
        road_id: str,
        lane: int,
        s_m: float,
        t_offset_m: float = 0.0,
        *,
        direction: int | None = None,
        route: tuple[str, ...] = (),
        own_from: OwnFrom | None = None,
    ) -> Spot:
        """Return the place beside a lane's middle (offset in t), driven its own way or as given."""
        road = self.road_map.road(road_id)
        number = section_number(self.road_map, road_id, s_m)
        section = road.sections[number]
        if direction is None:
            direction = road.direction(lane, reversed_lane=section.lanes[lane].reversed)
        place = Place(road.id, number, lane, direction)
        starts = self._starts
        track = starts.own(place, s_m, route, own_from) if own_from else starts.shared(place, route)
        until_m = 3.0 * road.length_m + 1000.0
        found = self.corridor(track).distance(road.id, s_m, lane, until_m=until_m)
        return Spot(track, 0.0 if found is None else found, direction * t_offset_m)

    def road_spot(self, spot: Spot) -> RoadSpot:
        """Return where on the road a place is."""
        place, s_m = self.corridor(spot.track).place(spot.s_m)
        return RoadSpot(place.road_id, s_m, place.lane_id, place.direction, place.direction * spot.offset_m)

    def t_of(self, here: RoadSpot) -> float:
        """Return t of a place on its road."""
        number = section_number(self.road_map, here.road, here.s_m)
        section = self.road_map.roads[here.road].sections[number]
        return float(section.centre(np.array([here.s_m]), here.lane)[0][0]) + here.offset_m

    def lane_of(self, here: RoadSpot) -> int | None:
        """Return the lane that a place is on, the track's if it is on its middle; None outside all."""
        if here.offset_m == 0.0:
            return here.lane
        return lane_at(self.road_map, here.road, here.s_m, self.t_of(here))

    def is_off_road(self, spot: Spot) -> bool:
        """Return whether a place is on no lane, or on one that is no road."""
        here = self.road_spot(spot)
        lane = self.lane_of(here)
        if lane is None:
            return True
        number = section_number(self.road_map, here.road, here.s_m)
        return self.road_map.roads[here.road].sections[number].lanes[lane].type in OFF_ROAD

    def pose(self, spot: Spot) -> tuple[Array, float]:
        """Return the world position (3,) and the heading of a place."""
        cubics, x, over = self.corridor(spot.track).row(spot.s_m)
        row = (cubics[0] + x * (cubics[1] + x * (cubics[2] + x * cubics[3]))).tolist()
        point = [row[k] + over * row[3 + k] + spot.offset_m * row[6 + k] for k in range(3)]
        return np.array(point), atan2(row[4], row[3]) + spot.turn_rad

    def projected(self, track: Track, s_m: float, point: Array) -> tuple[float, float, float]:
        """Return distance, offset, heading of the lane at the foot of a point near a distance (Newton)."""
        corridor = self.corridor(track)
        offset, yaw = 0.0, 0.0
        for _ in range(8):
            pose = corridor.pose(s_m)
            dx, dy, _ = (point - pose.position_world_m[0]).tolist()
            yaw = float(pose.yaw_rad[0])
            along, offset = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
            stretch = max(1.0 - float(pose.curvature_per_m[0]) * offset, 0.2)
            if abs(along) < 1e-9:
                break
            s_m += float(along) / stretch / float(np.cos(pose.pitch_rad[0]))
        return s_m, float(offset) / float(np.cos(pose.roll_rad[0])), yaw

    def world_spot(
        self, x_m: float, y_m: float, z_m: float | None, heading_rad: float | None, where: str
    ) -> Spot:
        """Return the place on the nearest road; raises StoryError far from any."""
        found = self.locator.nearest(x_m, y_m, z_m)
        if found is None:
            raise StoryError(f"{where}: ({x_m:.3f}, {y_m:.3f}) is on no road of {self.road_map.path}")
        road_id, s_m, t_m = found
        heading = float(self.road_map.road(road_id).heading(np.array([s_m]))[0])
        direction = None
        if heading_rad is not None:
            direction = 1 if abs(remainder(heading_rad - heading, 2 * pi)) <= pi / 2 else -1
        spot = self.spot_at(road_id, s_m, t_m, direction)
        if heading_rad is None:
            return spot
        _, yaw = self.pose(spot)
        return replace(spot, turn_rad=remainder(heading_rad - yaw, 2 * pi))

    def spot_at(self, road_id: str, s_m: float, t_m: float, direction: int | None = None) -> Spot:
        """Return the place at s, t of a road, on the lane there or the nearest one to drive on."""
        number = section_number(self.road_map, road_id, s_m)
        section = self.road_map.roads[road_id].sections[number]
        lane = lane_at(self.road_map, road_id, s_m, t_m)
        if lane is None or section.lanes[lane].type not in DRIVABLE:
            usable = section.of_type(*DRIVABLE) or tuple(i for i in section.ids if i != 0)
            centres = {i: float(section.centre(np.array([s_m]), i)[0][0]) for i in usable}
            if not centres:
                raise StoryError(f"{self.road_map.path}: road {road_id} has no lane at s = {s_m:g} m")
            lane = min(centres, key=lambda i: abs(centres[i] - t_m))
        centre = float(section.centre(np.array([s_m]), lane)[0][0])
        return self.lane_spot(road_id, lane, s_m, t_m - centre, direction=direction)

    def lanes_from(self, here: RoadSpot, count_left: int) -> int | None:
        """Return the lane so many lanes to the left as driven; None if there is none."""
        number = section_number(self.road_map, here.road, here.s_m)
        ids = sorted(i for i in self.road_map.roads[here.road].sections[number].lanes if i != 0)
        current = self.lane_of(here) or here.lane
        if current not in ids:
            return None
        place = ids.index(current) + here.direction * count_left
        return ids[place] if 0 <= place < len(ids) else None

    def has_lane(self, road_id: str, s_m: float, lane: int) -> bool:
        """Return whether a road has a lane at s."""
        number = section_number(self.road_map, road_id, s_m)
        return lane != 0 and lane in self.road_map.roads[road_id].sections[number].lanes

    def changed(self, spot: Spot, lane: int, changes: int) -> Spot:
        """Return the same place of the world on the track of another lane of the same road."""
        here = self.road_spot(spot)
        own_from = None
        if spot.track.is_own:
            groups = self.corridor(spot.track).groups(spot.s_m)
            own_from = OwnFrom(tuple(groups.items()), changes)
        target = self.lane_spot(
            here.road, lane, here.s_m, direction=here.direction, route=spot.track.route, own_from=own_from
        )
        point, heading = self.pose(spot)
        s_m, offset_m, yaw = self.projected(target.track, target.s_m, point)
        return Spot(target.track, s_m, offset_m, remainder(heading - yaw, 2 * pi) if spot.turn_rad else 0.0)

    def routed(self, spot: Spot, route: tuple[str, ...], changes: int) -> Spot:
        """Return the same place on the same lane with other roads ahead."""
        place, _ = self.corridor(spot.track).place(spot.s_m)
        here = self.road_spot(spot)
        own_from = None
        if spot.track.is_own:
            own_from = OwnFrom(tuple(self.corridor(spot.track).groups(spot.s_m).items()), changes)
        target = self.lane_spot(
            here.road, place.lane_id, here.s_m, direction=here.direction, route=route, own_from=own_from
        )
        return replace(spot, track=target.track, s_m=target.s_m)

    def owned(self, spot: Spot) -> Spot:
        """Return the same place on a track of the sensor's carrier."""
        place, s_m = self.corridor(spot.track).place(spot.s_m)
        target = self.lane_spot(
            place.road_id,
            place.lane_id,
            s_m,
            direction=place.direction,
            route=spot.track.route,
            own_from=OwnFrom((), 0),
        )
        return replace(spot, track=target.track, s_m=target.s_m)

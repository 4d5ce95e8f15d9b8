"""The storyboard within one step: what moved, and what is asked of it more than once is told once."""

from dataclasses import dataclass, field
from math import cos, hypot, inf, pi, remainder, sin

import numpy as np

from vsensor.types import Array
from vsensor.world.openscenario.bodies import Body, Motion, anchored, motion_of, spot_of, way_on
from vsensor.world.openscenario.model import Story
from vsensor.world.openscenario.rods import Rod
from vsensor.world.openscenario.spots import RoadSpot, Spot
from vsensor.world.openscenario.state import Happening, Memory, Phase, Running, StoryState
from vsensor.world.openscenario.tracks import Tracks

LOOK_M = 1000.0
"""How far along the roads one entity is looked for from another."""


@dataclass
class Work:
    """One step's working copy of the state; what it holds is put back into a StoryState at its end."""

    story: Story
    tracks: Tracks
    ego: int
    t_ns: int
    bodies: list[Body | None]
    phases: list[Phase]
    runs: list[int]
    memories: list[Memory]
    parameters: dict[str, str]
    running: list[Running]
    next_number: int
    before: StoryState
    marks: set[tuple[int, str]] = field(default_factory=set[tuple[int, str]])
    happened: list[Happening] = field(default_factory=list[Happening])
    fresh: set[int] = field(default_factory=set[int])
    _motions: dict[int, Motion] = field(default_factory=dict[int, Motion])
    _places: dict[int, RoadSpot] = field(default_factory=dict[int, RoadSpot])
    _poses: dict[int, tuple[Array, float]] = field(default_factory=dict[int, tuple[Array, float]])

    def put(self, entity: int, body: Body | None, motion: Motion | None = None) -> None:
        """Give an entity another state; what was told of it is forgotten, but what is known of it now."""
        self.bodies[entity] = body
        for told in (self._motions, self._places, self._poses):
            told.pop(entity, None)
        if motion is not None:
            self._motions[entity] = motion
        drawn = self.story.entities[entity].trailer
        while drawn is not None:
            self._poses.pop(drawn, None)
            drawn = self.story.entities[drawn].trailer

    def remembered(self, condition: int) -> Memory:
        """Return what a condition remembers of the step before; nothing if it is newly looked at."""
        return Memory() if condition in self.fresh else self.before.memories[condition]

    def body(self, entity: int) -> Body | None:
        """Return an entity's state, None if it is nowhere; a trailer moves as what draws it."""
        return self.bodies[entity]

    def leader(self, entity: int) -> int:
        """Return what draws an entity, at last, itself if nothing does."""
        drawn_by = self.story.entities[entity].drawn_by
        return entity if drawn_by is None else self.leader(drawn_by)

    def motion(self, entity: int) -> Motion | None:
        """Return what an entity does now, a trailer what its vehicle does."""
        entity = self.leader(entity)
        body = self.bodies[entity]
        if body is None:
            return None
        if entity not in self._motions:
            self._motions[entity] = motion_of(self.tracks, body, self.t_ns)
        return self._motions[entity]

    def spot(self, entity: int) -> Spot | None:
        """Return where an entity is on its track, a trailer where its vehicle is."""
        entity = self.leader(entity)
        body, motion = self.bodies[entity], self.motion(entity)
        return None if body is None or motion is None else spot_of(body, motion)

    def place(self, entity: int) -> RoadSpot | None:
        """Return where an entity is on its road, a trailer where its vehicle is."""
        entity = self.leader(entity)
        spot = self.spot(entity)
        if spot is None:
            return None
        if entity not in self._places:
            self._places[entity] = self.tracks.road_spot(spot)
        return self._places[entity]

    def pose(self, entity: int) -> tuple[Array, float] | None:
        """Return an entity's position (3,) in the world, and its heading."""
        spot, body = self.spot(entity), self.bodies[entity]
        if spot is None or body is None:
            return None
        if entity not in self._poses:
            self._poses[entity] = self._free_pose(entity, body) or self.tracks.pose(spot)
        return self._poses[entity]

    def _free_pose(self, entity: int, body: Body) -> tuple[Array, float] | None:
        """Return the pose of a trailer, or of one on a trajectory; None for the others."""
        drawn = self.rod(entity)
        if drawn is not None:
            return np.array(drawn[0].axle(drawn[1])), drawn[0].heading_rad
        if body.path is None:
            return None
        path = self.tracks.path(body.path)
        point, heading, _ = path.at(way_on(path, body.path, body, self.t_ns)[0])
        return np.array(point), heading

    def has_own_pose(self, entity: int) -> bool:
        """Return whether an entity's pose is not that of its track: a trailer's, one on a trajectory."""
        body = self.bodies[entity]
        return body is not None and (body.rod is not None or body.path is not None)

    def path_curvature(self, entity: int) -> float:
        """Return the curvature of the trajectory that an entity is on, 0 if it is on none."""
        body = self.bodies[entity]
        if body is None or body.path is None:
            return 0.0
        path = self.tracks.path(body.path)
        return path.at(way_on(path, body.path, body, self.t_ns)[0])[2]

    def hitch(self, entity: int) -> tuple[float, float, float]:
        """Return the point where an entity draws its trailer."""
        pose = self.pose(entity)
        assert pose is not None
        (x, y, z), heading = pose[0].tolist(), pose[1]
        along = self.story.entities[entity].hitch_m or 0.0
        return x + along * cos(heading), y + along * sin(heading), z

    def rod(self, entity: int) -> tuple[Rod, float] | None:
        """Return what a trailer is drawn by now, and its length; None for one that is not drawn."""
        one, body = self.story.entities[entity], self.bodies[entity]
        if body is None or body.rod is None or one.drawn_by is None or one.coupler_m is None:
            return None
        return body.rod.drawn(self.hitch(one.drawn_by), one.coupler_m), one.coupler_m

    def anchored(self, entity: int) -> Body | None:
        """Return an entity's state at this step, to be changed."""
        body = self.bodies[entity]
        return None if body is None else anchored(self.tracks, body, self.t_ns)

    def say(self, text: str) -> None:
        """Note what happens."""
        self.happened.append(Happening(self.t_ns, text))

    def ahead_m(self, entity: int, other: RoadSpot | None, on: Spot | None = None) -> float | None:
        """Return how far along the road a place is ahead of an entity (behind: negative); None off its way.

        On one road it is the difference of s; else the way along the lanes, up to 1 km.
        """
        here, spot = self.place(entity), self.spot(entity)
        if here is None or spot is None or other is None:
            return None
        if here.road == other.road:
            return here.direction * (other.s_m - here.s_m)
        corridor = self.tracks.corridor(spot.track)
        found = corridor.distance(other.road, other.s_m, from_m=spot.s_m, until_m=spot.s_m + LOOK_M)
        if found is not None:
            return found - spot.s_m
        if on is None:
            return None
        corridor = self.tracks.corridor(on.track)
        found = corridor.distance(here.road, here.s_m, from_m=on.s_m, until_m=on.s_m + LOOK_M)
        return None if found is None else on.s_m - found

    def extent(self, entity: int, axis_rad: float) -> tuple[float, float]:
        """Return how far an entity's box reaches from its origin along an axis: from, to."""
        box, pose = self.story.entities[entity].box, self.pose(entity)
        turn = remainder((0.0 if pose is None else pose[1]) - axis_rad, 2 * pi)
        middle = box.centre_m[0] * cos(turn) - box.centre_m[1] * sin(turn)
        half = (box.size_m[0] * abs(cos(turn)) + box.size_m[1] * abs(sin(turn))) / 2.0
        return middle - half, middle + half

    def corners(self, entity: int) -> Array:
        """Return the corners (4, 2) of an entity's box on the map."""
        box, pose = self.story.entities[entity].box, self.pose(entity)
        assert pose is not None
        (x, y, _), heading = pose[0].tolist(), pose[1]
        half_l, half_w = box.size_m[0] / 2.0, box.size_m[1] / 2.0
        local = np.array(box.centre_m[:2]) + np.array(
            [(half_l, half_w), (-half_l, half_w), (-half_l, -half_w), (half_l, -half_w)]
        )
        c, s = cos(heading), sin(heading)
        turned: Array = np.array([x, y]) + local @ np.array([[c, s], [-s, c]])
        return turned


def boxes_apart_m(first: Array, second: Array) -> float:
    """Return the distance of two convex outlines (4, 2), 0 where they touch or overlap."""
    if _overlap(first, second):
        return 0.0
    least = inf
    for corners, others in ((first, second), (second, first)):
        for corner in corners:
            for k in range(4):
                least = min(least, _to_edge(corner, others[k], others[(k + 1) % 4]))
    return least


def _to_edge(point: Array, start: Array, end: Array) -> float:
    edge = end - start
    length2 = float(edge @ edge)
    share = 0.0 if length2 == 0.0 else min(max(float((point - start) @ edge) / length2, 0.0), 1.0)
    away = point - start - share * edge
    return hypot(float(away[0]), float(away[1]))


def _overlap(first: Array, second: Array) -> bool:
    """Return whether no edge's normal parts the outlines."""
    for corners in (first, second):
        for k in range(2):
            edge = corners[k + 1] - corners[k]
            normal = np.array([-edge[1], edge[0]])
            a, b = first @ normal, second @ normal
            if a.max() < b.min() or b.max() < a.min():
                return False
    return True

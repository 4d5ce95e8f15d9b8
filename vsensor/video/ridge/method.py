"""The method joined: picture -> grid -> points -> lines of the road -> sides, from picture to picture."""

from dataclasses import dataclass, field, replace
from math import isfinite, radians

import msgspec
import numpy as np

from vsensor import tracker
from vsensor.camera import Camera
from vsensor.signals import VehicleConfig
from vsensor.tracker import TrackerConfig, TrackerState
from vsensor.types import Boundary, EgoState, LaneEstimate, Side, Sighting, Tick
from vsensor.video.ridge import lines
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.known import SAME_M, Known, Memory
from vsensor.video.ridge.paint import Points, Stencil, find, stencils
from vsensor.video.ridge.road import Road, fit_road
from vsensor.video.ridge.search import MOST_PITCH, search
from vsensor.video.types import Motion, Picture

LEAST_POINTS = 6
OWN, NEW = 1.2, 0.1
"""A line within so many lane widths bounds the own lane; the width follows the seen one by this part."""
OWN_SIDES = (Side.LEFT, Side.RIGHT)


@dataclass(frozen=True, slots=True, kw_only=True)
class RidgeState:
    """What is remembered: tracked lines, and the road as last seen."""

    tracks: TrackerState
    memory: Memory = field(default_factory=Memory)


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """What one picture gave, step by step; `road` is None where no line was found."""

    points: Points
    road: Road | None
    lines: tuple[lines.Line, ...]
    sightings: tuple[Sighting, ...]


class Ridge:
    """Our own method, ready for one camera. Raises ConfigError for a camera that sees no road."""

    def __init__(self, config: RidgeConfig, camera: Camera, vehicle: VehicleConfig | None = None) -> None:
        self.config = config
        self.ground = Ground.of(config, camera, (vehicle or VehicleConfig()).wheelbase_m)
        self.stencils: tuple[Stencil, ...] = stencils(self.config, self.ground)

    def begin(self) -> RidgeState:
        """Return the state before the first picture."""
        return RidgeState(tracks=tracker.initial_state())

    def look(self, state: RidgeState, picture: Picture, motion: Motion) -> tuple[RidgeState, LaneEstimate]:
        """Return the lines of one picture."""
        state, estimate, _ = self.examine(state, picture, motion)
        return state, estimate

    def examine(
        self, state: RidgeState, picture: Picture, motion: Motion
    ) -> tuple[RidgeState, LaneEstimate, Look]:
        """Return the lines of one picture, and what they were found from."""
        known = state.memory.now(motion, picture.t_ns)
        seen = self._seen(known, picture)
        if seen.road is not None and seen.lines:
            state = replace(state, memory=_after(state.memory, known, seen.road, seen.lines, picture.t_ns))
        ego = EgoState(
            t_ns=picture.t_ns,
            position_world_m=np.zeros(3),
            speed_mps=motion.speed_mps,
            yaw_rate_radps=motion.yaw_rate_radps,
        )
        period_ns = max(picture.t_ns - state.tracks.t_ns, 1)
        tick = Tick(index=picture.index, t_ns=picture.t_ns, period_ns=period_ns)
        sides = self._sides(state)
        tracks, assigned = tracker.assign(sides, state.tracks, seen.sightings, ego, tick)
        state = self._wide(state, assigned.boundaries)
        estimate = LaneEstimate(
            exposed_at_ns=picture.t_ns,
            image_index=picture.index,
            boundaries=tuple(line for line in assigned.boundaries if self._is_here(line)),
            lane_change=assigned.lane_change,
        )
        return replace(state, tracks=tracks), estimate, seen

    def _sides(self, state: RidgeState) -> TrackerConfig:
        """Return the tracker's limits: a line farther off than the lane is wide bounds another lane."""
        most_m = min(OWN * state.memory.lane_m, self.config.tracker.max_own_m)
        return msgspec.structs.replace(self.config.tracker, max_own_m=most_m)

    def _wide(self, state: RidgeState, boundaries: tuple[Boundary, ...]) -> RidgeState:
        """Remember how wide the lane is, where both its lines are seen well."""
        own = [line for line in boundaries if line.side in OWN_SIDES and line.measured and line.quality > 1]
        if len(own) < 2:
            return state
        left, right = (np.polyval(line.coefficients[::-1], self.ground.front_axle_m) for line in own)
        wide_m = float(left - right)
        was_m = state.memory.lane_m
        lane_m = was_m + NEW * (wide_m - was_m) if isfinite(was_m) else wide_m
        return replace(state, memory=replace(state.memory, lane_m=lane_m))

    def _is_here(self, line: Boundary) -> bool:
        """Whether a line is seen, or predicted and what was seen of it still lies ahead."""
        return line.measured or line.x_max_m > self.ground.front_axle_m

    def _seen(self, known: Known, picture: Picture) -> Look:
        config, ground = self.config, self.ground
        points = find(config, ground, self.stencils, ground.sample(picture))
        if len(points.row) < LEAST_POINTS:
            return Look(points=points, road=None, lines=(), sightings=())
        shape, offsets = search(config, ground, points, known.shape, known.rest_rad)
        if not len(offsets):
            return Look(points=points, road=None, lines=(), sightings=())
        road = fit_road(config, ground, points, shape, offsets, known)
        if abs(road.pitch_rad - known.rest_rad) > MOST_PITCH * radians(config.pitch_std_deg):
            return Look(points=points, road=None, lines=(), sightings=())
        chosen = lines.choose(config, ground, points, road, known)
        sightings = [lines.sighting(config, ground, points, road, line) for line in chosen]
        return Look(
            points=points,
            road=road,
            lines=tuple(chosen),
            sightings=tuple(seen for seen in sightings if seen.quality > 0),
        )


def _after(memory: Memory, known: Known, road: Road, seen: tuple[lines.Line, ...], t_ns: int) -> Memory:
    """Return what is known of the road after a picture of it; an outer stripe lies where it was seen now."""
    offsets = [float(road.offset_m[line.k]) for line in seen]
    doubles = [
        replace(line.double, outer_m=offset) if line.beside_m else line.double
        for line, offset in zip(seen, offsets, strict=True)
        if line.double is not None
    ]
    unseen = [
        one for one in known.doubles if all(abs(one.outer_m - other.outer_m) > SAME_M for other in doubles)
    ]
    inner = (offset + line.beside_m for line, offset in zip(seen, offsets, strict=True))
    return memory.after(road.shape, tuple(inner), (*doubles, *unseen), t_ns)

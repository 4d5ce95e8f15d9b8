"""The method joined: picture -> grid -> points -> lines of the road -> sides, from picture to picture."""

from dataclasses import dataclass, replace
from math import exp, radians

import numpy as np

from vsensor import tracker
from vsensor.camera import Camera
from vsensor.signals import VehicleConfig
from vsensor.tracker import TrackerState
from vsensor.types import NANOSECONDS_PER_SECOND, Boundary, EgoState, LaneEstimate, Sighting, Tick
from vsensor.video.ridge import lines
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.ground import Ground
from vsensor.video.ridge.paint import Points, Stencil, find, stencils
from vsensor.video.ridge.road import Road, fit_road
from vsensor.video.ridge.search import MOST_PITCH, Shape, search
from vsensor.video.types import Motion, Picture

REST_S = 3.0
"""The body's pitch at rest is the mean of so long."""
KNOWN_S = 1.0
"""A road's shape is of use for the next picture for so long."""
LEAST_POINTS = 6


@dataclass(frozen=True, slots=True, kw_only=True)
class RidgeState:
    """What is remembered: tracked lines, the road's shape when it was last seen, and the pitch at rest."""

    tracks: TrackerState
    shape: Shape | None = None
    shape_ns: int = 0
    rest_rad: float = 0.0


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
        seen = self._seen(state, picture)
        if seen.road is not None and seen.lines:
            state = self._remembered(state, seen.road, len(seen.lines), picture.t_ns)
        ego = EgoState(
            t_ns=picture.t_ns,
            position_world_m=np.zeros(3),
            speed_mps=motion.speed_mps,
            yaw_rate_radps=motion.yaw_rate_radps,
        )
        period_ns = max(picture.t_ns - state.tracks.t_ns, 1)
        tick = Tick(index=picture.index, t_ns=picture.t_ns, period_ns=period_ns)
        tracks, assigned = tracker.assign(self.config.tracker, state.tracks, seen.sightings, ego, tick)
        estimate = LaneEstimate(
            exposed_at_ns=picture.t_ns,
            image_index=picture.index,
            boundaries=tuple(line for line in assigned.boundaries if self._is_here(line)),
            lane_change=assigned.lane_change,
        )
        return replace(state, tracks=tracks), estimate, seen

    def _is_here(self, line: Boundary) -> bool:
        """Whether a line is seen, or predicted and what was seen of it still lies ahead."""
        return line.measured or line.x_max_m > self.ground.front_axle_m

    def _seen(self, state: RidgeState, picture: Picture) -> Look:
        config, ground = self.config, self.ground
        points = find(config, ground, self.stencils, ground.sample(picture.grey))
        if len(points.row) < LEAST_POINTS:
            return Look(points=points, road=None, lines=(), sightings=())
        is_recent = picture.t_ns - state.shape_ns < KNOWN_S * NANOSECONDS_PER_SECOND
        known = state.shape if is_recent else None
        shape, offsets = search(config, ground, points, known, state.rest_rad)
        if not len(offsets):
            return Look(points=points, road=None, lines=(), sightings=())
        road = fit_road(config, ground, points, shape, offsets, state.rest_rad)
        if abs(road.pitch_rad - state.rest_rad) > MOST_PITCH * radians(config.pitch_std_deg):
            return Look(points=points, road=None, lines=(), sightings=())
        chosen = lines.choose(config, ground, points, road)
        sightings = [lines.sighting(config, ground, points, road, line) for line in chosen]
        return Look(
            points=points,
            road=road,
            lines=tuple(chosen),
            sightings=tuple(seen for seen in sightings if seen.quality > 0),
        )

    def _remembered(self, state: RidgeState, road: Road, count: int, t_ns: int) -> RidgeState:
        """Keep the road's shape; two lines or more also say where the body is at rest."""
        rest = state.rest_rad
        if count >= 2:
            duration_s = (t_ns - state.shape_ns) / NANOSECONDS_PER_SECOND if state.shape else REST_S
            rest += (road.pitch_rad - rest) * (1.0 - exp(-duration_s / REST_S))
        return replace(state, shape=road.shape, shape_ns=t_ns, rest_rad=rest)

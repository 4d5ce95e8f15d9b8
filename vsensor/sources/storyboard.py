"""A drive that an OpenSCENARIO file tells: the storyboard moves everybody, one of them carries the sensor."""

from collections.abc import Mapping
from dataclasses import dataclass
from math import ceil, inf
from pathlib import Path
from typing import Annotated

import msgspec
import numpy as np

from vsensor.errors import StoryError
from vsensor.schema import Config
from vsensor.sources import Inputs
from vsensor.sources.story_files import find_road
from vsensor.sources.weather import Weather
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation
from vsensor.types import Array, EgoState, Environment, Obstacle, Scene, Snapshot, Tick, frozen
from vsensor.world.corridor import Poses
from vsensor.world.opendrive import load_map
from vsensor.world.openscenario import (
    Machine,
    Story,
    StoryState,
    Tracks,
    Work,
    boxes_near,
    load_story,
    spot_of,
)
from vsensor.world.openscenario.bodies import SLOWEST_MPS, Body, Motion
from vsensor.world.openscenario.state import STEP_NS

BEHIND_M = 20.0
LONGER_THAN_X = 1.3  # as for MapDrive: a road that turns by 60 degrees within the range
LONGEST_REHEARSAL_S = 600.0
"""So far a scenario is played through when it is loaded: its end, its events, its errors."""

MOST_TOLD = 40


class StoryboardConfig(Config, frozen=True, kw_only=True):
    """`[storyboard]`: with an .xosc as source: who carries the sensor, and values of its parameters."""

    ego: Annotated[str, msgspec.Meta(min_length=1)] = "Ego"
    parameters: Mapping[str, str | float | bool] = msgspec.field(
        default_factory=dict[str, str | float | bool]
    )

    def story(self, path: Path) -> Story:
        """Read a scenario with these words; raises StoryError."""
        given = {name: _text(value) for name, value in self.parameters.items()}
        return load_story(path, given, self.ego)


@dataclass(frozen=True, slots=True)
class Rehearsal:
    """What a scenario comes to: when it ends (inf: not within 10 minutes), and what happens, as sentences."""

    duration_s: float
    told: tuple[str, ...]


class StoryDrive:
    """The source of a scenario; its state is the storyboard's, at a step not after the tick."""

    def __init__(
        self,
        machine: Machine,
        environment: Environment | Weather | None = None,
        range_m: float = 100.0,
        notes: tuple[str, ...] = (),
        rehearsal_s: float = LONGEST_REHEARSAL_S,
    ) -> None:
        """Play the scenario through once; raises StoryError, MapError for what goes wrong on the way."""
        self.machine = machine
        self.weather = Weather.of(environment)
        self._view_m = LONGER_THAN_X * range_m + BEHIND_M
        self._notes = notes
        self._stands: dict[int, Obstacle] = {}
        self.rehearsal = self._rehearse(rehearsal_s)

    @classmethod
    def load(
        cls,
        path: Path,
        config: StoryboardConfig,
        environment: Environment | Weather,
        range_m: float = 100.0,
        rehearsal_s: float = LONGEST_REHEARSAL_S,
    ) -> "StoryDrive":
        """Read the scenario, its catalogs and its map; raises StoryError, MapError, ConfigError."""
        story = config.story(path)
        road, note = find_road(path, story.road_file)
        machine = Machine(story, Tracks(load_map(road)), config.ego)
        return cls(machine, environment, range_m, note, rehearsal_s)

    @property
    def notes(self) -> tuple[str, ...]:
        """Who carries the sensor, what was replaced, and what will happen when."""
        story = self.machine.story
        name = story.entities[self.machine.ego].name
        head = f"storyboard of {story.path}: {name} carries the sensor, {self.others} others"
        return (head, *self._notes, *story.notes, *self.rehearsal.told)

    @property
    def others(self) -> int:
        """How many entities there are beside the carrier, trailers not counted."""
        return sum(one.drawn_by is None for one in self.machine.story.entities) - 1

    @property
    def findings(self) -> tuple[str, ...]:
        """What is not played as the file says it, and what was found in the map."""
        return (*self.machine.story.findings, *self.machine.tracks.road_map.warnings)

    @property
    def duration_s(self) -> float:
        """Time until the storyboard stops or the carrier's road ends; inf if beyond 10 minutes."""
        return self.rehearsal.duration_s

    def remarks(self, state: StoryState) -> tuple[str, ...]:
        """Return nothing: what happens is told before."""
        return ()

    def initial_state(self) -> StoryState:
        """Return the state before the first tick: everybody in place."""
        return self.machine.initial_state()

    def advance(self, state: StoryState, tick: Tick, inputs: Inputs) -> tuple[StoryState, Snapshot | None]:
        """Return the truth at `tick.t_ns`; None once the scenario has ended."""
        while state.t_ns + STEP_NS <= tick.t_ns:
            state = self.machine.advance(state)
        if self._has_ended(state):
            return state, None
        work = self.machine.work(state, tick.t_ns)
        ego = ego_state(work)
        scene = self._scene(work, ego)
        return state, Snapshot(t_ns=tick.t_ns, ego=ego, scene=scene)

    def _has_ended(self, state: StoryState) -> bool:
        body = state.bodies[self.machine.ego]
        return state.ended_ns is not None or body is None or body.is_ended

    def _scene(self, work: Work, ego: EgoState) -> Scene:
        body, motion = work.body(work.ego), work.motion(work.ego)
        assert body is not None
        assert motion is not None
        corridor = work.tracks.corridor(body.track)
        view = motion.s_m - BEHIND_M, motion.s_m + self._view_m
        return Scene(
            markings=corridor.markings_window(*view),
            surface=corridor.surface_window(*view),
            ground=corridor.ground_window(*view),
            obstacles=boxes_near(work, ego.position_world_m, self._view_m, self._stands),
            environment=self.weather.at(work.t_ns / 1e9),
        )

    def _rehearse(self, longest_s: float) -> Rehearsal:
        """Play through without a sensor; the roads that the carrier comes by are built on the way."""
        state = self.machine.initial_state()
        told = [(one.t_ns, one.text) for one in state.happened]
        track = None
        for _ in range(ceil(longest_s * 1e9 / STEP_NS)):
            body = state.bodies[self.machine.ego]
            if body is not None and body.track != track:
                track = body.track
                self.machine.tracks.corridor(track).markings_window(body.s_m, body.s_m + self._view_m)
            if self._has_ended(state):
                break
            state = self.machine.advance(state)
            told += [(one.t_ns, one.text) for one in state.happened]
        duration_s = state.t_ns / 1e9 if self._has_ended(state) else inf
        if duration_s == 0.0:
            raise StoryError(
                f"{self.machine.story.path}: the storyboard stops at its start: nothing to drive"
            )
        texts = [f"{t_ns / 1e9:7.2f} s  {text}" for t_ns, text in told]
        if len(texts) > MOST_TOLD:
            texts = [*texts[:MOST_TOLD], f"... and {len(texts) - MOST_TOLD} more"]
        return Rehearsal(duration_s, tuple(texts))


def _text(value: str | float | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, float) and value == int(value) and abs(value) < 1e15:
        return str(int(value))
    return str(value)


def ego_state(work: Work) -> EgoState:
    """Return the carrier's pose and motion, its yaw rate that of its path over the ground."""
    entity = work.ego
    body, motion = work.body(entity), work.motion(entity)
    assert body is not None
    assert motion is not None
    corridor = work.tracks.corridor(body.track)
    poses = corridor.pose(motion.s_m, motion.offset_m)
    curvature = float(poses.curvature_per_m[0])
    turn = spot_of(body, motion).turn_rad
    roll, pitch, yaw = _turned(poses, turn)
    rate = _yaw_rate(work, body, motion, curvature)
    position = poses.position_world_m[0]
    if body.path is not None:
        pose = work.pose(entity)
        assert pose is not None
        position = _on_lane_plane(position, pose[0])
    return EgoState(
        t_ns=work.t_ns,
        position_world_m=frozen(position),
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        speed_mps=motion.speed_mps,
        yaw_rate_radps=rate,
        acceleration_mps2=motion.acceleration_mps2,
        lateral_acceleration_mps2=motion.speed_mps * rate,
        uneven=corridor.uneven(motion.s_m),
    )


def _on_lane_plane(lane: Array, point: Array) -> Array:
    """Return the point of a trajectory at the height of the road below it."""
    return np.array([float(point[0]), float(point[1]), float(lane[2])])


def _yaw_rate(work: Work, body: Body, motion: Motion, curvature: float) -> float:
    """Return the yaw rate: the lane's below the vehicle, and that of the path across it."""
    if motion.speed_mps < SLOWEST_MPS:
        return 0.0
    if body.path is not None:
        return motion.speed_mps * work.path_curvature(work.ego)
    along, across = motion.along_mps, motion.across_mps
    across_rate = motion.across_rate_mps2
    if across == 0.0 and across_rate == 0.0:
        return curvature * motion.foot_mps
    along_rate = (motion.speed_mps * motion.acceleration_mps2 - across * across_rate) / max(
        along, SLOWEST_MPS
    )
    return curvature * motion.foot_mps + (across_rate * along - across * along_rate) / motion.speed_mps**2


def _turned(poses: Poses, turn_rad: float) -> tuple[float, float, float]:
    """Return roll, pitch, yaw of the first pose, turned about the road's normal."""
    angles = float(poses.roll_rad[0]), float(poses.pitch_rad[0]), float(poses.yaw_rad[0])
    if turn_rad == 0.0:
        return angles
    return rpy_from_rotation(rotation_from_rpy(*angles) @ rotation_from_rpy(0.0, 0.0, turn_rad))

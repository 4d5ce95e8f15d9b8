"""The sensor's line joined: from what is there to what would be reported, once per image.

Snapshot --camera--> Observation --region, errors--> Detections --fit, tracker, quality--> LaneEstimate
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from math import isfinite, nan
from pathlib import Path

from vsensor import error_model, lanefit, motion, quality, tracker
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.draws import Draws
from vsensor.error_model import Conditions, ErrorLaw, ErrorModelConfig, ErrorState, ReportState, load_law
from vsensor.lanefit import LaneFitConfig
from vsensor.motion import Motion, MotionConfig, MotionState, load_motion
from vsensor.quality import QualityConfig
from vsensor.region import RegionConfig, limit, reach_at
from vsensor.scene import SceneConfig
from vsensor.schema import Config
from vsensor.tracker import Assignment, TrackerConfig, TrackerState
from vsensor.types import (
    Boundary,
    Detections,
    EgoState,
    LaneEstimate,
    Light,
    Observation,
    Scene,
    Snapshot,
    Tick,
    frozen,
)

Lap = Callable[[str], None]
"""Called with a stage's name when the stage has ended; the runner measures, the sensor knows no clock."""


def no_lap(stage: str) -> None:
    """Measure nothing."""


class SensorConfig(Config, frozen=True, kw_only=True):
    """The sections of a scenario that make up the sensor, and the vehicle's wheelbase."""

    camera: CameraConfig = CameraConfig()
    motion: MotionConfig = MotionConfig()
    scene: SceneConfig = SceneConfig()
    region: RegionConfig = RegionConfig()
    error_model: ErrorModelConfig = ErrorModelConfig()
    fit: LaneFitConfig = LaneFitConfig()
    tracker: TrackerConfig = TrackerConfig()
    quality: QualityConfig = QualityConfig()
    wheelbase_m: float = 2.8


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """A sensor ready to look: its configuration, compiled once. `draws` places all random numbers.

    `motion` is None where the body stands still on the road, `law` where no errors are made.
    """

    config: SensorConfig
    camera: Camera
    motion: Motion | None
    law: ErrorLaw | None
    draws: Draws

    @classmethod
    def of(cls, config: SensorConfig, seed: int = 0, folder: Path = Path()) -> "Sensor":
        """Compile `config`; a model file's relative path is meant from `folder`. Raises ConfigError."""
        return cls(
            config=config,
            camera=Camera.from_config(config.camera),
            motion=load_motion(config.motion, config.wheelbase_m, folder),
            law=load_law(config.error_model, folder),
            draws=Draws(seed),
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorState:
    """What the sensor remembers from image to image."""

    motion: MotionState
    errors: ErrorState
    reports: ReportState | None
    tracks: TrackerState


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensed:
    """What one image gave, stage by stage; `camera_ego` as in Output."""

    observation: Observation
    detections: Detections
    estimate: LaneEstimate
    camera_ego: EgoState | None = None


def initial_state() -> SensorState:
    """Return the state before the first image."""
    return SensorState(
        motion=motion.initial_state(),
        errors=error_model.initial_state(),
        reports=None,
        tracks=tracker.initial_state(),
    )


def sense(
    sensor: Sensor, state: SensorState, snapshot: Snapshot, tick: Tick, lap: Lap = no_lap
) -> tuple[SensorState, Sensed]:
    """Take one image of `snapshot` and report its lines.

    An ego state that is not finite is no exception: nothing is reported and the estimate says so.
    The body's motion is seen by the camera alone; `snapshot` is not changed.
    """
    config, ego, scene, body = sensor.config, snapshot.ego, snapshot.scene, state.motion
    seen, moved = snapshot, None
    if sensor.motion is not None:
        body, moved = motion.advance(sensor.motion, body, ego, sensor.draws, tick)
        seen = replace(snapshot, ego=moved)
    is_known = _is_finite(ego)
    if not is_known:
        ego, scene = _STANDING, Scene(markings=())
        seen = replace(snapshot, ego=ego, scene=scene)
    observation = observe(sensor.camera, config.scene, seen)
    lap("camera")
    conditions = _conditions(ego, scene)
    reach = reach_at(config.region, ego.speed_mps, error_model.reach(sensor.law, conditions))
    detections = limit(reach, observation, snapshot.t_ns)
    line_ids = tuple(scene.markings[place].group for place in detections.lines.marking.tolist())
    errors, lines = error_model.apply(
        sensor.law, state.errors, sensor.draws, tick, conditions, line_ids, detections.lines
    )
    detections = replace(detections, lines=lines)
    lap("region+error")
    fits = lanefit.fit_lines(config.fit, lines, detections.sigma_y_m)
    marking_ids = [scene.markings[place].id for place in lines.marking.tolist()]
    sightings = quality.sightings(config.quality, fits, detections, scene.environment, marking_ids)
    tracks, assignment = tracker.assign(config.tracker, state.tracks, sightings, snapshot.ego, tick)
    estimate = LaneEstimate(
        exposed_at_ns=detections.exposed_at_ns,
        image_index=tick.index,
        boundaries=_placed(assignment, scene) if is_known else (),
        lane_change=assignment.lane_change if is_known else 0,
        degraded=not is_known or bool(snapshot.stale),
    )
    reports, estimate = error_model.report(
        sensor.law, state.reports, sensor.draws, tick, conditions, estimate, reach.range_m
    )
    lap("fit+track")
    return SensorState(motion=body, errors=errors, reports=reports, tracks=tracks), Sensed(
        observation=observation, detections=detections, estimate=estimate, camera_ego=moved
    )


def _placed(assignment: Assignment, scene: Scene) -> tuple[Boundary, ...]:
    """Return the boundaries, those that are predicted with their marking's place in this scene."""
    if not assignment.predicted:
        return assignment.boundaries
    place = {marking.id: n for n, marking in enumerate(scene.markings)}
    return tuple(
        line if line.measured else replace(line, marking=place.get(assignment.predicted[line.side], -1))
        for line in assignment.boundaries
    )


def _conditions(ego: EgoState, scene: Scene) -> Conditions:
    """Return what the rule of the error model may ask for."""
    return Conditions(
        speed_mps=ego.speed_mps,
        acceleration_mps2=ego.acceleration_mps2,
        yaw_rate_radps=ego.yaw_rate_radps,
        curvature_per_m=ego.yaw_rate_radps / ego.speed_mps if ego.speed_mps > 1.0 else nan,
        night=scene.environment.light is Light.NIGHT,
        rain=scene.environment.rain,
        visibility_m=scene.environment.visibility_m,
    )


_STANDING = EgoState(t_ns=0, position_world_m=frozen([0.0, 0.0, 0.0]), speed_mps=0.0)


def _is_finite(ego: EgoState) -> bool:
    x, y, z = ego.position_world_m.tolist()
    return isfinite(
        x
        + y
        + z
        + ego.roll_rad
        + ego.pitch_rad
        + ego.yaw_rad
        + ego.speed_mps
        + ego.yaw_rate_radps
        + ego.body_roll_rad
        + ego.body_pitch_rad
        + ego.body_heave_m
    )

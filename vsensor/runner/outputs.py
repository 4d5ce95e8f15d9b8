"""Sinks of a scenario's run, opened with what the scenario says."""

from pathlib import Path

from vsensor.config import Scenario
from vsensor.draws import Draws
from vsensor.line import Line
from vsensor.profile import quantisation_error_m
from vsensor.sinks import Sink


def open_trace(path: Path, scenario: Scenario, line: Line) -> Sink:
    """Open a trace that says what ran; raises ConfigError, MissingExtraError."""
    from vsensor.sinks.trace import TraceSink

    vehicle = scenario.config.vehicle
    return TraceSink(
        path,
        front_axle_x_m=vehicle.wheelbase_m,
        metadata=_told(scenario, line),
        vehicle=vehicle,
        camera=line.sensor.camera,
    )


def open_truth(path: Path, scenario: Scenario, line: Line, *, every: int = 1) -> Sink:
    """Open the points of the true lines; raises ConfigError, MissingExtraError."""
    from vsensor.sinks.truth_points import TruthSink

    return TruthSink(path, camera=line.sensor.camera, every=every, metadata=_told(scenario, line))


def open_images(
    scenario: Scenario, line: Line, *, folder: Path | None = None, every: int = 25, video: Path | None = None
) -> Sink:
    """Open what renders images; raises ConfigError, MissingExtraError."""
    from vsensor.sinks.image import ImageSink

    return ImageSink(
        line.sensor.camera,
        scenario.config.image,
        Draws(scenario.config.seed),
        folder=folder,
        every=every,
        video=video,
        period_ns=scenario.config.cycle_ms * 1_000_000,
    )


def _told(scenario: Scenario, line: Line) -> dict[str, object]:
    """Return what a trace says of its run."""
    return {
        "scenario": scenario.name,
        "source": scenario.config.source,
        "seed": scenario.config.seed,
        "cycle_ms": scenario.config.cycle_ms,
        "profile": line.profile.name,
        "quantisation_m": {str(x): error for x, error in quantisation_error_m(line.profile).items()},
    }

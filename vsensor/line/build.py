"""A scenario loaded and compiled into a line."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import isfinite
from typing import Any, cast

import msgspec

from vsensor.config import Scenario, ScenarioConfig
from vsensor.errors import ConfigError
from vsensor.faults import faults_of
from vsensor.line.compute import Line
from vsensor.profile import load_profile
from vsensor.sensor import Sensor
from vsensor.sources import LOG_SUFFIXES, STORY_SUFFIXES, Source
from vsensor.sources.drive import RecordedDrive
from vsensor.sources.driven import DrivenDrive
from vsensor.sources.live import LiveDrive
from vsensor.sources.manoeuvres import Plan, planned
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.storyboard import LONGEST_REHEARSAL_S, StoryboardConfig, StoryDrive
from vsensor.transmit import Transmitter


def build_line(scenario: Scenario, source: Source | None = None) -> Line:
    """Load and compile everything that a scenario names; raises VsensorError subclasses.

    `source` stands in place of the one that the scenario names.
    """
    config = scenario.config
    profile = load_profile(*_profile_files(scenario))
    with _named(scenario):
        source = build_source(scenario) if source is None else source
        sensor = Sensor.of(config.sensor(), config.seed, scenario.folder)
        timeline = faults_of(config.fault, profile)
    return Line(
        source=source,
        sensor=sensor,
        vehicle=config.vehicle,
        state_config=config.state,
        transmitter=Transmitter(profile, config.vehicle, config.camera.position_m[0]),
        latency_ns=round(config.output.latency_ms * 1_000_000),
        timeline=timeline,
    )


@contextmanager
def _named(scenario: Scenario) -> Iterator[None]:
    """Put the scenario's file before a mistake that names only the key."""
    try:
        yield
    except ConfigError as error:
        if scenario.path is None or str(error).startswith(str(scenario.path)):
            raise
        raise ConfigError(f"{scenario.path}: {error}") from None


def build_source(scenario: Scenario) -> Source:
    """Open the map or the log that the scenario drives on."""
    config, path = scenario.config, scenario.source
    if not path.is_file():
        raise ConfigError(f"{scenario.path or 'source'}: source = {config.source!r}: no such file {path}")
    environment = config.environment.weather()
    reach_m = config.scene.range_m
    if path.suffix.lower() in LOG_SUFFIXES:
        _require_lane(config)
        return RecordedDrive.load(path, config.drive, config.road, scenario.folder, environment, reach_m)
    if path.suffix.lower() in STORY_SUFFIXES:
        _require_story(config)
        rehearsal_s = min(config.duration_s or LONGEST_REHEARSAL_S, LONGEST_REHEARSAL_S)
        return StoryDrive.load(path, config.storyboard, environment, reach_m, rehearsal_s)
    if config.storyboard != StoryboardConfig():
        raise ConfigError("storyboard: its keys are for an .xosc as source")
    ego = config.ego
    plan = _plan(ego)
    if plan is not None:
        ego = msgspec.structs.replace(ego, speed_kmh=plan.speed_kmh)
    drive = MapDrive.load(path, ego, config.traffic, environment, reach_m, config.obstacle, scenario.folder)
    alone: Source = drive
    if plan is not None:
        alone = DrivenDrive(drive, plan, config.driver, config.dynamics, config.vehicle)
    if ego.control in ("lane", "driver") and not config.listen.profiles:
        return alone
    return LiveDrive.load(
        drive,
        ego,
        config.listen,
        config.dynamics,
        config.vehicle.wheelbase_m,
        scenario.folder,
        config.departure,
        config.vehicle.width_m,
        alone,
    )


def _require_story(config: ScenarioConfig) -> None:
    """Raise ConfigError for what the storyboard says itself."""
    for key, is_there in (
        ("ego", config.ego != EgoConfig()),
        ("traffic", bool(config.traffic)),
        ("obstacle", bool(config.obstacle)),
        ("listen", bool(config.listen.profiles)),
    ):
        if is_there:
            raise ConfigError(
                f"{key}: the storyboard says who drives where; [storyboard] sets its parameters"
            )


def _plan(ego: EgoConfig) -> Plan | None:
    """Return what the driver is told to do, None where none drives."""
    if ego.control == "driver":
        return planned(ego.speed_kmh, ego.offset_m, ego.manoeuvre)
    if ego.manoeuvre:
        raise ConfigError(f'ego.manoeuvre: ego.control = "driver" was expected, it is "{ego.control}"')
    return None


def _require_lane(config: ScenarioConfig) -> None:
    """Raise ConfigError where a recorded drive is told to listen."""
    if config.ego.control != "lane":
        raise ConfigError(f'ego.control = "{config.ego.control}": a map as source was expected')
    if config.listen.profiles:
        raise ConfigError("listen.profile: a recorded drive listens to nothing; a map as source was expected")


def tick_count(scenario: Scenario, source: Source) -> int | None:
    """Return the number of slots of a run: the scenario's duration or the drive's; None = for ever."""
    seconds = scenario.config.duration_s
    if seconds is None:
        seconds = source.duration_s
    if not isfinite(seconds):
        return None
    return max(1, round(seconds * 1000 / scenario.config.cycle_ms))


def _profile_files(scenario: Scenario) -> tuple[Any, Any]:
    output = scenario.config.output
    name = output.profile
    if name.endswith(".toml"):
        return scenario.file(name), scenario.file(output.dbc) if output.dbc else None
    return name, cast(Any, scenario.file(output.dbc) if output.dbc else None)

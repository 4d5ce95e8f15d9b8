"""From a scenario to a sensor that can be laid over: a log, or whatever is on a bus."""

from collections.abc import Callable

from vsensor.config import Scenario
from vsensor.errors import ConfigError
from vsensor.line import Line, build_line, build_source
from vsensor.logs import LogTable
from vsensor.overlay.following import Following, drive_keys
from vsensor.overlay.on_map import OnMap
from vsensor.overlay.synth import Placed, Synth
from vsensor.overlay.taking_over import TakingOver
from vsensor.profile import Profile
from vsensor.sources import LOG_SUFFIXES, STORY_SUFFIXES
from vsensor.sources.drive import RecordedDrive, drive_of
from vsensor.sources.driven import DrivenDrive
from vsensor.sources.listening import Listener
from vsensor.sources.live import LiveDrive
from vsensor.sources.map_drive import MapDrive
from vsensor.sources.profiles import profiles_of
from vsensor.sources.steering import SteeringControl, steering_inputs
from vsensor.world.laid_road import lay_road
from vsensor.world.vehicle import SingleTrack

Read = Callable[[frozenset[tuple[int, bool]]], LogTable]
"""Reads the frames of these messages (id, is 29-bit) and the first frame of the log that is played."""


def synth_of(scenario: Scenario, read: Read | None = None, take_over_ns: int | None = None) -> Synth:
    """Compile the sensor of a scenario; `read` gives the frames of the log that it is laid over.

    A scenario whose source is a log takes the played one instead: the road is laid along its path. From
    `take_over_ns` of the log on an ECU steers its vehicle.
    """
    source = _source(scenario, read, take_over_ns)
    line = build_line(scenario, source)
    return Synth(line=line, source=source, period_ns=scenario.config.cycle_ms * 1_000_000)


def camera_keys(line: Line) -> frozenset[tuple[int, bool]]:
    """Return (id, is 29-bit) of the sensor's own messages, which the overlay replaces."""
    return frozenset(line.profile.by_id)


def heard_keys(synth: Synth) -> frozenset[tuple[int, bool]]:
    """Return (id, is 29-bit) of the messages that the source listens to."""
    source = synth.source.drive if isinstance(synth.source, OnMap) else synth.source
    if not isinstance(source, LiveDrive | TakingOver):
        return frozenset()
    layouts = [channel.plan.layout for channel in source.listener.channels.values()]
    return frozenset((layout.arbitration_id, layout.is_extended) for layout in layouts)


def vehicle_profiles(scenario: Scenario) -> list[Profile]:
    """Load the profiles through which a recorded drive is read."""
    drive = scenario.config.drive
    return profiles_of(drive.profile, drive.dbc, scenario.folder)


def _source(scenario: Scenario, read: Read | None, take_over_ns: int | None) -> Placed:
    if scenario.source.suffix.lower() in STORY_SUFFIXES:
        raise ConfigError(
            f"{scenario.path or scenario.source}: a storyboard has a time of its own: "
            "over a log, a map or a log as source was expected"
        )
    if scenario.source.suffix.lower() not in LOG_SUFFIXES:
        if take_over_ns is not None:
            raise ConfigError(
                f"--take-over: {scenario.path or scenario.source}: a log as source was expected, not a map"
            )
        on_map = build_source(scenario)
        assert isinstance(on_map, LiveDrive | DrivenDrive | MapDrive)
        return OnMap(on_map)
    if read is None:
        raise ConfigError(
            f"{scenario.path or scenario.source}: source = {scenario.config.source!r}: a map was expected, "
            "a road can be laid only along a log that is played"
        )
    config, profiles = scenario.config, vehicle_profiles(scenario)
    drive = drive_of(read(drive_keys(profiles)), profiles, config.drive)
    road = lay_road(config.road, drive.path, config.drive.offset_m)
    environment, reach_m = config.environment.weather(), config.scene.range_m
    recorded = RecordedDrive(drive, road, environment, reach_m)
    return Following(recorded) if take_over_ns is None else _taking_over(scenario, recorded, take_over_ns)


def _taking_over(scenario: Scenario, recorded: RecordedDrive, take_over_ns: int) -> TakingOver:
    config = scenario.config
    steering, _, _, _ = steering_inputs(config.listen)
    listener = Listener.load(config.listen, scenario.folder, (steering,))
    listener.require((steering,), "--take-over")
    vehicle = SingleTrack.of(config.dynamics, config.vehicle.wheelbase_m)
    control = SteeringControl(config.listen, vehicle, config.dynamics.steering_ratio, lambda t_s: 0.0)
    ratio = config.dynamics.steering_ratio
    return TakingOver(recorded, take_over_ns, control, vehicle, listener, ratio)

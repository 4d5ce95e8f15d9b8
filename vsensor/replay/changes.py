"""The changes of frames that the options ask for, as stages: repair, then translation."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from vsensor.errors import ConfigError
from vsensor.replay.options import ReplayOptions, speed_of
from vsensor.replay.stages import Stage

if TYPE_CHECKING:  # loaded where they are asked for: a third of the time to the first frame
    from vsensor.profile import Profile
    from vsensor.replay.translate import Translate


class Changes(NamedTuple):
    """Stages, the profiles that know the log's frames, and whether CAN FD frames come in."""

    stages: Sequence[Stage]
    profiles: Sequence["Profile"]
    adds_fd: bool


def changes_of(options: ReplayOptions) -> Changes:
    """Load and compile what is asked for. Raises ConfigError, DbcError.

    A profile that names no database gets it as NAME=DATABASE, or from a single --dbc.
    """
    _require_sense(options)
    if not options.repair and options.target is None:
        return Changes((), (), adds_fd=False)
    from vsensor.profile import load_worded
    from vsensor.replay.repair import Repair

    spare = options.dbc[0] if len(options.dbc) == 1 else None
    speed = 1.0 if options.fast else float(speed_of(options.speed))
    profiles = [load_worded(text, spare) for text in options.repair]
    stages = [Repair(profiles, speed=speed, keep_wrong=options.keep_wrong).stage()] if profiles else []
    if options.source is None or options.target is None:
        return Changes(stages, profiles, adds_fd=False)
    translate = _translate(options, options.source, options.target, spare, speed)
    is_fd = any(plan.layout.is_fd for plan in translate.target.messages)
    return Changes([*stages, translate.stage()], [translate.source, *profiles], adds_fd=is_fd)


def _require_sense(options: ReplayOptions) -> None:
    if options.keep_wrong and not options.repair:
        raise ConfigError("--keep-wrong: says something of --repair, which is not given")
    if (options.source is None) != (options.target is None):
        raise ConfigError(
            "--from and --as belong together: the profile of the log's frames, and the one sent"
        )
    if options.target is not None and options.overlay is not None:
        raise ConfigError("--as and --overlay exclude each other: both make the lane frames")
    for option, value in (("--camera-x", options.camera_x_m), ("--wheelbase", options.wheelbase_m)):
        if value is not None and options.target is None:
            raise ConfigError(f"{option}: says something of --as, which is not given")


def _translate(
    options: ReplayOptions, source: str, target: str, spare: Path | None, speed: float
) -> "Translate":
    import msgspec

    from vsensor.camera import CameraConfig
    from vsensor.profile import load_worded
    from vsensor.replay.translate import Translate
    from vsensor.signals import VehicleConfig

    vehicle = VehicleConfig()
    if options.wheelbase_m is not None:
        vehicle = msgspec.structs.replace(vehicle, wheelbase_m=options.wheelbase_m)
    camera_x_m = CameraConfig().position_m[0] if options.camera_x_m is None else options.camera_x_m
    return Translate(
        load_worded(source, spare),
        load_worded(target, spare),
        vehicle=vehicle,
        camera_x_m=camera_x_m,
        speed=speed,
    )

"""From the options to what is played: databases, the part of the log, its reel."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from vsensor.errors import ConfigError
from vsensor.replay.beat import Beat, beat_of
from vsensor.replay.choice import EXTENDED_KEY, Choice, Names, key, keys_of
from vsensor.replay.options import ReplayOptions, epoch_ns, log_time_ns, speed_of
from vsensor.replay.reading import Cut, Survey
from vsensor.replay.reel import PIECE, Reel, Sendable
from vsensor.replay.smooth import measured_cycles
from vsensor.replay.timeline import Pace

if TYPE_CHECKING:  # loaded where they are asked for: a third of the time to the first frame
    from vsensor.codec import Database
    from vsensor.profile import Profile

PIECE_WITHOUT_WAITING = 1024  # frames decoded at a time: fewer calls


def require_sense(options: ReplayOptions) -> None:
    """Refuse what cannot be meant, before anything is opened."""
    speed_of(options.speed)
    if options.realtime and options.fast:
        raise ConfigError("--realtime and --as-fast-as-possible exclude each other")
    if options.fast and options.speed != "1":
        raise ConfigError("--speed and --as-fast-as-possible exclude each other")
    if options.fast and options.loops == 0:
        raise ConfigError("--loop 0 plays for ever, which --as-fast-as-possible cannot: give a number")
    if options.wait_for is not None and options.start_at is not None:
        raise ConfigError("--wait-for and --start-at exclude each other: one of them starts the replay")
    if options.wait_for is not None:
        key("--wait-for", options.wait_for)
        if options.fast and not options.bus and not options.map:
            raise ConfigError("--wait-for: a frame is heard on a bus, and --log alone has none: give --bus")
    if options.start_at is not None:
        epoch_ns("--start-at", options.start_at)
    if options.take_over is not None and options.overlay is None:
        raise ConfigError("--take-over: needs --overlay, whose sensor shows the ECU where it steers")
    if options.take_over is not None and options.speed != "1":
        raise ConfigError("--take-over and --speed exclude each other: an ECU steers in real time")
    log = options.log
    if log is not None and log.exists() and options.path.exists() and log.samefile(options.path):
        raise ConfigError(f"{log}: is what is played, so it cannot be written over")


def databases_of(options: ReplayOptions) -> list["Database"]:
    """Load the databases whose names the options may use; raises ConfigError, DbcError."""
    if not options.profile:
        return loaded(options.dbc)
    if len(options.dbc) > 1:
        raise ConfigError("--dbc: with --profile one database at most, that of the profile that names none")
    from vsensor.profile import load_profiles

    profiles = load_profiles(options.profile, options.dbc[0] if options.dbc else None)
    return loaded(dict.fromkeys(profile.database for profile in profiles))


def loaded(paths: Iterable[Path]) -> list["Database"]:
    """Load databases, in this order; raises DbcError."""
    paths = list(paths)
    if not paths:
        return []
    from vsensor.codec import load_database

    return [load_database(path) for path in paths]


def names_of(databases: Sequence["Database"]) -> Names | None:
    """Return what the databases call messages; None without any."""
    return Names.of(databases) if databases else None


def cut_of(options: ReplayOptions, head: Survey, databases: Sequence["Database"]) -> Cut:
    """Return the part of the log that is played, and how often; raises ConfigError."""
    start, stop = (
        None if text is None else log_time_ns(option, text, head.start_ns)
        for option, text in (("--start", options.start), ("--stop", options.stop))
    )
    if stop is not None and stop <= (head.start_ns if start is None else start):
        raise ConfigError(f"--stop {options.stop}: lies before what is to be played begins")
    return Cut(
        start_ns=start,
        stop_ns=stop,
        loops=options.loops,
        rate_hz=options.rate_hz,
        cycles=_cycles(head, databases) if options.smooth else None,
    )


def _cycles(head: Survey, databases: Sequence["Database"]) -> dict[int, int]:
    """Return cycle times in ns by key: those of the databases; the measured medians where they have none."""
    layouts = [layout for database in databases for layout in database.layouts.values() if layout.cycle_ms]
    told = {
        layout.arbitration_id | EXTENDED_KEY * layout.is_extended: layout.cycle_ms * 1_000_000
        for layout in layouts
    }
    return measured_cycles(keys_of(head.columns), head.m_ns) | told


def rhythm(profiles: Sequence["Profile"], head: Survey, chosen: Choice) -> Beat | None:
    """Return the rhythm of the images that are repaired, as the beginning of the log has it."""
    rows = chosen.mask(head.columns, head.channels)
    return beat_of(profiles, keys_of(head.columns)[rows], head.m_ns[rows], chosen.rename)


def reel_of(options: ReplayOptions, head: Survey, chosen: Choice, cut: Cut, sendable: Sendable) -> Reel:
    """Return the log as it is played."""
    gap_ns = None if options.max_gap_s is None else round(options.max_gap_s * 1e9)
    pace = Pace(speed=speed_of(options.speed), max_gap_ns=gap_ns)
    piece = PIECE_WITHOUT_WAITING if options.fast else PIECE
    return Reel(options.path, head, choice=chosen, pace=pace, cut=cut, sendable=sendable, piece=piece)

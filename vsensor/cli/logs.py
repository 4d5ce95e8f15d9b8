"""`vsensor decode`, `convert`, `log`, `accept`: recorded frames, and what a consumer says of them."""

import argparse
import shutil
import sys
from collections.abc import Callable
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.values import bitrate, hertz, positive
from vsensor.errors import ConfigError
from vsensor.stop import stop_signals

DECODE_HELP = """\
Decode the lane signals of a CAN log through a profile: a table on a terminal, CSV with --csv.

  vsensor decode out.log
  vsensor decode out.blf --profile native --csv > lanes.csv
"""

CONVERT_HELP = """\
Write a CAN log in another format, which the suffix of OUT says; .parquet holds decoded signals.

  vsensor convert drive.blf drive.mf4
  vsensor convert drive.log drive.csv --lossy          leaves out what CSV cannot hold, and says what
  vsensor convert frames.log drive.asc --rate 100      text without times: 100 frames per second
  vsensor convert drive.blf drive.parquet --dbc car.dbc         a row per signal of a frame
  vsensor convert drive.blf lanes.parquet --profile native      a row per image

What OUT cannot hold is refused without --lossy. OUT appears when it is whole.
"""

LOG_HELP = """\
Say what is in a CAN log: channels and their load, and what every id does.

Of every id: cycle time, jitter, gaps, duplicates, counters (bits that count), and the checksum, found by
trying all known ones with their data ids.

  vsensor log drive.blf
  vsensor log drive.mf4 --dbc car.dbc --bitrate 250k --json drive.json
"""

ACCEPT_HELP = """\
Judge a stream of frames as an ECU would that reads it: a recording, or a bus for some time. Sends nothing.

  vsensor accept drive.log                            our own stream, or any sensor's with this profile
  vsensor accept --bus socketcan:can0 --duration 10   what is on the bus now; Ctrl-C ends and judges, too
  vsensor accept car.log --profile mine.toml --limits mine_limits.toml --json verdict.json

Looks for missing and late frames, wrong lengths, CRCs and counters, frozen images, torn or mixed bursts,
jumps, stuck signals, contradictions, values out of range. Each line is one kind of fault in one message: how
often, when first (seconds from the first frame), how bad, what passes, and what a consumer does about it.

A limits file needs schema = "vsensor.accept/1" and only the keys that differ: cycle_tolerance, jitter_ms,
frozen_ms, offset_step_m ..., [receiver] (AUTOSAR's tolerances), [allow] (how many of a kind pass).
Exit 0 accepted, 1 not (with the list), 2 bad input.
"""


def decode(arguments: argparse.Namespace) -> int:
    """`vsensor decode`: lane signals of a log as a table or CSV."""
    from vsensor.logs.decode import decode_log
    from vsensor.profile import load_profiles

    profiles = load_profiles(arguments.profile or ["native"], arguments.dbc)
    table = decode_log(arguments.log, profiles)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in table.csv_lines() if arguments.csv else table.text_lines(width):
        print(line)
    for finding in table.findings:
        note(finding)
    return 0


def convert(arguments: argparse.Namespace) -> int:
    """`vsensor convert`: a log in another format, or decoded."""
    from vsensor.logs.convert import convert_log
    from vsensor.logs.parquet import decode_to_parquet
    from vsensor.logs.progress import progress_bar

    source, target, rate_hz = arguments.log, arguments.out, arguments.rate
    decoding = target.suffix.lower() == ".parquet"
    if not decoding and (arguments.profile or arguments.dbc):
        raise ConfigError(f"{target}: --dbc and --profile decode signals, into .parquet")
    with progress_bar(source, shown=shows_progress(arguments)) as progress:
        if decoding:
            by = {"profiles": arguments.profile or [], "dbc": arguments.dbc}
            done = decode_to_parquet(source, target, **by, rate_hz=rate_hz, progress=progress)
        else:
            done = convert_log(source, target, lossy=arguments.lossy, rate_hz=rate_hz, progress=progress)
    print("\n".join(done.lines()))
    for one in done.notes:
        note(one)
    return 0


def log(arguments: argparse.Namespace) -> int:
    """`vsensor log`: what is in a log."""
    from vsensor.codec import load_database
    from vsensor.logs.inspect import inspect_log, write_json
    from vsensor.logs.inspect_text import text_lines
    from vsensor.logs.progress import progress_bar

    database = None if arguments.dbc is None else load_database(arguments.dbc)
    with progress_bar(arguments.log, shown=shows_progress(arguments)) as progress:
        summary = inspect_log(
            arguments.log,
            database=database,
            bitrate_bps=arguments.bitrate,
            data_bitrate_bps=arguments.data_bitrate,
            rate_hz=arguments.rate,
            progress=progress,
        )
    if arguments.json is not None:
        write_json(arguments.json, summary)
    for line in text_lines(summary):
        print(line)
    return 0


def accept(arguments: argparse.Namespace) -> int:
    """`vsensor accept`: a recording or a live bus, judged as a consumer would."""
    with stop_signals() as stopped:
        return _accept(arguments, stopped)


def _accept(arguments: argparse.Namespace, stopped: Callable[[], bool]) -> int:
    from vsensor.accept import accept_bus, accept_log, load_limits, write_report
    from vsensor.profile import load_profiles

    if (arguments.log is None) == (arguments.bus is None):
        raise ConfigError("accept: either a LOG or --bus was expected")
    if arguments.duration is not None and arguments.bus is None:
        raise ConfigError("accept: --duration is for --bus; a recording is judged as a whole")
    profiles = load_profiles(arguments.profile or ["native"], arguments.dbc)
    limits = load_limits(arguments.limits)
    if arguments.bus is None:
        judged = accept_log(arguments.log, profiles, limits)
    else:
        judged = accept_bus(arguments.bus, profiles, limits, duration_s=arguments.duration, stopped=stopped)
    if arguments.json is not None:
        write_report(arguments.json, judged)
    for line in judged.lines():
        print(line)
    return 0 if judged.is_accepted else 1


def add_decode(commands: Commands) -> None:
    """Add `vsensor decode`."""
    added = command(commands, "decode", decode, DECODE_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    added.add_argument(
        "--profile",
        action="append",
        metavar="NAME",
        help="shipped name or file, or NAME=DATABASE; repeatable (native)",
    )
    dbc_option(added, "the database of the profile that names none")
    added.add_argument("--csv", action="store_true", help="comma-separated values instead of a table")


def add_convert(commands: Commands) -> None:
    """Add `vsensor convert`."""
    added = command(commands, "convert", convert, CONVERT_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    added.add_argument("out", type=Path, help="the same formats, .gz behind those of text; or .parquet")
    added.add_argument("--lossy", action="store_true", help="leave out what OUT cannot hold, and list it")
    added.add_argument("--rate", type=hertz, metavar="HZ", help="frames per second, for text without times")
    dbc_option(added, "decode into .parquet by this database")
    added.add_argument(
        "--profile", action="append", metavar="NAME", help="decode into .parquet by this profile; repeatable"
    )
    added.add_argument("--quiet", action="store_true", help="no progress bar")


def add_log(commands: Commands) -> None:
    """Add `vsensor log`."""
    added = command(commands, "log", log, LOG_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    dbc_option(added, "names and data ids of the messages")
    added.add_argument("--json", type=Path, metavar="FILE", help="write it all as JSON too")
    added.add_argument("--rate", type=hertz, metavar="HZ", help="frames per second, for text without times")
    added.add_argument("--bitrate", type=bitrate, default="500k", metavar="RATE", help="of the bus (500k)")
    added.add_argument(
        "--data-bitrate", type=bitrate, default="2M", metavar="RATE", help="of CAN FD's data phase (2M)"
    )
    added.add_argument("--quiet", action="store_true", help="no progress bar")


def add_accept(commands: Commands) -> None:
    """Add `vsensor accept`."""
    added = command(commands, "accept", accept, ACCEPT_HELP)
    added.add_argument(
        "log", nargs="?", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped"
    )
    added.add_argument("--bus", metavar="INTERFACE:CHANNEL", help="python-can bus to listen to instead")
    added.add_argument("--duration", type=positive, metavar="S", help="listen for S seconds (until Ctrl-C)")
    added.add_argument(
        "--profile",
        action="append",
        metavar="NAME",
        help="shipped name or file, or NAME=DATABASE; repeatable (native)",
    )
    dbc_option(added, "the database of the profile that names none")
    added.add_argument(
        "--limits", type=Path, metavar="FILE", help="limits that differ from the defaults: .toml"
    )
    added.add_argument("--json", type=Path, metavar="FILE", help="write the verdict for programs")

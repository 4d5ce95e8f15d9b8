"""`vsensor monitor`, `examine`: what people look at."""

import argparse
import sys
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.scanning import reading_options, reference_of
from vsensor.cli.values import port, positive
from vsensor.stop import stop_signals

MONITOR_HELP = """\
Show a bus through a profile: lines, other quantities, and of every message cycle, counter, CRC and quality.

  vsensor monitor --bus socketcan:can0                               our own stream, or any with this profile
  vsensor monitor --bus socketcan:can0 --profile mine.toml --profile vehicle
  vsensor monitor --bus pcan:PCAN_USBBUS1 --profile honda=honda.dbc
  vsensor monitor --bus socketcan:can0 --duration 60 > night.txt     in a pipe: a line a second

Sends nothing. In place on a terminal; in a pipe a line a second, and one whenever a message changes: silent
(for 3 cycles), too short, wrong CRC, counter stands, N lost, not trusted (AUTOSAR's receiver), cycle off (by
10 %), ok. Offsets are as the bus has them, in metres, left positive. Ctrl-C ends with the tables.
"""

EXAMINE_HELP = """\
Look at a recorded drive in the browser: from above, and its lane errors, ranges, width, quality over time.

  vsensor examine drive.blf                                        profiles native and vehicle
  vsensor examine drive.mf4 --profile mine.toml --profile car=car.dbc --reference map town.xodr
  vsensor examine real.blf --compare virtual.blf                   two drives over each other
  vsensor examine run.blf --trace run.npz                          and why each line was not seen

The page is served to this machine alone and loads nothing from outside. Errors are those of `vsensor scan`,
with the same references and limits. Space plays, arrows step (with shift by 25 images), home and end; a click
on a point jumps there; the address restores the view. Ctrl-C ends.
"""


def examine(arguments: argparse.Namespace) -> int:
    """`vsensor examine`: a recorded drive as a page."""
    from dataclasses import replace

    from vsensor.apps.examine.causes import causes_of
    from vsensor.apps.examine.drive import load_drive
    from vsensor.apps.examine.page import make_app, require_dash
    from vsensor.apps.examine.server import PageServer
    from vsensor.field.scan import ScanOptions
    from vsensor.logs.progress import progress_bar

    require_dash()
    options = ScanOptions(
        profiles=tuple(arguments.profile or ScanOptions().profiles),
        dbc=None if arguments.dbc is None else str(arguments.dbc),
        reference=reference_of(arguments.reference),
        route=tuple(arguments.route.split(",")) if arguments.route else (),
        limits=None if arguments.limits is None else str(arguments.limits),
    )
    with progress_bar(arguments.log, shown=shows_progress(arguments)) as progress:
        drive = load_drive(arguments.log, options, progress)
    if arguments.compare is not None:
        with progress_bar(arguments.compare, shown=shows_progress(arguments)) as progress:
            drive = replace(drive, other=load_drive(arguments.compare, options, progress))
    if arguments.trace is not None:
        drive = replace(drive, causes=causes_of(arguments.trace, drive))
    with stop_signals() as stopped, PageServer(make_app(drive), arguments.port) as server:
        print(f"{arguments.log.name} is at {server.url}; Ctrl-C ends", flush=True)
        for text in drive.scanned.notes:
            note(text)
        if not arguments.no_browser:
            server.show()
        server.wait(stopped, arguments.duration)
        return 130 if stopped() else 0


def monitor(arguments: argparse.Namespace) -> int:
    """`vsensor monitor`: a bus as text."""
    from vsensor.apps.monitor import monitor_bus
    from vsensor.profile import load_profiles

    with stop_signals() as stopped:
        profiles = load_profiles(arguments.profile or ["native"], arguments.dbc)
        monitor_bus(
            arguments.bus,
            profiles,
            sys.stdout,
            duration_s=arguments.duration,
            every_s=arguments.every,
            stopped=stopped,
        )
        return 130 if stopped() else 0


def add_monitor(commands: Commands) -> None:
    """Add `vsensor monitor`."""
    added = command(commands, "monitor", monitor, MONITOR_HELP)
    option = added.add_argument
    option("--bus", required=True, metavar="INTERFACE:CHANNEL", help="python-can bus to listen to")
    option(
        "--profile",
        action="append",
        metavar="NAME",
        help="shipped name or file, or NAME=DATABASE; repeatable (native)",
    )
    dbc_option(added, "the database of the profile that names none")
    option("--duration", type=positive, metavar="S", help="end after S seconds (until Ctrl-C)")
    option("--every", type=positive, metavar="S", help="draw (0.1) or write a line (1) every S seconds")


def add_examine(commands: Commands) -> None:
    """Add `vsensor examine`."""
    added = command(commands, "examine", examine, EXAMINE_HELP)
    option = added.add_argument
    option("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    reading_options(added, "gta (default), map FILE.xodr, or a line FILE.csv, .parquet")
    option(
        "--compare",
        type=Path,
        metavar="LOG2",
        help="lay another log's analysis over it, by the same profiles",
    )
    option("--trace", type=Path, metavar="FILE", help="the run's trace: why a line was not seen")
    option("--port", type=port, metavar="N", help="of 127.0.0.1 (the first free one from 8765 on)")
    option("--duration", type=positive, metavar="S", help="end after S seconds (until Ctrl-C)")
    option("--no-browser", action="store_true", help="do not open a browser")
    option("--quiet", action="store_true", help="no progress bar")

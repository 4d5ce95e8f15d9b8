"""`vsensor monitor`: what people look at."""

import argparse
import sys

from vsensor.cli.adding import Commands, command, dbc_option
from vsensor.cli.values import positive
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

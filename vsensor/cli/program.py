"""The program: its commands in the order of --help, and what becomes of their errors.

Exit status: 0 done, 1 a check said no, 2 bad input (one line on stderr), 130 ended by Ctrl-C.
"""

import argparse
import os
import sys
from collections.abc import Callable, Sequence
from typing import NoReturn

from vsensor.cli import (
    examining,
    experiments,
    learning,
    logs,
    looking,
    playing,
    profiles,
    roads,
    scanning,
    scenarios,
    video,
)
from vsensor.errors import VsensorError

COMMANDS = (
    scenarios.add_run,
    scenarios.add_check,
    logs.add_decode,
    logs.add_convert,
    logs.add_log,
    scenarios.add_score,
    logs.add_accept,
    scenarios.add_sweep,
    experiments.add_experiment,
    playing.add_replay,
    playing.add_gateway,
    looking.add_monitor,
    looking.add_examine,
    scanning.add_scan,
    scanning.add_table,
    learning.add_tune,
    learning.add_validate,
    examining.add_density,
    examining.add_influence,
    roads.add_road,
    profiles.add_profile,
    video.add_video,
)
"""Each adds one command; the order is that of --help."""


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        command = self.prog.removeprefix("vsensor").strip()
        print(f"vsensor: {message}; see vsensor {command}{' ' * bool(command)}--help", file=sys.stderr)
        sys.exit(2)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    # One core is enough, and OpenBLAS threads would disturb the cycle; numpy reads it when it is loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if argv is None:
        _leave_out_asammdf()
    arguments = _parser().parse_args(argv)
    command: Callable[[argparse.Namespace], int] = arguments.command
    try:
        status = command(arguments)
        sys.stdout.flush()
        return status
    except VsensorError as error:
        print(f"vsensor: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # what writes files has told its own by now: this is standard output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        where = f"{error.filename}: " if error.filename else "standard output: "
        print(f"vsensor: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


def _leave_out_asammdf() -> None:
    """Keep asammdf out of a process that is ours, where it is installed.

    python-can loads it, with pandas, for logs that are read here without it: half of the time to the first
    frame. To python-can it is then not installed.
    """
    sys.modules.setdefault("asammdf", None)  # type: ignore[arg-type]


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="vsensor",
        description="A virtual lane-detection sensor: a road scene in, DBC-defined lane frames on CAN out.",
        epilog="Start with `vsensor run`; every command explains itself with --help.",
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for add in COMMANDS:
        add(commands)
    return parser


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"vsensor {version('vsensor')}"
    except PackageNotFoundError:
        return "vsensor (not installed)"

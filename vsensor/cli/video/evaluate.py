"""`vsensor video evaluate`: a video's offsets against CAN, and against the truth where there is one."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, note, shows_progress
from vsensor.cli.values import count, hertz

EVALUATE_HELP = """\
Compare the lane offsets of videos with those on the CAN bus: tables and pictures, methods side by side.

  vsensor video evaluate events --out results
  vsensor video evaluate events --out results --rate 4 --fill      as published: 4 pictures/s, gaps filled
  vsensor video evaluate events --out results --limit 50 --workers 1

EVENTS is a folder of events, or one: folders with event.toml, a video, its CAN log, and truth.parquet where
it is known (vsensor video make and vsensor video events write them). Each method runs on each event, in
parallel; what is finished is kept in DIR/cells and not run again. An event is reliable if --share of its CAN
offsets have --confidence or more; others are masked. Errors are distances: positive where the video says too
far out.

Into DIR: report.html, table.csv (the published table 3.2, by light, road and driving), events.csv,
rows/METHOD/EVENT.csv. Exit 1 if an event failed.
"""


def evaluate(arguments: argparse.Namespace) -> int:
    """`vsensor video evaluate`: methods over events."""
    from vsensor.video.evaluate.report import EvaluateOptions
    from vsensor.video.evaluate.report import evaluate as evaluated
    from vsensor.video.evaluate.rules import Rules
    from vsensor.video.evaluate.runs import RunOptions
    from vsensor.video.methods import METHODS
    from vsensor.video.settings import read_settings

    options = EvaluateOptions(
        out=arguments.out,
        methods=tuple(arguments.method.split(",")) if arguments.method else tuple(METHODS),
        rules=Rules(share=arguments.share, least_confidence=arguments.confidence, fill=arguments.fill),
        which=arguments.events_taken,
        pictures=not arguments.no_pictures,
        run=RunOptions(
            settings=read_settings(arguments.settings),
            rate_hz=arguments.rate,
            limit=arguments.limit,
            scheduler=arguments.scheduler,
            workers=arguments.workers,
            progress=shows_progress(arguments),
        ),
    )
    found = evaluated(arguments.events, options, note)
    if found.lines:
        print("\n".join(found.lines))
    for text in found.missing:
        note(f"no pictures in the report: {text}")
    for text in found.failures:
        note(f"not compared: {text}")
    if found.interrupted:
        note("stopped; the same command goes on with the rest")
        return 130
    return int(bool(found.failures))


def _part(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1.0:
        raise argparse.ArgumentTypeError(f"{text}: expected a share from 0 to 1")
    return value


def add_evaluate(commands: Commands) -> None:
    """Add `vsensor video evaluate`."""
    added = command(commands, "evaluate", evaluate, EVALUATE_HELP)
    option = added.add_argument
    option("events", type=Path, metavar="EVENTS", help="folder of events, or one event")
    option("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    option("--method", metavar="NAME,NAME", help="methods to compare (all)")
    option("--settings", type=Path, metavar="FILE", help="settings of the methods: .toml")
    option("--rate", type=hertz, metavar="HZ", help="pictures per second that are looked at (all)")
    option("--limit", type=count, metavar="N", help="only the first N pictures of each event (all)")
    option("--share", type=_part, default=0.6, metavar="P", help="of reliable CAN offsets in an event (0.6)")
    option(
        "--confidence",
        type=int,
        choices=range(1, 5),
        default=3,
        help="from which on a CAN offset is reliable (3)",
    )
    option(
        "--events-taken",
        choices=("reliable", "unreliable", "all"),
        default="reliable",
        help="which events (reliable)",
    )
    option("--fill", action="store_true", help="fill gaps: CAN up to 50 m, the published method's up to 2 s")
    option("--no-pictures", action="store_true", help="tables and rows only")
    option("--scheduler", metavar="ADDRESS", help="Dask scheduler; its workers must see the same files")
    option("--workers", type=count, metavar="N", help="local processes (all cores)")
    option("--quiet", action="store_true", help="no progress bar")

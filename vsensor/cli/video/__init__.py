"""`vsensor video SUB`: a front video as lane offsets. A module for each SUB; a new one goes into SUBS."""

import argparse

from vsensor.cli.adding import Commands
from vsensor.cli.video import calibrate, evaluate, events, make, mount, run, score, sensitivity, view

VIDEO_HELP = """\
Lane offset from a front video: the camera found, offsets read, compared with CAN.

  vsensor video calibrate boards/*.jpg --board 9x6 --out camera.toml       the lens, from chessboards
  vsensor video mount drive.mp4 --camera camera.toml --lane-width 3.5 --out mounted.toml   the pose
  vsensor video run drive.mp4 --camera camera.toml --out offsets.csv       offsets, and CAN frames
  vsensor video make events --events 100                                   made drives with truth and CAN
  vsensor video events drive.blf                                           events in a long log
  vsensor video evaluate events --out results                              methods against CAN and truth
  vsensor video score labels.toml --images DIR --camera camera.toml        methods against hand labels
  vsensor video sensitivity results/rows/ours --camera camera.toml --out DIR   where the camera stands
  vsensor video view drive.mp4 --camera camera.toml --rows rows.csv --out view.mp4   signals drawn
"""

SUBS = (
    calibrate.add_calibrate,
    mount.add_mount,
    run.add_run,
    make.add_make,
    events.add_events,
    evaluate.add_evaluate,
    score.add_score,
    sensitivity.add_sensitivity,
    view.add_view,
)
"""Each adds one subcommand; the order is that of --help."""


def add_video(commands: Commands) -> None:
    """Add `vsensor video`."""
    added = commands.add_parser(
        "video",
        help=VIDEO_HELP.split("\n", 1)[0],
        description=VIDEO_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    subs = added.add_subparsers(required=True, metavar="SUB")
    for add in SUBS:
        add(subs)

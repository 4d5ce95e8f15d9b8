"""`vsensor video view`: a video with its signals drawn."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.video.words import camera_option, limit_option, rate_option, video_argument

VIEW_HELP = """\
Draw lane offsets into their video: as it was seen, from above, or both side by side.

  vsensor video view drive.mp4 --camera camera.toml --rows rows.csv --out view.mp4
  vsensor video view drive.mp4 --camera camera.toml --rows rows.csv --can drive.blf --out view.avi
  vsensor video view drive.mp4 --camera camera.toml --view top --frame 100 --out top.png

The video's offsets are magenta, those of the CAN log green, as published; --rows may be given several times.
Lines run along the lane's direction from the front axle on. The top view is 15 m wide and reaches 25 m ahead
of the camera, taken back to the road by its pose and lens: how straight and parallel its lines are shows how
good those are.
"""


def view(arguments: argparse.Namespace) -> int:
    """`vsensor video view`: a video of views, or one picture."""
    from vsensor.profile import load_profiles
    from vsensor.video.view_command import ViewOptions, write_view

    profiles = load_profiles(tuple(arguments.profile or ["p2"]), arguments.dbc) if arguments.can else ()
    options = ViewOptions(
        out=arguments.out,
        camera=arguments.camera,
        rows=tuple(arguments.rows or ()),
        can=arguments.can,
        profiles=tuple(profiles),
        starts_at_log_s=arguments.can_at,
        view=arguments.view,
        frame=arguments.frame,
        rate_hz=arguments.rate,
        limit=arguments.limit,
        progress=shows_progress(arguments),
    )
    report = write_view(arguments.video, options)
    print(report.line)
    for text in report.notes:
        note(text)
    return 0


def add_view(commands: Commands) -> None:
    """Add `vsensor video view`."""
    added = command(commands, "view", view, VIEW_HELP)
    video_argument(added)
    camera_option(added)
    option = added.add_argument
    option("--rows", action="append", type=Path, metavar="FILE", help="of vsensor video run; repeatable")
    option("--can", type=Path, metavar="LOG", help="CAN log of the drive, its offsets are drawn too")
    option("--can-at", type=float, default=0.0, metavar="S", help="the log's time at the first picture (0)")
    option("--profile", action="append", metavar="NAME", help="of the CAN log; repeatable (p2)")
    dbc_option(added, "the database of the profile that names none")
    option("--view", choices=("front", "top", "both"), default="both", help="which (both)")
    option("--frame", type=int, metavar="K", help="one picture, counted from 0: --out FILE.png")
    option("--out", type=Path, required=True, metavar="FILE", help="video .mp4, .avi, or a picture .png")
    rate_option(added)
    limit_option(added)
    option("--quiet", action="store_true", help="no progress bar")

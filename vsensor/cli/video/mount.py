"""`vsensor video mount`: the camera's pose from the road."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.video.words import camera_option, limit_option, rate_option, video_argument

MOUNT_HELP = """\
Find where a camera points and how high it is, from the road in its video.

  vsensor video mount drive.mp4 --camera camera.toml --lane-width 3.5 --out mounted.toml
  vsensor video mount drive.mp4 --camera camera.toml --motion drive.blf --out mounted.toml

Pitch and yaw come from the lines of the lane, which run parallel and along which the vehicle goes; a minute
of driving without many lane changes is good, bends do no harm. Height comes from the width of the lane,
between the centres of its markings, or from the speed on CAN. Position to the side and ahead, and roll, stay
as they are. --camera is where it starts from: right to some 4 degrees. Drift across the lane is taken off the
yaw by the speed of --motion, else by 72 km/h.
"""


def mount(arguments: argparse.Namespace) -> int:
    """`vsensor video mount`: a pose as a camera file."""
    from vsensor.sources.profiles import profiles_of
    from vsensor.video.mount_command import MountRun, mount_video

    names = tuple(arguments.motion_profile or ("vehicle",))
    run = MountRun(
        video=arguments.video,
        camera=arguments.camera,
        out=arguments.out,
        rate_hz=arguments.rate,
        limit=arguments.limit,
        lane_width_m=arguments.lane_width,
        motion=arguments.motion,
        profiles=profiles_of(names, arguments.dbc, Path()) if arguments.motion else (),
        begins_s=arguments.motion_begins,
        picture=arguments.picture,
        progress=shows_progress(arguments),
    )
    report = mount_video(run)
    print("\n".join(report.lines))
    for text in report.notes:
        note(text)
    return 0


def _lane_width(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = 0.0
    if not 2.0 <= value <= 6.0:
        raise argparse.ArgumentTypeError(f"{text}: expected metres, 2 to 6")
    return value


def add_mount(commands: Commands) -> None:
    """Add `vsensor video mount`."""
    added = command(commands, "mount", mount, MOUNT_HELP)
    video_argument(added)
    camera_option(added)
    added.add_argument("--out", type=Path, required=True, metavar="FILE", help="camera file: .toml")
    added.add_argument(
        "--lane-width", type=_lane_width, metavar="M", help="between the centres of both markings"
    )
    added.add_argument("--motion", type=Path, metavar="LOG", help="CAN log with the speed of the same drive")
    added.add_argument(
        "--motion-profile", action="append", metavar="NAME", help="what reads --motion; repeatable (vehicle)"
    )
    added.add_argument(
        "--motion-begins",
        type=float,
        default=0.0,
        metavar="S",
        help="the log's time when the video begins (0)",
    )
    dbc_option(added, "the database of the profile that names none")
    rate_option(added)
    limit_option(added)
    added.add_argument("--picture", type=Path, metavar="FILE", help="draw what was found: .png .svg .pdf")
    added.add_argument("--quiet", action="store_true", help="no progress bar")

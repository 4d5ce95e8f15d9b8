"""`vsensor video run`: a video into lane offsets, and into CAN frames."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.values import count, moment
from vsensor.cli.video.words import camera_option, limit_option, out_option, rate_option, video_argument
from vsensor.stop import stop_signals

RUN_HELP = """\
Find the lane in a front video: one row per picture, and the lane sensor's CAN frames of it.

  vsensor video run drive.mp4 --camera camera.toml --out offsets.csv --report drive.html
  vsensor video run drive.mp4 --camera camera.toml --log lanes.blf --profile honda --dbc honda.dbc
  vsensor video run drive.mp4 --camera camera.toml --bus socketcan:can0       the video's lanes, paced
  vsensor video run drive.mp4 --motion drive.blf --motion-profile vehicle --out offsets.parquet
  vsensor video run drive.mp4 --method published --steps steps/ --every 25    P2's method, step by step

A row has t_s, left_offset_m, right_offset_m (from the vehicle's centreline to the marking's inner edge at the
front axle, positive to the left), lane_width_m, heading_rad, left_confidence, right_confidence (0 to 4).
Where no line was seen its offset is empty and its confidence 0.

Frames leave as those of the sensor itself do: cycles, counters, CRCs of the profile. All pictures are looked
at first, then the frames are sent. FILE of --settings has schema = "vsensor.video/1" and a table for each
method: [ours], [published], [lov].
"""


def run(arguments: argparse.Namespace) -> int:
    """`vsensor video run`: a video through a method."""
    from vsensor.video.run import MOTION_PROFILES, VideoRun, run_video

    given = {name: getattr(arguments, name) for name in _SINGLE}
    options = VideoRun(
        **given,
        rate_hz=arguments.rate,
        motion_profiles=tuple(arguments.motion_profile or MOTION_PROFILES),
        progress=shows_progress(arguments),
    )
    with stop_signals() as stopped:
        print("\n".join(run_video(options, note, stopped)))
        return 130 if stopped() else 0


_SINGLE = (
    *("video", "method", "camera", "settings", "limit", "motion", "motion_begins_s", "fill"),
    *("out", "report", "steps", "every", "log", "bus", "profile", "dbc"),
)


def add_run(commands: Commands) -> None:
    """Add `vsensor video run`."""
    added = command(commands, "run", run, RUN_HELP)
    video_argument(added)
    camera_option(added)
    option = added.add_argument
    option("--method", default="ours", metavar="NAME", help="ours, or published: P2's method (ours)")
    option("--settings", type=Path, metavar="FILE", help="numbers of the methods that differ: .toml")
    rate_option(added)
    limit_option(added)
    option("--motion", type=Path, metavar="LOG", help="CAN log with speed and yaw rate of the same drive")
    option(
        "--motion-profile", action="append", metavar="NAME", help="what reads --motion; repeatable (vehicle)"
    )
    option(
        "--motion-begins",
        type=moment,
        default=0.0,
        dest="motion_begins_s",
        metavar="S",
        help="when in the log the video begins, s from its first frame (0)",
    )
    option("--fill", action="store_true", help="fill gaps of up to 2 s as P2 does, with confidence 0")
    out_option(added, "rows: .parquet .csv .mf4")
    option("--report", type=Path, metavar="PAGE", help="page of figures and pictures with the lines: .html")
    option("--steps", type=Path, metavar="DIR", help="pictures of every step of the method")
    option("--every", type=count, default=1, metavar="N", help="steps of every N-th picture only (1)")
    option(
        "--log",
        type=Path,
        metavar="FILE",
        help="write the CAN frames: .log .asc .blf .mf4, without a bus at once",
    )
    option("--bus", metavar="INTERFACE:CHANNEL", help="send the CAN frames, at the video's pace")
    option("--profile", metavar="NAME", help="of the frames: shipped name or file (native)")
    dbc_option(added, "the database that --profile maps")
    option("--quiet", action="store_true", help="no progress bar")

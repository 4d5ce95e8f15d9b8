"""`vsensor video events`: events in long logs, and the folders that are compared."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress

EVENTS_HELP = """\
Find events in a long CAN log, and cut them out together with its video.

  vsensor video events drive.blf --profile p2
  vsensor video events drive.blf --profile p2 --video drive.avi --camera camera.toml --out events

An event is a second in which the lane is at most 4 m wide, the vehicle moves across it slower than 2.5 m/s,
is nearer than 0.7 m to a marking, turns at most 10 deg/s and does not indicate, with 15 s before and after.
They do not overlap. --criteria FILE changes that: schema = "vsensor.events/1" and the keys that differ, such
as near_m = 0.5 or before_s = 5. With --out each becomes a folder for vsensor video evaluate.
"""


def events(arguments: argparse.Namespace) -> int:
    """`vsensor video events`: events of a log, and their folders."""
    from vsensor.profile import load_profiles
    from vsensor.signals import VehicleConfig
    from vsensor.video.camera_file import read_camera
    from vsensor.video.can_signals import read_can
    from vsensor.video.cut import CutOptions, cut_events
    from vsensor.video.events import event_lines, find_events, read_criteria

    criteria = read_criteria(arguments.criteria)
    names = tuple(arguments.profile or ["p2"])
    can = read_can(arguments.log, load_profiles(names, arguments.dbc))
    camera = None if arguments.camera is None else read_camera(arguments.camera)
    found = find_events(can, criteria, (camera.vehicle if camera else VehicleConfig()).width_m)
    print("\n".join(event_lines(found)))
    for text in (*can.notes, *found.notes):
        note(text)
    if arguments.out is not None:
        options = CutOptions(
            out=arguments.out,
            video=arguments.video,
            starts_at_log_s=arguments.video_at,
            profiles=names,
            progress=shows_progress(arguments),
        )
        for text in cut_events(can, found.events, camera, options):
            note(text)
    return 0


def add_events(commands: Commands) -> None:
    """Add `vsensor video events`."""
    added = command(commands, "events", events, EVENTS_HELP)
    option = added.add_argument
    option("log", type=Path, metavar="LOG", help="CAN log with lane offsets")
    option("--profile", action="append", metavar="NAME", help="shipped name or file; repeatable (p2)")
    dbc_option(added, "the database of the profile that names none")
    option("--criteria", type=Path, metavar="FILE", help="criteria that differ from the published: .toml")
    option("--out", type=Path, metavar="DIR", help="a folder for each event")
    option("--video", metavar="VIDEO", help="the drive's video, cut with the log")
    option(
        "--video-at",
        type=float,
        default=0.0,
        metavar="S",
        help="when it begins, after the log's first frame; may be below 0 (0)",
    )
    option("--camera", metavar="FILE", help="the video's camera and vehicle; needed for --out")
    option("--quiet", action="store_true", help="no progress bar")

"""Arguments that the subcommands share: the video, its camera, its rate."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Once
from vsensor.cli.values import count, hertz

VIDEO_WORDS = "video (.mp4 .avi ...), folder of images, pattern 'drive/*.png' in quotes, or one image"


def video_argument(added: argparse.ArgumentParser) -> None:
    """Add the video that a subcommand reads: `arguments.video`."""
    added.add_argument("video", metavar="VIDEO", help=VIDEO_WORDS)


def camera_option(added: argparse.ArgumentParser) -> None:
    """Add `--camera`: for `camera_file.camera_of`."""
    added.add_argument(
        "--camera",
        action=Once,
        metavar="FILE",
        help="camera file, scenario file or shipped scenario that says lens and pose (a stated default)",
    )


def rate_option(added: argparse.ArgumentParser) -> None:
    """Add `--rate`: for `frames.open_pictures`."""
    added.add_argument(
        "--rate", type=hertz, action=Once, metavar="HZ", help="pictures per second (the video's own times)"
    )


def limit_option(added: argparse.ArgumentParser) -> None:
    """Add `--limit`: pictures that are read at most."""
    added.add_argument("--limit", type=count, metavar="N", help="only the first N pictures (all)")


def out_option(added: argparse.ArgumentParser, text: str) -> None:
    """Add `--out FILE`."""
    added.add_argument("--out", type=Path, metavar="FILE", help=text)

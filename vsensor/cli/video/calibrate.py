"""`vsensor video calibrate`: the lens from pictures of a chessboard."""

import argparse
import re
from pathlib import Path

from vsensor.cli.adding import Commands, command, note, shows_progress

CALIBRATE_HELP = """\
Find a camera's lens from pictures of a chessboard: focal lengths, centre, distortion.

  vsensor video calibrate boards/*.jpg --board 9x6 --out camera.toml

--board counts inner corners, where four squares meet: a board of 10 x 7 squares has 9x6. Take 10 to 20
pictures from different sides, tilted, some with the board in the corners of the picture. A board that shows
only in part is used as far as it shows; pictures of another size, without a board, or that contradict the
others are left out and named. The size of a square does not matter.

FILE is a camera file (schema vsensor.camera/1): a scenario takes it with camera_file = "camera.toml". The
pose in it is the default's: type in where the camera is.
"""


def calibrate(arguments: argparse.Namespace) -> int:
    """`vsensor video calibrate`: a lens as a camera file."""
    from vsensor.video.calibrate_command import calibrate_files

    columns, rows = arguments.board
    report = calibrate_files(
        arguments.images,
        columns,
        rows,
        out=arguments.out,
        pictures=arguments.pictures,
        progress=shows_progress(arguments),
    )
    print("\n".join(report.lines))
    for text in report.notes:
        note(text)
    return 0


def _board(text: str) -> tuple[int, int]:
    match = re.fullmatch(r"(\d{1,3})x(\d{1,3})", text)
    if match is None:
        raise argparse.ArgumentTypeError(f"{text}: expected inner corners such as 9x6")
    return int(match[1]), int(match[2])


def add_calibrate(commands: Commands) -> None:
    """Add `vsensor video calibrate`."""
    added = command(commands, "calibrate", calibrate, CALIBRATE_HELP)
    added.add_argument("images", nargs="+", metavar="IMAGES", help="images, folders of them, or patterns")
    added.add_argument(
        "--board", type=_board, required=True, metavar="CxR", help="inner corners across and down: 9x6"
    )
    added.add_argument("--out", type=Path, required=True, metavar="FILE", help="camera file: .toml")
    added.add_argument(
        "--pictures", type=Path, metavar="DIR", help="each picture with its corners drawn, and undistorted"
    )
    added.add_argument("--quiet", action="store_true", help="no progress bar")

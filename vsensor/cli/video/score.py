"""`vsensor video score`: methods against lines that were marked in pictures by hand."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command

SCORE_HELP = """\
Compare methods with lines that were marked by hand in real pictures: pixels, and metres on the road.

  vsensor video score labels.toml --images pictures --camera camera.toml
  vsensor video score labels.toml --images pictures --camera wide.toml --camera narrow.toml --method ours

LABELS says of each image, or frame of a video, where the paint of both lines is:
  schema = "vsensor.lane_labels/1"
  [[image]]
  file = "drive.mp4"                       seen from --images
  frame = 90                               of a video, from 0; an image has none
  size_px = [960, 540]
  sigma_px = 0.5                           how sure the middle of the two edges is
  left = [[525, 157.9, 177.2], ...]        rows: v, left edge, right edge of the paint; centres at integers
  right = [[487, 758.7, 775.9], ...]

Pictures of each size need a --camera of that size. A video is looked at from its beginning, a still once.
Errors in pixels are across the picture, to the paint's middle; in metres across the road, root mean square,
to its edge towards the vehicle, by distance from the rear axle. The body's pitch moves the far road and is
not known: one row is with the mount's pitch, the other with the one that fits both lines of a picture best.
"""


def score(arguments: argparse.Namespace) -> int:
    """`vsensor video score`: methods against labels."""
    from vsensor.study.table import write_csv
    from vsensor.video.camera_file import read_camera
    from vsensor.video.label_score import score_method, score_rows, score_table
    from vsensor.video.labels import read_labels
    from vsensor.video.methods import METHODS, require_method
    from vsensor.video.settings import read_settings

    names = arguments.method.split(",") if arguments.method else list(METHODS)
    for name in names:
        require_method(name)
    labels = read_labels(arguments.labels)
    cameras = [read_camera(file) for file in arguments.camera]
    settings = read_settings(arguments.settings)
    results = {name: score_method(name, labels, arguments.images, cameras, settings) for name in names}
    print("\n".join(score_table(results)))
    if arguments.out is not None:
        write_csv(arguments.out, score_rows(results))
    return 0


def add_score(commands: Commands) -> None:
    """Add `vsensor video score`."""
    added = command(commands, "score", score, SCORE_HELP)
    added.add_argument("labels", type=Path, metavar="LABELS", help="labels: .toml")
    added.add_argument(
        "--images", type=Path, required=True, metavar="DIR", help="where the labelled files are"
    )
    added.add_argument(
        "--camera",
        action="append",
        required=True,
        metavar="FILE",
        help="camera file; one for each size of pictures",
    )
    added.add_argument("--method", metavar="NAME,NAME", help="methods to compare (all)")
    added.add_argument("--settings", type=Path, metavar="FILE", help="settings of the methods: .toml")
    added.add_argument("--out", type=Path, metavar="FILE", help="the errors of every row: .csv")

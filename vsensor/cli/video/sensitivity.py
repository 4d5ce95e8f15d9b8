"""`vsensor video sensitivity`: what a camera that stands elsewhere than thought does to offsets."""

import argparse
import math
from collections.abc import Callable, Mapping
from pathlib import Path

from vsensor.cli.adding import Commands, command, note, shows_progress
from vsensor.cli.values import count, seed

SENSITIVITY_HELP = """\
How much offsets change if the camera stands elsewhere than thought: height, lateral place, yaw, pitch, roll.

  vsensor video sensitivity results/rows/published --camera camera.toml --out sensitivity
  vsensor video sensitivity rows.csv --camera camera.toml --out sensitivity --within height=0.1,pitch=0.5

ROWS are files of vsensor video run, or folders of them, as vsensor video evaluate writes. One parameter at a
time, the published plots: relative and absolute change; then all together within tolerances: which share of
the variance each has alone, with others, and in pairs. Seen again are the lines that were measured: what a
change does to the detection itself is left out. --again EVENT says how much that is: --method runs on that
event with each parameter at both ends of its tolerance.

Into DIR: report.html, one_by_one.csv, together.csv.
"""


def sensitivity(arguments: argparse.Namespace) -> int:
    """`vsensor video sensitivity`: one parameter at a time, and all together."""
    from vsensor.video.camera_file import read_camera
    from vsensor.video.evaluate.runs import RunOptions
    from vsensor.video.sensitivity.report import WITHIN, SensitivityOptions
    from vsensor.video.sensitivity.report import sensitivity as found_by

    options = SensitivityOptions(
        out=arguments.out,
        events=arguments.events,
        seed=arguments.seed or 0,
        angle_deg=arguments.angles,
        distance_m=arguments.distances,
        within={**WITHIN, **(arguments.within or {})},
        again=arguments.again,
        method=arguments.method,
        run=RunOptions(limit=arguments.limit, workers=arguments.workers, progress=shows_progress(arguments)),
    )
    found = found_by(arguments.rows, read_camera(arguments.camera), options)
    print("\n".join(found.lines))
    for text in found.missing:
        note(f"no pictures in the report: {text}")
    return 0


def _up_to(most: float, unit: str) -> Callable[[str], float]:
    def value(text: str) -> float:
        try:
            number = float(text)
        except ValueError:
            number = math.nan
        if not 0.0 < number <= most:
            raise argparse.ArgumentTypeError(f"{text}: expected {unit} above 0, at most {most:g}")
        return number

    return value


def _within(text: str) -> Mapping[str, float]:
    names = ("height", "lateral", "yaw", "pitch", "roll")
    found = {}
    for part in text.split(","):
        name, _, number = part.partition("=")
        try:
            found[name] = float(number)
        except ValueError:
            found[name] = math.nan
        if name not in names or not 0.0 < found[name] <= (20.0 if name in names[2:] else 1.0):
            raise argparse.ArgumentTypeError(
                f"{part}: expected such as height=0.1,pitch=0.5 of {', '.join(names)}; "
                "m up to 1, degrees up to 20"
            )
    return found


def add_sensitivity(commands: Commands) -> None:
    """Add `vsensor video sensitivity`."""
    added = command(commands, "sensitivity", sensitivity, SENSITIVITY_HELP)
    option = added.add_argument
    option("rows", nargs="+", type=Path, metavar="ROWS", help="files of rows, or folders of them")
    option("--camera", required=True, metavar="FILE", help="camera file, scenario file or shipped scenario")
    option("--out", type=Path, required=True, metavar="DIR", help="folder of the results")
    option("--events", type=count, default=90, metavar="N", help="files that are drawn at most (90)")
    option("--angles", type=_up_to(20.0, "degrees"), default=3.0, metavar="DEG", help="one at a time: +- (3)")
    option("--distances", type=_up_to(1.0, "m"), default=0.3, metavar="M", help="one at a time: +- (0.3)")
    option(
        "--within",
        type=_within,
        metavar="NAME=VALUE,...",
        help="all together: tolerances (height=0.05,lateral=0.05,yaw=1,pitch=1,roll=1)",
    )
    option("--again", type=Path, metavar="EVENT", help="an event on which a method runs again")
    option("--method", default="ours", metavar="NAME", help="which (ours)")
    option("--limit", type=count, metavar="N", help="only on its first N pictures (all)")
    option("--workers", type=count, metavar="N", help="local processes (all cores)")
    option("--quiet", action="store_true", help="no progress bar")
    option("--seed", type=seed, metavar="N", help="of the draws (0)")

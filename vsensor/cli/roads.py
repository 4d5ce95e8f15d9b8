"""`vsensor road`: roads built."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command

ROAD_HELP = """\
Build a road from a short description (.toml) and say what it is: length, radii, lanes, paint.

  vsensor road mine.toml --out mine.xodr --plot mine.png
  vsensor road p3_track                     a shipped one
  vsensor run mine.toml --fast              drive on it as it is, without writing a map

FILE has schema = "vsensor.road/1" and [[road]] tables: pieces of the line (straight, arc, clothoid, bend),
lanes, heights, paint with gaps, wear, ghost and construction lines, crosswalks, bumps, rough stretches.
README, "Building a road", shows all of it. The map is OpenDRIVE 1.7, which other programs read too.
"""


def road(arguments: argparse.Namespace) -> int:
    """`vsensor road`: a road file as a summary, a map, a picture."""
    from vsensor.world.road.command import build_road

    print("\n".join(build_road(arguments.file, out=arguments.out, plot=arguments.plot)))
    return 0


def add_road(commands: Commands) -> None:
    """Add `vsensor road`."""
    added = command(commands, "road", road, ROAD_HELP)
    added.add_argument("file", metavar="FILE", help="road file (.toml), or the name of a shipped one")
    added.add_argument("--out", type=Path, metavar="FILE", help="write the map: .xodr")
    added.add_argument("--plot", type=Path, metavar="FILE", help="draw it: .png .svg .pdf")

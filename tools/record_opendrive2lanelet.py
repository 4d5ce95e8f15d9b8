"""Record where opendrive2lanelet puts lane borders, for tests/authorities; in an environment of its own.

    pip install --no-deps opendrive2lanelet==1.2.1 && pip install lxml numpy scipy
    vsensor road p3_track --out p3_track.xodr
    python tools/record_opendrive2lanelet.py MAPS... p3_track.xodr > tests/authorities/opendrive2lanelet.json

It reads OpenDRIVE by itself (Technical University of Munich) and evaluates borders in the plane, at any s by
its own formulas. The table of places that it would interpolate is switched off, junctions are left out (it
knows no direct ones). For every map: road, place of the lane section in the file, lane, s, x, y of the lane's
outer border.
"""

import json
import random
import sys
from pathlib import Path
from unittest.mock import MagicMock

from lxml import etree

for name in ("commonroad", "commonroad.scenario", "commonroad.scenario.lanelet"):
    sys.modules[name] = MagicMock()  # only what makes lanelets of the borders needs it

from opendrive2lanelet.converter import OpenDriveConverter  # noqa: E402
from opendrive2lanelet.opendriveparser.parser import parse_opendrive  # noqa: E402

PLACES = 25
"""Places drawn in each map."""


def borders_of(road):
    """Return (section, lane id) -> (border, s of the section's start, its length)."""
    reference = OpenDriveConverter.create_reference_border(road.planView, road.lanes.laneOffsets)
    found = {}
    for number, section in enumerate(road.lanes.lane_sections):
        for side, lanes in ((-1.0, section.rightLanes), (1.0, section.leftLanes)):
            chain = [reference]
            for lane in lanes:
                if not lane.widths:
                    break  # it knows no <border>
                chain.append(OpenDriveConverter._create_outer_lane_border(chain, lane, side))
                found[number, lane.id] = chain[-1], section.sPos, section.length
    return found


def recorded(path):
    """Return rows of one map."""
    root = etree.parse(str(path)).getroot()
    for junction in root.findall("junction"):
        root.remove(junction)
    everything = []
    for road in parse_opendrive(root).roads:
        road.planView._precalculation = None
        everything += [(road.id, key, *value) for key, value in borders_of(road).items()]
    rng = random.Random(path.stem)
    rows = []
    for _ in range(PLACES):
        road, (section, lane), border, start, length = rng.choice(everything)
        s = start + rng.uniform(0.001, 0.999) * length
        (x, y), _ = border.calc(s - start)
        rows.append([road, section, lane, s, float(x), float(y)])
    return rows


def main(words):
    """Print a JSON object: map -> rows."""
    found = {Path(word).stem: recorded(Path(word)) for word in words}
    lines = [f"{json.dumps(name)}: {json.dumps(rows)}" for name, rows in found.items()]
    print("{\n" + ",\n".join(lines) + "\n}")


if __name__ == "__main__":
    main(sys.argv[1:])

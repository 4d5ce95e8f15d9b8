"""Write the demo map: a closed motorway of about 8 km, three lanes each way, as OpenDRIVE.

    python tools/make_highway_map.py            write vsensor/scenarios/highway.xodr
    python tools/make_highway_map.py --print    write it to standard output

The ring is a chain of straights, clothoids and arcs. Its heading closes because the turns add up to
360 degrees; its place closes because the end point is linear in the lengths of the straights, and two
of them are solved for. Every number is written with repr precision, so a joint is as good as float64.

Why this is no road file: `vsensor.world.road` closes a circuit of one road, this one is of six with lane
sections of their own; the shipped map is older than the road builder, and figures of README and tests hang
on its bits and on the ids of its roads. New maps are road files.
"""

import argparse
import math
import sys
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

TARGET = Path(__file__).parents[1] / "vsensor" / "scenarios" / "highway.xodr"

MEDIAN_M, LEFT_M, MIDDLE_M, RIGHT_M, SHOULDER_M = 1.75, 3.5, 3.75, 3.75, 2.5
DASH_M, GAP_M = 6.0, 12.0  # lane line of German motorways (RMS): 6 m paint, 12 m gap
LANE_LINE_M, EDGE_LINE_M = 0.15, 0.30  # widths of the thin and the thick line there
STRIPE_GAP_M = 0.15  # between the stripes of a double line

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


@dataclass(frozen=True)
class Element:
    """A piece of the reference line: curvature from `start_per_m` linearly to `end_per_m`."""

    length_m: float
    start_per_m: float = 0.0
    end_per_m: float = 0.0

    @property
    def turn_rad(self) -> float:
        """Change of heading over the element."""
        return self.length_m * (self.start_per_m + self.end_per_m) / 2

    def chord(self, heading_rad: float) -> complex:
        """Return end minus start as x + iy, exact to rounding (Gauss-Legendre, pieces <= 0.25 rad)."""
        pieces = max(1, math.ceil(abs(self.turn_rad) / 0.25))
        s = (np.arange(pieces)[:, None] + (_NODES + 1) / 2) * (self.length_m / pieces)
        rate = (self.end_per_m - self.start_per_m) / self.length_m
        heading = heading_rad + self.start_per_m * s + rate * s * s / 2
        return complex(np.sum(np.exp(1j * heading) * _WEIGHTS) * (self.length_m / pieces / 2))


def bend(radius_m: float, turn_deg: float, clothoid_m: float) -> list[Element]:
    """Return clothoid, arc, clothoid turning by `turn_deg` in all; negative = to the right."""
    k = math.copysign(1 / radius_m, turn_deg)
    arc_m = math.radians(turn_deg) / k - clothoid_m
    return [Element(clothoid_m, 0.0, k), Element(arc_m, k, k), Element(clothoid_m, k, 0.0)]


@dataclass(frozen=True)
class Stretch:
    """One road of the ring: a straight, then a bend; `crossfall` towards the inside of the bend."""

    straight_m: float
    radius_m: float
    turn_deg: float
    clothoid_m: float
    crossfall: float
    summit_m: float = 0.0  # place of a crest in this road, 0 = flat
    grade: float = 0.0
    solved: bool = False  # length of the straight comes from closing the ring

    def elements(self) -> list[Element]:
        """Return the straight and the bend's three elements."""
        return [Element(self.straight_m), *bend(self.radius_m, self.turn_deg, self.clothoid_m)]


RING = (
    Stretch(240.0, 2000.0, 25.0, 240.0, 0.025, summit_m=750.0, grade=0.02),
    Stretch(200.0, 800.0, 90.0, 200.0, 0.045),
    Stretch(250.0, 600.0, 100.0, 180.0, 0.055, solved=True),
    Stretch(180.0, 1200.0, -25.0, 220.0, 0.03),
    Stretch(250.0, 600.0, 100.0, 180.0, 0.055, solved=True),
    Stretch(180.0, 1000.0, 70.0, 200.0, 0.04, summit_m=700.0, grade=0.015),
)
CREST_RADIUS_M, SAG_RADIUS_M = 9000.0, 8000.0


def close(ring: Sequence[Stretch]) -> list[Stretch]:
    """Return the ring with the two solved straights lengthened so that its end meets its start."""
    heading, end, directions = 0.0, 0j, []
    for stretch in ring:
        if stretch.solved:
            directions.append(np.exp(1j * heading))
        for element in stretch.elements():
            end += element.chord(heading)
            heading += element.turn_rad
    matrix = np.array([[d.real for d in directions], [d.imag for d in directions]])
    longer = iter(np.linalg.solve(matrix, [-end.real, -end.imag]))
    return [replace(s, straight_m=s.straight_m + float(next(longer))) if s.solved else s for s in ring]


def poses(elements: Sequence[Element], start: complex, heading: float) -> list[tuple[complex, float]]:
    """Return the start of each element and of what follows the last."""
    found = [(start, heading)]
    for element in elements:
        start, heading = start + element.chord(heading), heading + element.turn_rad
        found.append((start, heading))
    return found


def elevation(stretch: Stretch) -> list[tuple[float, float, float, float, float]]:
    r"""Return (s, a, b, c, d): sag, ramp, crest, ramp, sag around the summit, parabolas and tangents.

              _____ crest
             /     \
        ____/       \____
         sag  ramp
    """
    if not stretch.summit_m:
        return [(0.0, 0.0, 0.0, 0.0, 0.0)]
    g, ramp = stretch.grade, 60.0
    sag, crest = g * SAG_RADIUS_M, 2 * g * CREST_RADIUS_M
    lengths = [sag, ramp, crest, ramp, sag]
    bends = [0.5 / SAG_RADIUS_M, 0.0, -0.5 / CREST_RADIUS_M, 0.0, 0.5 / SAG_RADIUS_M]
    s, z, slope = stretch.summit_m - sum(lengths) / 2, 0.0, 0.0
    rows = [(0.0, 0.0, 0.0, 0.0, 0.0)]
    for length, c in zip(lengths, bends, strict=True):
        rows.append((s, z, slope, c, 0.0))
        s, z, slope = s + length, z + slope * length + c * length * length, slope + 2 * c * length
    return [*rows, (s, 0.0, 0.0, 0.0, 0.0)]


def superelevation(stretch: Stretch) -> list[tuple[float, float, float, float, float]]:
    """Return (s, a, b, c, d): smooth from 0 to the crossfall along the entry clothoid, and back."""
    full = -math.copysign(math.atan(stretch.crossfall), stretch.turn_deg)  # left bend: left side down
    straight, entry, arc, leave = (e.length_m for e in stretch.elements())
    s1, s2, s3 = straight, straight + entry + arc, straight + entry + arc + leave
    return [
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (s1, 0.0, 0.0, 3 * full / entry**2, -2 * full / entry**3),
        (s1 + entry, full, 0.0, 0.0, 0.0),
        (s2, full, 0.0, -3 * full / leave**2, 2 * full / leave**3),
        (s3, 0.0, 0.0, 0.0, 0.0),
    ]


Mark = tuple[float, str]
"""Start within the lane section, and type: solid, broken, solid solid, edge or none."""

DASHED: tuple[Mark, ...] = ((0.0, "broken"),)
EDGE: tuple[Mark, ...] = ((0.0, "solid"),)


@dataclass(frozen=True)
class Section:
    """Marks of one lane section, by border: both carriageways have the same, mirrored."""

    s_m: float
    median: tuple[Mark, ...] = EDGE
    left_middle: tuple[Mark, ...] = DASHED
    middle_right: tuple[Mark, ...] = DASHED
    right_shoulder: tuple[Mark, ...] = EDGE


SECTIONS: tuple[tuple[Section, ...], ...] = (
    (
        Section(0.0, left_middle=((0.0, "broken"), (306.0, "solid solid"), (606.0, "broken"))),
        Section(900.0),
    ),
    (
        Section(0.0, middle_right=((0.0, "broken"), (198.0, "none"), (396.0, "broken"))),
        Section(720.0, right_shoulder=((0.0, "solid"), (120.0, "none"), (170.0, "solid"))),
    ),
    (Section(0.0, median=((0.0, "solid"), (300.0, "none"), (320.0, "solid"))),),
    (Section(0.0), Section(450.0, left_middle=((0.0, "solid"), (90.0, "broken")))),
    (Section(0.0, left_middle=((0.0, "broken"), (450.0, "solid"), (900.0, "broken"))),),
    (Section(0.0),),
)


def text(value: float) -> str:
    """Return the shortest decimal that reads back as the same float64."""
    return repr(float(value) + 0.0)


def add(parent: ET.Element, tag: str, **attributes: object) -> ET.Element:
    """Append an element; floats keep all their digits."""
    shown = {k: text(v) if isinstance(v, float) else str(v) for k, v in attributes.items()}
    return ET.SubElement(parent, tag, shown)


def add_polynomials(parent: ET.Element, tag: str, rows: Sequence[tuple[float, ...]]) -> None:
    for row in rows:
        add(parent, tag, **dict(zip("sabcd", row, strict=True)))


def add_plan(road: ET.Element, elements: Sequence[Element], start: complex, heading: float) -> None:
    plan, s = add(road, "planView"), 0.0
    for element, (place, angle) in zip(elements, poses(elements, start, heading), strict=False):
        geometry = add(plan, "geometry", s=s, x=place.real, y=place.imag, hdg=angle, length=element.length_m)
        if element.start_per_m != element.end_per_m:
            add(geometry, "spiral", curvStart=element.start_per_m, curvEnd=element.end_per_m)
        elif element.start_per_m:
            add(geometry, "arc", curvature=element.start_per_m)
        else:
            add(geometry, "line")
        s += element.length_m


def add_mark(lane: ET.Element, s: float, kind: str, width_m: float) -> None:
    if kind == "none":
        add(lane, "roadMark", sOffset=s, type="none", color="white")  # colour is required
        return
    width = 3 * LANE_LINE_M if kind == "solid solid" else width_m
    mark = add(
        lane,
        "roadMark",
        sOffset=s,
        type=kind,
        weight="standard",
        color="white",
        width=width,
        laneChange="both" if kind == "broken" else "none",
    )
    if kind == "broken":
        line = {"length": DASH_M, "space": GAP_M, "tOffset": 0.0, "sOffset": 0.0, "width": LANE_LINE_M}
        add(add(mark, "type", name=kind, width=LANE_LINE_M), "line", **line)
    elif kind == "solid solid":
        both = add(mark, "type", name=kind, width=width)
        offset = (LANE_LINE_M + STRIPE_GAP_M) / 2
        for t in (offset, -offset):
            add(both, "line", length=10.0, space=0.0, tOffset=t, sOffset=0.0, width=LANE_LINE_M)


def add_lane(
    parent: ET.Element, number: int, kind: str, width_m: float, marks: tuple[Mark, ...], mark_m: float
) -> None:
    lane = add(parent, "lane", id=number, type=kind, level="false")
    link = add(lane, "link")
    add(link, "predecessor", id=number)
    add(link, "successor", id=number)
    add(lane, "width", sOffset=0.0, a=width_m, b=0.0, c=0.0, d=0.0)
    for s, name in marks:
        add_mark(lane, s, name, mark_m)


def add_section(lanes: ET.Element, section: Section) -> None:
    element = add(lanes, "laneSection", s=section.s_m)
    rows: list[tuple[int, str, float, tuple[Mark, ...], float]] = [
        (1, "median", MEDIAN_M, section.median, EDGE_LINE_M),
        (2, "driving", LEFT_M, section.left_middle, LANE_LINE_M),
        (3, "driving", MIDDLE_M, section.middle_right, LANE_LINE_M),
        (4, "driving", RIGHT_M, section.right_shoulder, EDGE_LINE_M),
        (5, "shoulder", SHOULDER_M, ((0.0, "none"),), EDGE_LINE_M),
    ]
    left = add(element, "left")
    for number, kind, width_m, marks, mark_m in reversed(rows):
        add_lane(left, number, kind, width_m, marks, mark_m)
    centre = add(add(element, "center"), "lane", id=0, type="none", level="false")
    add_mark(centre, 0.0, "none", 0.0)
    right = add(element, "right")
    for number, kind, width_m, marks, mark_m in rows:
        add_lane(right, -number, kind, width_m, marks, mark_m)


def build() -> ET.Element:
    """Return the whole map as an element tree."""
    root = ET.Element("OpenDRIVE")
    add(root, "header", revMajor=1, revMinor=6, name="vsensor motorway ring", version="1.00")
    ring = close(RING)
    place, heading = 0j, 0.0
    for number, stretch in enumerate(ring):
        elements = stretch.elements()
        length = math.fsum(e.length_m for e in elements)
        road = add(
            root, "road", name=f"ring {number + 1}", length=length, id=number + 1, junction=-1, rule="RHT"
        )
        link = add(road, "link")
        before, after = (number - 1) % len(ring) + 1, (number + 1) % len(ring) + 1
        add(link, "predecessor", elementType="road", elementId=before, contactPoint="end")
        add(link, "successor", elementType="road", elementId=after, contactPoint="start")
        add(add(road, "type", s=0.0, type="motorway"), "speed", max="no limit")
        add_plan(road, elements, place, heading)
        add_polynomials(add(road, "elevationProfile"), "elevation", elevation(stretch))
        add_polynomials(add(road, "lateralProfile"), "superelevation", superelevation(stretch))
        lanes = add(road, "lanes")
        add(lanes, "laneOffset", s=0.0, a=0.0, b=0.0, c=0.0, d=0.0)
        for section in SECTIONS[number]:
            add_section(lanes, section)
        place, heading = poses(elements, place, heading)[-1]
    return root


def render() -> str:
    """Return the map's text."""
    root = build()
    ET.indent(root, space=" ")
    return '<?xml version="1.0" encoding="UTF-8"?>\n' + ET.tostring(root, encoding="unicode") + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--print", action="store_true", help="write to standard output, not into the package")
    if parser.parse_args().print:
        sys.stdout.write(render())
    else:
        TARGET.write_text(render(), encoding="utf-8")
    return 0


if __name__ == "__main__":
    raise SystemExit(main())

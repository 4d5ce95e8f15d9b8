"""What is painted on or wrong with a road beside its lanes: extra lines, crosswalks, bumps, roughness.

Crosswalks and stop lines are objects of the standard, whose outlines are filled with paint: as their fillType
says (1.8), or userData of ours ("vsensor.paint"). The rest is userData, too ("vsensor.line",
"vsensor.uneven"), as the standard has no element for it.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.motion.swell import bump_swell
from vsensor.types import Array, Colour, Swell, frozen
from vsensor.world.opendrive.marks import COLOURS, RoadMark, read_mark
from vsensor.world.opendrive.polynomial import Cubics
from vsensor.world.opendrive.xml import Element, MapReader, children, own_data, read_cubic
from vsensor.world.rough import CLASSES, rough_swells

PAINTED_TYPES = ("crosswalk", "roadMark")
MOST_CORNERS = 1000


@dataclass(frozen=True, slots=True)
class PaintedLine:
    """A line from `from_m` to `to_m` at t over s, beside or over a lane's border; its marks as a border's."""

    from_m: float
    to_m: float
    t: Cubics
    marks: tuple[RoadMark, ...]


@dataclass(frozen=True, slots=True, eq=False)
class PaintedArea:
    """A filled polygon: `corners` (N, 2) of s and t."""

    corners: Array
    colour: Colour
    contrast: float
    wear: float


def read_lines(reader: MapReader, road: Element) -> tuple[PaintedLine, ...]:
    """Return the lines beside the lanes' borders."""
    return tuple(
        _line(reader, line)
        for data in children(road, "userData")
        if data.get("code") == "vsensor.line"
        for line in children(data, "line")
    )


def _line(reader: MapReader, line: Element) -> PaintedLine:
    from_m, to_m = reader.number(line, "sStart"), reader.number(line, "sEnd")
    t = [read_cubic(reader, el, "s") for el in children(line, "t")]
    marks = [read_mark(reader, el, 0, 0.0, "") for el in children(line, "roadMark")]
    if not (t and marks and to_m > from_m):
        raise reader.error(line, "sStart below sEnd, t and roadMark were expected")
    return PaintedLine(from_m, to_m, Cubics.of(t), tuple(sorted(marks, key=lambda mark: mark.start_m)))


def read_ground(reader: MapReader, road: Element) -> tuple[PaintedArea, ...]:
    """Return the polygons of crosswalks and road marks that are filled with paint."""
    return tuple(
        area
        for thing in children(road.find("objects"), "object")
        if thing.get("type") in PAINTED_TYPES
        for area in _areas(reader, thing)
    )


def _areas(reader: MapReader, thing: Element) -> Iterator[PaintedArea]:
    paint = own_data(thing, "vsensor.paint", "paint")
    colour, contrast, wear = Colour.WHITE, 1.0, 0.0
    if paint is not None:
        colour = COLOURS[reader.choice(paint, "color", tuple(COLOURS))]
        contrast, wear = reader.number(paint, "contrast", 1.0), reader.number(paint, "wear", 0.0)
    for outline in children(thing.find("outlines"), "outline"):
        if paint is None and outline.get("fillType") != "paint":
            continue
        corners = [(reader.number(c, "s"), reader.number(c, "t")) for c in children(outline, "cornerRoad")]
        if 3 <= len(corners) <= MOST_CORNERS:
            yield PaintedArea(frozen(np.array(corners)), colour, contrast, wear)


def read_swells(reader: MapReader, road: Element) -> tuple[Swell, ...]:
    """Return bumps and rough stretches, over s."""
    found: list[Swell] = []
    for data in children(road, "userData"):
        if data.get("code") != "vsensor.uneven":
            continue
        for el in children(data, "bump"):
            length = reader.at_least(el, "length", 0.01)
            found.append(bump_swell(reader.number(el, "s"), length, reader.number(el, "height")))
        for el in children(data, "rough"):
            start, end = reader.number(el, "sStart"), reader.number(el, "sEnd")
            grade = reader.choice(el, "grade", tuple(CLASSES))
            if not end > start:
                raise reader.error(el, f'sEnd="{end:g}": above sStart was expected')
            found += rough_swells(grade, start, end, abs(reader.integer(el, "seed")))
    return tuple(sorted(found, key=lambda swell: swell.from_m))

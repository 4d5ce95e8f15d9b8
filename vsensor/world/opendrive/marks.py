"""Road marks of one lane border: which stripes lie where across it, and where along s they are painted.

`type` names the stripes from the reference line outwards (on the centre lane from left to right);
`<type><line>` and `<explicit><line>` replace that by stripes with their own tOffset (positive to the
left of the road) and dashes. A dash pattern starts at the mark's sOffset plus the line's.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, BoolArray, Colour, MarkingKind
from vsensor.world.opendrive.polynomial import Cubics
from vsensor.world.opendrive.xml import Element, MapReader, children, own_data, read_cubic, shortened

STANDARD_WIDTH_M = 0.12
BOLD_WIDTH_M = 0.25
"""Narrow and wide lines of German RMS-1 (0.12 and 0.25 m), where the file gives no width."""

DASH_AND_GAP_M = {"motorway": (6.0, 12.0), "town": (3.0, 6.0), "lowSpeed": (3.0, 6.0), "": (4.0, 8.0)}
"""Default dashes by road type, RMS-1: 1 to 2, 6 m on motorways, 4 m on rural roads, 3 m in towns."""

BOTTS_DOT_AND_GAP_M = (0.1, 1.2)
"""Dots of 0.1 m every 1.3 m (California: four dots per 4.3 m, roughly evenly laid)."""

COLOURS = {
    "standard": Colour.WHITE,
    "white": Colour.WHITE,
    "yellow": Colour.YELLOW,
    "blue": Colour.BLUE,
    "red": Colour.RED,
    "green": Colour.GREEN,
    "orange": Colour.ORANGE,
}
SINGLE_KINDS = {
    "none": MarkingKind.NONE,
    "solid": MarkingKind.SOLID,
    "broken": MarkingKind.DASHED,
    "botts dots": MarkingKind.BOTTS_DOTS,
    "edge": MarkingKind.ROAD_EDGE,
    "curb": MarkingKind.CURB,
    "grass": MarkingKind.ROAD_EDGE,
    "custom": MarkingKind.UNKNOWN,
}
DOUBLE_WORDS = ("solid solid", "solid broken", "broken solid", "broken broken")
DOUBLE_KINDS = {
    (False, False): MarkingKind.DOUBLE_SOLID,
    (True, True): MarkingKind.DOUBLE_DASHED,
    (False, True): MarkingKind.SOLID_DASHED,
    (True, False): MarkingKind.DASHED_SOLID,
}
"""(left stripe dashed, right stripe dashed), left and right as seen along increasing s."""

FOREVER_M = 1e9


@dataclass(frozen=True, slots=True)
class Dashes:
    """Paint from `start_m` (absolute s) on: `dash_m` of paint, `gap_m` without, `repeats` times over."""

    start_m: float
    dash_m: float
    gap_m: float
    once: bool = False

    @property
    def dashed(self) -> bool:
        """Whether there are gaps."""
        return self.gap_m > 0.0 and not self.once

    def painted(self, s_m: Array) -> BoolArray:
        """Return where there is paint, (N,)."""
        along = s_m - self.start_m
        if self.once:
            return (along >= 0.0) & (along < self.dash_m)
        if not self.dashed:
            return along >= 0.0
        return (along >= 0.0) & (np.mod(along, self.dash_m + self.gap_m) < self.dash_m)


@dataclass(frozen=True, slots=True)
class StripeMark:
    """One stripe of a mark: its centre `t_offset_m` to the left of the border, paint where any dash is."""

    t_offset_m: float
    width_m: float
    dashes: tuple[Dashes, ...]

    @property
    def dashed(self) -> bool:
        """Whether it has gaps."""
        return all(dash.dashed or dash.once for dash in self.dashes)

    def painted(self, s_m: Array) -> BoolArray:
        """Return where there is paint, (N,)."""
        return np.asarray(np.logical_or.reduce([dash.painted(s_m) for dash in self.dashes]), np.bool_)


@dataclass(frozen=True, slots=True)
class RoadMark:
    """A border's mark from `start_m` (absolute s) to the next one's; stripes from left to right of the road.

    `kind` is as seen along increasing s; `mirrored_kind` as seen by those who drive the other way.
    `contrast`, `wear`, `valid` as in Marking, over s; None: as new. No element of OpenDRIVE has them, so
    they come from userData "vsensor.paint".
    """

    start_m: float
    kind: MarkingKind
    colour: Colour
    stripes: tuple[StripeMark, ...]
    contrast: Cubics | None = None
    wear: Cubics | None = None
    valid: bool = True

    @property
    def mirrored_kind(self) -> MarkingKind:
        """The kind as seen along decreasing s."""
        swap = {
            MarkingKind.SOLID_DASHED: MarkingKind.DASHED_SOLID,
            MarkingKind.DASHED_SOLID: MarkingKind.SOLID_DASHED,
        }
        return swap.get(self.kind, self.kind)


UNMARKED = RoadMark(-FOREVER_M, MarkingKind.NONE, Colour.UNKNOWN, ())


def marks_between(
    marks: tuple[RoadMark, ...], from_m: float, to_m: float
) -> list[tuple[float, float, RoadMark]]:
    """Return (from, to, mark) of ordered marks that cover the stretch; UNMARKED before the first."""
    starts = [-np.inf, *(mark.start_m for mark in marks), np.inf]
    pieces = zip(starts[:-1], starts[1:], (UNMARKED, *marks), strict=True)
    return [(low, high, mark) for low, high, mark in pieces if low < to_m and high > from_m]


def read_marks(
    reader: MapReader, lane: Element, side: int, section_m: float, road_type: str
) -> tuple[RoadMark, ...]:
    """Return the marks of a lane's outer border (of the centre lane, side 0: its own), ordered by start."""
    marks = [read_mark(reader, el, side, section_m, road_type) for el in children(lane, "roadMark")]
    by_start = {mark.start_m: mark for mark in sorted(marks, key=lambda mark: mark.start_m)}
    return tuple(by_start.values())


def read_mark(reader: MapReader, el: Element, side: int, section_m: float, road_type: str) -> RoadMark:
    """Return one <roadMark>, whose sOffset counts from `section_m`."""
    start = section_m + reader.at_least(el, "sOffset", 0.0, 0.0)
    words = reader.text(el, "type").replace("_", " ").lower()
    width = _width(reader, el)
    double = words.split() if words in DOUBLE_WORDS else []
    if not double and words not in SINGLE_KINDS:
        reader.warn(el, f'type="{shortened(words)}" is not known: taken as painted, kind unknown')
    for sway in children(el, "sway"):
        reader.warn(sway, "is ignored: the mark is laid along its border")
    stripes = list(_lines(reader, el, start, width))
    if not stripes:
        stripes = _default(words, double, side, start, width, road_type)
    stripes = _two_at_most(reader, el, stripes)
    kind = _kind(words, stripes)
    paint = own_data(el, "vsensor.paint", "paint")
    return RoadMark(
        start,
        kind,
        _colour(reader, el, kind),
        tuple(stripes),
        _over_s(reader, paint, "contrast"),
        _over_s(reader, paint, "wear"),
        paint is None or reader.choice(paint, "valid", ("true", "false")) == "true",
    )


def _over_s(reader: MapReader, paint: Element | None, name: str) -> Cubics | None:
    records = [read_cubic(reader, el, "s") for el in children(paint, name)]
    return Cubics.of(records) if records else None


def _colour(reader: MapReader, el: Element, kind: MarkingKind) -> Colour:
    if kind in (MarkingKind.NONE, MarkingKind.CURB, MarkingKind.ROAD_EDGE):
        return Colour.UNKNOWN
    name = el.get("color", "standard").strip().lower()
    if name not in COLOURS:
        reader.warn(el, f'color="{shortened(name)}" is not known: taken as unknown')
    return COLOURS.get(name, Colour.UNKNOWN)


def _width(reader: MapReader, el: Element) -> float:
    bold = (el.get("weight") or "").strip().lower() == "bold"
    width = reader.at_least(el, "width", 0.0, BOLD_WIDTH_M if bold else STANDARD_WIDTH_M)
    return width or (BOLD_WIDTH_M if bold else STANDARD_WIDTH_M)


def _lines(reader: MapReader, mark: Element, start_m: float, width_m: float) -> Iterator[StripeMark]:
    """Yield one stripe per tOffset of the mark's <line> elements, from left to right."""
    found: dict[float, list[tuple[Dashes, float]]] = {}
    for group in children(mark, "type", "explicit"):
        width = reader.at_least(group, "width", 0.0, width_m) or width_m
        for line in children(group, "line"):
            dashes = _dashes(reader, line, start_m, once=group.tag == "explicit")
            line_width = reader.at_least(line, "width", 0.0, width) or width
            found.setdefault(reader.number(line, "tOffset", 0.0), []).append((dashes, line_width))
    for t_offset in sorted(found, reverse=True):
        yield StripeMark(t_offset, found[t_offset][0][1], tuple(dashes for dashes, _ in found[t_offset]))


def _dashes(reader: MapReader, line: Element, start_m: float, *, once: bool) -> Dashes:
    begin = start_m + reader.at_least(line, "sOffset", 0.0, 0.0)
    dash = reader.at_least(line, "length", 0.0)
    gap = 0.0 if once else reader.at_least(line, "space", 0.0, 0.0)
    if dash == 0.0 and gap > 0.0:
        reader.warn(line, f"gaps of {gap:g} m between dashes of 0 m: nothing is painted")
    return Dashes(begin, dash, gap, once)


def _default(
    words: str, double: list[str], side: int, start_m: float, width_m: float, road_type: str
) -> list[StripeMark]:
    """Return the stripes of a mark without lines; two stripes have a gap of one stripe between them."""
    key = "motorway" if road_type.startswith("motorway") else road_type
    broken = Dashes(start_m, *DASH_AND_GAP_M.get(key, DASH_AND_GAP_M[""]))
    solid = Dashes(start_m, 0.0, 0.0)
    if words in ("none", "grass"):
        return []
    if double:
        left_to_right = double if side <= 0 else double[::-1]
        dashes = [broken if word == "broken" else solid for word in left_to_right]
        return [StripeMark(width_m, width_m, (dashes[0],)), StripeMark(-width_m, width_m, (dashes[1],))]
    if words == "botts dots":
        return [StripeMark(0.0, width_m, (Dashes(start_m, *BOTTS_DOT_AND_GAP_M),))]
    return [StripeMark(0.0, width_m, (broken if words == "broken" else solid,))]


def _two_at_most(reader: MapReader, el: Element, stripes: list[StripeMark]) -> list[StripeMark]:
    if len(stripes) <= 2:
        return stripes
    reader.warn(el, f"{len(stripes)} stripes side by side: the two outermost are kept")
    return [stripes[0], stripes[-1]]


def _kind(words: str, stripes: list[StripeMark]) -> MarkingKind:
    """Return the kind; of lines it follows the paint, so that a `solid` made of dashes is dashed."""
    if len(stripes) == 2:
        return DOUBLE_KINDS[stripes[0].dashed, stripes[1].dashed]
    kind = SINGLE_KINDS.get(words, MarkingKind.UNKNOWN)
    follows_paint = kind in (MarkingKind.SOLID, MarkingKind.DASHED) or words in DOUBLE_WORDS
    if stripes and follows_paint:
        return MarkingKind.DASHED if stripes[0].dashed else MarkingKind.SOLID
    return kind

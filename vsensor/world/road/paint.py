"""What is painted on each border over s, and as which stripes and dashes.

Later wins: a lane's own paint, `[[road.paint]]` in their order, gaps; a construction line makes what lies
under it count no more.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from math import ceil

from vsensor.errors import ConfigError
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.config import (
    ConstructionConfig,
    GhostConfig,
    PaintConfig,
    RoadConfig,
    StretchConfig,
)
from vsensor.world.road.layout import Layout, PlannedLane
from vsensor.world.road.rows import smooth_rows, stations, total

NOTHING = PaintConfig(kind="none")
SOLID, DASHED = PaintConfig(kind="solid"), PaintConfig(kind="dashed")
BOTTS_DASH_M, BOTTS_GAP_M = 0.1, 1.2
SNAP_M = 1e-9
"""A dash that is shorter than this is none."""


@dataclass(frozen=True, slots=True)
class Mark:
    """Paint from `start_m` to `end_m`; `valid` False: it does not count."""

    start_m: float
    end_m: float
    paint: PaintConfig
    valid: bool = True


@dataclass(frozen=True, slots=True)
class Dash:
    """Paint from `start_m` on: `dash_m`, then `gap_m` without, and so on; `once`: one dash; gap 0: solid."""

    start_m: float
    dash_m: float
    gap_m: float
    once: bool = False


@dataclass(frozen=True, slots=True)
class ExtraLine:
    """A line that is no lane's border: t over s from `from_m` to `to_m`."""

    name: str
    from_m: float
    to_m: float
    t: tuple[CubicRecord, ...]
    paint: PaintConfig
    valid: bool


def marks_of(config: RoadConfig, layout: Layout, border: int, where: str) -> tuple[Mark, ...]:
    """Return the marks of a border over the whole road, or the part where it is; raises ConfigError."""
    start_m, end_m = _extent(layout, border)
    stretches = [s for s in config.paint if s.border == border]
    gaps = [(g.at_m, g.at_m + g.length_m) for g in config.gap if border in g.borders]
    voided = [(c.from_m, c.to_m) for c in config.construction if border in overridden(c)]
    ends = [*((s.from_m, s.to_m) for s in stretches), *gaps, *voided]
    places = {*(s for pair in ends for s in pair), *(section.start_m for section in layout.sections)}
    edges = sorted({start_m, end_m, *(s for s in places if start_m < s < end_m)})
    marks: list[Mark] = []
    for a, b in pairwise(edges):
        own = [s for s in stretches if s.from_m <= a and b <= s.to_m]
        paint: PaintConfig = own[-1] if own else _own_paint(config, layout, border, a)
        if _covered(a, b, gaps):
            paint = NOTHING
        mark = Mark(a, b, paint, not _covered(a, b, voided))
        if marks and (marks[-1].paint, marks[-1].valid) == (mark.paint, mark.valid):
            mark = Mark(marks.pop().start_m, b, mark.paint, mark.valid)
        marks.append(mark)
    for mark in marks:
        check_paint(mark.paint, f"{where}, border {border}")
    return tuple(marks)


def overridden(construction: ConstructionConfig) -> tuple[int, ...]:
    """Return the borders whose paint a construction line overrides."""
    return (construction.border,) if construction.overrides is None else construction.overrides


def check_all(config: RoadConfig, layout: Layout, where: str) -> None:
    """Raise ConfigError for paint on borders or stretches that are not there."""
    for key, one in _stretches(config, where):
        layout.check_border(one.border, f"{key}.border")
        layout.check_stretch(one.from_m, one.to_m, key)
        check_paint(one, key)
    for number, gap in enumerate(config.gap):
        key = f"{where}.gap[{number}]"
        layout.check_stretch(gap.at_m, gap.at_m + gap.length_m, key)
        for border in gap.borders:
            layout.check_border(border, f"{key}.borders")
    for number, line in enumerate(config.construction):
        for border in overridden(line):
            layout.check_border(border, f"{where}.construction[{number}].overrides")


def _stretches(config: RoadConfig, where: str) -> Iterator[tuple[str, StretchConfig]]:
    """Yield everything that is painted between two places, and its key."""
    for name in ("paint", "ghost", "construction"):
        for number, one in enumerate(getattr(config, name)):
            yield f"{where}.{name}[{number}]", one


def check_paint(paint: PaintConfig, key: str) -> None:
    """Raise ConfigError for contrast or wear that is not a share."""
    for name, points in (("contrast", paint.contrast), ("wear", paint.wear)):
        for _, value in stations(points, f"{key}.{name}"):
            if not 0.0 <= value <= 1.0:
                raise ConfigError(f"{key}.{name} = {value:g}: from 0 to 1 was expected")


def extra_lines(config: RoadConfig, layout: Layout, where: str) -> tuple[ExtraLine, ...]:
    """Return ghost and construction lines."""
    found = []
    for key, line in _stretches(config, where):
        if isinstance(line, GhostConfig | ConstructionConfig):
            beside = smooth_rows(line.offset_m, f"{key}.offset_m")
            t = total([(1.0, layout.t(line.border)), (1.0, beside)])
            is_ghost = isinstance(line, GhostConfig)
            name = "ghost" if is_ghost else "construction"
            to_m = min(line.to_m, layout.length_m)
            found.append(ExtraLine(name, line.from_m, to_m, t, line, valid=not is_ghost))
    return tuple(found)


def stripes(paint: PaintConfig) -> tuple[tuple[float, bool], ...]:
    """Return t offset (to the left of the border) and whether dashed, of each stripe from left to right."""
    words = {"double_solid": "solid_solid", "double_dashed": "dashed_dashed"}.get(paint.kind, paint.kind)
    parts = words.split("_")
    if words in ("solid_solid", "dashed_dashed", "solid_dashed", "dashed_solid"):
        half_m = (paint.double_gap_m + paint.width_m) / 2.0
        return ((half_m, parts[0] == "dashed"), (-half_m, parts[1] == "dashed"))
    if paint.kind in ("none", "curb", "road_edge"):
        return ()
    return ((0.0, paint.kind in ("dashed", "botts_dots")),)


def dashes(paint: PaintConfig, from_m: float, to_m: float, dashed: bool) -> Iterator[Dash]:
    """Yield the paint of a stripe that begins at `from_m`, in step with `phase_m`."""
    if not dashed:
        yield Dash(from_m, 10.0, 0.0)
        return
    dash_m, gap_m = (paint.dash_m, paint.gap_m)
    if paint.kind == "botts_dots":
        dash_m, gap_m = BOTTS_DASH_M, BOTTS_GAP_M
    period_m = dash_m + gap_m
    next_m = paint.phase_m + ceil((from_m - paint.phase_m) / period_m - SNAP_M) * period_m
    left_m = min(next_m - period_m + dash_m, to_m) - from_m
    if left_m > SNAP_M:
        yield Dash(from_m, left_m, 0.0, once=True)
    if next_m < to_m - SNAP_M:
        yield Dash(max(next_m, from_m), dash_m, gap_m)


def _covered(from_m: float, to_m: float, parts: Sequence[tuple[float, float]]) -> bool:
    return any(a <= from_m and to_m <= b for a, b in parts)


def _extent(layout: Layout, border: int) -> tuple[float, float]:
    if border == 0:
        return 0.0, layout.length_m
    lane = layout.lanes[border]
    return lane.from_m, lane.to_m


def _own_paint(config: RoadConfig, layout: Layout, border: int, s_m: float) -> PaintConfig:
    """Return a border's own paint at s: what its lane says, else by what lies on both sides."""
    if border == 0:
        return config.centre or _between(layout, s_m)
    lane = layout.lanes[border]
    if lane.config.paint is not None:
        return lane.config.paint
    if not lane.is_driven:
        return NOTHING
    outside = _outside(layout, border, s_m)
    return DASHED if outside is not None and outside.is_driven else SOLID


def _between(layout: Layout, s_m: float) -> PaintConfig:
    """Return the default paint of the line itself: dashed between two driven lanes, solid beside one."""
    sides = [_outside(layout, 0, s_m, side) for side in (1, -1)]
    driven = sum(lane is not None and lane.is_driven for lane in sides)
    return (NOTHING, SOLID, DASHED)[driven]


def _outside(layout: Layout, border: int, s_m: float, side: int = 0) -> PlannedLane | None:
    side = side or (1 if border > 0 else -1)
    outer = sorted((n for n in layout.lanes if n * side > border * side), key=abs)
    here = [layout.lanes[n] for n in outer if layout.lanes[n].from_m <= s_m < layout.lanes[n].to_m]
    return here[0] if here else None

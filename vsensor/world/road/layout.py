"""The lanes of a road over s: widths, sections, the numbers that OpenDRIVE gives them, and t of borders.

A lane keeps its number in the file (1, 2 to the left, -1, -2 to the right) all along the road; in a section
where an inner one is not there OpenDRIVE counts it one less.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

from vsensor.errors import ConfigError
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.config import LaneConfig, RoadConfig
from vsensor.world.road.rows import between, smooth_rows, step_row, tidied, total, value_at

DRIVEN = frozenset({"driving", "entry", "exit", "bus"})


@dataclass(frozen=True, slots=True)
class PlannedLane:
    """A lane from `from_m` to `to_m`; `width` over the whole road, 0 where the lane is not."""

    number: int
    config: LaneConfig
    from_m: float
    to_m: float
    width: tuple[CubicRecord, ...]

    @property
    def is_driven(self) -> bool:
        """Whether vehicles drive on it."""
        return self.config.kind in DRIVEN


@dataclass(frozen=True, slots=True)
class PlannedSection:
    """From `start_m` to `end_m` the same lanes: `ids` by their numbers in the file."""

    start_m: float
    end_m: float
    ids: Mapping[int, int]


@dataclass(frozen=True, slots=True)
class Layout:
    """All lanes of a road; `offset` is t of border 0."""

    length_m: float
    offset: tuple[CubicRecord, ...]
    lanes: Mapping[int, PlannedLane]
    sections: tuple[PlannedSection, ...]

    @property
    def borders(self) -> tuple[int, ...]:
        """The borders from left to right."""
        return tuple(sorted([0, *self.lanes], reverse=True))

    def t(self, border: int) -> tuple[CubicRecord, ...]:
        """Return t of a border over s."""
        side = 1 if border > 0 else -1
        inside = [lane for number, lane in self.lanes.items() if 0 < side * number <= side * border]
        return total([(1.0, self.offset), *((float(side), lane.width) for lane in inside)])

    def driven_between(self, s_m: float, sides: tuple[int, ...] = (1, -1)) -> tuple[float, float] | None:
        """Return t of the right and the left edge of what is driven on at s, None where nothing is."""
        edges = []
        for number, lane in self.lanes.items():
            side = 1 if number > 0 else -1
            if side in sides and lane.is_driven and value_at(lane.width, s_m) > 0.0:
                edges += [value_at(self.t(number), s_m), value_at(self.t(number - side), s_m)]
        return (min(edges), max(edges)) if edges else None

    def check_border(self, border: int, key: str) -> None:
        """Raise ConfigError for a border that the road has not."""
        if border not in self.borders:
            known = ", ".join(map(str, self.borders))
            raise ConfigError(f"{key} = {border}: no such border; from left to right there are {known}")

    def check_stretch(self, from_m: float, to_m: float, key: str) -> None:
        """Raise ConfigError for a stretch without length, or beyond the end of the road."""
        if not to_m > from_m:
            raise ConfigError(f"{key}: from {from_m:g} m to {to_m:g} m: a length above 0 was expected")
        if to_m > self.length_m + 1e-6:
            raise ConfigError(f"{key}: up to {to_m:g} m, but the road is {self.length_m:.9g} m long")


def layout_of(config: RoadConfig, length_m: float, where: str) -> Layout:
    """Return the road's lanes; raises ConfigError."""
    lanes = {}
    for side, name, found in ((1, "left", config.left), (-1, "right", config.right)):
        for place, lane in enumerate(found):
            planned = _lane(side * (place + 1), lane, length_m, f"{where}.{name}[{place}]")
            lanes[planned.number] = planned
    if not any(lane.is_driven for lane in lanes.values()):
        raise ConfigError(f"{where}: no lane is driven on: left or right with a lane of kind driving")
    offset = smooth_rows(config.offset_m, f"{where}.offset_m")
    return Layout(length_m, offset, lanes, _sections(lanes, length_m))


def _lane(number: int, config: LaneConfig, length_m: float, where: str) -> PlannedLane:
    from_m = 0.0 if config.from_m is None else config.from_m
    to_m = length_m if config.to_m is None else config.to_m
    if not from_m < to_m <= length_m + 1e-6:
        raise ConfigError(f"{where}: from {from_m:g} m to {to_m:g} m of a road of {length_m:.9g} m")
    to_m = min(to_m, length_m)
    opens = 0.0 if config.from_m is None else config.taper_m
    closes = 0.0 if config.to_m is None else config.taper_m
    if opens + closes > to_m - from_m + 1e-9:
        raise ConfigError(f"{where}.taper_m = {config.taper_m:g}: the lane is {to_m - from_m:g} m long")
    base = smooth_rows(config.width_m, f"{where}.width_m")
    full_m, narrows_m = from_m + opens, to_m - closes
    rows: list[CubicRecord] = [(0.0, 0.0, 0.0, 0.0, 0.0)] if from_m > 0.0 else []
    if opens:
        rows.append(step_row(from_m, full_m, 0.0, value_at(base, full_m)))
    rows += between(base, full_m, narrows_m)
    if closes:
        rows.append(step_row(narrows_m, to_m, value_at(base, narrows_m), 0.0))
    if to_m < length_m:
        rows.append((to_m, 0.0, 0.0, 0.0, 0.0))
    return PlannedLane(number, config, from_m, to_m, tidied(rows))


def _sections(lanes: Mapping[int, PlannedLane], length_m: float) -> tuple[PlannedSection, ...]:
    edges = sorted({0.0, length_m, *(e for lane in lanes.values() for e in (lane.from_m, lane.to_m))})
    return tuple(PlannedSection(a, b, _ids(lanes, a, b)) for a, b in pairwise(edges))


def _ids(lanes: Mapping[int, PlannedLane], start_m: float, end_m: float) -> dict[int, int]:
    ids = {0: 0}
    for side in (1, -1):
        here = [
            number
            for number in sorted((n for n in lanes if n * side > 0), key=abs)
            if lanes[number].from_m <= start_m and lanes[number].to_m >= end_m
        ]
        ids |= {number: side * (place + 1) for place, number in enumerate(here)}
    return ids

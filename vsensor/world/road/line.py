"""The reference line: pieces in order into records of OpenDRIVE, closed or placed where a file says.

Ends are computed by the reader's own curves, so a joint is as good as float64.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import copysign, cos, fsum, hypot, pi, radians, sin

import numpy as np

from vsensor.errors import ConfigError
from vsensor.world.opendrive.planview import Arc as ArcCurve
from vsensor.world.opendrive.planview import Curve, Record, Spiral
from vsensor.world.road.config import Arc, Bend, Clothoid, Piece, RoadConfig, Straight

SHORTEST_RADIUS_M = 1.0
CLOSES_M, CLOSES_RAD = 1e-6, 1e-9


@dataclass(frozen=True, slots=True)
class Element:
    """A part of the line: curvature from `start_per_m` evenly to `end_per_m`; `piece` it came from."""

    length_m: float
    start_per_m: float
    end_per_m: float
    piece: int

    @property
    def turn_rad(self) -> float:
        """Change of heading over the element."""
        return self.length_m * (self.start_per_m + self.end_per_m) / 2.0

    @property
    def curve(self) -> Curve:
        """The reader's curve of it."""
        if self.start_per_m == self.end_per_m:
            return ArcCurve(self.start_per_m)
        return Spiral(self.start_per_m, self.end_per_m, self.length_m)


@dataclass(frozen=True, slots=True)
class Pose:
    """A place in the plane and a heading."""

    x_m: float = 0.0
    y_m: float = 0.0
    heading_rad: float = 0.0

    def shifted(self, left_m: float) -> "Pose":
        """Return the pose so far to the left."""
        h = self.heading_rad
        return Pose(self.x_m - left_m * sin(h), self.y_m + left_m * cos(h), h)

    def after(self, local: "Pose") -> "Pose":
        """Return a pose that is given in the frame of this one."""
        c, s = cos(self.heading_rad), sin(self.heading_rad)
        return Pose(
            self.x_m + c * local.x_m - s * local.y_m,
            self.y_m + s * local.x_m + c * local.y_m,
            self.heading_rad + local.heading_rad,
        )

    def inverse(self) -> "Pose":
        """Return the origin's pose in the frame of this one."""
        c, s = cos(self.heading_rad), sin(self.heading_rad)
        return Pose(-c * self.x_m - s * self.y_m, s * self.x_m - c * self.y_m, -self.heading_rad)


@dataclass(frozen=True, slots=True)
class Line:
    """A placed line: elements and the records they become, in order; `end` is the pose behind the last."""

    elements: tuple[Element, ...]
    records: tuple[Record, ...]
    end: Pose

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return self.records[-1].s_m + self.records[-1].length_m

    @property
    def start(self) -> Pose:
        """The pose at s = 0."""
        first = self.records[0]
        return Pose(first.x_m, first.y_m, first.heading_rad)


def elements_of(config: RoadConfig, where: str) -> tuple[Element, ...]:
    """Return the elements of a road's line, those of a closed one stretched; raises ConfigError."""
    elements: list[Element] = []
    for number, piece in enumerate(config.line):
        before = elements[-1].end_per_m if elements else 0.0
        elements += _elements(piece, number, before, f"{where}.line[{number}]")
    if config.closed:
        return _closed(elements, config, where)
    for number, piece in enumerate(config.line):
        if isinstance(piece, Straight) and piece.stretches:
            raise ConfigError(f"{where}.line[{number}].stretches: only a road with closed = true stretches")
    return tuple(elements)


def placed(elements: Sequence[Element], start: Pose) -> Line:
    """Return the line that starts at a pose."""
    records, pose, s_m = [], start, 0.0
    for element in elements:
        record = Record(s_m, pose.x_m, pose.y_m, pose.heading_rad, element.length_m, element.curve)
        records.append(record)
        pose = _end(record)
        s_m += element.length_m
    return Line(tuple(elements), tuple(records), pose)


def _end(record: Record) -> Pose:
    x, y, heading, _ = record.at(np.array([record.length_m]))
    return Pose(float(x[0]), float(y[0]), float(heading[0]))


def _elements(piece: Piece, number: int, before_per_m: float, where: str) -> list[Element]:
    if isinstance(piece, Straight):
        return [Element(piece.length_m, 0.0, 0.0, number)]
    if isinstance(piece, Arc):
        curvature = _curvature(piece.radius_m, f"{where}.radius_m")
        return [Element(_arc_length(piece, where), curvature, curvature, number)]
    if isinstance(piece, Clothoid):
        end = 0.0 if piece.to_radius_m is None else _curvature(piece.to_radius_m, f"{where}.to_radius_m")
        start = before_per_m
        if piece.from_radius_m is not None:
            start = _curvature(piece.from_radius_m, f"{where}.from_radius_m")
        return [Element(piece.length_m, start, end, number)]
    return _bend(piece, number, where)


def _curvature(radius_m: float, key: str) -> float:
    if abs(radius_m) < SHORTEST_RADIUS_M:
        raise ConfigError(f"{key} = {radius_m:g}: at least {SHORTEST_RADIUS_M:g} m was expected")
    return 1.0 / radius_m


def _arc_length(piece: Arc, where: str) -> float:
    if (piece.length_m is None) == (piece.turn_deg is None):
        raise ConfigError(f"{where}: an arc has either length_m or turn_deg")
    if piece.length_m is not None:
        return piece.length_m
    return radians(piece.turn_deg or 0.0) * abs(piece.radius_m)


def _bend(piece: Bend, number: int, where: str) -> list[Element]:
    curvature = copysign(_curvature(piece.radius_m, f"{where}.radius_m"), piece.turn_deg)
    arc_m = radians(piece.turn_deg) / curvature - piece.clothoid_m
    if arc_m < 0.0 or piece.turn_deg == 0.0:
        raise ConfigError(
            f"{where}.turn_deg = {piece.turn_deg:g}: two clothoids of {piece.clothoid_m:g} m to a radius of "
            f"{piece.radius_m:g} m alone turn by {np.degrees(piece.clothoid_m * abs(curvature)):.3g} degrees"
        )
    if piece.superelevation_percent and not piece.clothoid_m:
        raise ConfigError(f"{where}.superelevation_percent: it is reached along clothoids, clothoid_m")
    parts = [
        Element(piece.clothoid_m, 0.0, curvature, number),
        Element(arc_m, curvature, curvature, number),
        Element(piece.clothoid_m, curvature, 0.0, number),
    ]
    return [part for part in parts if part.length_m > 0.0]


def _closed(elements: Sequence[Element], config: RoadConfig, where: str) -> tuple[Element, ...]:
    """Return the elements with two straights made longer so that the end meets the start.

    The end's place is linear in their lengths: two equations for two unknowns.
    """
    turn = fsum(element.turn_rad for element in elements)
    if abs(abs(turn) - 2.0 * pi) > CLOSES_RAD:
        raise ConfigError(
            f"{where}.closed: its pieces turn by {np.degrees(turn):.9g} degrees in all, 360 were expected"
        )
    free = [
        number
        for number, element in enumerate(elements)
        if isinstance(piece := config.line[element.piece], Straight) and piece.stretches
    ]
    line = placed(elements, Pose())
    if not free:
        if hypot(line.end.x_m, line.end.y_m) > CLOSES_M:
            raise ConfigError(
                f"{where}.closed: its end misses its start by {hypot(line.end.x_m, line.end.y_m):.6g} m; "
                "stretches = true on two straights would close it"
            )
        return tuple(elements)
    headings = [line.records[number].heading_rad for number in free]
    if len(free) != 2 or abs(sin(headings[1] - headings[0])) < 1e-3:
        raise ConfigError(f"{where}.closed: stretches = true on two straights, not parallel, was expected")
    return _stretched(list(elements), free, headings, where)


def _stretched(
    elements: list[Element], free: Sequence[int], headings: Sequence[float], where: str
) -> tuple[Element, ...]:
    matrix = np.array([[cos(h) for h in headings], [sin(h) for h in headings]])
    for _ in range(2):  # the second time for the rounding of the first
        end = placed(elements, Pose()).end
        longer = np.linalg.solve(matrix, [-end.x_m, -end.y_m]).tolist()
        for number, more_m in zip(free, longer, strict=True):
            old = elements[number]
            if old.length_m + more_m <= 0.0:
                raise ConfigError(
                    f"{where}.line[{old.piece}]: a closed road would need it {-more_m:.6g} m shorter; "
                    "more length in the pieces across from it was expected"
                )
            elements[number] = Element(old.length_m + more_m, 0.0, 0.0, old.piece)
    return tuple(elements)

"""Elevation and superelevation of a road as rows (s, a, b, c, d): a + b ds + c ds^2 + d ds^3 from s on."""

from itertools import pairwise
from math import atan, copysign

from vsensor.errors import ConfigError
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.config import Bend, GradeConfig, RoadConfig
from vsensor.world.road.line import Line
from vsensor.world.road.rows import ZERO, smooth_rows, step_row, tidied

CLOSES_Z_M, CLOSES_GRADE = 1e-9, 1e-12


def elevation_rows(config: RoadConfig, length_m: float, where: str) -> tuple[CubicRecord, ...]:
    """Return tangents and parabolas; raises ConfigError where they overlap."""
    corners = config.elevation
    if not corners:
        return ZERO
    if len(corners) == 1:
        return ((0.0, corners[0].z_m, 0.0, 0.0, 0.0),)
    grades = _grades(corners, where)
    first = corners[0]
    rows: list[CubicRecord] = [(0.0, first.z_m - grades[0] * first.at_m, grades[0], 0.0, 0.0)]
    before_m = first.at_m
    for number in range(1, len(corners) - 1):
        corner, (g0, g1) = corners[number], (grades[number - 1], grades[number])
        half_m = corner.radius_m * abs(g1 - g0) / 2.0
        after_m = corners[number + 1].at_m
        if corner.at_m - half_m < before_m - 1e-9 or corner.at_m + half_m > after_m + 1e-9:
            raise ConfigError(
                f"{where}.elevation[{number}].radius_m = {corner.radius_m:g}: its parabola is "
                f"{2.0 * half_m:.4g} m long and runs into the next corner or parabola"
            )
        if half_m > 0.0:
            bend = copysign(0.5 / corner.radius_m, g1 - g0)
            rows.append((corner.at_m - half_m, corner.z_m - g0 * half_m, g0, bend, 0.0))
        rows.append((corner.at_m + half_m, corner.z_m + g1 * half_m, g1, 0.0, 0.0))
        before_m = corner.at_m + half_m
    rows = [row for row in rows if row[0] < length_m]
    if config.closed:
        _check_closed(rows, length_m, where)
    return tuple(rows)


def _grades(corners: tuple[GradeConfig, ...], where: str) -> list[float]:
    grades = []
    for number, (a, b) in enumerate(pairwise(corners)):
        if b.at_m <= a.at_m:
            raise ConfigError(f"{where}.elevation[{number + 1}].at_m = {b.at_m:g}: at_m must rise")
        grades.append((b.z_m - a.z_m) / (b.at_m - a.at_m))
    return grades


def _check_closed(rows: list[CubicRecord], length_m: float, where: str) -> None:
    s, a, b, c, _ = rows[-1]
    ds = length_m - s
    rise, grade = a + ds * (b + ds * c) - rows[0][1], b + 2.0 * c * ds - rows[0][2]
    if abs(rise) > CLOSES_Z_M or abs(grade) > CLOSES_GRADE:
        raise ConfigError(
            f"{where}.elevation: a closed road was expected to end at the height and grade that it starts "
            f"with, but ends {rise:g} m higher, {100.0 * grade:g} % steeper"
        )


def superelevation_rows(config: RoadConfig, line: Line, where: str) -> tuple[CubicRecord, ...]:
    """Return the angle over s, left side up positive; raises ConfigError if both ways of it are used."""
    banked = [piece for piece in config.line if isinstance(piece, Bend) and piece.superelevation_percent]
    if not banked:
        return smooth_rows(
            config.superelevation_percent, f"{where}.superelevation_percent", lambda p: atan(p / 100.0)
        )
    if config.superelevation_percent != 0.0:
        raise ConfigError(
            f"{where}.superelevation_percent: its bends have their own; either here or there was expected"
        )
    rows: list[CubicRecord] = [(0.0, 0.0, 0.0, 0.0, 0.0)]
    for element, record in zip(line.elements, line.records, strict=True):
        piece = config.line[element.piece]
        if not isinstance(piece, Bend) or not piece.superelevation_percent:
            continue
        full = -copysign(atan(piece.superelevation_percent / 100.0), piece.turn_deg)
        start, end = (full if k else 0.0 for k in (element.start_per_m, element.end_per_m))
        rows.append(step_row(record.s_m, record.s_m + record.length_m, start, end))
        rows.append((record.s_m + record.length_m, end, 0.0, 0.0, 0.0))
    return tidied(rows)

"""Where lines run, exactly: y(x) and its derivatives of the map's own curve at chosen x of the ego frame.

The curve is asked once for all lines of an image, at places between two points of the chain that are found by
linear interpolation; what is left to the wanted x, some 1e-6 m, is a step along the Taylor series.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from vsensor.transforms import Rigid
from vsensor.types import Array, Curve, Marking
from vsensor.world.opendrive import taylor


@dataclass(slots=True)
class Course:
    """A line at the wanted x (M,): `series` (4, M) is y, y', y''/2, y'''/6 there, NaN where it ends."""

    series: Array

    @property
    def y_m(self) -> Array:
        """Where the line is, left positive."""
        return np.asarray(self.series[0])


@dataclass(slots=True)
class _Asked:
    """What one curve is asked in one call."""

    ids: list[Array] = field(default_factory=list[Array])
    stations: list[Array] = field(default_factory=list[Array])
    lines: list[int] = field(default_factory=list[int])


def courses(
    frame: Rigid, wanted_x_m: Array, lines: Mapping[int, tuple[Marking, Array, Array]]
) -> dict[int, Course]:
    """Return the course of each line whose marking has a curve, by its key.

    `lines`: key -> marking, x (N,) increasing in the ego frame and the places (N,) in the marking's arrays
    of points of it. `frame` is the road-level pose of the vehicle in the world.
    """
    asked: dict[int, tuple[Curve, _Asked]] = {}
    for key, (marking, x, places) in lines.items():
        if marking.curve is not None and x.size > 1:
            _, batch = asked.setdefault(id(marking.curve), (marking.curve, _Asked()))
            stations = marking.station + np.interp(wanted_x_m, x, places, left=np.nan, right=np.nan)
            batch.ids.append(np.full(wanted_x_m.size, marking.id, dtype=np.int64))
            batch.stations.append(stations)
            batch.lines.append(key)
    found = {}
    for curve, batch in asked.values():
        world = curve.series(np.concatenate(batch.ids), np.concatenate(batch.stations))
        over_x = _over_x(frame, world, np.tile(wanted_x_m, len(batch.lines)))
        found.update(_split(batch.lines, over_x))
    return found


def _over_x(frame: Rigid, world: Array, wanted_x_m: Array) -> Array:
    """Return the series (4, M) of y over x, about the wanted x (M,), of curves (4, 3, M) in the world."""
    world[0] -= frame.translation[:, None]
    x, y = np.einsum("ji,kjm->ikm", frame.rotation[:, :2], world)
    step = (wanted_x_m - x[0]) / x[1]
    return taylor.over(taylor.shifted(x, step), taylor.shifted(y, step))


def _split(lines: Sequence[int], series: Array) -> dict[int, Course]:
    parts = np.split(series, len(lines), axis=1)
    return {key: Course(part) for key, part in zip(lines, parts, strict=True)}

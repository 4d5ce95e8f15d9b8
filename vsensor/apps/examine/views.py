"""What can be looked at in the analysis window: series of a drive, as chosen on the page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from vsensor.apps.examine.analysis import (
    error_over_range_m,
    lane_error_m,
    reported_range_m,
    road_width_m,
)
from vsensor.apps.examine.drive import Drive
from vsensor.apps.examine.raw import signal_names, signal_series
from vsensor.errors import ConfigError
from vsensor.field.scan_plot import COLOURS
from vsensor.types import SIDE_NAMES, Array, IntArray, Side

FUNCTIONS: Mapping[str, str] = {
    "error": "Lane error at a range",
    "range": "Reported range",
    "width": "Road width",
    "over_range": "Error over range, selected image",
    "signal": "Raw signal",
}
SORTS: Mapping[str, str] = {"time": "time", "yaw_rate": "yaw rate"}
WHOLE = "#000000"
OTHER_COLOURS: Mapping[str, str] = {
    WHOLE: "#009e73",
    COLOURS[Side.LEFT]: COLOURS[Side.NEXT_LEFT],
    COLOURS[Side.RIGHT]: COLOURS[Side.NEXT_RIGHT],
}
"""Colour of a curve -> that of the drive laid over."""
LEAST_RANGE_M, FARTHEST_M = 0.0, 250.0


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """What is chosen: function, range of the error, order, sides, raw signal, selected image."""

    function: str = "error"
    range_m: float = 50.0
    sort: str = "time"
    sides: tuple[Side, ...] = (Side.LEFT, Side.RIGHT)
    signal: str = ""
    number: int = 0

    @classmethod
    def of(
        cls,
        drive: Drive,
        function: str,
        range_m: object,
        sort: str,
        sides: Sequence[str] | None,
        signal: str | None,
        number: object,
    ) -> "View":
        """Return the view that a page asks for; raises ConfigError naming what cannot be."""
        if function not in FUNCTIONS:
            raise ConfigError(f"function {function}: one of {', '.join(FUNCTIONS)} was expected")
        if sort not in SORTS:
            raise ConfigError(f"sort {sort}: one of {', '.join(SORTS)} was expected")
        known = {SIDE_NAMES[side]: side for side in drive.sides}
        if unknown := [word for word in sides or () if word not in known]:
            raise ConfigError(f"side {unknown[0]}: one of {', '.join(known)} was expected")
        if function == "signal" and signal not in set(signal_names(drive)):
            raise ConfigError(f"signal {signal}: no message of the log has it")
        return cls(
            function=function,
            range_m=_number(range_m, "range", LEAST_RANGE_M, FARTHEST_M),
            sort=sort,
            sides=tuple(known[word] for word in sides or ()),
            signal=signal or "",
            number=int(_number(number, "image", 0, len(drive) - 1)),
        )

    @property
    def is_one_image(self) -> bool:
        """Whether only the selected image is shown."""
        return self.function == "over_range"

    @property
    def x_title(self) -> str:
        """What the horizontal axis shows, with its unit."""
        if self.is_one_image:
            return "range (m)"
        return "time (s)" if self.sort == "time" else "yaw rate (deg/s), left positive"


@dataclass(frozen=True, slots=True, kw_only=True)
class Series:
    """One curve: `x`, `y` (M,), the image (M,) that a click on each point selects, name and colour.

    `is_other`: of the drive that is laid over.
    """

    name: str
    colour: str
    x: Array
    y: Array
    numbers: IntArray
    is_other: bool = False


def series_of(drive: Drive, view: View) -> tuple[list[Series], str]:
    """Return the curves of a view, those of the other drive too, and the title of the vertical axis."""
    curves, title = _own_series(drive, view)
    if drive.other is None:
        return curves, title
    return [*curves, *_laid_over(drive, drive.other, view)], title


def _laid_over(drive: Drive, other: Drive, view: View) -> list[Series]:
    """Return the other drive's curves; a click on one selects this drive's image of the same time."""
    if view.function == "signal" and view.signal not in set(signal_names(other)):
        return []
    same = replace(view, number=other.number_at(float(drive.t_s[view.number])))
    return [
        replace(
            curve,
            name=f"{curve.name}, {other.log.name}",
            colour=OTHER_COLOURS[curve.colour],
            numbers=np.clip(np.searchsorted(drive.t_s, other.t_s[curve.numbers]), 0, len(drive) - 1),
            is_other=True,
        )
        for curve in _own_series(other, same)[0]
    ]


def _own_series(drive: Drive, view: View) -> tuple[list[Series], str]:
    if view.is_one_image:
        ranges = drive.scanned.work.ranges_m
        here = np.full(len(ranges), view.number)
        curves = [
            _of_side(side, ranges, error_over_range_m(drive, side, view.number), here) for side in view.sides
        ]
        return curves, "lane error (m), left positive"
    if view.function == "signal":
        t_s, values, unit = signal_series(drive, view.signal)
        numbers = np.clip(np.searchsorted(drive.t_s, t_s), 0, len(drive) - 1)
        x = t_s if view.sort == "time" else np.degrees(drive.yaw_rate_radps[numbers])
        curve = Series(name=view.signal, colour=WHOLE, x=x, y=values, numbers=numbers)
        return [curve], f"{view.signal} ({unit or '1'})"
    x = drive.t_s if view.sort == "time" else np.degrees(drive.yaw_rate_radps)
    numbers = np.arange(len(drive))
    if view.function == "width":
        y = road_width_m(drive)
        return [Series(name="road width", colour=WHOLE, x=x, y=y, numbers=numbers)], "road width (m)"
    if view.function == "range":
        curves = [_of_side(side, x, reported_range_m(drive, side), numbers) for side in view.sides]
        return curves, "reported range (m)"
    curves = [_of_side(side, x, lane_error_m(drive, side, view.range_m), numbers) for side in view.sides]
    return curves, f"lane error at {view.range_m:g} m (m), left positive"


def csv_of(drive: Drive, view: View) -> str:
    """Return all points of a view, not only those drawn, as comma-separated values; NaN as nothing."""
    curves, title = series_of(drive, view)
    lines = [f"# {drive.log.name}: {title}", "curve,image,time_s,yaw_rate_degps,x,y"]
    rate = np.degrees(drive.yaw_rate_radps)
    for curve in curves:
        columns = (curve.numbers, drive.t_s[curve.numbers], rate[curve.numbers], curve.x, curve.y)
        for number, *values in zip(*(column.tolist() for column in columns), strict=True):
            cells = ("" if value != value else f"{value:.9g}" for value in values)
            lines.append(",".join((curve.name, str(number), *cells)))
    return "\n".join(lines) + "\n"


def _of_side(side: Side, x: Array, y: Array, numbers: IntArray) -> Series:
    return Series(name=SIDE_NAMES[side], colour=COLOURS[side], x=x, y=y, numbers=numbers)


def _number(value: object, name: str, low: float, high: float) -> float:
    try:
        number = float(str(value))
    except ValueError:
        number = float("nan")
    if not low <= number <= high:
        raise ConfigError(f"{name} {value}: a number from {low:g} to {high:g} was expected")
    return number

"""The table of model quantities: what a signal can carry, in which unit, with which codes."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from enum import IntEnum

from vsensor.types import SIDE_NAMES, Colour, Light, MarkingKind, SensorMode


class LaneChange(IntEnum):
    """Lane change seen in this image; numbers are those of the native DBC."""

    NONE = 0
    LEFT = 1
    RIGHT = 2


class Indicator(IntEnum):
    """Direction indicators; numbers are those of vehicle.dbc."""

    OFF = 0
    LEFT = 1
    RIGHT = 2
    BOTH = 3


class LaneWarning(IntEnum):
    """Lane departure warning of an ECU; numbers are those of vehicle.dbc."""

    NONE = 0
    LEFT = 1
    RIGHT = 2


class Wiper(IntEnum):
    """Wiper of the windscreen; numbers are those of vehicle.dbc."""

    OFF = 0
    INTERVAL = 1
    SLOW = 2
    FAST = 3


RAIN_OF_WIPER: Mapping[Wiper, float] = {
    Wiper.OFF: 0.0,
    Wiper.INTERVAL: 0.2,
    Wiper.SLOW: 0.5,
    Wiper.FAST: 1.0,
}
"""Rain, 0 dry to 1 heaviest, that a driver has the wiper at this speed for."""


def wiper_of(rain: float) -> Wiper:
    """Return the speed at which a driver has the wiper in this rain: the nearest, off only when it is dry."""
    if rain <= 0.0:
        return Wiper.OFF
    return min(list(Wiper)[1:], key=lambda wiper: abs(RAIN_OF_WIPER[wiper] - rain))


@dataclass(frozen=True, slots=True, kw_only=True)
class Quantity:
    """One thing the model knows: its SI `unit` ("" for a pure number), `meaning`, sign and codes.

    `lateral`: positive to the left in the model, so a profile whose bus counts to the right flips it.
    `codes`: the enumeration it belongs to, None for a number; `levels`: whole values from 0 that a table
    of a quantity without codes must map.
    """

    unit: str
    meaning: str
    lateral: bool = False
    codes: type[IntEnum] | None = None
    levels: int = 2


_LINE = {
    "available": Quantity(unit="", meaning="1 if the line is reported, else 0"),
    "offset_m": Quantity(unit="m", meaning="c0: y at x = 0 of the marking's centre", lateral=True),
    "heading": Quantity(unit="rad", meaning="c1: slope dy/dx at x = 0", lateral=True),
    "c2_per_m": Quantity(unit="1/m", meaning="c2", lateral=True),
    "c3_per_m2": Quantity(unit="1/m^2", meaning="c3", lateral=True),
    "curvature_per_m": Quantity(unit="1/m", meaning="2 c2: second derivative at x = 0", lateral=True),
    "curvature_rate_per_m2": Quantity(unit="1/m^2", meaning="6 c3: third derivative", lateral=True),
    "order": Quantity(unit="", meaning="order of the polynomial"),
    "x_min_m": Quantity(unit="m", meaning="x from which the polynomial is valid"),
    "x_max_m": Quantity(unit="m", meaning="x up to which the polynomial is valid"),
    "quality": Quantity(unit="", meaning="confidence 0 (none) to 4 (high)", levels=5),
    "kind": Quantity(unit="", meaning="kind of marking", codes=MarkingKind),
    "colour": Quantity(unit="", meaning="colour of the marking", codes=Colour),
    "width_m": Quantity(unit="m", meaning="width of the marking"),
    "measured": Quantity(unit="", meaning="1 measured in this image, 0 predicted or not available"),
}
_CENTRE = {name: quantity for name, quantity in _LINE.items() if name not in ("kind", "colour", "width_m")}
LINES = (*SIDE_NAMES.values(), "centre")
"""What has a polynomial: the four lines, and the virtual one in the middle of the lane."""

_LANE_OFFSET = Quantity(
    unit="m",
    meaning="vehicle's centreline to the inner edge at the front axle, left line > 0, right line < 0",
    lateral=True,
)

QUANTITIES: Mapping[str, Quantity] = {
    **{f"{side}.{name}": quantity for side in SIDE_NAMES.values() for name, quantity in _LINE.items()},
    **{f"centre.{name}": quantity for name, quantity in _CENTRE.items()},
    "left.lane_offset_m": _LANE_OFFSET,
    "right.lane_offset_m": _LANE_OFFSET,
    "lane.width_m": Quantity(unit="m", meaning="between the inner edges, across the lane, at the front axle"),
    "lane.lateral_speed_mps": Quantity(
        unit="m/s", meaning="speed of the front axle across the lane, to the left", lateral=True
    ),
    "lane.time_to_crossing_s": Quantity(
        unit="s",
        meaning="until the outer edge of a front wheel meets the inner edge, at constant lateral speed",
    ),
    "lane.change": Quantity(unit="", meaning="lane change seen in this image", codes=LaneChange),
    "image.index": Quantity(unit="", meaning="number of the image, counts every camera cycle"),
    "image.timestamp_ms": Quantity(unit="ms", meaning="time of exposure"),
    "sensor.state": Quantity(unit="", meaning="state of the sensor", codes=SensorMode),
    "sensor.light": Quantity(unit="", meaning="ambient light as the sensor sees it", codes=Light),
    "sensor.rain": Quantity(unit="", meaning="rain, 0 dry to 1 heaviest"),
    "ego.speed_mps": Quantity(unit="m/s", meaning="speed of the vehicle"),
    "ego.yaw_rate_radps": Quantity(unit="rad/s", meaning="yaw rate, positive to the left"),
    "ego.acceleration_mps2": Quantity(unit="m/s^2", meaning="acceleration forward"),
    "ego.lateral_acceleration_mps2": Quantity(unit="m/s^2", meaning="acceleration to the left"),
    "ego.steering_wheel_rad": Quantity(
        unit="rad", meaning="angle of the steering wheel, positive to the left"
    ),
    "ego.steering_request_rad": Quantity(
        unit="rad", meaning="angle of the front wheels that an ECU asks for, positive to the left"
    ),
    "ego.lane_warning": Quantity(
        unit="", meaning="side on which an ECU warns of leaving the lane", codes=LaneWarning
    ),
    "ego.x_m": Quantity(unit="m", meaning="x (east) of the vehicle in the world, rear axle, on the road"),
    "ego.y_m": Quantity(unit="m", meaning="y (north) of the vehicle in the world"),
    "ego.z_m": Quantity(unit="m", meaning="z (up) of the vehicle in the world; without it the road's height"),
    "ego.yaw_rad": Quantity(unit="rad", meaning="heading in the world, 0 to the east, positive to the left"),
    "ego.wiper": Quantity(unit="", meaning="wiper", codes=Wiper),
    "ego.low_beam": Quantity(unit="", meaning="1 if the low beam is on"),
    "ego.high_beam": Quantity(unit="", meaning="1 if the high beam is on"),
    "ego.light": Quantity(unit="", meaning="light outside as the vehicle measures it", codes=Light),
    "ego.indicator": Quantity(unit="", meaning="direction indicators", codes=Indicator),
}
"""Name -> what it is. Signs are the model's (ISO 8855: left positive); NaN = not available."""

UNITS: Mapping[str, Mapping[str, float]] = {
    "m": {"m": 1.0, "cm": 100.0, "mm": 1000.0},
    "m/s": {"m/s": 1.0, "km/h": 3.6, "mph": 3600.0 / 1609.344},
    "m/s^2": {"m/s^2": 1.0, "g": 1.0 / 9.80665},
    "rad": {"rad": 1.0, "mrad": 1000.0, "deg": 180.0 / math.pi},
    "rad/s": {"rad/s": 1.0, "deg/s": 180.0 / math.pi},
    "1/m": {"1/m": 1.0, "1/km": 1e3},
    "1/m^2": {"1/m^2": 1.0, "1/km^2": 1e6},
    "s": {"s": 1.0, "ms": 1e3},
    "ms": {"ms": 1.0, "s": 1e-3},
    "": {"": 1.0, "%": 100.0},
}
"""SI unit of a quantity -> units a bus may use, with their size: bus value = quantity * factor."""

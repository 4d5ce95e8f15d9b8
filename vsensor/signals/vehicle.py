"""The vehicle that carries the sensor, as far as signals need it."""

from typing import Annotated

import msgspec

from vsensor.schema import Config

_Length = Annotated[float, msgspec.Meta(gt=0, le=15)]


class VehicleConfig(Config, frozen=True, kw_only=True):
    """`[vehicle]`: the vehicle around the sensor.

    `width_m` over the outer edges of the front wheels; `front_overhang_m` from front axle to bumper;
    `assumed_lane_width_m` of a lane of which only one line is seen, for its virtual centre.
    """

    wheelbase_m: _Length = 2.8
    front_overhang_m: Annotated[float, msgspec.Meta(ge=0, le=5)] = 0.9
    width_m: _Length = 1.85
    assumed_lane_width_m: _Length = 3.5

"""The thresholds of an evaluation: which values of the CAN log count, and what parts them."""

from typing import Annotated

import msgspec

from vsensor.schema import Config

Share = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]


class Rules(Config, frozen=True, kw_only=True):
    """Defaults are P2's (2.3 to 2.6).

    A CAN offset counts from `least_confidence` on; an event is reliable if at least `share` of its values do.
    `fill`: gaps of the CAN offsets shorter than `gap_m` of driving are filled, straight from value to value,
    level at the ends. Curvy is a yaw rate above `curvy_degps`, changing speed an acceleration above
    `changing_mps2`, either way. An offset farther from the truth than `gross_m` is another line's.
    """

    share: Share = 0.6
    least_confidence: Annotated[int, msgspec.Meta(ge=1, le=4)] = 3
    fill: bool = False
    gap_m: Annotated[float, msgspec.Meta(ge=0.0, le=1000.0)] = 50.0
    curvy_degps: Annotated[float, msgspec.Meta(ge=0.0, le=90.0)] = 5.0
    changing_mps2: Annotated[float, msgspec.Meta(ge=0.0, le=20.0)] = 0.1
    gross_m: Annotated[float, msgspec.Meta(gt=0.0, le=10.0)] = 0.5

"""`[tracker]` of a scenario."""

from typing import Annotated

import msgspec

from vsensor.schema import Config


class TrackerConfig(Config, frozen=True, kw_only=True):
    """How lines are told apart, confirmed and coasted.

    Farther than `max_lateral_m` from the vehicle is no line of interest, farther than `max_own_m` none
    of the own lane; two fits nearer to each other than `min_separation_m` are the same paint. `gate_m`
    is how far a line may be from where it was expected and still be the same one; the gate grows while
    a line is not seen. A line is reported, and no other takes its side, once it was seen in
    `confirm_images` images; one that was not in sight in between takes one back. A confirmed line that
    is not seen is predicted for `coast_s` or `coast_m`, whichever ends first, and not beyond what was
    seen of it; 0 = never. The place of any unseen line is remembered for `memory_s`.
    """

    max_lateral_m: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = 8.0
    max_own_m: Annotated[float, msgspec.Meta(gt=0.0, le=30.0)] = 4.5
    min_separation_m: Annotated[float, msgspec.Meta(ge=0.0, le=2.0)] = 0.3
    hysteresis_m: Annotated[float, msgspec.Meta(ge=0.0, le=1.0)] = 0.2
    gate_m: Annotated[float, msgspec.Meta(gt=0.0, le=3.0)] = 1.0
    memory_s: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 0.5
    confirm_images: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 3
    coast_s: Annotated[float, msgspec.Meta(ge=0.0, le=10.0)] = 2.5
    coast_m: Annotated[float, msgspec.Meta(ge=0.0, le=200.0)] = 60.0

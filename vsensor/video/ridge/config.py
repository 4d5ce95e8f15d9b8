"""How our own method looks for lines; every length is on the road."""

from typing import Annotated

from msgspec import Meta

from vsensor.schema import Config
from vsensor.tracker import TrackerConfig

Metres = Annotated[float, Meta(gt=0.0, le=1000.0)]


class RidgeConfig(Config, frozen=True, kw_only=True):
    """Where lines are looked for, what paint looks like, and what a road may be.

    Looked at is the road up to `range_m` ahead of the camera, where a pixel covers no more than
    `most_px_m`, and up to `aside_m` to either side of it, in `rows` rows across whose distance grows by a
    constant factor, so that a row is a row of pixels or two near and far; points across are `step_m`
    apart. Paint is a stripe about `paint_m` wide that is lighter than the road on both sides: by
    `least_contrast` of the road's level, and by `noise_factor` times the row's noise.

    A line counts from `least_rows` rows of paint on, `least_length_m` of it in all. Lines of lanes are
    `least_lane_m` apart or more; two nearer than `double_m` are a double marking, whose inner stripe counts.

    The camera pitches with the body by `pitch_std_deg` (standard deviation) about the mount's angle; lines
    of one road converge by `converge_std` (slope), and bend by `bend_std_per_m`, changing by
    `clothoid_std_per_m2`.
    """

    range_m: Metres = 45.0
    most_px_m: Metres = 0.12
    aside_m: Metres = 6.0
    rows: Annotated[int, Meta(ge=24, le=1000)] = 144
    step_m: Annotated[float, Meta(ge=0.005, le=0.1)] = 0.025
    paint_m: Annotated[float, Meta(ge=0.05, le=0.6)] = 0.15
    least_contrast: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.07
    noise_factor: Annotated[float, Meta(ge=1.0, le=20.0)] = 3.2
    least_rows: Annotated[int, Meta(ge=2, le=200)] = 8
    least_length_m: Metres = 1.5
    least_lane_m: Metres = 2.2
    double_m: Metres = 0.6
    pitch_std_deg: Annotated[float, Meta(ge=0.0, le=5.0)] = 0.5
    converge_std: Annotated[float, Meta(ge=0.0, le=0.1)] = 0.004
    bend_std_per_m: Annotated[float, Meta(ge=0.0, le=0.2)] = 0.02
    clothoid_std_per_m2: Annotated[float, Meta(ge=0.0, le=0.01)] = 1e-4
    tracker: TrackerConfig = TrackerConfig(
        confirm_images=1, coast_s=1.0, coast_m=20.0, hysteresis_m=0.05, max_own_m=4.0
    )

"""What P2 leaves open, and what it fixes, as numbers that can be changed."""

from typing import Annotated

from msgspec import Meta

from vsensor.schema import Config

_Share = Annotated[float, Meta(gt=0.0, lt=1.0)]
_Level = Annotated[int, Meta(ge=0, le=255)]
_Angle = Annotated[float, Meta(gt=0.0, lt=90.0)]


class PublishedConfig(Config, frozen=True, kw_only=True):
    """`[published]`: the numbers of P2's method; those marked * are not in the paper.

    Static pixels: `static_levels`* is the largest change over the whole video of a pixel that counts as
    static (0: the step is left out), `static_pictures`* what it takes to say so. Region: the upper
    `sky_share` is not looked at. White zones: a median over `median_share`* of the width, then more than
    `white_above`* (t1) and less than `white_below`* (t2) levels lighter than it; patches below
    `least_patch_px`* go. Borders: an optimal threshold below `least_edge`* says that there is no edge at
    all (a black picture). Lines: normals of `least_angle_deg` to `most_angle_deg` from the horizontal on
    either side, the best `lines` of each, of at least `least_votes`* pixels and `peak_share`* of the best.
    """

    static_levels: _Level = 10
    static_pictures: Annotated[int, Meta(ge=2, le=100_000)] = 20
    sky_share: _Share = 0.5
    median_share: _Share = 0.125
    white_above: _Level = 20
    white_below: _Level = 200
    least_patch_px: Annotated[int, Meta(ge=0, le=100_000)] = 20
    least_edge: _Level = 10
    least_angle_deg: _Angle = 20.0
    most_angle_deg: _Angle = 80.0
    lines: Annotated[int, Meta(ge=1, le=50)] = 3
    peak_share: _Share = 0.5
    least_votes: Annotated[int, Meta(ge=2, le=100_000)] = 40

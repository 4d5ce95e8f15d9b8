"""What a road file holds: `schema = "vsensor.road/1"` and one or more `[[road]]`, or the same in Python.

s runs along a road's reference line from its start, t to the left of it. Lanes stand to the left and to the
right of the line, each list from the line outwards; a border is named by the lane whose outer side it is:
0 is the line itself, 2 the outer border of the second lane on the left, -1 that of the first on the right.

    left = [lane 1, lane 2]     2     1     0    -1
                                |  L2 |  L1 |  R1 |      right = [lane -1]

Where a value may change along s it is a number or points [[s, value], ...]: constant before the first and
after the last, between them on 3 u^2 - 2 u^3 (lane widths, offsets, superelevation), or straight (contrast,
wear).
"""

from typing import Annotated, Literal

from msgspec import Meta

from vsensor.motion.config import BumpConfig
from vsensor.schema import Config

SCHEMA = "vsensor.road/1"

Points = float | list[tuple[float, float]]

Kind = Literal[
    "none",
    "solid",
    "dashed",
    "double_solid",
    "double_dashed",
    "solid_dashed",
    "dashed_solid",
    "botts_dots",
    "road_edge",
    "curb",
]
"""As in `[road]` of a scenario; of a double line the left stripe along s comes first."""

ColourName = Literal["white", "yellow", "orange", "blue", "red", "green"]
LaneKind = Literal[
    "driving",
    "entry",
    "exit",
    "bus",
    "shoulder",
    "stop",
    "border",
    "median",
    "biking",
    "sidewalk",
    "parking",
    "restricted",
    "none",
]
Length = Annotated[float, Meta(gt=0.0, le=1e5)]
Station = Annotated[float, Meta(ge=0.0, le=1e6)]
Width = Annotated[float, Meta(ge=0.0, le=50.0)]
Radius = Annotated[float, Meta(ge=-1e6, le=1e6)]
Share = Annotated[float, Meta(ge=0.0, le=1.0)]


class Straight(Config, frozen=True, kw_only=True, tag_field="kind", tag="straight"):
    """`kind = "straight"`; `stretches`: as much longer as a closed road needs to meet its start."""

    length_m: Length
    stretches: bool = False


class Arc(Config, frozen=True, kw_only=True, tag_field="kind", tag="arc"):
    """`kind = "arc"`: a circle's part, to the left for a positive radius; its length or how far it turns."""

    radius_m: Radius
    length_m: Length | None = None
    turn_deg: Annotated[float, Meta(gt=0.0, le=3600.0)] | None = None


class Clothoid(Config, frozen=True, kw_only=True, tag_field="kind", tag="clothoid"):
    """`kind = "clothoid"`: its curvature changes evenly to that of `to_radius_m` (absent: straight).

    It begins with the curvature of the piece before it, or with that of `from_radius_m`.
    """

    length_m: Length
    to_radius_m: Radius | None = None
    from_radius_m: Radius | None = None


class Bend(Config, frozen=True, kw_only=True, tag_field="kind", tag="bend"):
    """`kind = "bend"`: clothoid, arc, clothoid, which turn by `turn_deg` in all; negative: to the right.

    `superelevation_percent` is the fall towards the inside on the arc, reached along the clothoids.
    """

    radius_m: Annotated[float, Meta(gt=0.0, le=1e6)]
    turn_deg: Annotated[float, Meta(ge=-3600.0, le=3600.0)]
    clothoid_m: Annotated[float, Meta(ge=0.0, le=1e4)] = 0.0
    superelevation_percent: Annotated[float, Meta(ge=0.0, le=30.0)] = 0.0


Piece = Straight | Arc | Clothoid | Bend


class PaintConfig(Config, frozen=True, kw_only=True):
    """What is painted on a border. `width_m` is that of a stripe, `double_gap_m` between two of them.

    The dash that begins at s = `phase_m` fixes all others. `contrast` is that of fresh paint against the
    road, `wear` how much of the paint is gone, in patches; both 0 to 1.
    """

    kind: Kind = "solid"
    width_m: Annotated[float, Meta(ge=0.02, le=1.0)] = 0.15
    dash_m: Annotated[float, Meta(gt=0.0, le=1000.0)] = 6.0
    gap_m: Annotated[float, Meta(gt=0.0, le=1000.0)] = 12.0
    double_gap_m: Annotated[float, Meta(ge=0.02, le=1.0)] = 0.15
    phase_m: Annotated[float, Meta(ge=-1e6, le=1e6)] = 0.0
    colour: ColourName = "white"
    contrast: Points = 1.0
    wear: Points = 0.0


class StretchConfig(PaintConfig, frozen=True, kw_only=True):
    """`[[road.paint]]`: a border painted otherwise between two places."""

    border: int
    from_m: Station
    to_m: Station


class GapConfig(Config, frozen=True, kw_only=True):
    """`[[road.gap]]`: nothing is painted on these borders for `length_m` from `at_m` on; dashes keep step."""

    borders: tuple[int, ...]
    at_m: Station
    length_m: Length


class GhostConfig(StretchConfig, frozen=True, kw_only=True):
    """`[[road.ghost]]`: an old line, removed but still to be seen, `offset_m` to the left of a border."""

    offset_m: Points = 0.0
    contrast: Points = 0.15
    wear: Points = 0.3


class ConstructionConfig(StretchConfig, frozen=True, kw_only=True):
    """`[[road.construction]]`: a yellow line that overrides white ones from `from_m` to `to_m`.

    It lies `offset_m` to the left of a border; `overrides` are the borders whose own paint does not
    count there (without it: that border).
    """

    offset_m: Points = 0.0
    overrides: tuple[int, ...] | None = None
    colour: ColourName = "yellow"


class LaneConfig(Config, frozen=True, kw_only=True):
    """A lane; `paint` is that of its outer border.

    Without `paint` a driving lane is dashed towards another one beside it, else solid; others have none.
    It is there from `from_m` to `to_m` (absent: the road's ends), where it opens and closes over
    `taper_m`: widening, or merging.
    """

    width_m: Width | list[tuple[float, Width]] = 3.5
    kind: LaneKind = "driving"
    paint: PaintConfig | None = None
    from_m: Station | None = None
    to_m: Station | None = None
    taper_m: Annotated[float, Meta(ge=0.0, le=1e4)] = 60.0


class GradeConfig(Config, frozen=True, kw_only=True):
    r"""`[[road.elevation]]`: a corner of the line of tangents, rounded by a parabola of `radius_m`.

    z   ______ corner
      /   ....  \        radius 0: no rounding. The first and the last corner have none; beyond
     / ../    \.. \       them the outermost tangent goes on.
    """

    at_m: Station
    z_m: Annotated[float, Meta(ge=-9000.0, le=9000.0)]
    radius_m: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.0


class RoughConfig(Config, frozen=True, kw_only=True):
    """`[[road.rough]]`: an uneven stretch of a class of ISO 8608, the same for the same seed."""

    from_m: Station
    to_m: Station
    grade: Literal["A", "B", "C", "D", "E", "F", "G", "H"]
    seed: Annotated[int, Meta(ge=0, le=2**32 - 1)] = 1


class CrosswalkConfig(Config, frozen=True, kw_only=True):
    """`[[road.crosswalk]]`: stripes along the road, across all lanes that are driven on."""

    at_m: Station
    length_m: Annotated[float, Meta(gt=0.0, le=50.0)] = 4.0
    stripe_m: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.5
    gap_m: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.5
    colour: ColourName = "white"
    contrast: Share = 1.0
    wear: Share = 0.0


class StopLineConfig(Config, frozen=True, kw_only=True):
    """`[[road.stop_line]]`: a bar across the driving lanes of one side, or both."""

    at_m: Station
    width_m: Annotated[float, Meta(gt=0.0, le=5.0)] = 0.5
    side: Literal["left", "right", "both"] = "right"
    colour: ColourName = "white"
    contrast: Share = 1.0
    wear: Share = 0.0


class LinkConfig(Config, frozen=True, kw_only=True):
    """What a road's start or end is joined to: another road of the file, by its name.

    This road's line lies `shift_m` to the left of the other's there. `lanes` pairs lanes [other, this];
    without it those of one kind that meet are joined.
    """

    road: str
    shift_m: Annotated[float, Meta(ge=-100.0, le=100.0)] = 0.0
    lanes: tuple[tuple[int, int], ...] | None = None


class RoadConfig(Config, frozen=True, kw_only=True):
    """One road: pieces of its line in order, lanes, heights, and what is painted on or wrong with it.

    It starts at `x_m`, `y_m`, heading `heading_deg`; or where the road `after` ends; or so that it ends
    where the road `before` starts.
    """

    line: Annotated[tuple[Piece, ...], Meta(min_length=1)]
    name: str = ""
    after: LinkConfig | None = None
    before: LinkConfig | None = None
    closed: bool = False
    x_m: Annotated[float, Meta(ge=-1e6, le=1e6)] = 0.0
    y_m: Annotated[float, Meta(ge=-1e6, le=1e6)] = 0.0
    heading_deg: Annotated[float, Meta(ge=-360.0, le=360.0)] = 0.0
    traffic: Literal["right", "left"] = "right"
    type: Literal["motorway", "rural", "town"] = "rural"
    left: tuple[LaneConfig, ...] = ()
    right: tuple[LaneConfig, ...] = (LaneConfig(),)
    centre: PaintConfig | None = None
    offset_m: Points = 0.0
    elevation: tuple[GradeConfig, ...] = ()
    superelevation_percent: Points = 0.0
    paint: tuple[StretchConfig, ...] = ()
    gap: tuple[GapConfig, ...] = ()
    ghost: tuple[GhostConfig, ...] = ()
    construction: tuple[ConstructionConfig, ...] = ()
    crosswalk: tuple[CrosswalkConfig, ...] = ()
    stop_line: tuple[StopLineConfig, ...] = ()
    bump: tuple[BumpConfig, ...] = ()
    rough: tuple[RoughConfig, ...] = ()


class RoadFile(Config, frozen=True, kw_only=True):
    """A road file as data; `vsensor.world.road` writes, checks, and loads it."""

    road: Annotated[tuple[RoadConfig, ...], Meta(min_length=1)]
    name: str = ""

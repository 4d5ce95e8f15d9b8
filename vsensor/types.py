"""The data between stages: frozen values, arrays float64 and read-only, shapes in the docstrings.

Snapshot -> Observation -> Detections -> LaneEstimate -> SignalValues -> Frame
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from enum import IntEnum
from typing import Any, Protocol

import msgspec
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
IntArray = NDArray[np.int64]
CodeArray = NDArray[np.uint8]
BoolArray = NDArray[np.bool_]
ComplexArray = NDArray[np.complex128]

NANOSECONDS_PER_SECOND = 1_000_000_000
FOG_M = 1000.0
"""Below this meteorological visibility it is called fog."""


class MarkingKind(IntEnum):
    """What a marking looks like; numbers are those of the native DBC."""

    NONE = 0
    SOLID = 1
    DASHED = 2
    DOUBLE_SOLID = 3
    DOUBLE_DASHED = 4
    SOLID_DASHED = 5  # left stripe solid, right stripe dashed, seen along the driving direction
    DASHED_SOLID = 6
    BOTTS_DOTS = 7
    ROAD_EDGE = 8
    CURB = 9
    UNKNOWN = 15


class Colour(IntEnum):
    """Paint colour; numbers are those of the native DBC."""

    UNKNOWN = 0
    WHITE = 1
    YELLOW = 2
    BLUE = 3
    RED = 4
    GREEN = 5
    ORANGE = 6


class Stripe(IntEnum):
    """Which stripe of a border a marking is: the left or right one of a double, or the only one."""

    SINGLE = 0
    LEFT = 1
    RIGHT = 2


class Side(IntEnum):
    """The line's place as seen from the vehicle; numbers are those of the trace."""

    LEFT = 0
    RIGHT = 1
    NEXT_LEFT = 2
    NEXT_RIGHT = 3


SIDE_NAMES: Mapping[Side, str] = {
    Side.LEFT: "left",
    Side.RIGHT: "right",
    Side.NEXT_LEFT: "next_left",
    Side.NEXT_RIGHT: "next_right",
}
"""The word for a line in quantities, profiles, traces and tables."""


class Unseen(IntEnum):
    """Why a point of a line was not seen; numbers are those of the trace, SEEN is 0."""

    SEEN = 0
    NO_LINE = 1  # no marking on this side within reach
    NO_PAINT = 2  # gap of a dashed line, or a border without paint
    BEHIND_CAMERA = 3
    OUTSIDE_IMAGE = 4
    OCCLUDED = 5
    BEYOND_RANGE = 6  # beyond the operating range at this speed
    TOO_FEW_POINTS = 7
    LOST = 8  # dropped by the error model or a fault
    BEYOND_SIGHT = 9  # deeper than the camera sees, or where its inverse finds no road
    TOO_NARROW = 10  # paint of too few pixels across
    TOO_FAINT = 11  # paint too little lighter than the road: light, rain, fog, wear


class Light(IntEnum):
    """Ambient light; numbers are those of the native DBC."""

    DAY = 0
    DUSK = 1
    NIGHT = 2


class Beam(IntEnum):
    """The own headlights."""

    OFF = 0
    LOW = 1
    HIGH = 2


class SensorMode(IntEnum):
    """State of the sensor; numbers are those of the native DBC."""

    INIT = 0
    CALIBRATING = 1
    AVAILABLE = 2
    DEGRADED = 3
    BLOCKED = 4
    FAILED = 5

    @property
    def reports_lines(self) -> bool:
        """Whether lines are reported in this state; otherwise all are not available."""
        return self in (SensorMode.AVAILABLE, SensorMode.DEGRADED)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tick:
    """One step of the clock: `index` counts from 0, `t_ns` = start + index * period_ns, exactly."""

    index: int
    t_ns: int
    period_ns: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Swell:
    """An unevenness of the road between two places along a way: a sum of waves, level road outside.

    The height is the real part of the sum of `amplitude_m` (J,) complex times
    exp(1j `wave_radpm` (J,) (s - from_m)).
    """

    from_m: float
    to_m: float
    wave_radpm: Array
    amplitude_m: ComplexArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Unevenness:
    """What lies under the wheels: the swells near, and where along their way the rear axle is.

    The way is that of the drive and goes on over joints of roads; both wheels of an axle stand equally high.
    """

    rear_axle_m: float
    swells: tuple[Swell, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class EgoState:
    """The vehicle: origin on the road below the centre of the rear axle.

    `position_world_m` (3,). `roll_rad`, `pitch_rad`, `yaw_rad` are those of the road-level ego frame
    (plane of the road, heading of the vehicle; R_world_from_ego = Rz(yaw) Ry(pitch) Rx(roll), nose
    down positive). The body moves on its springs relative to it: `body_roll_rad`, `body_pitch_rad`,
    `body_heave_m`. `yaw_rate_radps` is positive to the left. A state that is not known holds NaN.
    The position is that on the even road; `uneven` is what the springs' feet are lifted by, None: even.
    """

    t_ns: int
    position_world_m: Array
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    speed_mps: float
    yaw_rate_radps: float = 0.0
    acceleration_mps2: float = 0.0
    lateral_acceleration_mps2: float = 0.0
    body_roll_rad: float = 0.0
    body_pitch_rad: float = 0.0
    body_heave_m: float = 0.0
    uneven: Unevenness | None = None


class Curve(Protocol):
    """The exact curves that the points of markings lie on, at places between them too."""

    def series(self, ids: IntArray, stations: Array) -> Array:
        """Return p, p', p''/2, p'''/6 (4, 3, N) of the world points p of markings `ids` (N,) at stations.

        `stations` (N,) count the points of a marking, with fractions; the derivatives are over a parameter
        that runs along the driving direction. NaN where no curve is known.
        """
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Marking:
    """One painted stripe as a chain of points along the driving direction, across roads and kinds.

    `points_world_m` (N, 3) centre of the stripe, dense (0.1 m by default) and continuous, paint or
    not; `painted` (N,) bool is False in the gaps of a dashed line and on a border without paint;
    `kind` (N,) MarkingKind of the whole border (a double's stripes both say DOUBLE_SOLID); `colour`
    (N,) Colour; `width_m` (N,) of the stripe. `contrast` 0..1 of the paint that is left, `wear` 0..1 the
    part that is gone, in patches; `valid`: whether it bounds a lane, False for what was removed or is
    overridden; each a value or (N,). Stripes of one border share `group`; `stripe` says which one this is.
    `id` is stable for the whole run. `curve` is what the points lie on, the first of them at its `station`;
    None where nothing but the points is known.
    """

    id: int
    group: int
    stripe: Stripe
    points_world_m: Array
    painted: BoolArray
    kind: CodeArray
    colour: CodeArray
    width_m: Array
    contrast: Array | float = 1.0
    wear: Array | float = 0.0
    valid: BoolArray | bool = True
    curve: Curve | None = None
    station: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GroundPaint:
    """Paint on the road that is no line: a polygon `points_world_m` (N, 3), filled."""

    points_world_m: Array
    colour: Colour
    contrast: float = 1.0
    wear: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Mesh:
    """A shape of triangles: `vertices_m` (V, 3), `faces` (F, 3) places in them, either winding.

    In the frame of the obstacle that wears it, origin at its box's centre. `raycast.mesh_of` checks
    one; what is compiled of it is found again by identity, so share one Mesh among its likes.
    """

    vertices_m: Array
    faces: IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Obstacle:
    """A solid that hides what lies behind it, never the ego vehicle itself: a box, or the mesh in it.

    `centre_world_m` (3,) of the box, `size_m` (length, width, height), angles as for EgoState. One
    that is not moving stays the same object from tick to tick.
    """

    id: int
    centre_world_m: Array
    size_m: tuple[float, float, float]
    roll_rad: float = 0.0
    pitch_rad: float = 0.0
    yaw_rad: float = 0.0
    mesh: Mesh | None = None
    is_moving: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class RoadSurface:
    """The road itself where it may hide what lies behind a crest: cross-sections in driving order.

    `points_world_m` (M, L, 3): L points of section m from one side of the road to the other, straight
    between them; NaN where the road is narrower.
    """

    points_world_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Environment:
    """Light and weather; `rain` from 0 (dry) to 1 (heaviest).

    `visibility_m` is the meteorological visibility in fog (5 % of a contrast is left there), inf without.
    `beam` is what the driver has switched on, None: what the law asks for, see `headlights`.
    """

    light: Light = Light.DAY
    rain: float = 0.0
    visibility_m: float = math.inf
    beam: Beam | None = None

    @property
    def headlights(self) -> Beam:
        """The own headlights; as long as nobody says otherwise low beams when it is not a clear day."""
        if self.beam is not None:
            return self.beam
        is_hindered = self.light is not Light.DAY or self.rain > 0.0 or self.visibility_m < FOG_M
        return Beam.LOW if is_hindered else Beam.OFF


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """The road near the pose: markings and obstacles, in world coordinates.

    `surface` is None where the road is too flat to hide anything of itself. `ground` is seen in images alone.
    """

    markings: tuple[Marking, ...]
    obstacles: tuple[Obstacle, ...] = ()
    environment: Environment = Environment()
    surface: RoadSurface | None = None
    ground: tuple[GroundPaint, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """The truth at one tick; `stale` names the inputs that the sensor lacks: missing, or too old."""

    t_ns: int
    ego: EgoState
    scene: Scene
    stale: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class LinePoints:
    """Points of several lines in flat arrays, so that a stage handles all lines in one numpy call.

    Line k owns the points `starts[k]:starts[k + 1]`, ordered along the driving direction with x
    strictly increasing. `marking` (K,) is each line's place in `scene.markings`; `starts` (K + 1,);
    `index` (N,) is each point's place in its marking's arrays (so truth can be looked up);
    `points_ego_m` (N, 3) in the road-level ego frame.
    """

    marking: IntArray
    starts: IntArray
    index: IntArray
    points_ego_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How far a sensor reports at a speed: its operating range, and the points that it uses.

    Points up to `points_m`, at or beyond `range_m`, count, but not those with x inside an interval of
    `blind_m` (B, 2).
    """

    range_m: float
    points_m: float
    blind_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """What the optics let the sensor see.

    `lines` are the points as the camera reconstructs them (after pixel grid and inverse projection);
    every line of `candidates` is there, with 0 points if nothing of it was seen. `sigma_y_m` (N,) is
    each point's lateral standard deviation from the pixel grid (0 without one). `candidates` are the
    points that were tried, exact, paint or not, and `reason` (len(candidates),) says for each why it
    was not seen (Unseen; 0 = seen). `kind`, `colour` (K,) and `width_m` (K,) are each line's nearest
    seen paint.
    """

    lines: LinePoints
    sigma_y_m: Array
    kind: CodeArray
    colour: CodeArray
    width_m: Array
    candidates: LinePoints
    reason: CodeArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Detections:
    """What the real sensor would report as line points: operating range and errors applied.

    `exposed_at_ns` carries the latency. `lines`, `sigma_y_m`, `kind`, `colour`, `width_m` as in
    Observation, fewer points. `operating_range_m` is the range limit of the points at this speed.
    """

    exposed_at_ns: int
    lines: LinePoints
    sigma_y_m: Array
    kind: CodeArray
    colour: CodeArray
    width_m: Array
    operating_range_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Fit:
    """A polynomial through the points of one line: `y(x) = c0 + c1 x + ...`, ego frame, road level.

    `coefficients` (order + 1,) ascending; `covariance` (order + 1, order + 1) of them, NaN where no
    degree of freedom was left to estimate it; `x_min_m`, `x_max_m` the extent of the points;
    `residual_std_m` of the points about the polynomial; `points` their number.
    """

    coefficients: Array
    covariance: Array
    x_min_m: float
    x_max_m: float
    residual_std_m: float
    points: int

    def y_at(self, x_m: float) -> float:
        """Return y in metres at x."""
        y = 0.0
        for coefficient in reversed(self.coefficients.tolist()):
            y = y * x_m + coefficient
        return y

    def std_at(self, x_m: float) -> float:
        """Return the standard deviation of y at x in metres, NaN if the covariance is not known."""
        variance = 0.0
        for row in reversed(self.covariance.tolist()):
            inner = 0.0
            for entry in reversed(row):
                inner = inner * x_m + entry
            variance = variance * x_m + inner
        return math.sqrt(max(variance, 0.0)) if variance == variance else math.nan


@dataclass(frozen=True, slots=True, kw_only=True)
class Sighting:
    """One line as this image shows it, before it is known which it is.

    `quality` 1..4; `kind`, `colour`, `width_m` of its nearest paint; `marking` is its place in
    `scene.markings`, `marking_id` that marking's id; both -1 if it belongs to none.
    """

    fit: Fit
    quality: int
    kind: MarkingKind
    colour: Colour
    width_m: float
    marking: int
    marking_id: int = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Boundary:
    """One line as reported: `y(x) = c0 + c1 x + ...` on [x_min_m, x_max_m], left positive, road level.

    `coefficients` (order + 1,) ascending; `covariance` (order + 1, order + 1) of them; `quality` 0..4;
    `marking` is its place in `scene.markings`, -1 if it belongs to none (a ghost); `points` is its
    place among the lines of the Detections it was fitted to, -1 if `measured` is False: the line is
    not seen in this image, but predicted from what was seen of it before.
    """

    side: Side
    coefficients: Array
    covariance: Array
    x_min_m: float
    x_max_m: float
    quality: int
    kind: MarkingKind
    colour: Colour
    width_m: float
    measured: bool
    marking: int
    points: int


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneEstimate:
    """The lines of one image, measured and predicted; a side that is missing has neither.

    `lost`: sides whose line was there until the error model or a fault dropped it.
    """

    exposed_at_ns: int
    image_index: int
    boundaries: tuple[Boundary, ...]
    lane_change: int = 0  # 1 = to the left, -1 = to the right, in this image
    degraded: bool = False  # an input (ego motion) is missing or stale
    lost: tuple[Side, ...] = ()

    def on(self, side: Side) -> Boundary | None:
        """Return the boundary on `side`, None if none is reported."""
        return next((line for line in self.boundaries if line.side is side), None)


SignalValues = Mapping[str, float]
"""Quantity -> physical value in SI and model signs, NaN = not available. `signals.QUANTITIES` lists them."""


class Frame(msgspec.Struct, frozen=True, kw_only=True, gc=False):
    """A CAN frame and the time it is due; hashable. `due_ns` of a received frame is its receive time.

    `data` of a remote frame is as many zero bytes as it asks for. A struct, for it is built ten times as fast
    as a frozen dataclass of ten fields (0.2 us instead of 2), and thousands are in a second; changed with
    `msgspec.structs.replace`.
    """

    due_ns: int
    arbitration_id: int
    data: bytes
    is_extended: bool = False
    is_fd: bool = False
    bitrate_switch: bool = False
    channel: int = 0
    error_state_indicator: bool = False
    is_remote: bool = False
    is_error: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Output:
    """Everything of one tick, so that a sink can score what was sent against the truth.

    `camera_ego` is the vehicle as the camera stood on it, its body in motion; None: that of `snapshot`.
    """

    tick: Tick
    snapshot: Snapshot
    observation: Observation
    detections: Detections
    estimate: LaneEstimate
    values: SignalValues
    frames: tuple[Frame, ...]
    lateness_ns: int = 0
    stage_ns: Mapping[str, int] = field(default_factory=dict[str, int])
    camera_ego: EgoState | None = None

    @property
    def seen(self) -> Snapshot:
        """The truth as the camera stood in it; `snapshot` itself where the body stands still."""
        return self.snapshot if self.camera_ego is None else replace(self.snapshot, ego=self.camera_ego)


def frozen(values: Any, dtype: Any = np.float64) -> NDArray[Any]:
    """Return `values` as a contiguous read-only array."""
    array = np.ascontiguousarray(values, dtype=dtype)
    if array.flags.writeable:
        array = array.copy() if array is values else array
        array.flags.writeable = False
    return array

"""Positions and actions of an OpenSCENARIO file as data, in the words and units of `model`."""

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Orientation:
    """Heading: absolute in the world, or relative to what the position refers to."""

    relative: bool
    heading_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Position:
    """A place. `kind` says which of the numbers count.

    world: x, y, z. road: road, s, t. lane: road, lane, s, offset (in t). relative_world, relative_object:
    x, y, z from `ref`. relative_road: s, t from `ref`. relative_lane: lanes, s, offset (in t) from `ref`.
    route: `s` along the route's waypoints, lane and offset (in t).
    """

    kind: str
    where: str
    ref: int = -1
    road: str = ""
    lane: int | None = None
    s_m: float = 0.0
    t_m: float = 0.0
    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float | None = None
    waypoints: tuple["Position", ...] = ()
    orientation: Orientation | None = None


@dataclass(frozen=True, slots=True)
class Dynamics:
    """How a value gets to its target: step, linear, cubic, sinusoidal; in a time, distance or at a rate."""

    shape: str
    dimension: str
    value: float


@dataclass(frozen=True, slots=True, kw_only=True)
class SpeedAction:
    """A speed: absolute (`ref` -1), or `ref`'s times `factor` plus `value`; `continuous` keeps to it."""

    dynamics: Dynamics
    value: float
    ref: int = -1
    factor: float = 1.0
    continuous: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class GapAction:
    """A gap to keep to `ref`: metres, or seconds of the own speed."""

    ref: int
    metres: float | None
    seconds: float | None
    freespace: bool
    continuous: bool
    max_acceleration_mps2: float | None
    max_deceleration_mps2: float | None
    max_speed_mps: float | None
    trails: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneChange:
    """A lane: its id, or so many to the left of `ref`'s; ends `offset_m` (in t) beside its middle."""

    dynamics: Dynamics
    lane: int
    ref: int = -1
    offset_m: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LaneOffset:
    """An offset (in t) from the lane's middle, or from `ref`'s offset, by shape and lateral acceleration."""

    shape: str
    value_m: float
    ref: int = -1
    max_acceleration_mps2: float | None = None
    continuous: bool = False


@dataclass(frozen=True, slots=True)
class Vertex:
    """A point of a polyline and its time."""

    position: Position
    time_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Trajectory:
    """A path: vertices, or a clothoid from `start`; `timed` if the vertices' times count.

    `time_offset_s` is added to scaled times; `absolute` times are those of the simulation.
    """

    name: str
    vertices: tuple[Vertex, ...] = ()
    start: Position | None = None
    curvature_per_m: float = 0.0
    curvature_rate_per_m2: float = 0.0
    length_m: float = 0.0
    timed: bool = False
    absolute: bool = False
    time_scale: float = 1.0
    time_offset_s: float = 0.0


@dataclass(frozen=True, slots=True)
class RouteAction:
    """The roads to come by."""

    waypoints: tuple[Position, ...]


@dataclass(frozen=True, slots=True)
class Teleport:
    """A place to be at from now on."""

    position: Position


@dataclass(frozen=True, slots=True)
class ParameterAction:
    """A parameter's or variable's new value: set, add or multiply."""

    name: str
    how: str
    value: str


@dataclass(frozen=True, slots=True)
class NoAction:
    """What changes nothing here, or is not played: said as a finding when the file is read."""

    tag: str
    moves: bool
    where: str


Action = (
    SpeedAction
    | GapAction
    | LaneChange
    | LaneOffset
    | Trajectory
    | RouteAction
    | Teleport
    | ParameterAction
    | NoAction
)

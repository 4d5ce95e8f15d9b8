"""An OpenSCENARIO file as data: entities, positions, actions, triggers, the tree of the storyboard.

Entities, elements and conditions are named by their place in the scenario's tuples. SI units; lateral
offsets are along the road's t axis, to the left of rising s, as the standard has it.
"""

from dataclasses import dataclass, field
from enum import IntEnum

Rule = str
"""greaterThan, lessThan, equalTo, greaterOrEqual, lessOrEqual, notEqualTo."""


@dataclass(frozen=True, slots=True)
class Box:
    """A bounding box: its centre from the entity's origin, and length, width, height."""

    centre_m: tuple[float, float, float]
    size_m: tuple[float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Entity:
    """What moves or stands: the origin is on the road, of a vehicle below its rear axle.

    `trailer` is the entity that it draws; `hitch_m` where, `coupler_m` how far ahead of a trailer's own
    axle it is drawn.
    """

    name: str
    kind: str
    category: str
    box: Box
    wheelbase_m: float = 0.0
    max_speed_mps: float = float("inf")
    max_acceleration_mps2: float = 10.0
    max_deceleration_mps2: float = 10.0
    hitch_m: float | None = None
    coupler_m: float | None = None
    trailer: int | None = None
    drawn_by: int | None = None


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A condition; `kind` says which of the numbers count. `entities` are the triggering ones, `any_of` them.

    `frame`: road, lane, entity or trajectory; `measure`: longitudinal, lateral or euclidian.
    """

    kind: str
    name: str
    delay_ns: int = 0
    edge: str = "none"
    entities: tuple[int, ...] = ()
    any_of: bool = True
    rule: Rule = "greaterThan"
    value: float = 0.0
    text: str = ""
    ref: int = -1
    position: Position | None = None
    freespace: bool = False
    frame: str = "entity"
    measure: str = "euclidian"
    elements: tuple[int, ...] = ()
    state: str = ""


@dataclass(frozen=True, slots=True)
class Trigger:
    """Groups of conditions: any group of which all are true. `groups` hold places in the conditions."""

    groups: tuple[tuple[int, ...], ...]


class Level(IntEnum):
    """What an element of the storyboard is."""

    STORY = 0
    ACT = 1
    GROUP = 2
    MANEUVER = 3
    EVENT = 4
    ACTION = 5


LEVEL_NAMES = {
    "story": Level.STORY,
    "act": Level.ACT,
    "maneuverGroup": Level.GROUP,
    "sequence": Level.GROUP,
    "maneuver": Level.MANEUVER,
    "event": Level.EVENT,
    "action": Level.ACTION,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """An element of the storyboard. `start` None: at once; `stop` None: never."""

    level: Level
    name: str
    parent: int
    children: tuple[int, ...] = ()
    start: Trigger | None = None
    stop: Trigger | None = None
    most_runs: int = 1
    priority: str = "parallel"
    actors: tuple[int, ...] = ()
    actors_trigger: bool = False
    action: Action | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Story:
    """A scenario, read and checked. `init` are (entity, action), entity -1 for global ones."""

    path: str
    road_file: str
    entities: tuple[Entity, ...]
    init: tuple[tuple[int, Action], ...]
    nodes: tuple[Node, ...]
    conditions: tuple[Condition, ...]
    stop: Trigger | None
    parameters: dict[str, str] = field(default_factory=dict[str, str])
    findings: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

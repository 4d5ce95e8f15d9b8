"""An OpenSCENARIO file as data: entities, triggers, the storyboard's tree; `action_data` has the actions.

Entities, elements and conditions are named by their place in the scenario's tuples. SI units; lateral
offsets are along the road's t axis, to the left of rising s, as the standard has it.
"""

from dataclasses import dataclass, field
from enum import IntEnum
from pathlib import Path

from vsensor.world.openscenario.action_data import Action, Position

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
    """A scenario, read and checked. `init` are (entity, action), entity -1 for global ones.

    `catalogs` are the other files that were read.
    """

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
    catalogs: tuple[Path, ...] = ()

"""What a storyboard remembers: everything, so that it goes on from any step to the same bits."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum

from vsensor.world.openscenario.bodies import Body

STEP_NS = 10_000_000
"""The storyboard's own step: what happens does not depend on the sensor's cycle. A car at 130 km/h drives
0.36 m in it, so that no place with a tolerance of 0.2 m on is missed."""


class Phase(IntEnum):
    """Where an element of the storyboard is."""

    IDLE = 0
    STANDBY = 1
    RUNNING = 2
    COMPLETE = 3


@dataclass(frozen=True, slots=True)
class Memory:
    """What a condition remembers: its last value, the changes that a delay still has to bring, since when.

    `changes` are (t_ns, value after the edge); `since` is (entity, t_ns) of what lasts.
    """

    last: bool | None = None
    changes: tuple[tuple[int, bool], ...] = ()
    since: tuple[tuple[int, int], ...] = ()


@dataclass(frozen=True, slots=True)
class Running:
    """An action that goes on: `number` is its own, `node` its element (-1: of the start), its actor."""

    number: int
    node: int
    actor: int


@dataclass(frozen=True, slots=True)
class Happening:
    """Something that happened: when, and what, as a sentence."""

    t_ns: int
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class StoryState:
    """The storyboard after the step at `t_ns`; `marks` are (element, transition) of that step."""

    t_ns: int
    bodies: tuple[Body | None, ...]
    phases: tuple[Phase, ...]
    runs: tuple[int, ...]
    marks: frozenset[tuple[int, str]] = frozenset()
    running: tuple[Running, ...] = ()
    memories: tuple[Memory, ...] = ()
    parameters: Mapping[str, str] = field(default_factory=dict[str, str])
    next_number: int = 0
    ended_ns: int | None = None
    ended_by: str = ""
    happened: tuple[Happening, ...] = ()

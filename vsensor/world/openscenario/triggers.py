"""Conditions and triggers at one step: values, edges, delays."""

from collections.abc import Callable
from dataclasses import replace
from math import cos, inf, isfinite

from vsensor.world.openscenario.distances import distance_m
from vsensor.world.openscenario.model import Condition, Trigger
from vsensor.world.openscenario.state import Memory, Phase
from vsensor.world.openscenario.work import Work, boxes_apart_m

SAME = 1e-9
"""Numbers count as equal so near, relative to their size."""

STANDING_MPS = 1e-3


def compared(value: float, rule: str, other: float) -> bool:
    """Return whether a value keeps to a rule; what is not known (NaN) never does."""
    if value != value:
        return False
    same = abs(value - other) <= SAME * max(1.0, abs(other)) or value == other
    return {
        "greaterThan": value > other,
        "lessThan": value < other,
        "equalTo": same,
        "notEqualTo": not same,
        "greaterOrEqual": value >= other or same,
        "lessOrEqual": value <= other or same,
    }[rule]


def trigger_value(work: Work, trigger: Trigger | None) -> tuple[bool, tuple[int, ...]]:
    """Return whether a trigger fires at this step, and the entities that made it.

    All conditions are looked at, so that each remembers its edge.
    """
    fired, who = False, tuple[int, ...]()
    for group in trigger.groups if trigger else ():
        results = [_condition(work, place) for place in group]
        if all(hit for hit, _ in results):
            fired = True
            who += tuple(entity for _, found in results for entity in found if entity not in who)
    return fired, who


def _condition(work: Work, place: int) -> tuple[bool, tuple[int, ...]]:
    """Return a condition's value after edge and delay; its memory goes on at the end of the step."""
    condition = work.story.conditions[place]
    raw, who = _raw(work, condition, place)
    memory = work.remembered(place)
    edged = _edge(condition.edge, memory.last, raw)
    changes = memory.changes
    if not changes or changes[-1][1] != edged:
        changes = (*changes, (work.t_ns, edged))
    seen = work.t_ns - condition.delay_ns
    known = [value for t_ns, value in changes if t_ns <= seen]
    while len(changes) > 1 and changes[1][0] <= seen:
        changes = changes[1:]
    work.memories[place] = Memory(raw, changes, work.memories[place].since)
    return bool(known and known[-1]), who


def _edge(edge: str, last: bool | None, now: bool) -> bool:
    """Return whether the edge is there; at the first look there is none."""
    if edge == "none":
        return now
    if last is None:
        return False
    rising, falling = now and not last, last and not now
    return {"rising": rising, "falling": falling, "risingOrFalling": rising or falling}[edge]


def _raw(work: Work, condition: Condition, place: int) -> tuple[bool, tuple[int, ...]]:
    if not condition.entities:
        return _BY_VALUE[condition.kind](work, condition), ()
    hits = tuple(entity for entity in condition.entities if _entity_value(work, condition, place, entity))
    if condition.any_of:
        return bool(hits), hits
    return len(hits) == len(condition.entities), hits


def _time(work: Work, condition: Condition) -> bool:
    return compared(work.t_ns / 1e9, condition.rule, condition.value)


def _parameter(work: Work, condition: Condition) -> bool:
    value = work.parameters.get(condition.state, "")
    try:
        return compared(float(value), condition.rule, float(condition.text))
    except ValueError:
        same = value.strip() == condition.text.strip()
        return same if condition.rule == "equalTo" else condition.rule == "notEqualTo" and not same


def _element(work: Work, condition: Condition) -> bool:
    phases = {"standbyState": Phase.STANDBY, "runningState": Phase.RUNNING, "completeState": Phase.COMPLETE}
    if condition.state in phases:
        return any(work.phases[k] is phases[condition.state] for k in condition.elements)
    return any((k, condition.state) in work.marks for k in condition.elements)


_BY_VALUE: dict[str, Callable[[Work, Condition], bool]] = {
    "time": _time,
    "parameter": _parameter,
    "element": _element,
    "never": lambda work, condition: False,
}


def _entity_value(work: Work, condition: Condition, place: int, entity: int) -> bool:
    if condition.kind == "never" or work.motion(entity) is None:
        return False
    if condition.kind in _LASTING:
        return _lasted(work, condition, place, entity, _LASTING[condition.kind](work, entity))
    return _BY_ENTITY[condition.kind](work, condition, entity)


def _lasted(work: Work, condition: Condition, place: int, entity: int, is_so: bool) -> bool:
    """Return whether something has been so for the condition's time."""
    since = dict(work.remembered(place).since)
    if not is_so:
        since.pop(entity, None)
    else:
        since.setdefault(entity, work.t_ns)
    memory = work.memories[place]
    others = tuple((e, t) for e, t in memory.since if e != entity)
    mine = ((entity, since[entity]),) if is_so else ()
    work.memories[place] = replace(memory, since=(*others, *mine))
    return is_so and work.t_ns - since[entity] >= round(condition.value * 1e9)


def _stands(work: Work, entity: int) -> bool:
    motion = work.motion(entity)
    return motion is not None and motion.speed_mps < STANDING_MPS


def _off_road(work: Work, entity: int) -> bool:
    spot = work.spot(entity)
    return spot is not None and work.tracks.is_off_road(spot)


def _at_end(work: Work, entity: int) -> bool:
    body = work.body(entity)
    return body is not None and body.is_ended


_LASTING: dict[str, Callable[[Work, int], bool]] = {
    "standstill": _stands,
    "offroad": _off_road,
    "end_of_road": _at_end,
}


def _distance(work: Work, condition: Condition, entity: int) -> bool:
    return compared(abs(distance_m(work, condition, entity)), condition.rule, condition.value)


def _headway(work: Work, condition: Condition, entity: int) -> bool:
    """Time to where the other is now; there is none to one behind, and none for one who stands."""
    motion, gap = work.motion(entity), distance_m(work, condition, entity)
    if motion is None or not gap >= 0.0 or motion.speed_mps < STANDING_MPS:
        return False
    return compared(gap / motion.speed_mps, condition.rule, condition.value)


def _collision_time(work: Work, condition: Condition, entity: int) -> bool:
    """Time until the gap is closed at the present speeds; there is none while it is not closing."""
    motion, gap = work.motion(entity), distance_m(work, condition, entity)
    if motion is None or not gap >= 0.0:
        return False
    closing = motion.speed_mps - _speed_along(work, condition, entity)
    seconds = gap / closing if closing > STANDING_MPS else inf
    return isfinite(seconds) and compared(seconds, condition.rule, condition.value)


def _speed_along(work: Work, condition: Condition, entity: int) -> float:
    """Return the speed of what a condition refers to, along the heading of an entity."""
    if condition.position is not None:
        return 0.0
    motion, here, there = work.motion(condition.ref), work.pose(entity), work.pose(condition.ref)
    if motion is None or here is None or there is None:
        return 0.0
    return motion.speed_mps * cos(there[1] - here[1])


def _relative_speed(work: Work, condition: Condition, entity: int) -> bool:
    motion, other = work.motion(entity), work.motion(condition.ref)
    if motion is None or other is None:
        return False
    return compared(motion.speed_mps - other.speed_mps, condition.rule, condition.value)


def _own(name: str) -> Callable[[Work, Condition, int], bool]:
    def value(work: Work, condition: Condition, entity: int) -> bool:
        return compared(getattr(work.motion(entity), name), condition.rule, condition.value)

    return value


def _collision(work: Work, condition: Condition, entity: int) -> bool:
    if work.pose(condition.ref) is None:
        return False
    return boxes_apart_m(work.corners(entity), work.corners(condition.ref)) == 0.0


_BY_ENTITY: dict[str, Callable[[Work, Condition, int], bool]] = {
    "distance": _distance,
    "headway": _headway,
    "ttc": _collision_time,
    "relative_speed": _relative_speed,
    "speed": _own("speed_mps"),
    "acceleration": _own("acceleration_mps2"),
    "travelled": _own("driven_m"),
    "collision": _collision,
}

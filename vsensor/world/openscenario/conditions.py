"""Triggers and their conditions."""

from collections.abc import Callable
from typing import Any

from vsensor.world.opendrive.xml import Element, children
from vsensor.world.openscenario.entities import Cast
from vsensor.world.openscenario.model import Condition, Trigger
from vsensor.world.openscenario.positions import read_position
from vsensor.world.openscenario.reader import StoryReader

RULES = (
    *("greaterThan", "lessThan", "equalTo"),
    *("greaterOrEqual", "lessOrEqual", "notEqualTo"),
)
EDGES = ("none", "rising", "falling", "risingOrFalling")
LONGEST_DELAY_S = 1e6

Fields = dict[str, Any]


class Conditions:
    """Reads triggers; `elements` finds the storyboard's elements by type and name once all are known."""

    def __init__(self, reader: StoryReader, cast: Cast) -> None:
        self._reader = reader
        self._cast = cast
        self.all: list[Condition] = []
        self.asked: list[tuple[int, Element]] = []

    def trigger(self, element: Element | None) -> Trigger | None:
        """Return a trigger; None for one that is not there or has no groups."""
        groups = [tuple(self._group(group)) for group in children(element, "ConditionGroup")]
        return Trigger(tuple(groups)) if groups else None

    def _group(self, group: Element) -> list[int]:
        places = []
        for element in children(group, "Condition"):
            places.append(len(self.all))
            self.all.append(self._condition(element))
        if not places:
            raise self._reader.error(group, "<Condition> is missing")
        return places

    def _condition(self, element: Element) -> Condition:
        reader = self._reader
        delay_s = reader.at_least(element, "delay", 0.0, 0.0)
        if delay_s > LONGEST_DELAY_S:
            raise reader.error(element, f'delay="{delay_s:g}": at most {LONGEST_DELAY_S:g} s were expected')
        common: Fields = {
            "name": " ".join((element.get("name") or "").split()),
            "delay_ns": round(delay_s * 1e9),
            "edge": reader.choice(element, "conditionEdge", EDGES),
        }
        inner = reader.child(element, "ByValueCondition", "ByEntityCondition")
        if inner.tag == "ByValueCondition":
            return Condition(**common, **self._by_value(reader.only(inner)))
        return Condition(**common, **self._by_entity(inner))

    def _by_value(self, element: Element) -> Fields:
        reader = self._reader
        if element.tag == "SimulationTimeCondition":
            return {"kind": "time", **self._compared(element)}
        if element.tag in ("ParameterCondition", "VariableCondition"):
            attribute = "parameterRef" if element.tag == "ParameterCondition" else "variableRef"
            name = reader.text(element, attribute).lstrip("$")
            if name not in reader.parameters:
                known = ", ".join(reader.parameters) or "none"
                raise reader.error(element, f'{attribute}="{name}": no such parameter; there are: {known}')
            rule = reader.choice(element, "rule", RULES)
            return {"kind": "parameter", "state": name, "text": element.get("value") or "", "rule": rule}
        if element.tag == "StoryboardElementStateCondition":
            self.asked.append((len(self.all), element))
            return {"kind": "element", "state": reader.text(element, "state")}
        reader.warn(element, "conditions of this kind are not played: it is never true")
        return {"kind": "never", "text": element.tag}

    def _by_entity(self, element: Element) -> Fields:
        reader = self._reader
        triggering = reader.child(element, "TriggeringEntities")
        rule = reader.choice(triggering, "triggeringEntitiesRule", ("any", "all"))
        entities = tuple(self._cast.of(reader, one) for one in children(triggering, "EntityRef"))
        if not entities:
            raise reader.error(triggering, "<EntityRef> is missing")
        inner = reader.only(reader.child(element, "EntityCondition"))
        read = _READERS.get(inner.tag)
        fields: Fields = {"entities": entities, "any_of": rule == "any"}
        if read is None:
            reader.warn(inner, "conditions of this kind are not played: it is never true")
            return {"kind": "never", "text": inner.tag, **fields}
        return {**fields, **read(self, inner)}

    def _compared(self, element: Element) -> Fields:
        reader = self._reader
        return {"rule": reader.choice(element, "rule", RULES), "value": reader.number(element, "value")}

    def _measure(self, element: Element) -> Fields:
        """Return how a distance is measured; alongRoute is how version 1.0 says it."""
        reader = self._reader
        raw = {
            "cartesianDistance": "euclidian",
            "euclidianDistance": "euclidian",
            "euclideanDistance": "euclidian",
            "longitudinal": "longitudinal",
            "lateral": "lateral",
        }
        name = "relativeDistanceType"
        measure = reader.choice(element, name, ("euclidianDistance", *raw))
        frame = reader.choice(element, "coordinateSystem", ("entity", "road", "lane", "trajectory", "world"))
        if element.get("alongRoute") is not None and element.get("coordinateSystem") is None:
            along = reader.boolean(element, "alongRoute", default=False)
            frame = "road" if along else "entity"
            measure = "longitudinal" if along and element.get(name) is None else measure
        if frame in ("trajectory", "world"):
            reader.warn(element, f'coordinateSystem="{frame}": it is measured along the road')
            frame = "road"
        freespace = reader.boolean(element, "freespace", default=False)
        return {"frame": frame, "measure": raw[measure], "freespace": freespace}

    def _headway(self, element: Element) -> Fields:
        return {
            "kind": "headway",
            "ref": self._cast.of(self._reader, element),
            **self._compared(element),
            **self._measure(element),
        }

    def _collision_time(self, element: Element) -> Fields:
        target = self._reader.only(self._reader.child(element, "TimeToCollisionConditionTarget"))
        fields = {"kind": "ttc", **self._compared(element), **self._measure(element)}
        if target.tag == "Position":
            return {**fields, "position": read_position(self._reader, self._cast, target)}
        return {**fields, "ref": self._cast.of(self._reader, target)}

    def _relative_distance(self, element: Element) -> Fields:
        fields = {"ref": self._cast.of(self._reader, element), **self._compared(element)}
        return {"kind": "distance", **fields, **self._measure(element)}

    def _distance(self, element: Element) -> Fields:
        position = read_position(self._reader, self._cast, self._reader.child(element, "Position"))
        fields = {"position": position, **self._compared(element), **self._measure(element)}
        return {"kind": "distance", **fields}

    def _reach(self, element: Element) -> Fields:
        position = read_position(self._reader, self._cast, self._reader.child(element, "Position"))
        tolerance = self._reader.at_least(element, "tolerance", 0.0)
        return {"kind": "distance", "position": position, "value": tolerance, "rule": "lessOrEqual"}

    def _relative_speed(self, element: Element) -> Fields:
        self._whole_speed(element)
        ref = self._cast.of(self._reader, element)
        return {"kind": "relative_speed", "ref": ref, **self._compared(element)}

    def _whole_speed(self, element: Element) -> None:
        if element.get("direction") not in (None, "longitudinal"):
            self._reader.warn(element, f'direction="{element.get("direction")}": the whole speed is taken')

    def _speed(self, element: Element) -> Fields:
        self._whole_speed(element)
        return {"kind": "speed", **self._compared(element)}

    def _acceleration(self, element: Element) -> Fields:
        self._whole_speed(element)
        return {"kind": "acceleration", **self._compared(element)}

    def _travelled(self, element: Element) -> Fields:
        value = self._reader.number(element, "value")
        return {"kind": "travelled", "rule": "greaterOrEqual", "value": value}

    def _lasting(self, kind: str) -> Callable[[Element], Fields]:
        return lambda element: {"kind": kind, "value": self._reader.at_least(element, "duration", 0.0)}

    def _collision(self, element: Element) -> Fields:
        target = next(children(element, "EntityRef"), None)
        if target is None:
            self._reader.warn(element, "collisions with kinds of objects are not played: it is never true")
            return {"kind": "never", "text": element.tag}
        return {"kind": "collision", "ref": self._cast.of(self._reader, target)}


_READERS: dict[str, Callable[[Conditions, Element], Fields]] = {
    "TimeHeadwayCondition": Conditions._headway,
    "TimeToCollisionCondition": Conditions._collision_time,
    "RelativeDistanceCondition": Conditions._relative_distance,
    "DistanceCondition": Conditions._distance,
    "ReachPositionCondition": Conditions._reach,
    "RelativeSpeedCondition": Conditions._relative_speed,
    "SpeedCondition": Conditions._speed,
    "AccelerationCondition": Conditions._acceleration,
    "TraveledDistanceCondition": Conditions._travelled,
    "StandStillCondition": lambda self, element: self._lasting("standstill")(element),
    "OffroadCondition": lambda self, element: self._lasting("offroad")(element),
    "EndOfRoadCondition": lambda self, element: self._lasting("end_of_road")(element),
    "CollisionCondition": Conditions._collision,
}

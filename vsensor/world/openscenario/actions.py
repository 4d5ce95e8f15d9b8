"""Actions: what a storyboard tells entities to do; what is not played is a finding with its line."""

from math import inf

from vsensor.world.opendrive.xml import Element
from vsensor.world.openscenario.action_data import (
    Action,
    Dynamics,
    GapAction,
    LaneChange,
    LaneOffset,
    NoAction,
    ParameterAction,
    RouteAction,
    SpeedAction,
    Teleport,
)
from vsensor.world.openscenario.entities import Cast
from vsensor.world.openscenario.positions import read_position, read_trajectory, read_waypoints
from vsensor.world.openscenario.reader import StoryReader

SHAPES = ("linear", "cubic", "sinusoidal", "step")
DIMENSIONS = ("time", "distance", "rate")
LARGEST_SPEED_MPS = 200.0

MOVING = (
    *("SynchronizeAction", "LateralDistanceAction", "SpeedProfileAction", "AcquirePositionAction"),
    *("FollowTrajectoryAction", "ConnectTrailerAction", "DisconnectTrailerAction"),
)
"""Actions that move somebody: one that is not played changes what a scenario means."""

NO_OPS = {
    "VisibilityAction": "everybody is seen",
    "ControllerAction": "vehicles follow their lane and the storyboard",
    "ActivateControllerAction": "vehicles follow their lane and the storyboard",
    "AppearanceAction": "lights and animations are not shown",
    "EnvironmentAction": "light and rain are those of [environment]",
    "InfrastructureAction": "traffic lights are not shown",
    "TrafficAction": "no traffic is made",
    "UserDefinedAction": "nobody here knows it",
    "EntityAction": "entities stay what they are",
}


def read_private(reader: StoryReader, cast: Cast, element: Element) -> list[Action]:
    """Return the actions of a <PrivateAction> (or of an <Action>); raises StoryError."""
    return [_private(reader, cast, one) for one in element.iterchildren("*")]


def _private(reader: StoryReader, cast: Cast, element: Element) -> Action:
    if element.tag in ("LongitudinalAction", "LateralAction", "RoutingAction"):
        return _private(reader, cast, reader.only(element))
    read = _READERS.get(element.tag)
    return _no_action(reader, element) if read is None else read(reader, cast, element)


def _no_action(reader: StoryReader, element: Element) -> NoAction:
    said = NO_OPS.get(element.tag, "actions of this kind are not played")
    reader.warn(element, f"has no effect: {said}")
    moves = element.tag not in NO_OPS
    return NoAction(element.tag, moves, f"{reader.file_of(element)}:{element.sourceline}: <{element.tag}>")


def read_global(reader: StoryReader, cast: Cast, element: Element) -> Action:
    """Return the action of a <GlobalAction>."""
    inner = reader.only(element)
    if inner.tag not in ("ParameterAction", "VariableAction"):
        return _no_action(reader, inner)
    name = reader.text(inner, "parameterRef" if inner.tag == "ParameterAction" else "variableRef")
    how = reader.only(inner)
    if how.tag in ("SetAction", "ParameterSetAction", "VariableSetAction"):
        return ParameterAction(name.lstrip("$"), "set", how.get("value") or "")
    rule = reader.only(reader.child(how, "Rule"))
    if rule.tag not in ("AddValue", "MultiplyByValue"):
        raise reader.error(rule, "AddValue or MultiplyByValue was expected")
    verb = "add" if rule.tag == "AddValue" else "multiply"
    return ParameterAction(name.lstrip("$"), verb, repr(reader.number(rule, "value")))


def _dynamics(reader: StoryReader, element: Element) -> Dynamics:
    shape = reader.choice(element, "dynamicsShape", SHAPES)
    dimension = reader.choice(element, "dynamicsDimension", DIMENSIONS)
    value = reader.number(element, "value", 0.0 if shape == "step" else None)
    if value < 0.0 and dimension != "rate":
        raise reader.error(element, f'value="{value:g}": a {dimension} of at least 0 was expected')
    value = abs(value)  # of a rate: some files give one that brakes a sign
    if dimension == "rate" and shape != "step" and value == 0.0:
        raise reader.error(element, 'value="0": a rate other than 0 was expected')
    return Dynamics(shape, dimension, value)


def _speed(reader: StoryReader, cast: Cast, element: Element) -> Action:
    dynamics = _dynamics(reader, reader.child(element, "SpeedActionDynamics"))
    target = reader.only(reader.child(element, "SpeedActionTarget"))
    value = reader.number(target, "value")
    if abs(value) > LARGEST_SPEED_MPS:
        raise reader.error(target, f'value="{value:g}": at most {LARGEST_SPEED_MPS:g} m/s were expected')
    if target.tag == "AbsoluteTargetSpeed":
        if value < 0.0:
            raise reader.error(target, f'value="{value:g}": vehicles do not drive backwards here')
        return SpeedAction(dynamics=dynamics, value=value)
    is_factor = reader.choice(target, "speedTargetValueType", ("delta", "factor")) == "factor"
    return SpeedAction(
        dynamics=dynamics,
        value=0.0 if is_factor else value,
        factor=value if is_factor else 1.0,
        ref=cast.of(reader, target),
        continuous=reader.boolean(target, "continuous", default=False),
    )


def _gap(reader: StoryReader, cast: Cast, element: Element) -> Action:
    metres = _optional(reader, element, "distance")
    seconds = _optional(reader, element, "timeGap")
    if (metres is None) == (seconds is None):
        raise reader.error(element, "either distance or timeGap was expected")
    if element.get("coordinateSystem") not in (None, "entity", "road", "lane"):
        reader.warn(element, "the gap is measured along the road")
    limits = element.find("DynamicConstraints")
    where = reader.choice(
        element, "displacement", ("trailingReferencedEntity", "leadingReferencedEntity", "any")
    )
    return GapAction(
        ref=cast.of(reader, element),
        metres=metres,
        seconds=seconds,
        freespace=reader.boolean(element, "freespace", default=False),
        continuous=reader.boolean(element, "continuous", default=False),
        max_acceleration_mps2=_optional(reader, limits, "maxAcceleration"),
        max_deceleration_mps2=_optional(reader, limits, "maxDeceleration"),
        max_speed_mps=_optional(reader, limits, "maxSpeed"),
        trails=where != "leadingReferencedEntity",
    )


def _optional(reader: StoryReader, element: Element | None, name: str) -> float | None:
    if element is None or element.get(name) is None:
        return None
    if str(element.get(name)).strip().upper().lstrip("+") in ("INF", "INFINITY"):
        return inf
    return reader.at_least(element, name, 0.0)


def _lane_change(reader: StoryReader, cast: Cast, element: Element) -> Action:
    target = reader.only(reader.child(element, "LaneChangeTarget"))
    return LaneChange(
        dynamics=_dynamics(reader, reader.child(element, "LaneChangeActionDynamics")),
        lane=reader.integer(target, "value"),
        ref=cast.of(reader, target) if target.tag == "RelativeTargetLane" else -1,
        offset_m=reader.number(element, "targetLaneOffset", 0.0),
    )


def _lane_offset(reader: StoryReader, cast: Cast, element: Element) -> Action:
    dynamics = reader.child(element, "LaneOffsetActionDynamics")
    target = reader.only(reader.child(element, "LaneOffsetTarget"))
    relative = target.tag == "RelativeTargetLaneOffset"
    if relative and reader.boolean(element, "continuous", default=False):
        reader.warn(element, "the offset is that of the other's at the start: it is not followed on")
    limit = _optional(reader, dynamics, "maxLateralAcc")
    if limit == 0.0:
        raise reader.error(dynamics, 'maxLateralAcc="0": a number above 0 was expected')
    return LaneOffset(
        shape=reader.choice(dynamics, "dynamicsShape", SHAPES),
        value_m=reader.number(target, "value"),
        ref=cast.of(reader, target) if relative else -1,
        max_acceleration_mps2=limit,
        continuous=reader.boolean(element, "continuous", default=False),
    )


def _trajectory(reader: StoryReader, cast: Cast, element: Element) -> Action:
    if (
        next(element.iter("Polyline", "Clothoid"), None) is None
        and next(element.iter("Shape"), None) is not None
    ):
        return _no_action(reader, element)
    return read_trajectory(reader, cast, element)


def _route(reader: StoryReader, cast: Cast, element: Element) -> Action:
    return RouteAction(read_waypoints(reader, cast, reader.child(element, "Route")))


def _acquire(reader: StoryReader, cast: Cast, element: Element) -> Action:
    return RouteAction((read_position(reader, cast, reader.child(element, "Position")),))


def _teleport(reader: StoryReader, cast: Cast, element: Element) -> Action:
    return Teleport(read_position(reader, cast, reader.child(element, "Position")))


_READERS = {
    "SpeedAction": _speed,
    "LongitudinalDistanceAction": _gap,
    "LaneChangeAction": _lane_change,
    "LaneOffsetAction": _lane_offset,
    "FollowTrajectoryAction": _trajectory,
    "AssignRouteAction": _route,
    "AcquirePositionAction": _acquire,
    "TeleportAction": _teleport,
}

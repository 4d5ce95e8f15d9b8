"""Small OpenSCENARIO files for tests, written as text over small maps."""

from weakref import WeakKeyDictionary

from tests.maps import document, geometry, lane, road, section
from vsensor.sources.storyboard import StoryboardConfig, StoryDrive
from vsensor.types import Environment, Tick
from vsensor.world.openscenario import STEP_NS, motion_of

LANE_M = 3.5
TWO_EACH = section(left=[lane(2), lane(1)], right=[lane(-1), lane(-2)])

STRAIGHT = document(road(length=2000.0, sections=TWO_EACH))
BEND_M = 200.0
BEND = document(
    road(plan=geometry(f'<arc curvature="{1 / BEND_M!r}"/>', 600.0), length=600.0, sections=TWO_EACH)
)

CAR = (
    '<Vehicle name="car" vehicleCategory="car"><BoundingBox><Center x="1.5" y="0" z="0.75"/>'
    '<Dimensions width="2" length="5" height="1.5"/></BoundingBox>'
    '<Performance maxSpeed="70" maxDeceleration="10" maxAcceleration="5"/>'
    '<Axles><FrontAxle positionX="3"/><RearAxle positionX="0"/></Axles></Vehicle>'
)


def lane_position(s, lane_id=-1, offset=0.0, inner="", road_id=1):
    place = f'roadId="{road_id}" laneId="{lane_id}" s="{s}" offset="{offset}"'
    return f"<LanePosition {place}>{inner}</LanePosition>"


def catalog_reference(catalog, entry, **assigned):
    inner = "".join(f'<ParameterAssignment parameterRef="{k}" value="{v}"/>' for k, v in assigned.items())
    return (
        f'<CatalogReference catalogName="{catalog}" entryName="{entry}">'
        f"<ParameterAssignments>{inner}</ParameterAssignments></CatalogReference>"
    )


def teleport(position):
    return f"<PrivateAction><TeleportAction><Position>{position}</Position></TeleportAction></PrivateAction>"


def speed(target, shape="step", dimension="time", value=0):
    if not isinstance(target, str):
        target = f'<AbsoluteTargetSpeed value="{target}"/>'
    return (
        "<PrivateAction><LongitudinalAction><SpeedAction>"
        f'<SpeedActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'
        f"<SpeedActionTarget>{target}</SpeedActionTarget></SpeedAction></LongitudinalAction></PrivateAction>"
    )


def lane_change(target, shape="cubic", dimension="time", value=3, offset=None):
    if isinstance(target, int):
        target = f'<AbsoluteTargetLane value="{target}"/>'
    more = "" if offset is None else f' targetLaneOffset="{offset}"'
    return (
        f"<PrivateAction><LateralAction><LaneChangeAction{more}>"
        f'<LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'
        f"<LaneChangeTarget>{target}</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"
    )


def lane_offset(value, shape="sinusoidal", limit=2.0):
    return (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="false">'
        f'<LaneOffsetActionDynamics dynamicsShape="{shape}" maxLateralAcc="{limit}"/>'
        f'<LaneOffsetTarget><AbsoluteTargetLaneOffset value="{value}"/></LaneOffsetTarget>'
        "</LaneOffsetAction></LateralAction></PrivateAction>"
    )


def set_parameter(name, value):
    return (
        f'<GlobalAction><ParameterAction parameterRef="{name}"><SetAction value="{value}"/>'
        "</ParameterAction></GlobalAction>"
    )


def by_value(inner, edge="rising", delay=0, name="c"):
    return (
        f'<Condition name="{name}" delay="{delay}" conditionEdge="{edge}">'
        f"<ByValueCondition>{inner}</ByValueCondition></Condition>"
    )


def after(seconds, edge="rising", delay=0):
    return by_value(f'<SimulationTimeCondition value="{seconds}" rule="greaterThan"/>', edge, delay)


def element(kind, name, state, edge="none", delay=0):
    return by_value(
        f'<StoryboardElementStateCondition storyboardElementType="{kind}" storyboardElementRef="{name}" '
        f'state="{state}"/>',
        edge,
        delay,
    )


def by_entity(inner, entities=("Ego",), edge="rising", delay=0, rule="any"):
    refs = "".join(f'<EntityRef entityRef="{name}"/>' for name in entities)
    return (
        f'<Condition name="c" delay="{delay}" conditionEdge="{edge}"><ByEntityCondition>'
        f'<TriggeringEntities triggeringEntitiesRule="{rule}">{refs}</TriggeringEntities>'
        f"<EntityCondition>{inner}</EntityCondition></ByEntityCondition></Condition>"
    )


def trigger(*groups, tag="StartTrigger"):
    """Return a trigger of groups; each is a condition, or several joined."""
    inner = "".join(f"<ConditionGroup>{group}</ConditionGroup>" for group in groups)
    return f"<{tag}>{inner}</{tag}>"


def event(name, start, *actions, priority="parallel", runs=1):
    inner = "".join(f'<Action name="{name}{k}">{one}</Action>' for k, one in enumerate(actions))
    return f'<Event name="{name}" priority="{priority}" maximumExecutionCount="{runs}">{inner}{start}</Event>'


def group(*events, actors=("Ego",), name="group", runs=1):
    refs = "".join(f'<EntityRef entityRef="{actor}"/>' for actor in actors)
    return (
        f'<ManeuverGroup name="{name}" maximumExecutionCount="{runs}">'
        f'<Actors selectTriggeringEntities="false">{refs}</Actors>'
        f'<Maneuver name="{name}_m">{"".join(events)}</Maneuver></ManeuverGroup>'
    )


def story(*groups, start="", stop=""):
    return f'<Story name="story"><Act name="act">{"".join(groups)}{start}{stop}</Act></Story>'


def private(name, *actions):
    return f'<Private entityRef="{name}">{"".join(actions)}</Private>'


def text(
    init=None,
    stories="",
    stop="",
    entities=("Ego", "Other"),
    parameters="",
    more="",
    bodies=None,
    road_file="map.xodr",
):
    """Return a scenario; Ego at s = 50 and Other at s = 100 of lane -1 at 20 m/s unless said otherwise."""
    if init is None:
        init = private("Ego", teleport(lane_position(50)), speed(20)) + private(
            "Other", teleport(lane_position(100)), speed(20)
        )
    bodies = bodies or {}
    objects = "".join(
        f'<ScenarioObject name="{name}">{bodies.get(name, CAR)}</ScenarioObject>' for name in entities
    )
    return (
        '<?xml version="1.0"?>\n<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/>'
        f"<ParameterDeclarations>{parameters}</ParameterDeclarations>\n{more}"
        f'<RoadNetwork><LogicFile filepath="{road_file}"/></RoadNetwork>\n'
        f"<Entities>{objects}</Entities>\n<Storyboard><Init><Actions>{init}</Actions></Init>\n"
        f"{stories}\n{stop}</Storyboard></OpenSCENARIO>"
    )


def written(folder, scenario, road_text=STRAIGHT):
    """Write a scenario and its map; return the scenario's path."""
    (folder / "map.xodr").write_text(road_text)
    path = folder / "story.xosc"
    path.write_text(scenario)
    return path


def drive(folder, scenario=None, road_text=STRAIGHT, ego="Ego", rehearsal_s=15.0, **parameters):
    """Return the source of a scenario."""
    path = written(folder, text() if scenario is None else scenario, road_text)
    config = StoryboardConfig(ego=ego, parameters=parameters)
    return StoryDrive.load(path, config, Environment(), rehearsal_s=rehearsal_s)


STATES = WeakKeyDictionary()


def played(source, seconds):
    """Return the storyboard's state at a time; what was played before is not played again."""
    states = STATES.setdefault(source, [source.machine.initial_state()])
    steps = round(seconds * 1e9 / STEP_NS)
    while len(states) <= steps:
        states.append(source.machine.advance(states[-1]))
    return states[steps]


def motion(source, seconds, name="Ego"):
    """Return what an entity does at a time."""
    state = played(source, seconds)
    place = [one.name for one in source.machine.story.entities].index(name)
    return motion_of(source.machine.tracks, state.bodies[place], state.t_ns)


def pose(source, seconds, name="Ego"):
    """Return x, y and heading of an entity at a time."""
    state = played(source, seconds)
    place = [one.name for one in source.machine.story.entities].index(name)
    point, heading = source.machine.work(state, state.t_ns).pose(place)
    return float(point[0]), float(point[1]), heading


def events(source, seconds=30.0):
    """Return the times at which events start and end: {(name, "starts"): s}."""
    found = {}
    for step in range(round(seconds * 1e9 / STEP_NS)):
        state = played(source, step * STEP_NS / 1e9)
        for one in state.happened:
            if one.text.startswith("event "):
                name, verb = one.text.removeprefix("event ").rsplit(" ", 1)
                found.setdefault((name, verb), one.t_ns / 1e9)
        if state.ended_ns is not None:
            break
    return found


def snapshots(source, seconds, period_ns=40_000_000):
    """Return the snapshots of a run."""
    state, found = source.initial_state(), []
    for index in range(int(seconds * 1e9 / period_ns) + 1):
        state, one = source.advance(state, Tick(index=index, t_ns=index * period_ns, period_ns=period_ns), ())
        if one is None:
            break
        found.append(one)
    return found

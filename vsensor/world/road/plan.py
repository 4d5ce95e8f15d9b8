"""A road file planned: every road placed, its heights, lanes and paint over s, and who follows whom."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from math import hypot, pi

from vsensor.errors import ConfigError
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.check import check_shape
from vsensor.world.road.config import RoadConfig, RoadFile
from vsensor.world.road.ground import Polygons, ground_paint
from vsensor.world.road.heights import elevation_rows, superelevation_rows
from vsensor.world.road.joints import MEETS_M, Joint, check_joint, joints_of, lanes_joined
from vsensor.world.road.layout import Layout, layout_of
from vsensor.world.road.line import Element, Line, Pose, elements_of, placed
from vsensor.world.road.paint import ExtraLine, Mark, check_all, extra_lines, marks_of


@dataclass(frozen=True, slots=True)
class Link:
    """What an end of a road is linked to, by its id in the map."""

    is_junction: bool
    id: int
    contact: str = ""


@dataclass(frozen=True, slots=True)
class PlannedConnection:
    """A way from the end of a road to the start of another; lanes by their ids in the map."""

    incoming: int
    linked: int
    lanes: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Junction:
    """Where more than two roads meet."""

    id: int
    connections: tuple[PlannedConnection, ...]


@dataclass(frozen=True, slots=True)
class Body:
    """A road without its neighbours."""

    config: RoadConfig
    line: Line
    layout: Layout
    elevation: tuple[CubicRecord, ...]
    superelevation: tuple[CubicRecord, ...]
    marks: Mapping[int, tuple[Mark, ...]]
    extra: tuple[ExtraLine, ...]
    ground: tuple[Polygons, ...]

    @property
    def length_m(self) -> float:
        """Length of the line."""
        return self.line.length_m


@dataclass(frozen=True, slots=True)
class PlannedRoad:
    """A road with its links; `lanes_before`, `lanes_after`: lane of the file -> id in the linked road."""

    id: int
    body: Body
    predecessor: Link | None = None
    successor: Link | None = None
    lanes_before: Mapping[int, int] = field(default_factory=dict[int, int])
    lanes_after: Mapping[int, int] = field(default_factory=dict[int, int])


@dataclass(frozen=True, slots=True)
class Plan:
    """All roads and junctions of a file."""

    name: str
    roads: tuple[PlannedRoad, ...]
    junctions: tuple[Junction, ...]


def plan_of(file: RoadFile) -> Plan:
    """Return the plan; raises ConfigError naming the key."""
    names = [f"road[{number}]" for number in range(len(file.road))]
    joints = joints_of(file)
    lines = _placed(file, joints, names)
    bodies = [_body(*one) for one in zip(file.road, lines, names, strict=True)]
    for joint in joints:
        check_joint(joint, bodies[joint.incoming], bodies[joint.outgoing])
    groups = _groups(joints)
    first = len(bodies) + 1
    junctions = [_junction(first + k, group, bodies) for k, group in enumerate(groups) if len(group) > 1]
    roads = [_linked(number, bodies, groups, first) for number in range(len(bodies))]
    return Plan(file.name, tuple(roads), tuple(junctions))


def _junction(number: int, group: Sequence[Joint], bodies: Sequence[Body]) -> Junction:
    found = [PlannedConnection(j.incoming + 1, j.outgoing + 1, _ids(j, bodies)) for j in group]
    return Junction(number, tuple(found))


def _placed(file: RoadFile, joints: Sequence[Joint], names: Sequence[str]) -> list[Line]:
    """Return every road's line: the first of those that are joined lies where it says, the others by it.

    First comes who names no road before or after it.
    """
    elements = [elements_of(*one) for one in zip(file.road, names, strict=True)]
    lines: dict[int, Line] = {}
    free = sorted(
        range(len(elements)), key=lambda k: file.road[k].after is not None or file.road[k].before is not None
    )
    for number in free:
        if number not in lines:
            lines[number] = placed(elements[number], _own_pose(file.road[number]))
        count = 0
        while count != len(lines):
            count = len(lines)
            for joint in joints:
                _place_by(joint, elements, lines)
    for number, config in enumerate(file.road):
        _check_own_pose(config, lines[number], names[number])
    return [lines[number] for number in range(len(elements))]


def _check_own_pose(config: RoadConfig, line: Line, where: str) -> None:
    """Raise ConfigError for a road that says where it starts and is joined to be elsewhere."""
    own, start = _own_pose(config), line.start
    gap = hypot(own.x_m - start.x_m, own.y_m - start.y_m)
    if (config.x_m or config.y_m or config.heading_deg) and gap > MEETS_M:
        raise ConfigError(
            f"{where}: x_m, y_m: it starts {gap:.6g} m from there, by the roads that it is joined to"
        )


def _own_pose(config: RoadConfig) -> Pose:
    return Pose(config.x_m, config.y_m, config.heading_deg * pi / 180.0)


def _place_by(joint: Joint, elements: Sequence[tuple[Element, ...]], lines: dict[int, Line]) -> None:
    """Place the one road of a joint by the other, if that is placed."""
    a, b = joint.incoming, joint.outgoing
    if a in lines and b not in lines:
        lines[b] = placed(elements[b], lines[a].end.shifted(joint.shift_m))
    elif b in lines and a not in lines:
        end = placed(elements[a], Pose()).end
        lines[a] = placed(elements[a], lines[b].start.shifted(-joint.shift_m).after(end.inverse()))


def _body(config: RoadConfig, line: Line, where: str) -> Body:
    layout = layout_of(config, line.length_m, where)
    check_shape(config, line, layout, where)
    check_all(config, layout, where)
    for number, bump in enumerate(config.bump):
        layout.check_stretch(bump.at_m, bump.at_m + bump.length_m, f"{where}.bump[{number}]")
    for number, rough in enumerate(config.rough):
        layout.check_stretch(rough.from_m, rough.to_m, f"{where}.rough[{number}]")
    elevation = elevation_rows(config, line.length_m, where)
    return Body(
        config=config,
        line=line,
        layout=layout,
        elevation=elevation,
        superelevation=superelevation_rows(config, line, where),
        marks={border: marks_of(config, layout, border, where) for border in layout.borders},
        extra=extra_lines(config, layout, where),
        ground=ground_paint(config, layout, where),
    )


def _groups(joints: Sequence[Joint]) -> list[list[Joint]]:
    """Return the joints by where they are: those that share an end belong together."""
    groups: list[list[Joint]] = []
    for joint in joints:
        same = [group for group in groups if any(_share_an_end(joint, other) for other in group)]
        merged = [*(j for g in same for j in g), joint]
        groups = [g for g in groups if g not in same] + [merged]
    return groups


def _share_an_end(one: Joint, other: Joint) -> bool:
    return one.incoming == other.incoming or one.outgoing == other.outgoing


def _ids(joint: Joint, bodies: Sequence[Body]) -> tuple[tuple[int, int], ...]:
    """Return the pairs of lanes that a joint joins, as the map numbers them."""
    last = bodies[joint.incoming].layout.sections[-1].ids
    first = bodies[joint.outgoing].layout.sections[0].ids
    pairs = lanes_joined(joint, bodies[joint.incoming], bodies[joint.outgoing])
    return tuple((last[a], first[b]) for a, b in pairs)


def _linked(
    number: int, bodies: Sequence[Body], groups: Sequence[Sequence[Joint]], first_junction: int
) -> PlannedRoad:
    """Return a road with what is before and after it."""
    before, after = None, None
    lanes_before: dict[int, int] = {}
    lanes_after: dict[int, int] = {}
    for place, group in enumerate(groups):
        junction = Link(True, first_junction + place) if len(group) > 1 else None
        for joint in group:
            a, b = bodies[joint.incoming], bodies[joint.outgoing]
            pairs = lanes_joined(joint, a, b) if junction is None else ()
            if joint.outgoing == number:
                before = junction or Link(False, joint.incoming + 1, "end")
                lanes_before = {mine: a.layout.sections[-1].ids[other] for other, mine in pairs}
            if joint.incoming == number:
                after = junction or Link(False, joint.outgoing + 1, "start")
                lanes_after = {mine: b.layout.sections[0].ids[other] for mine, other in pairs}
    return PlannedRoad(number + 1, bodies[number], before, after, lanes_before, lanes_after)

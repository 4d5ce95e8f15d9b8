"""Positions of every kind, routes and trajectories."""

from typing import Any

from vsensor.world.opendrive.xml import Element, children
from vsensor.world.openscenario.action_data import Orientation, Position, Trajectory, Vertex
from vsensor.world.openscenario.entities import Cast
from vsensor.world.openscenario.reader import StoryReader

MOST_POINTS = 10_000


def read_position(reader: StoryReader, cast: Cast, element: Element) -> Position:
    """Return the position in a <Position>; raises StoryError for one that is not played."""
    inner = reader.only(element)
    read = _READERS.get(inner.tag)
    if read is None:
        raise reader.error(inner, "positions of this kind are not played")
    return read(reader, cast, inner)


def _where(reader: StoryReader, element: Element) -> str:
    return f"{reader.file_of(element)}:{element.sourceline}: <{element.tag}>"


def _orientation(reader: StoryReader, element: Element) -> Orientation | None:
    found = element.find("Orientation")
    if found is None:
        return None
    kind = reader.choice(found, "type", ("absolute", "relative"))
    for name in ("p", "r"):
        if abs(reader.number(found, name, 0.0)) > 1e-6:
            reader.warn(found, f"{name} is not played: pitch and roll are the road's")
    return Orientation(kind == "relative", reader.number(found, "h", 0.0))


def _world(reader: StoryReader, cast: Cast, element: Element) -> Position:
    heading = reader.number(element, "h", 0.0) if element.get("h") is not None else None
    return Position(
        kind="world",
        where=_where(reader, element),
        x_m=reader.number(element, "x"),
        y_m=reader.number(element, "y"),
        z_m=None if element.get("z") is None else reader.number(element, "z"),
        orientation=None if heading is None else Orientation(False, heading),
    )


def _relative_xyz(reader: StoryReader, cast: Cast, element: Element) -> Position:
    return Position(
        kind="relative_world" if element.tag == "RelativeWorldPosition" else "relative_object",
        where=_where(reader, element),
        ref=cast.of(reader, element),
        x_m=reader.number(element, "dx"),
        y_m=reader.number(element, "dy"),
        z_m=reader.number(element, "dz", 0.0),
        orientation=_orientation(reader, element),
    )


def _road(reader: StoryReader, cast: Cast, element: Element) -> Position:
    return Position(
        kind="road",
        where=_where(reader, element),
        road=reader.text(element, "roadId"),
        s_m=reader.number(element, "s"),
        t_m=reader.number(element, "t"),
        orientation=_orientation(reader, element),
    )


def _relative_road(reader: StoryReader, cast: Cast, element: Element) -> Position:
    return Position(
        kind="relative_road",
        where=_where(reader, element),
        ref=cast.of(reader, element),
        s_m=reader.number(element, "ds"),
        t_m=reader.number(element, "dt"),
        orientation=_orientation(reader, element),
    )


def _lane(reader: StoryReader, cast: Cast, element: Element) -> Position:
    return Position(
        kind="lane",
        where=_where(reader, element),
        road=reader.text(element, "roadId"),
        lane=reader.integer(element, "laneId"),
        s_m=reader.number(element, "s"),
        t_m=reader.number(element, "offset", 0.0),
        orientation=_orientation(reader, element),
    )


def _relative_lane(reader: StoryReader, cast: Cast, element: Element) -> Position:
    distance = "dsLane" if element.get("ds") is None and element.get("dsLane") is not None else "ds"
    return Position(
        kind="relative_lane",
        where=_where(reader, element),
        ref=cast.of(reader, element),
        lane=reader.integer(element, "dLane"),
        s_m=reader.number(element, distance),
        t_m=reader.number(element, "offset", 0.0),
        orientation=_orientation(reader, element),
    )


def _route(reader: StoryReader, cast: Cast, element: Element) -> Position:
    waypoints = read_waypoints(reader, cast, reader.child(reader.child(element, "RouteRef"), "Route"))
    inside = reader.only(reader.child(element, "InRoutePosition"))
    common: dict[str, Any] = {"kind": "route", "where": _where(reader, element), "waypoints": waypoints}
    orientation = _orientation(reader, element)
    if inside.tag == "FromCurrentEntity":
        return Position(**common, ref=cast.of(reader, inside), orientation=orientation)
    s_m = reader.number(inside, "pathS")
    if inside.tag in ("FromRoadCoordinates", "PositionInRoadCoordinates"):
        return Position(**common, s_m=s_m, t_m=reader.number(inside, "t"), orientation=orientation)
    return Position(
        **common,
        s_m=s_m,
        lane=reader.integer(inside, "laneId"),
        t_m=reader.number(inside, "laneOffset", 0.0),
        orientation=orientation,
    )


_READERS = {
    "WorldPosition": _world,
    "RelativeWorldPosition": _relative_xyz,
    "RelativeObjectPosition": _relative_xyz,
    "RoadPosition": _road,
    "RelativeRoadPosition": _relative_road,
    "LanePosition": _lane,
    "RelativeLanePosition": _relative_lane,
    "RoutePosition": _route,
}


def read_waypoints(reader: StoryReader, cast: Cast, route: Element) -> tuple[Position, ...]:
    """Return the places of a <Route>."""
    points = list(children(route, "Waypoint"))
    if len(points) < 2 or len(points) > MOST_POINTS:
        raise reader.error(route, f"2 to {MOST_POINTS} waypoints were expected")
    if reader.boolean(route, "closed", default=False):
        reader.warn(route, "a closed route is driven once")
    for point in points:
        if point.get("routeStrategy") not in (None, "shortest"):
            reader.warn(point, f'routeStrategy="{point.get("routeStrategy")}": the way of the links is taken')
    return tuple(read_position(reader, cast, reader.child(point, "Position")) for point in points)


def read_trajectory(reader: StoryReader, cast: Cast, action: Element) -> Trajectory:
    """Return the path of a <FollowTrajectoryAction>."""
    holder = action.find("TrajectoryRef")
    trajectory = reader.child(action if holder is None else holder, "Trajectory")
    shape = reader.only(reader.child(trajectory, "Shape"))
    name = reader.text(trajectory, "name")
    timing = next(children(action.find("TimeReference"), "Timing"), None)
    time: dict[str, Any] = {}
    if timing is not None:
        domain = reader.choice(timing, "domainAbsoluteRelative", ("absolute", "relative"))
        time = {
            "timed": True,
            "absolute": domain == "absolute",
            "time_scale": reader.number(timing, "scale", 1.0),
            "time_offset_s": reader.number(timing, "offset", 0.0),
        }
        if time["time_scale"] <= 0.0:
            raise reader.error(timing, "scale: a number above 0 was expected")
    if shape.tag == "Polyline":
        return Trajectory(name=name, vertices=_vertices(reader, cast, shape, bool(time)), **time)
    if shape.tag == "Clothoid":
        if time:
            reader.warn(timing, "times are those of vertices; a clothoid is driven at the vehicle's speed")
        rate = "curvaturePrime" if shape.get("curvaturePrime") is not None else "curvatureDot"
        length_m = reader.number(shape, "length")
        if not 0.0 < length_m <= 100_000.0:
            raise reader.error(shape, f'length="{length_m:g}": above 0 to 100 km was expected')
        return Trajectory(
            name=name,
            start=read_position(reader, cast, reader.child(shape, "Position")),
            curvature_per_m=reader.number(shape, "curvature"),
            curvature_rate_per_m2=reader.number(shape, rate),
            length_m=length_m,
        )
    raise reader.error(shape, "trajectories of this shape are not played: Polyline or Clothoid was expected")


def _vertices(reader: StoryReader, cast: Cast, shape: Element, timed: bool) -> tuple[Vertex, ...]:
    points = list(children(shape, "Vertex"))
    if not 2 <= len(points) <= MOST_POINTS:
        raise reader.error(shape, f"2 to {MOST_POINTS} vertices were expected")
    vertices: list[Vertex] = []
    for point in points:
        time_s = reader.number(point, "time", 0.0) if timed else None
        if timed and vertices and time_s is not None and time_s <= (vertices[-1].time_s or 0.0):
            raise reader.error(point, f'time="{time_s:g}": times must rise from vertex to vertex')
        vertices.append(Vertex(read_position(reader, cast, reader.child(point, "Position")), time_s))
    return tuple(vertices)

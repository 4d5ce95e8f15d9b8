"""A map file into a RoadMap: everything is read and checked once, nothing is sampled."""

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from vsensor.types import frozen
from vsensor.world.opendrive.extras import read_ground, read_lines, read_swells
from vsensor.world.opendrive.load_lanes import read_cubics, read_lanes
from vsensor.world.opendrive.load_plan import LENGTH_TOLERANCE_M, LONGEST_ROAD_M, read_plan_view
from vsensor.world.opendrive.planview import PlanView
from vsensor.world.opendrive.polynomial import CubicRecord, Cubics
from vsensor.world.opendrive.road import Connection, Road, RoadLink, RoadMap
from vsensor.world.opendrive.surface import Shape
from vsensor.world.opendrive.xml import Element, MapReader, children, read_cubic, read_root, shortened


def load_map(path: Path | str) -> RoadMap:
    """Read an OpenDRIVE file (1.4 to 1.8), or a road file (.toml) by way of what it is in OpenDRIVE.

    Raises MapError naming file, line, element, attribute; ConfigError naming the key of a road file.
    """
    path = Path(path)
    if path.suffix.lower() == ".toml":
        from vsensor.world.road import opendrive_of  # it is built of this package's curves

        return parse_map(opendrive_of(path), path)
    return parse_map(None, path)


def parse_map(text: bytes | None, path: Path) -> RoadMap:
    """Read the text of an OpenDRIVE map, that of the file at `path` if None; errors name `path`."""
    reader = MapReader(path)
    root = read_root(path, text)
    _check_header(reader, root)
    roads: dict[str, Road] = {}
    for element in children(root, "road"):
        road = _road(reader, element)
        if road.id in roads:
            raise reader.error(element, f'id="{shortened(road.id)}" is used by two roads')
        roads[road.id] = road
    if not roads:
        raise reader.error(root, "no <road> in it")
    connections = _junctions(reader, root, roads)
    _check_links(reader, root, roads, connections)
    return RoadMap(reader.path, roads, connections, tuple(reader.warnings))


def _check_header(reader: MapReader, root: Element) -> None:
    header = root.find("header")
    if header is None:
        reader.warn(root, "no <header>: version unknown, read as 1.4 to 1.8")
        return
    major, minor = reader.integer(header, "revMajor"), reader.integer(header, "revMinor")
    if major != 1:
        raise reader.error(header, f"OpenDRIVE {major}.{minor}: versions 1.4 to 1.8 are read")
    if not 4 <= minor <= 8:
        reader.warn(header, f"OpenDRIVE {major}.{minor} is read as 1.4 to 1.8")


def _road(reader: MapReader, element: Element) -> Road:
    road_id = reader.text(element, "id")
    plan = read_plan_view(reader, element)
    length = _length(reader, element, plan)
    rule = reader.choice(element, "rule", ("RHT", "LHT"))
    lateral = element.find("lateralProfile")
    for ignored in children(lateral, "crossfall", "crossSectionSurface"):
        reader.warn(ignored, "is ignored: the surface is taken without it")
    link = element.find("link")
    return Road(
        id=road_id,
        length_m=length,
        junction=" ".join((element.get("junction") or "-1").split()),
        left_hand_traffic=rule == "LHT",
        plan=plan,
        elevation=_cubics(reader, children(element.find("elevationProfile"), "elevation")),
        superelevation=_cubics(reader, children(lateral, "superelevation")),
        shape=_shape(reader, lateral),
        sections=read_lanes(reader, element, length, _type(element)),
        predecessor=_link(reader, link, "predecessor"),
        successor=_link(reader, link, "successor"),
        lines=read_lines(reader, element),
        ground=read_ground(reader, element),
        swells=read_swells(reader, element),
    )


def _type(road: Element) -> str:
    element = road.find("type")
    return "" if element is None else (element.get("type") or "").strip()


def _length(reader: MapReader, element: Element, plan: PlanView) -> float:
    length = reader.number(element, "length")
    if not 0.0 < length <= LONGEST_ROAD_M:
        raise reader.error(element, f'length="{length:g}": more than 0, up to 1e6 m was expected')
    if abs(length - plan.end_m) > LENGTH_TOLERANCE_M:
        reader.warn(
            element,
            f'length="{length:g}", but its geometry ends at {plan.end_m:g} m: ends where the shorter does',
        )
    return min(length, plan.end_m)


def _cubics(reader: MapReader, elements: Iterable[Element]) -> Cubics:
    return Cubics.of(read_cubics(reader, tuple(elements), "s"))


def _shape(reader: MapReader, lateral: Element | None) -> Shape | None:
    rows: dict[float, list[CubicRecord]] = {}
    for element in children(lateral, "shape"):
        rows.setdefault(reader.number(element, "s"), []).append(read_cubic(reader, element, "t"))
    if not rows:
        return None
    stations = sorted(rows)
    return Shape(frozen(np.array(stations)), tuple(Cubics.of(rows[s]) for s in stations))


def _link(reader: MapReader, link: Element | None, name: str) -> RoadLink | None:
    element = next(children(link, name), None)
    if element is None:
        return None
    kind = reader.choice(element, "elementType", ("road", "junction"))
    contact = reader.choice(element, "contactPoint", ("start", "end"))
    return RoadLink(kind == "junction", reader.text(element, "elementId"), contact)


def _junctions(reader: MapReader, root: Element, roads: dict[str, Road]) -> dict[str, tuple[Connection, ...]]:
    found: dict[str, tuple[Connection, ...]] = {}
    for junction in children(root, "junction"):
        connections = (_connection(reader, el, roads) for el in children(junction, "connection"))
        found[reader.text(junction, "id")] = tuple(c for c in connections if c is not None)
    return found


def _connection(reader: MapReader, el: Element, roads: dict[str, Road]) -> Connection | None:
    direct = el.get("linkedRoad") is not None
    name = "linkedRoad" if direct else "connectingRoad"
    if el.get("incomingRoad") is None or el.get(name) is None:  # a virtual connection
        reader.warn(el, "has no incomingRoad or connectingRoad and is left out")
        return None
    incoming, connecting = reader.text(el, "incomingRoad"), reader.text(el, name)
    contact = reader.choice(el, "contactPoint", ("start", "end"))
    for road in (incoming, connecting):
        if road not in roads:
            reader.warn(el, f"names road {shortened(road)}, which is not in the map, and is left out")
            return None
    lanes = tuple(
        (reader.integer(link, "from"), reader.integer(link, "to")) for link in children(el, "laneLink")
    )
    return Connection(incoming, connecting, contact, lanes, direct)


def _check_links(
    reader: MapReader,
    root: Element,
    roads: dict[str, Road],
    connections: dict[str, tuple[Connection, ...]],
) -> None:
    for element in children(root, "road"):
        road = roads[reader.text(element, "id")]
        for name, link in (("predecessor", road.predecessor), ("successor", road.successor)):
            if link is not None and link.id not in (connections if link.is_junction else roads):
                what = "junction" if link.is_junction else "road"
                reader.warn(
                    element, f"its {name}, {what} {shortened(link.id)}, is not in the map: a dead end"
                )

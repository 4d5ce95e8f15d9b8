"""A map file into a RoadMap: everything is read and checked once, nothing is sampled."""

from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path

import numpy as np

from vsensor.types import frozen
from vsensor.world.opendrive.crossing import self_crossing
from vsensor.world.opendrive.extras import read_ground, read_lines, read_swells
from vsensor.world.opendrive.load_lanes import read_cubics, read_lanes
from vsensor.world.opendrive.load_plan import LENGTH_TOLERANCE_M, LONGEST_ROAD_M, read_plan_view
from vsensor.world.opendrive.packed import PackedRoads
from vsensor.world.opendrive.parts import parts_of
from vsensor.world.opendrive.planview import PlanView
from vsensor.world.opendrive.polynomial import CubicRecord, Cubics
from vsensor.world.opendrive.road import Connection, Road, RoadLink, RoadMap
from vsensor.world.opendrive.surface import Shape
from vsensor.world.opendrive.xml import Element, MapReader, children, read_cubic, shortened

HUGE_BYTES = 16_000_000
"""The roads of a larger file are kept packed: plain they take some 12 times the file's size."""


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
    return _Loading(path, _size(path, text) > HUGE_BYTES).load(parts_of(path, text))


def _size(path: Path, text: bytes | None) -> int:
    if text is not None:
        return len(text)
    return path.stat().st_size if path.is_file() else 0


class _Loading:
    """A map on its way: what was read so far, part by part, in whatever order they come."""

    def __init__(self, path: Path, is_huge: bool) -> None:
        self._reader = MapReader(path)
        self._packed = PackedRoads(lambda element: _road(MapReader(path), element)) if is_huge else None
        self._plain: dict[str, Road] = {}
        self._links: list[tuple[int, str, RoadLink]] = []
        self._junctions: dict[str, list[tuple[int, Connection]]] = {}
        self._has_header = self._has_swells = False

    @property
    def _roads(self) -> Mapping[str, Road]:
        return self._plain if self._packed is None else self._packed

    def load(self, parts: Iterator[Element]) -> RoadMap:
        """Return the map of all parts, the last of which is the root."""
        reader, part = self._reader, None
        for part in parts:
            if part.tag == "header" and not self._has_header:
                _check_header(reader, part)
                self._has_header = True
            elif part.tag == "road":
                self._take_road(part)
            elif part.tag == "junction":
                connections = (_connection(reader, el) for el in children(part, "connection"))
                self._junctions[reader.text(part, "id")] = [one for one in connections if one is not None]
        if not self._roads:
            raise reader.error(part, "no <road> in it")
        if not self._has_header:
            reader.warn(part, "no <header>: version unknown, read as 1.4 to 1.8")
        connections_by_id = {name: tuple(self._known(found)) for name, found in self._junctions.items()}
        self._check_links()
        findings = tuple(reader.warnings)
        return RoadMap(reader.path, self._roads, connections_by_id, self._has_swells, findings)

    def _take_road(self, element: Element) -> None:
        road = _road(self._reader, element)
        if road.id in self._roads:
            raise self._reader.error(element, f'id="{shortened(road.id)}" is used by two roads')
        for name, link in (("predecessor", road.predecessor), ("successor", road.successor)):
            if link is not None:
                self._links.append((element.sourceline, name, link))
        self._has_swells |= bool(road.swells)
        if self._packed is None:
            self._plain[road.id] = road
        else:
            self._packed.add(road.id, element)

    def _known(self, found: list[tuple[int, Connection]]) -> Iterator[Connection]:
        """Yield the connections; raises MapError for one whose roads are not in the map."""
        for line, connection in found:
            missing = [r for r in (connection.incoming, connection.connecting) if r not in self._roads]
            if missing:
                what = f"names road {shortened(missing[0])}, which is not in the map"
                raise self._reader.error_at(line, "connection", what)
            yield connection

    def _check_links(self) -> None:
        for line, name, link in self._links:
            if link.id not in (self._junctions if link.is_junction else self._roads):
                what = "junction" if link.is_junction else "road"
                told = f"its {name}, {what} {shortened(link.id)}, is not in the map"
                raise self._reader.error_at(line, "road", told)


def _check_header(reader: MapReader, header: Element) -> None:
    major, minor = reader.integer(header, "revMajor"), reader.integer(header, "revMinor")
    if major != 1:
        raise reader.error(header, f"OpenDRIVE {major}.{minor}: versions 1.4 to 1.8 are read")
    if not 4 <= minor <= 8:
        reader.warn(header, f"OpenDRIVE {major}.{minor} is read as 1.4 to 1.8")


def _road(reader: MapReader, element: Element) -> Road:
    road_id = reader.text(element, "id")
    plan = read_plan_view(reader, element)
    length = _length(reader, element, plan)
    elevation = _cubics(reader, children(element.find("elevationProfile"), "elevation"))
    if (crossing := self_crossing(plan, elevation, length)) is not None:
        where = "s = {:.1f} and {:.1f} m".format(*crossing)
        raise reader.error(element, f"crosses itself on one level at {where}")
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
        elevation=elevation,
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


def _connection(reader: MapReader, el: Element) -> tuple[int, Connection] | None:
    """Return a connection and its line, None for a virtual one."""
    direct = el.get("linkedRoad") is not None
    name = "linkedRoad" if direct else "connectingRoad"
    if el.get("incomingRoad") is None or el.get(name) is None:
        reader.warn(el, "has no incomingRoad or connectingRoad and is left out")
        return None
    incoming, connecting = reader.text(el, "incomingRoad"), reader.text(el, name)
    contact = reader.choice(el, "contactPoint", ("start", "end"))
    lanes = tuple(
        (reader.integer(link, "from"), reader.integer(link, "to")) for link in children(el, "laneLink")
    )
    return el.sourceline, Connection(incoming, connecting, contact, lanes, direct)

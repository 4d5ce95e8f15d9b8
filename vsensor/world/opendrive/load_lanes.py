"""Lane sections of one road from XML, `singleSide` resolved."""

from collections.abc import Sequence

from vsensor.world.opendrive.lanes import Lane, Section
from vsensor.world.opendrive.marks import read_marks
from vsensor.world.opendrive.polynomial import START_TOLERANCE_M, CubicRecord, Cubics
from vsensor.world.opendrive.xml import Element, MapReader, children, read_cubic

SIDES = {"left": 1, "center": 0, "right": -1}
MOST_LANES = 200
WIDTH_TOLERANCE_M = 1e-3
"""Widths of real maps end at 0 with rounding."""
SAME_S_M = 1e-6
"""A lane offset that starts this close to a section's start starts with it."""


def read_lanes(reader: MapReader, road: Element, length_m: float, road_type: str) -> tuple[Section, ...]:
    """Return the lane sections of a road, ordered; raises MapError where there are none."""
    lanes = road.find("lanes")
    if lanes is None:
        raise reader.error(road, "no <lanes> in it")
    offsets = [read_cubic(reader, el, "s") for el in children(lanes, "laneOffset")]
    elements = _ordered(reader, lanes, length_m)
    starts = [start for start, _ in elements]
    sections: list[Section] = []
    current: dict[int, dict[int, Lane]] = {1: {}, 0: {}, -1: {}}
    for (start, element), end in zip(elements, [*starts[1:], length_m], strict=True):
        current = current | _section(reader, element, start, road_type)
        offset = _within(offsets, start, end)
        by_id = current[1] | current[0] | current[-1]
        _check_widths(reader, element, by_id, end)
        sections.append(Section(start, end, offset, {i: by_id[i] for i in sorted(by_id, reverse=True)}))
    return tuple(sections)


def _check_widths(reader: MapReader, section: Element, lanes: dict[int, Lane], end_m: float) -> None:
    """Refuse lanes that are narrower than nothing; raises MapError saying where one is worst."""
    for el in (el for group in children(section, *SIDES) for el in children(group, "lane")):
        lane = lanes[reader.integer(el, "id")]
        if lane.is_border or lane.id == 0:
            continue
        narrowest, at_m = lane.width.least(end_m)
        if narrowest < -WIDTH_TOLERANCE_M:
            raise reader.error(el, f"its width is {narrowest:.3g} m at s = {at_m:.6g}")


def _within(records: list[CubicRecord], start_m: float, end_m: float) -> Cubics:
    """Return the lane offset of one section: it may jump at a section's end, where lanes are counted anew."""
    kept = [record for record in records if record[0] < end_m - SAME_S_M]
    return Cubics.of([(start_m if abs(s - start_m) < SAME_S_M else s, *rest) for s, *rest in kept])  # type: ignore[misc]


def read_cubics(reader: MapReader, elements: Sequence[Element], start: str) -> list[CubicRecord]:
    """Return the records of a curve that ought to be given from 0 on."""
    records = [read_cubic(reader, element, start) for element in elements]
    if records and min(record[0] for record in records) > START_TOLERANCE_M:
        reader.warn(elements[0], f"the first one starts at {start} = {records[0][0]:g}: 0 before it")
    return records


def _ordered(reader: MapReader, lanes: Element, length_m: float) -> list[tuple[float, Element]]:
    found = [(reader.number(el, "s"), el) for el in children(lanes, "laneSection")]
    kept = sorted((item for item in found if item[0] < length_m), key=lambda item: item[0])
    if not kept:
        raise reader.error(lanes, "no <laneSection> within the road's length")
    if kept != found:
        reader.warn(lanes, "lane sections out of order, or beyond the end of the road: sorted, cut")
    if kept[0][0] > START_TOLERANCE_M:
        reader.warn(kept[0][1], f"the first lane section starts at s = {kept[0][0]:g}: taken from 0 on")
    return [(0.0, kept[0][1]), *kept[1:]]


def _section(
    reader: MapReader, element: Element, start_m: float, road_type: str
) -> dict[int, dict[int, Lane]]:
    """Return the lanes of each side that the section defines."""
    single = (element.get("singleSide") or "false").strip().lower() in ("true", "1")
    sides: dict[int, dict[int, Lane]] = {} if single else {1: {}, 0: {}, -1: {}}
    for group in children(element, *SIDES):
        side = SIDES[group.tag]
        lanes = [_lane(reader, el, side, start_m, road_type) for el in children(group, "lane")]
        ids = {lane.id: lane for lane in lanes}
        if len(ids) != len(lanes) or len(lanes) > MOST_LANES:
            raise reader.error(
                group, f"{len(lanes)} lanes with {len(ids)} ids: each id once, up to {MOST_LANES}"
            )
        if sorted(map(abs, ids)) != list(range(0 if side == 0 else 1, len(ids) + (side != 0))):
            reader.warn(group, f"lane ids are not counted on from the centre: {sorted(ids, reverse=True)}")
        sides.setdefault(side, {}).update(ids)
    if not single and 0 not in sides[0]:
        reader.warn(element, "no centre lane: its border is taken as not marked")
    if 0 not in sides.get(0, {0: None}):
        sides[0] = {0: Lane(0, "none", Cubics.of([]), False, (), (0,), (0,), False)}
    return sides


def _lane(reader: MapReader, el: Element, side: int, start_m: float, road_type: str) -> Lane:
    lane_id = reader.integer(el, "id")
    if (lane_id > 0) - (lane_id < 0) != side:
        raise reader.error(el, f'id="{lane_id}" inside <{el.getparent().tag}>')
    width, is_border = _width(reader, el, side, start_m)
    link = el.find("link")
    return Lane(
        id=lane_id,
        type=" ".join((el.get("type") or "none").split()),
        width=width,
        is_border=is_border,
        marks=read_marks(reader, el, side, start_m, road_type),
        predecessors=tuple(reader.integer(e, "id") for e in children(link, "predecessor")),
        successors=tuple(reader.integer(e, "id") for e in children(link, "successor")),
        reversed=(el.get("direction") or "").strip() == "reversed",
    )


def _width(reader: MapReader, el: Element, side: int, start_m: float) -> tuple[Cubics, bool]:
    """Return width or, without one, the outer border's distance from the centre, over absolute s."""
    if side == 0:
        return Cubics.of([]), False
    is_border = next(children(el, "width"), None) is None
    read = read_cubics(reader, tuple(children(el, "border" if is_border else "width")), "sOffset")
    records = [(start_m + s if s > START_TOLERANCE_M else start_m, a, b, c, d) for s, a, b, c, d in read]
    if not records:
        reader.warn(el, "neither width nor border: taken as 0 m wide")
    elif is_border and side * records[0][1] < 0.0:
        reader.warn(el, "its border lies on the other side of the road: taken as a distance")
        return Cubics.of([(s, -side * a, -side * b, -side * c, -side * d) for s, a, b, c, d in records]), True
    sign = side if is_border else 1
    return Cubics.of([(s, sign * a, sign * b, sign * c, sign * d) for s, a, b, c, d in records]), is_border

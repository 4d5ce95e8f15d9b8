"""A planned road as the elements of OpenDRIVE 1.7, in the order of its schema.

Every number is written with as many digits (up to 17) as it takes to read the same float64 back. What the
standard has no element for goes into `userData` whose code begins with `vsensor.`: others pass it over.
"""

from collections.abc import Iterable, Sequence
from typing import Any

from lxml import etree

from vsensor.world.opendrive.planview import Arc, Spiral
from vsensor.world.opendrive.polynomial import CubicRecord
from vsensor.world.road.config import CrosswalkConfig, PaintConfig, StopLineConfig
from vsensor.world.road.ground import Polygons
from vsensor.world.road.layout import PlannedSection
from vsensor.world.road.paint import Mark, dashes, stripes
from vsensor.world.road.plan import Junction, Link, PlannedRoad
from vsensor.world.road.rows import between, straight_rows

Element = Any

TYPES = {
    "none": "none",
    "solid": "solid",
    "dashed": "broken",
    "double_solid": "solid solid",
    "double_dashed": "broken broken",
    "solid_dashed": "solid broken",
    "dashed_solid": "broken solid",
    "botts_dots": "botts dots",
    "road_edge": "edge",
    "curb": "curb",
}


def text(value: float) -> str:
    """Return the shortest decimal that reads back as the same float64; 0 without a sign."""
    return repr(float(value) + 0.0)


def add(parent: Element, tag: str, **attributes: object) -> Element:
    """Append an element; floats keep all their digits, truth is written in small letters."""
    shown = {key: _shown(value) for key, value in attributes.items()}
    return etree.SubElement(parent, tag, shown)


def _shown(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return text(value) if isinstance(value, float) else str(value)


def add_rows(
    parent: Element, tag: str, rows: Iterable[CubicRecord], start: str = "s", less_m: float = 0.0
) -> None:
    """Append polynomials; `less_m` is taken off their starts."""
    for s, *coefficients in rows:
        add(parent, tag, **{start: s - less_m, **dict(zip("abcd", coefficients, strict=True))})


def document(name: str, roads: Sequence[PlannedRoad], junctions: Sequence[Junction]) -> bytes:
    """Return the whole map's text."""
    root = etree.Element("OpenDRIVE")
    add(root, "header", revMajor=1, revMinor=7, name=name, version="1.00")
    for road in roads:
        _add_road(root, road)
    for junction in junctions:
        _add_junction(root, junction)
    etree.indent(root, space=" ")
    return bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8")) + b"\n"


def _add_road(root: Element, road: PlannedRoad) -> None:
    config = road.body.config
    rule = "RHT" if config.traffic == "right" else "LHT"
    name = config.name or f"road {road.id}"
    element = add(root, "road", name=name, length=road.body.length_m, id=road.id, junction=-1, rule=rule)
    link = add(element, "link")
    for tag, end in (("predecessor", road.predecessor), ("successor", road.successor)):
        if end is not None:
            _add_link(link, tag, end)
    add(element, "type", s=0.0, type=config.type)
    _add_plan_view(element, road)
    add_rows(add(element, "elevationProfile"), "elevation", road.body.elevation)
    add_rows(add(element, "lateralProfile"), "superelevation", road.body.superelevation)
    lanes = add(element, "lanes")
    add_rows(lanes, "laneOffset", road.body.layout.offset)
    for number in range(len(road.body.layout.sections)):
        _add_section(lanes, road, number)
    _add_objects(element, road)
    _add_lines(element, road)
    _add_unevenness(element, road)


def _add_link(link: Element, tag: str, end: Link) -> None:
    if end.is_junction:
        add(link, tag, elementType="junction", elementId=end.id)
    else:
        add(link, tag, elementType="road", elementId=end.id, contactPoint=end.contact)


def _add_plan_view(element: Element, road: PlannedRoad) -> None:
    view = add(element, "planView")
    for record in road.body.line.records:
        geometry = add(
            view,
            "geometry",
            s=record.s_m,
            x=record.x_m,
            y=record.y_m,
            hdg=record.heading_rad,
            length=record.length_m,
        )
        curve = record.curve
        if isinstance(curve, Spiral):
            add(geometry, "spiral", curvStart=curve.start_per_m, curvEnd=curve.end_per_m)
        elif isinstance(curve, Arc) and curve.curvature_per_m:
            add(geometry, "arc", curvature=curve.curvature_per_m)
        else:
            add(geometry, "line")


def _add_section(lanes: Element, road: PlannedRoad, number: int) -> None:
    section = road.body.layout.sections[number]
    element = add(lanes, "laneSection", s=section.start_m)
    order = sorted(section.ids, reverse=True)
    for side, wanted in (("left", [n for n in order if n > 0]), ("right", [n for n in order if n < 0])):
        if side == "right":
            _add_lane(add(element, "center"), road, number, 0)
        if wanted:
            group = add(element, side)
            for lane in wanted:
                _add_lane(group, road, number, lane)


def _add_lane(group: Element, road: PlannedRoad, number: int, lane: int) -> None:
    sections = road.body.layout.sections
    section = sections[number]
    kind = road.body.layout.lanes[lane].config.kind if lane else "none"
    element = add(group, "lane", id=section.ids[lane], type=kind, level=False)
    if lane:
        link = add(element, "link")
        before = sections[number - 1].ids.get(lane) if number else road.lanes_before.get(lane)
        last = number + 1 == len(sections)
        after = road.lanes_after.get(lane) if last else sections[number + 1].ids.get(lane)
        for tag, other in (("predecessor", before), ("successor", after)):
            if other is not None:
                add(link, tag, id=other)
        width = between(road.body.layout.lanes[lane].width, section.start_m, section.end_m)
        add_rows(element, "width", width, "sOffset", section.start_m)
    for mark in road.body.marks[lane]:
        if mark.end_m > section.start_m and mark.start_m < section.end_m:
            _add_mark(element, mark, section, 1 if lane > 0 else -1)


def _add_mark(parent: Element, mark: Mark, section: PlannedSection, side: int) -> None:
    """Append a mark, cut to its section; `side` 1: its type names stripes from right to left."""
    start_m, end_m = max(mark.start_m, section.start_m), min(mark.end_m, section.end_m)
    paint = mark.paint
    sides = stripes(paint)
    words = TYPES[paint.kind].split()
    double = len(sides) == 2
    kind = " ".join(words[::-1] if double and side > 0 else words)
    width_m = paint.width_m * 2 + paint.double_gap_m if double else paint.width_m
    element = add(
        parent,
        "roadMark",
        sOffset=start_m - section.start_m,
        type=kind,
        weight="standard",
        color="white" if paint.kind == "none" else paint.colour,
        width=width_m,
        laneChange="both" if paint.kind == "dashed" else "none",
    )
    if paint.kind == "none":
        return
    _add_stripes(element, paint, kind, start_m, end_m)
    _add_paint(element, paint, mark.valid)


def _add_stripes(element: Element, paint: PaintConfig, kind: str, start_m: float, end_m: float) -> None:
    found = [
        (offset_m, dash)
        for offset_m, dashed in stripes(paint)
        for dash in dashes(paint, start_m, end_m, dashed)
    ]
    for once, tag in ((False, "type"), (True, "explicit")):
        mine = [(offset_m, dash) for offset_m, dash in found if dash.once is once]
        if not mine:
            continue
        group = add(element, "explicit") if once else add(element, tag, name=kind, width=paint.width_m)
        for offset_m, dash in mine:
            line = add(group, "line", length=dash.dash_m)
            if not once:
                line.set("space", text(dash.gap_m))
            line.set("tOffset", text(offset_m))
            line.set("sOffset", text(dash.start_m - start_m))
            line.set("width", text(paint.width_m))


def _add_paint(parent: Element, paint: PaintConfig, valid: bool) -> None:
    """Append contrast, wear, and whether the paint counts, where they are not as the standard takes them."""
    contrast, wear = straight_rows(paint.contrast, "contrast"), straight_rows(paint.wear, "wear")
    plain = [rows == ((0.0, value, 0.0, 0.0, 0.0),) for rows, value in ((contrast, 1.0), (wear, 0.0))]
    if valid and all(plain):
        return
    data = add(add(parent, "userData", code="vsensor.paint", value="1"), "paint", valid=valid)
    for tag, rows, is_plain in (("contrast", contrast, plain[0]), ("wear", wear, plain[1])):
        if not is_plain:
            add_rows(data, tag, rows)


def _add_lines(element: Element, road: PlannedRoad) -> None:
    for extra in road.body.extra:
        data = add(element, "userData", code="vsensor.line", value="1")
        line = add(data, "line", name=extra.name, sStart=extra.from_m, sEnd=extra.to_m)
        add_rows(line, "t", between(extra.t, extra.from_m, extra.to_m))
        whole = PlannedSection(0.0, road.body.length_m, {})
        _add_mark(line, Mark(extra.from_m, extra.to_m, extra.paint, extra.valid), whole, -1)


def _add_unevenness(element: Element, road: PlannedRoad) -> None:
    config = road.body.config
    if not config.bump and not config.rough:
        return
    data = add(element, "userData", code="vsensor.uneven", value="1")
    for bump in config.bump:
        add(data, "bump", s=bump.at_m, length=bump.length_m, height=bump.height_m)
    for rough in config.rough:
        add(data, "rough", sStart=rough.from_m, sEnd=rough.to_m, grade=rough.grade, seed=rough.seed)


def _add_objects(element: Element, road: PlannedRoad) -> None:
    if road.body.ground:
        objects = add(element, "objects")
        for number, polygons in enumerate(road.body.ground):
            _add_object(objects, f"{road.id}{number:03d}", polygons)


def _add_object(objects: Element, number: str, polygons: Polygons) -> None:
    config = polygons.config
    crosswalk = isinstance(config, CrosswalkConfig)
    right_m, left_m = polygons.extent_m
    s_from, s_to = polygons.s_m
    element = add(
        objects,
        "object",
        id=number,
        name="crosswalk" if crosswalk else "stop line",
        type="crosswalk" if crosswalk else "roadMark",
        subtype="zebra" if crosswalk else "other",
        s=(s_from + s_to) / 2.0,
        t=(left_m + right_m) / 2.0,
        zOffset=0.0,
        hdg=0.0,
        pitch=0.0,
        roll=0.0,
        orientation="none",
        length=s_to - s_from,
        width=left_m - right_m,
        height=0.0,
    )
    outlines = add(element, "outlines")
    for place, corners in enumerate(polygons.corners):
        outline = add(outlines, "outline", id=place, outer=True, closed=True)
        for corner, (s, t) in enumerate(corners):
            add(outline, "cornerRoad", id=corner, s=s, t=t, dz=0.0, height=0.0)
    _add_ground_paint(element, config)


def _add_ground_paint(element: Element, config: CrosswalkConfig | StopLineConfig) -> None:
    data = add(element, "userData", code="vsensor.paint", value="1")
    add(data, "paint", color=config.colour, contrast=config.contrast, wear=config.wear)


def _add_junction(root: Element, junction: Junction) -> None:
    element = add(root, "junction", id=junction.id, name=f"junction {junction.id}", type="direct")
    for number, connection in enumerate(junction.connections):
        link = add(
            element,
            "connection",
            id=number,
            incomingRoad=connection.incoming,
            linkedRoad=connection.linked,
            contactPoint="start",
        )
        for a, b in connection.lanes:
            add(link, "laneLink", **{"from": a, "to": b})

"""Geometry records of one road from XML: line, arc, spiral, poly3, paramPoly3."""

import itertools
import math
from collections.abc import Sequence

import numpy as np

from vsensor.world.opendrive.planview import (
    LARGEST_TURN_RAD,
    Arc,
    Curve,
    ParamPoly3,
    PlanView,
    Record,
    Spiral,
)
from vsensor.world.opendrive.xml import Element, MapReader, children

LENGTH_TOLERANCE_M = 1e-3
"""Road length against the end of its geometry; real files differ by up to 1e-5 m."""

GAP_M, KINK_RAD = 0.01, 0.01
"""Joints of geometry that are worth a remark; the worst of the real maps at hand: 1.5 mm, 6e-5 rad."""

LONGEST_ROAD_M = 1e6


def read_plan_view(reader: MapReader, road: Element) -> PlanView:
    """Return the geometry records of a road, ordered; raises MapError where there are none."""
    view = road.find("planView")
    if view is None:
        raise reader.error(road, "no <planView> in it")
    records = [record for el in children(view, "geometry") if (record := _record(reader, el)) is not None]
    if not records:
        raise reader.error(view, "no <geometry> with a length in it")
    ordered = sorted(records, key=lambda record: record.s_m)
    if [record.s_m for record in records] != [record.s_m for record in ordered]:
        reader.warn(view, "geometry records are not in the order of s: sorted")
    _check_gaps(reader, view, ordered)
    return PlanView(tuple(ordered))


def _check_gaps(reader: MapReader, view: Element, records: Sequence[Record]) -> None:
    if abs(records[0].s_m) > LENGTH_TOLERANCE_M:
        raise reader.error(view, f"the first geometry starts at s = {records[0].s_m:g}, not at 0")
    for record, after in itertools.pairwise(records):
        end_m = record.s_m + record.length_m
        x, y, heading, _ = record.at(np.array([record.length_m]))
        gap = math.hypot(x[0] - after.x_m, y[0] - after.y_m)
        turn = abs(math.remainder(heading[0] - after.heading_rad, 2 * math.pi))
        if abs(end_m - after.s_m) > LENGTH_TOLERANCE_M:
            reader.warn(view, f"a geometry ends at s = {end_m:g}, the next starts at {after.s_m:g}")
        elif gap > GAP_M or turn > KINK_RAD:
            reader.warn(view, f"a gap of {gap:.3g} m and a kink of {turn:.3g} rad at s = {after.s_m:g}")


def _record(reader: MapReader, el: Element) -> Record | None:
    length = reader.at_least(el, "length", 0.0)
    s, x, y, heading = (reader.number(el, name) for name in ("s", "x", "y", "hdg"))
    if length == 0.0:
        reader.warn(el, "has length 0 and is left out")
        return None
    if length > LONGEST_ROAD_M:
        raise reader.error(el, f'length="{length:g}": up to 1e6 m was expected')
    shape = next(children(el, "line", "arc", "spiral", "poly3", "paramPoly3"), None)
    if shape is None:
        raise reader.error(el, "no line, arc, spiral, poly3 or paramPoly3 in it")
    return Record(s, x, y, heading, length, _curve(reader, shape, length))


def _curve(reader: MapReader, el: Element, length_m: float) -> Curve:
    if el.tag == "line":
        return Arc(0.0)
    if el.tag == "arc":
        return Arc(_curvature(reader, el, "curvature", length_m))
    if el.tag == "spiral":
        start, end = (_curvature(reader, el, name, length_m) for name in ("curvStart", "curvEnd"))
        return Spiral(start, end, length_m)
    return _parametric(reader, el, length_m)


def _curvature(reader: MapReader, el: Element, name: str, length_m: float) -> float:
    value = reader.number(el, name)
    if abs(value) * length_m > LARGEST_TURN_RAD:
        raise reader.error(
            el, f'{name}="{value:g}" over {length_m:g} m: up to {LARGEST_TURN_RAD:g} rad of turn'
        )
    return value


def _parametric(reader: MapReader, el: Element, length_m: float) -> ParamPoly3:
    if el.tag == "poly3":
        a, b, c, d = (reader.number(el, name) for name in "abcd")
        curve = ParamPoly3((0.0, 1.0, 0.0, 0.0), (a, b, c, d), length_m, length_m, stretch=False)
    else:
        span = reader.choice(el, "pRange", ("normalized", "arcLength"))
        u0, u1, u2, u3 = (reader.number(el, f"{name}U") for name in "abcd")
        v0, v1, v2, v3 = (reader.number(el, f"{name}V") for name in "abcd")
        p_max = length_m if span == "arcLength" else 1.0
        curve = ParamPoly3((u0, u1, u2, u3), (v0, v1, v2, v3), p_max, length_m)
    _check_parametric(reader, el, curve)
    return curve


def _check_parametric(reader: MapReader, el: Element, curve: ParamPoly3) -> None:
    true = curve.arc_length_m
    if not (math.isfinite(true) and true > 1e-9 * curve.length_m):
        raise reader.error(el, f"the curve has no length (p from 0 to {curve.p_max:g})")
    if curve.starts_at_rest:
        reader.warn(el, "du/dp and dv/dp are 0 at its start: the heading there is taken as the limit")
    if curve.stretch and abs(true / curve.length_m - 1.0) > 0.01:
        reader.warn(el, f"the curve is {true:.6g} m long, not {curve.length_m:.6g}: s is stretched to fit")

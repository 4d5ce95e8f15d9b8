"""A planned road in words: lengths, radii, heights, lanes and paint."""

from collections.abc import Iterator
from math import degrees

import numpy as np

from vsensor.world.opendrive.polynomial import Cubics
from vsensor.world.road.layout import Layout, PlannedSection
from vsensor.world.road.paint import Mark
from vsensor.world.road.plan import Body, Plan, PlannedRoad
from vsensor.world.road.rows import value_at


def text_lines(plan: Plan) -> list[str]:
    """Return the summary of a road file."""
    lines = [f"{plan.name}: {_count(len(plan.roads), 'road')}, {_count(len(plan.junctions), 'junction')}"]
    for road in plan.roads:
        lines += _road_lines(road)
    return lines


def _count(number: int, word: str) -> str:
    return f"{number} {word}{'s' * (number != 1)}"


def _road_lines(road: PlannedRoad) -> Iterator[str]:
    body = road.body
    name = f' "{body.config.name}"' if body.config.name else ""
    shape = "closed" if body.config.closed else f"turns by {degrees(_turn(body)):.4g} deg"
    yield f"road {road.id}{name}: {body.length_m:.3f} m, {shape}"
    yield f"  radii m        {_radii(body)}"
    yield f"  heights m      {_heights(body)}"
    for section in body.layout.sections:
        where = f"{section.start_m:.1f} to {section.end_m:.1f} m"
        yield f"  lanes          {where}: {_lanes(body.layout, section)}"
    for border in body.layout.borders:
        yield f"  border {border:<7} {_marks(body.marks[border])}"
    for line in body.extra:
        where = f"{line.from_m:.1f} to {line.to_m:.1f} m"
        yield f"  {line.name:<14} {where}: {line.paint.kind}, {line.paint.colour}"
    for key, count in (
        ("crosswalks", len(body.config.crosswalk)),
        ("stop lines", len(body.config.stop_line)),
        ("bumps", len(body.config.bump)),
        ("rough", len(body.config.rough)),
    ):
        if count:
            yield f"  {key:<14} {count}"


def _turn(body: Body) -> float:
    return sum(element.turn_rad for element in body.line.elements)


def _radii(body: Body) -> str:
    found = [
        f"{'left' if element.start_per_m > 0 else 'right'} {1.0 / abs(element.start_per_m):.6g}"
        for element in body.line.elements
        if element.start_per_m == element.end_per_m != 0.0
    ]
    spirals = sum(element.start_per_m != element.end_per_m for element in body.line.elements)
    return f"{', '.join(found) or 'straight'}; {_count(spirals, 'clothoid')}"


def _heights(body: Body) -> str:
    s = np.linspace(0.0, body.length_m, 2001)
    z, grade, _ = Cubics.of(body.elevation).at(s)
    tilt = Cubics.of(body.superelevation).at(s)[0]
    steepest = 100.0 * float(np.abs(grade).max())
    return (
        f"{float(z.min()):.2f} to {float(z.max()):.2f}, up to {steepest:.2f} % steep, "
        f"superelevation up to {100.0 * float(np.tan(np.abs(tilt)).max()):.2f} %"
    )


def _lanes(layout: Layout, section: PlannedSection) -> str:
    start_m, end_m = section.start_m, section.end_m
    words = []
    for number in sorted(section.ids, reverse=True):
        if number == 0:
            words.append("|")
            continue
        lane = layout.lanes[number]
        widths = [value_at(lane.width, s) for s in (start_m, (start_m + end_m) / 2.0, end_m - 1e-9)]
        low, high = min(widths), max(widths)
        width = f"{high:.4g}" if high - low < 1e-6 else f"{low:.4g}-{high:.4g}"
        words.append(f"{section.ids[number]} {lane.config.kind} {width} m")
    return ", ".join(words).replace(", |,", " |").replace(", |", " |").replace("|, ", "| ")


def _marks(marks: tuple[Mark, ...]) -> str:
    shown = []
    for mark in marks[:6]:
        word = mark.paint.kind if mark.paint.kind == "none" else f"{mark.paint.kind} {mark.paint.colour}"
        if not mark.valid:
            word += " (overridden)"
        shown.append(f"{mark.start_m:.1f} {word}")
    more = len(marks) - len(shown)
    return "; ".join(shown) + (f"; and {more} more" if more else "")

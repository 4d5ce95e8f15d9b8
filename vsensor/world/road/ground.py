"""Paint on the ground that is no lane line: crosswalks and stop lines as polygons in s and t."""

from dataclasses import dataclass

from vsensor.errors import ConfigError
from vsensor.world.road.config import CrosswalkConfig, RoadConfig, StopLineConfig
from vsensor.world.road.layout import Layout

Corners = tuple[tuple[float, float], ...]
SIDES = {"left": (1,), "right": (-1,), "both": (1, -1)}


@dataclass(frozen=True, slots=True)
class Polygons:
    """One crosswalk or stop line: `corners` (s, t) of each painted polygon, its extent in t and s."""

    config: CrosswalkConfig | StopLineConfig
    corners: tuple[Corners, ...]
    extent_m: tuple[float, float]
    s_m: tuple[float, float]


def ground_paint(config: RoadConfig, layout: Layout, where: str) -> tuple[Polygons, ...]:
    """Return the polygons of all crosswalks and stop lines; raises ConfigError."""
    crosswalks = [
        _crosswalk(one, layout, f"{where}.crosswalk[{number}]") for number, one in enumerate(config.crosswalk)
    ]
    lines = [
        _stop_line(one, layout, f"{where}.stop_line[{number}]") for number, one in enumerate(config.stop_line)
    ]
    return (*crosswalks, *lines)


def _crosswalk(config: CrosswalkConfig, layout: Layout, where: str) -> Polygons:
    s0, s1 = config.at_m, config.at_m + config.length_m
    layout.check_stretch(s0, s1, where)
    right_m, left_m = _driven(layout, s0, (1, -1), where)
    stripes, t = [], right_m
    while t < left_m - 1e-9:
        upper = min(t + config.stripe_m, left_m)
        stripes.append(_box(s0, s1, t, upper))
        t += config.stripe_m + config.gap_m
    return Polygons(config, tuple(stripes), (right_m, left_m), (s0, s1))


def _stop_line(config: StopLineConfig, layout: Layout, where: str) -> Polygons:
    s0, s1 = config.at_m, config.at_m + config.width_m
    layout.check_stretch(s0, s1, where)
    right_m, left_m = _driven(layout, s0, SIDES[config.side], where)
    return Polygons(config, (_box(s0, s1, right_m, left_m),), (right_m, left_m), (s0, s1))


def _box(s0: float, s1: float, t0: float, t1: float) -> Corners:
    return ((s0, t0), (s1, t0), (s1, t1), (s0, t1))


def _driven(layout: Layout, s_m: float, sides: tuple[int, ...], where: str) -> tuple[float, float]:
    found = layout.driven_between(s_m, sides)
    if found is None:
        raise ConfigError(f"{where}.at_m = {s_m:g}: no lane of this side is driven on there")
    return found

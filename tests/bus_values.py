"""Estimates and values that the tests of the bus side share."""

import numpy as np

from vsensor.types import (
    Boundary,
    Colour,
    EgoState,
    LaneEstimate,
    MarkingKind,
    SensorMode,
    Side,
    Tick,
    frozen,
)

PERIOD_NS = 40_000_000
SIDES_AT_M = {Side.LEFT: 1.8, Side.RIGHT: -1.7, Side.NEXT_LEFT: 5.3, Side.NEXT_RIGHT: -5.2}


def slot(index):
    return Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)


def boundary(side, coefficients, **changes):
    size = len(coefficients)
    facts = {
        "side": side,
        "coefficients": frozen(coefficients),
        "covariance": frozen(np.zeros((size, size))),
        "x_min_m": 4.0,
        "x_max_m": 80.0,
        "quality": 4,
        "kind": MarkingKind.DASHED,
        "colour": Colour.WHITE,
        "width_m": 0.15,
        "measured": True,
        "marking": 0,
        "points": 0,
    }
    return Boundary(**{**facts, **changes})


def estimate(*boundaries, index=0, **changes):
    facts = {"exposed_at_ns": index * PERIOD_NS, "image_index": index, "boundaries": boundaries}
    return LaneEstimate(**{**facts, **changes})


def four_lines(index=0, bend=(0.01, 1e-3, 2e-6)):
    return estimate(*(boundary(side, [y, *bend]) for side, y in SIDES_AT_M.items()), index=index)


def ego(speed_mps=20.0, yaw_rate_radps=0.0):
    return EgoState(
        t_ns=0, position_world_m=frozen([0, 0, 0]), speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps
    )


AVAILABLE = SensorMode.AVAILABLE

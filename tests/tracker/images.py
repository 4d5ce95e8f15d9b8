"""Lines as the tracker gets them, and a drive over images of them."""

import numpy as np

from tests.lines import ego, tick
from vsensor.tracker import TrackerConfig, assign, initial_state
from vsensor.types import Colour, Fit, MarkingKind, Side, Sighting, frozen

LEFT, RIGHT, NEXT_LEFT, NEXT_RIGHT = Side.LEFT, Side.RIGHT, Side.NEXT_LEFT, Side.NEXT_RIGHT
SIDES_ONLY = TrackerConfig(confirm_images=1, coast_s=0.0)
"""Every line counts at once and is never predicted: what remains is which line is on which side."""


def line(*coefficients, x_min_m=4.0, x_max_m=80.0, points=500):
    coefficients = coefficients if len(coefficients) > 1 else (*coefficients, 0.0)
    return Fit(
        coefficients=frozen(np.array(coefficients, dtype=float)),
        covariance=frozen(1e-6 * np.eye(len(coefficients))),
        x_min_m=x_min_m,
        x_max_m=x_max_m,
        residual_std_m=0.01,
        points=points,
    )


def sighting(fit, number=0, quality=4):
    """What one image shows of a line; `number` stands for its marking."""
    return fit and Sighting(
        fit=fit,
        quality=quality,
        kind=MarkingKind.DASHED,
        colour=Colour.YELLOW,
        width_m=0.15,
        marking=number,
        marking_id=100 + number,
    )


def shown(fits):
    """Return the sightings of fits; None is a line without one."""
    return tuple(sighting(fit, number) for number, fit in enumerate(fits))


def drive(images, speed_mps=0.0, config=SIDES_ONLY, state=None, first=0, yaw_rate_radps=0.0):
    """Run over images (tuples of fits); return per image the assignment, and the last state."""
    found = []
    state = initial_state() if state is None else state
    for index, fits in enumerate(images, first):
        ego_ = ego(speed_mps, yaw_rate_radps)
        state, assignment = assign(config, state, shown(fits), ego_, tick(index))
        found.append(assignment)
    return found, state

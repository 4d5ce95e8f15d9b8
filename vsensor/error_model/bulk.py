"""Errors of many images at once, as the sensor applies them to points: for closing the loop through the fit.

    white = random.standard_normal((100_000, grid_size(model)))
    errors_m = applied_errors(model, x_m, 30.0, white)                 (100_000, N)
    reported_m = errors_m @ lanefit.operator(fit_config, x_m).T        (100_000, order + 1), powers of x

The same white numbers with another model give errors that differ by the models alone.
"""

import numpy as np

from vsensor.error_model.law import ErrorLaw, ErrorModelConfig, compile_law, quantile
from vsensor.error_model.model import ErrorModel, library_of
from vsensor.types import Array

_BLOCK = 4096


def grid_size(model: ErrorModel) -> int:
    """Return how many normal numbers an image of one line takes."""
    return len(_law(model).grid_m)


def applied_errors(model: ErrorModel, x_m: Array, speed_mps: float, white: Array) -> Array:
    """Return the errors (M, N) of M images at `x_m` (N,) from standard normal numbers (M, grid_size).

    Rows of `white` that are independent give independent images; an AR(1) process gives one in time.
    """
    law = _law(model)
    one = law.models["all"]
    table = one.at_speed(speed_mps)
    to_x = np.array([np.interp(x_m, law.grid_m, row) for row in np.eye(len(law.grid_m))])
    found = np.empty((len(white), len(x_m)))
    for start in range(0, len(white), _BLOCK):
        z = white[start : start + _BLOCK] @ one.factor.T
        found[start : start + _BLOCK] = quantile(one.knots, table, z) @ to_x
    return found


def _law(model: ErrorModel) -> ErrorLaw:
    return compile_law(ErrorModelConfig(), library_of(model, ""))

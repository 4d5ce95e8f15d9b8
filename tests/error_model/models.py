"""Small error models for tests of what makes errors of them."""

import numpy as np

from tests.lines import line_points, tick
from vsensor.draws import Draws
from vsensor.error_model import (
    Conditions,
    ErrorModelConfig,
    apply,
    compile_law,
    initial_state,
    library_of,
    normal_model,
)

SPEED_MPS = 30.0
X_M = np.arange(5.0, 101.0, 1.0)
RANGE_M, GRID_MPS = np.arange(0.0, 121.0, 10.0), np.array([0.0, 20.0, 40.0])
STD_M = 0.01 * (RANGE_M[:, None] + GRID_MPS[None, :])


def at(speed_mps=SPEED_MPS, **conditions):
    return Conditions(speed_mps=speed_mps, **conditions)


def flat_model(**changes):
    """A normal model whose errors grow by 1 cm a metre and 1 cm a (m/s): every interpolation is exact."""
    given = {
        "range_m": RANGE_M,
        "speed_mps": GRID_MPS,
        "levels": np.array([0.5, 0.95]),
        "absolute_m": np.stack([STD_M, 2.0 * STD_M]),
        "std_m": STD_M,
        "correlation_time_s": 0.8,
        "correlation_length_m": 50.0,
    }
    return normal_model(**given | changes)


def constant_model(error_m):
    return flat_model(absolute_m=np.full((2, 13, 3), error_m))


def law_of(model, mode="volume", **config):
    return compile_law(ErrorModelConfig(mode=mode, **config), library_of(model, "test"))


def once(law, lines, speed_mps=SPEED_MPS, seed=1, index=0):
    """Return the lines moved by the errors of one image, the first one."""
    ids = tuple(range(len(lines.marking)))
    return apply(law, initial_state(), Draws(seed), tick(index), at(speed_mps), ids, lines)[1]


def two_straight_lines():
    return line_points((X_M, np.full(len(X_M), 1.75)), (X_M, np.full(len(X_M), -1.75)))


def many_lines(count, x_m):
    return line_points(*[(np.array(x_m), np.zeros(len(x_m)))] * count)


def errors(lines):
    return lines.points_ego_m[:, 1].reshape(len(lines.marking), -1)

"""A known error law for made drives: Student-t, wider with range and speed, lost lines, quality, range.

What is exact is what the points are moved by; `reported_quantiles_m` says what the fit makes of it.
"""

import numpy as np
from scipy.stats import t as student_t

from vsensor.error_model import ErrorLibrary, ErrorModel, Rule, library_of, model_of
from vsensor.error_model.bulk import applied_errors, grid_size
from vsensor.lanefit import LaneFitConfig, operator
from vsensor.types import Array

DEGREES = 5
CORRELATION_TIME_S, CORRELATION_LENGTH_M = 0.8, 50.0
LEVELS = np.array([0.5, 0.8, 0.9, 0.95, 0.97, 0.99])
SIGNED_LEVELS = np.concatenate(
    [[0.0005, 0.001, 0.0025, 0.005, 0.01], np.linspace(0.02, 0.98, 49), [0.99, 0.995, 0.9975, 0.999, 0.9995]]
)
RANGE_M, SPEED_MPS = np.arange(0.0, 121.0, 5.0), np.arange(0.0, 51.0, 5.0)
REGION_MPS, REGION_M = np.array([0.0, 30.0]), np.array([30.0, 100.0])
POINT_STEP_M = 0.5


def scale_m(range_m: Array, speed_mps: Array | float) -> Array:
    """Return the scale of the law: 95 % of the errors are within 2.57 of it (5 degrees of freedom)."""
    growth = 0.6 + 0.4 * np.asarray(speed_mps) / 33.3
    x = np.asarray(range_m)
    return np.sqrt(0.012**2 + growth**2 * ((0.75e-3 * x) ** 2 + (3.5e-5 * x**2 / 2) ** 2))


def student_model(wider: float = 1.0, *, lossy: bool = True) -> ErrorModel:
    """Return the model; `wider` times every error."""
    scale = wider * scale_m(RANGE_M[:, None], SPEED_MPS[None, :])
    return model_of(
        range_m=RANGE_M,
        speed_mps=SPEED_MPS,
        levels=LEVELS,
        absolute_m=student_t.ppf(0.5 + LEVELS / 2, DEGREES)[:, None, None] * scale,
        signed_levels=SIGNED_LEVELS,
        signed_m=student_t.ppf(SIGNED_LEVELS, DEGREES)[:, None, None] * scale,
        correlation_time_s=CORRELATION_TIME_S,
        correlation_length_m=CORRELATION_LENGTH_M,
        region_speed_mps=REGION_MPS,
        region_range_m=REGION_M,
        **(_losses() if lossy else {}),
    )


def _losses() -> dict[str, Array | float]:
    """Return losses of 0.9 s in the median every 25 s, ranges of 0.7 to 1, quality 3 and 4 mostly."""
    levels = np.linspace(0.0, 1.0, 201)
    tail = -np.log1p(-np.minimum(levels, 0.9975))
    share = np.array([0.0, 0.04, 0.10, 0.26, 0.60])
    return {
        "dwell_levels": levels,
        "lost_dwell_s": 0.2 + 1.0 * tail,
        "seen_dwell_s": 1.0 + 35.0 * tail,
        "range_share_levels": levels,
        "range_share": 0.7 + 0.3 * np.sqrt(levels),
        "range_time_s": 1.5,
        "quality_step": 0.9 * np.eye(5)
        + 0.1 * share
        + 0.9 * np.diag([-1.0, 0, 0, 0, 0])
        + _first(0.9 * share),
        "quality_period_s": 0.04,
    }


def _first(row: Array) -> Array:
    """Return a matrix (5, 5) of zeros but for its first row: state 0 is never visited, and left at once."""
    matrix = np.zeros((5, 5))
    matrix[0] = row
    return matrix


def student_library() -> ErrorLibrary:
    """Return the model by day, and 1.5 times its errors at night."""
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    source = "made: Student-t of 5 degrees of freedom, known in closed form"
    return ErrorLibrary(
        source=source, rule=rule, models={"day": student_model(), "night": student_model(1.5)}
    )


def day_library() -> ErrorLibrary:
    """Return the model alone."""
    return library_of(student_model(), "made: Student-t of 5 degrees of freedom, known in closed form", "day")


def reported_quantiles_m(
    model: ErrorModel, levels: Array, range_m: Array, speed_mps: float, count: int = 200_000, seed: int = 0
) -> Array:
    """Return quantiles (L, R) of the signed error of the reported cubic, from `count` images.

    A line of points every half metre up to the operating range; where nothing is reported NaN. The std of a
    quantile of level p is sqrt(p (1 - p) / count) over the density: 0.3 % of the 95 % surface.
    """
    end_m = float(np.interp(speed_mps, model.region_speed_mps, model.region_range_m))
    points_m = np.arange(POINT_STEP_M / 2, end_m, POINT_STEP_M)
    to_ranges = np.vander(range_m, 4, increasing=True) @ operator(LaneFitConfig(), points_m)
    random, found = np.random.default_rng(seed), []
    for _ in range(max(count // 10_000, 1)):
        white = random.standard_normal((10_000, grid_size(model)))
        found.append(applied_errors(model, points_m, speed_mps, white) @ to_ranges.T)
    quantiles = np.quantile(np.concatenate(found), levels, axis=0)
    return np.where(range_m <= end_m, quantiles, np.nan)

"""A known error law for made drives: Student-t, wider with range and speed, lost lines, quality, range.

What is exact is what the points are moved by; `reported_errors_m` says what the fit makes of it.
"""

from collections.abc import Callable
from math import comb

import numpy as np
from scipy.stats import t as student_t

from vsensor.error_model import ErrorLibrary, ErrorModel, Rule, library_of, model_of
from vsensor.error_model.bulk import applied_errors, grid_size
from vsensor.error_model.law import range_grid
from vsensor.field.virtual import POINT_STEP_M, FitSetting, points_at
from vsensor.lanefit import operator
from vsensor.types import Array

DEGREES = 5
CORRELATION_TIME_S, CORRELATION_LENGTH_M = 0.8, 50.0
LEVELS = np.array([0.5, 0.8, 0.9, 0.95, 0.97, 0.99])
SIGNED_LEVELS = np.concatenate(
    [[0.0005, 0.001, 0.0025, 0.005, 0.01], np.linspace(0.02, 0.98, 49), [0.99, 0.995, 0.9975, 0.999, 0.9995]]
)
RANGE_M, SPEED_MPS = np.arange(0.0, 121.0, 5.0), np.arange(0.0, 51.0, 5.0)
REGION_MPS, REGION_M = np.array([0.0, 30.0]), np.array([30.0, 100.0])


def scale_m(range_m: Array, speed_mps: Array | float) -> Array:
    """Return the scale of the law: 95 % of the errors are within 2.57 of it (5 degrees of freedom)."""
    growth = 0.6 + 0.4 * np.asarray(speed_mps) / 33.3
    x = np.asarray(range_m)
    return np.sqrt(0.012**2 + growth**2 * ((0.75e-3 * x) ** 2 + (3.5e-5 * x**2 / 2) ** 2))


def student_model(
    wider: float = 1.0, *, lossy: bool = True, range_m: Array = RANGE_M, speed_mps: Array = SPEED_MPS
) -> ErrorModel:
    """Return the model; `wider` times every error."""
    scale = wider * scale_m(range_m[:, None], speed_mps[None, :])
    return model_of(
        range_m=range_m,
        speed_mps=speed_mps,
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


def cubic_at(range_m: Array) -> Array:
    """Return (R, 4): y at ranges is this times a cubic's coefficients."""
    return np.vander(range_m, 4, increasing=True)


def parabola_at(range_m: Array, origin_m: float) -> Array:
    """Return (R, 4) likewise where the bus has no cubic coefficient, and its origin `origin_m` ahead."""
    powers = np.arange(4)
    shift = np.array([[comb(k, j) * origin_m ** max(k - j, 0) for k in powers] for j in powers[:3]])
    return np.vander(range_m - origin_m, 3, increasing=True) @ shift


def reported_errors_m(
    model: ErrorModel,
    range_m: Array,
    speed_mps: float,
    *,
    setting: FitSetting | None = None,
    read: Callable[[Array], Array] = cubic_at,
    count: int = 200_000,
    seed: int = 0,
) -> Array:
    """Return signed errors (M, R) of the reported line, of about `count` images.

    Of points as `setting` has them, dashes in every place alike, up to the operating range; `read(range_m)`
    (R, 4) is how a reader makes y of the coefficients. NaN at ranges beyond the last point of an image.
    """
    setting = setting or FitSetting()
    random, found = np.random.default_rng(seed), []
    grid = range_grid(model.range_m, model.applied_length_m)
    for phase in range(setting.phases):
        points_m = points_at(model, setting, speed_mps, phase)
        on_points = np.stack([np.interp(points_m, grid, unit) for unit in np.eye(len(grid))], axis=1)
        to_ranges = read(range_m) @ operator(setting.config, points_m) @ on_points
        white = random.standard_normal((count // setting.phases, grid_size(model)))
        errors = applied_errors(model, grid, speed_mps, white) @ to_ranges.T
        found.append(np.where(range_m <= points_m[-1] + POINT_STEP_M, errors, np.nan))
    return np.concatenate(found)


def quantiles_m(errors_m: Array, levels: Array) -> Array:
    """Return quantiles (L, R) of errors (M, R), NaN where there are none.

    The std of a quantile of level p is sqrt(p (1 - p) / M) over the density: of 200,000 images 0.3 % of the
    95 % surface.
    """
    columns = [column[np.isfinite(column)] for column in errors_m.T]
    nothing = np.full(len(levels), np.nan)
    return np.stack([np.quantile(one, levels) if len(one) else nothing for one in columns], axis=1)

"""What an error model says: surfaces over range and speed, how long errors last, what the sensor loses.

A library is one or more models and the rule that picks one; it is what a file holds.
All laws are those of the *reported* polynomial. `applied_*` is what its points must be moved by before the
fit so that this comes out; it equals the reported law where nobody closed that loop.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from vsensor.error_model.rule import Rule, always
from vsensor.types import Array, BoolArray, frozen

_NORMAL_Z = np.array([-3.0, 0.0, 3.0])
NORMAL_KNOTS = frozen([0.0013498980316300933, 0.5, 0.9986501019683699])
"""Their levels. They hold a normal law: between and beyond its levels a law is linear in z."""


def _none() -> Array:
    return frozen(np.zeros(0))


def _no_matrix() -> Array:
    return frozen(np.zeros((0, 0)))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorModel:
    """One model: `range_m` (R,), `speed_mps` (V,), `levels` (L,), `signed_levels` (S,), all increasing.

    `absolute_m` (L, R, V) is the size of the error not exceeded at a level, `absolute_low_m` and
    `absolute_high_m` its 95 % interval (NaN: not known); `signed_m` (S, R, V) quantiles of the signed
    error, left positive; neither falls with the level. `rows` and `seconds` (R, V) stand behind each cell;
    `blind` (R, V) has too few, its values may be NaN. `fir` (K,) smoothed along the speed.

    `region_*` (G,): the operating range over speed. `lost_dwell_s`, `seen_dwell_s` at `dwell_levels` (Q,):
    quantiles of how long a line stays lost and reported. `range_share` at `range_share_levels`: quantiles of
    the view range's end over the operating range. `quality_step` (5, 5), `level_step` (L + 1, L + 1): row
    = from, column = to, after one period; level k: the error's size is above k of the levels.
    What was not fitted is empty, and not made.
    """

    range_m: Array
    speed_mps: Array
    levels: Array
    absolute_m: Array
    absolute_low_m: Array
    absolute_high_m: Array
    signed_levels: Array
    signed_m: Array
    applied_signed_m: Array
    applied_length_m: float
    applied_time_s: float
    correlation_length_m: float
    correlation_time_s: float
    rows: Array
    seconds: Array
    blind: BoolArray
    fir: Array = field(default_factory=_none)
    fir_order: float = 0.0
    fir_cutoff_s_per_m: float = 0.0
    region_speed_mps: Array = field(default_factory=_none)
    region_range_m: Array = field(default_factory=_none)
    region_level: float = 0.95
    dwell_levels: Array = field(default_factory=_none)
    lost_dwell_s: Array = field(default_factory=_none)
    seen_dwell_s: Array = field(default_factory=_none)
    range_share_levels: Array = field(default_factory=_none)
    range_share: Array = field(default_factory=_none)
    range_time_s: float = 1.0
    quality_period_s: float = 0.04
    quality_step: Array = field(default_factory=_no_matrix)
    level_period_s: float = 0.04
    level_step: Array = field(default_factory=_no_matrix)
    log_count: float = 0.0
    hours: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorLibrary:
    """The models of a file by name, and the rule that picks one; `source`: from what data, when, how."""

    source: str
    rule: tuple[Rule, ...]
    models: Mapping[str, ErrorModel]


def model_of(
    *,
    range_m: Array,
    speed_mps: Array,
    levels: Array,
    absolute_m: Array,
    signed_levels: Array,
    signed_m: Array,
    correlation_time_s: float,
    correlation_length_m: float,
    **fitted: Any,
) -> ErrorModel:
    """Return a model of what must be known; `fitted` is the rest, as far as it is.

    Without it: no interval, the applied law is the reported one, no rows, no blind cell.
    """
    cells = (len(range_m), len(speed_mps))
    rest: dict[str, Any] = {
        "absolute_low_m": np.full(np.shape(absolute_m), np.nan),
        "absolute_high_m": np.full(np.shape(absolute_m), np.nan),
        "applied_signed_m": signed_m,
        "applied_length_m": correlation_length_m,
        "applied_time_s": correlation_time_s,
        "rows": np.zeros(cells),
        "seconds": np.zeros(cells),
        "blind": np.zeros(cells, bool),
    }
    return ErrorModel(
        range_m=range_m,
        speed_mps=speed_mps,
        levels=levels,
        absolute_m=absolute_m,
        signed_levels=signed_levels,
        signed_m=signed_m,
        correlation_time_s=correlation_time_s,
        correlation_length_m=correlation_length_m,
        **rest | fitted,
    )


def normal_model(
    *, range_m: Array, speed_mps: Array, levels: Array, std_m: Array, absolute_m: Array, **known: Any
) -> ErrorModel:
    """Return a model whose signed errors are normal with standard deviation `std_m` (R, V)."""
    return model_of(
        range_m=range_m,
        speed_mps=speed_mps,
        levels=levels,
        absolute_m=absolute_m,
        signed_levels=NORMAL_KNOTS,
        signed_m=frozen(_NORMAL_Z[:, None, None] * std_m),
        **known,
    )


def library_of(model: ErrorModel, source: str, name: str = "all") -> ErrorLibrary:
    """Return a library of one model that always holds."""
    return ErrorLibrary(source=source, rule=always(name), models={name: model})

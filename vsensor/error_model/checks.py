"""What an error model must be so that the stages can work with it, entry by entry."""

from collections.abc import Iterator, Mapping
from dataclasses import fields
from typing import Any

import numpy as np

from vsensor.error_model.model import ErrorModel
from vsensor.types import Array

KEYS = tuple(field.name for field in fields(ErrorModel))
SCALARS = tuple(field.name for field in fields(ErrorModel) if field.type in (float, "float"))
_SUM = 1e-6
"""Rows of a Markov matrix may miss 1 by this much: they were rounded somewhere."""
_OVER_CELLS = ("absolute_m", "signed_m", "applied_signed_m")
_INTERVALS = ("absolute_low_m", "absolute_high_m")

_PLAUSIBLE = {
    **dict.fromkeys(("range_m", "region_range_m", *_OVER_CELLS), (-1e3, 1e3, "m")),
    **dict.fromkeys(("speed_mps", "region_speed_mps"), (-1e3, 1e3, "m/s")),
    **dict.fromkeys(("applied_length_m", "correlation_length_m"), (1e-3, 1e6, "m")),
    **dict.fromkeys(("applied_time_s", "correlation_time_s", "range_time_s"), (1e-6, 1e9, "s")),
    **dict.fromkeys(("quality_period_s", "level_period_s"), (1e-3, 1e6, "s")),
    **dict.fromkeys(("lost_dwell_s", "seen_dwell_s"), (0.0, 1e9, "s")),
    "range_share": (0.0, 100.0, ""),
    "signed_levels": (1e-12, 1.0 - 1e-12, ""),
}
"""Beyond these a number is a mistake in the file, and could not be computed with."""

Entries = Mapping[str, Any]
Check = tuple[str, Any, str]


def first_fault(entries: Entries) -> str | None:
    """Return what is wrong with the entries of one model, `entry: what was expected`; None if nothing."""
    for key in KEYS:
        if entries[key].dtype.kind not in ("b" if key == "blind" else "fiu"):
            return f"{key}: {'true or false' if key == 'blind' else 'numbers'} expected"
        if key in SCALARS and entries[key].ndim:
            return f"{key}: one number expected"
        if key not in (*_OVER_CELLS, *_INTERVALS, "blind") and not np.isfinite(entries[key]).all():
            return f"{key}: finite numbers expected"
    for stage in (_shapes, _finite, _values, _fitted, _plausible):
        for key, good, expected in stage(entries):
            if not good:
                return f"{key}: {expected} expected"
    return None


def _shapes(has: Entries) -> Iterator[Check]:
    for key in ("range_m", "speed_mps", "signed_levels"):
        yield key, increases(has[key], 2), "at least 2 increasing values"
    yield "levels", increases(has["levels"], 1), "increasing values"
    cells = (len(has["range_m"]), len(has["speed_mps"]))
    for key in ("absolute_m", *_INTERVALS):
        yield key, has[key].shape == (len(has["levels"]), *cells), "shape (levels, range, speed)"
    for key in ("signed_m", "applied_signed_m"):
        yield (
            key,
            has[key].shape == (len(has["signed_levels"]), *cells),
            "shape (signed levels, range, speed)",
        )
    for key in ("rows", "seconds", "blind"):
        yield key, has[key].shape == cells, "shape (range, speed)"
    yield "fir", has["fir"].ndim == 1, "a list"
    for keys in (
        ("region_speed_mps", "region_range_m"),
        ("dwell_levels", "lost_dwell_s", "seen_dwell_s"),
        ("range_share_levels", "range_share"),
    ):
        for key in keys:
            expected = f"a list as long as {keys[0]}"
            yield key, has[key].ndim == 1 and len(has[key]) == len(has[keys[0]]), expected
    for key, size in (("quality_step", 5), ("level_step", len(has["levels"]) + 1)):
        yield key, has[key].shape in ((size, size), (0, 0)), f"shape ({size}, {size}), or (0, 0) for none,"


def _finite(has: Entries) -> Iterator[Check]:
    for key in _OVER_CELLS:
        is_finite = np.isfinite(has[key]).all(axis=0)
        yield key, is_finite[~has["blind"]].all(), "finite numbers outside of blind"
    yield "blind", not has["blind"].all(), "a cell that is not blind"


def _values(has: Entries) -> Iterator[Check]:
    for key in ("levels", "signed_levels"):
        yield key, np.all((has[key] > 0.0) & (has[key] < 1.0)), "values between 0 and 1"
    for key in _OVER_CELLS:
        steps = np.diff(np.where(has["blind"], 0.0, has[key]), axis=0)
        yield key, np.all(steps >= 0.0), "no value that falls with the level"
    for key in ("absolute_m", "rows", "seconds", "log_count", "hours", "fir_order", "fir_cutoff_s_per_m"):
        yield key, not np.any(has[key] < 0.0), "no negative value"
    lengths = ("applied_length_m", "correlation_length_m")
    times = ("applied_time_s", "correlation_time_s", "range_time_s", "quality_period_s", "level_period_s")
    for key in (*lengths, *times):
        yield key, has[key] > 0.0, "one positive number"


def _fitted(has: Entries) -> Iterator[Check]:
    yield "region_speed_mps", increases(has["region_speed_mps"], 0), "increasing values"
    yield "region_range_m", np.all(has["region_range_m"] > 0.0), "positive values"
    yield "region_level", 0.0 < has["region_level"] < 1.0, "a value between 0 and 1"
    for key in ("dwell_levels", "range_share_levels"):
        yield key, increases(has[key], 0), "increasing values"
        yield key, np.all((has[key] >= 0.0) & (has[key] <= 1.0)), "values from 0 to 1"
    for key in ("lost_dwell_s", "seen_dwell_s", "range_share"):
        yield (
            key,
            np.all(has[key] >= 0.0) and np.all(np.diff(has[key]) >= 0.0),
            "values that never fall, from 0",
        )
    for key in ("quality_step", "level_step"):
        good = np.all(has[key] >= 0.0) and np.all(np.abs(has[key].sum(axis=1) - 1.0) < _SUM)
        yield key, good, "probabilities, each row summing to 1,"


def _plausible(has: Entries) -> Iterator[Check]:
    for key, (low, high, unit) in _PLAUSIBLE.items():
        values = has[key][:, ~has["blind"]] if key in _OVER_CELLS else has[key]
        expected = f"values from {low:g} to {high:g} {unit}".rstrip()
        yield key, np.all((values >= low) & (values <= high)), expected


def increases(values: Array, at_least: int) -> bool:
    """Return whether `values` is a list of at least so many numbers, each above the one before."""
    return bool(values.ndim == 1 and len(values) >= at_least and np.all(np.diff(values) > 0.0))

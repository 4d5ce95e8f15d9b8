"""What P2 does to the offsets of a video afterwards (its 2.5.3 and 2.4.2): thresholds, gaps, ends.

raw        thresholds            gaps up to 2 s          ends
-- x --    --   --               -------                 _------_
   |          NaN                  straight between        held level
0 < offset < 4 m; no faster sideways than a vehicle moves
"""

from dataclasses import replace
from typing import Annotated

import numpy as np
from msgspec import Meta

from vsensor.schema import Config
from vsensor.types import Array, BoolArray, frozen
from vsensor.video.rows import Rows


class LovConfig(Config, frozen=True, kw_only=True):
    """`[lov]`: which offsets are believed, and which gaps are filled.

    `max_offset_m`: an offset lies between 0 and this, on its own side (P2: 4 m). `max_lateral_mps`: two
    offsets one after the other differ by no more than this times the time between them. P2 prints 0.1 m,
    which at its 4 Hz is 0.4 m/s; its data has up to 2.5 m/s, so at 0.4 real movements would go.
    `longest_gap_s`: longer gaps stay (P2: 20 values at 10 Hz). `fill`: whether gaps are filled at all, and
    `extrapolate` those at the beginning and the end too, as P2 leaves to its user.
    """

    max_offset_m: Annotated[float, Meta(gt=0.0, le=20.0)] = 4.0
    max_lateral_mps: Annotated[float, Meta(gt=0.0, le=100.0)] = 2.5
    longest_gap_s: Annotated[float, Meta(ge=0.0, le=60.0)] = 2.0
    fill: bool = False
    extrapolate: bool = True


def processed(config: LovConfig, rows: Rows) -> Rows:
    """Return rows of which both offsets went through `plausible` and, where wanted, `filled`.

    A filled offset has confidence 0: nothing was seen there.
    """
    left_m = plausible(config, rows.t_s, rows.left_offset_m)
    right_m = -plausible(config, rows.t_s, -rows.right_offset_m)
    seen_left, seen_right = np.isfinite(left_m), np.isfinite(right_m)
    if config.fill:
        left_m, right_m = filled(config, rows.t_s, left_m), filled(config, rows.t_s, right_m)
    heading_rad = np.where(seen_left | seen_right, rows.heading_rad, np.nan)
    along = np.where(np.isfinite(heading_rad), np.cos(heading_rad), 1.0)
    return replace(
        rows,
        left_offset_m=frozen(left_m),
        right_offset_m=frozen(right_m),
        lane_width_m=frozen((left_m - right_m) * along),
        heading_rad=frozen(heading_rad),
        left_confidence=frozen(np.where(seen_left, rows.left_confidence, 0), np.uint8),
        right_confidence=frozen(np.where(seen_right, rows.right_confidence, 0), np.uint8),
    )


def plausible(config: LovConfig, t_s: Array, offset_m: Array) -> Array:
    """Return the offsets (N,), positive towards their side, without those beyond the thresholds (P2 2.25).

    Of a jump the value after it goes, both ways; so a value that stands out takes the next one with it.
    """
    kept: Array = np.where((offset_m > 0.0) & (offset_m < config.max_offset_m), offset_m, np.nan)
    jumps = np.abs(np.diff(kept)) > config.max_lateral_mps * np.diff(t_s)
    kept[1:][jumps] = np.nan
    return kept


def filled(config: LovConfig, t_s: Array, offset_m: Array) -> Array:
    """Return the offsets (N,) with gaps filled that are no longer than `longest_gap_s` (P2 2.26).

    Straight between their neighbours; level at the beginning and the end, where `extrapolate` says so.
    """
    known = np.isfinite(offset_m)
    if not known.any() or known.all():
        return offset_m
    result = offset_m.copy()
    step_s = float(np.median(np.diff(t_s)))
    for first, last in _stretches(~known):
        at_end = first == 0 or last == len(t_s) - 1
        is_short = t_s[last] - t_s[first] + step_s <= config.longest_gap_s + 0.001 * step_s
        if is_short and (config.extrapolate or not at_end):
            gap = slice(first, last + 1)
            result[gap] = np.interp(t_s[gap], t_s[known], offset_m[known])
    return result


def _stretches(mask: BoolArray) -> list[tuple[int, int]]:
    """Return first and last place of each run of True."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    starts, ends = np.flatnonzero(edges == 1), np.flatnonzero(edges == -1) - 1
    return list(zip(starts.tolist(), ends.tolist(), strict=True))

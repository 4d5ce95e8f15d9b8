"""Many plain numbers rounded to raw values at once."""

import math
from collections.abc import Sequence
from operator import itemgetter
from typing import Any

import numpy as np

from vsensor.codec import SignalLayout, number_range
from vsensor.profile import Binding
from vsensor.types import Array, BoolArray, IntArray, SignalValues

WIDEST_EXACT_BITS = 52  # a float64 holds such integers and their halves


class Rounding:
    """Rounds many plain signals at once; gives the same raw values as Binding.raw, one by one.

    The bounds are in the quantity's own unit, so that nothing overflows on the way: lowest and highest
    raw value (SNA excluded), widened by half a step where saturation is counted.
    """

    def __init__(self, bindings: Sequence[Binding]) -> None:
        signals = [binding.signal for binding in bindings]
        self.names = [signal.name for signal in signals]
        self.sources = sorted({binding.quantity for binding in bindings if not binding.wrap})
        self.wraps = sorted({(binding.quantity, binding.wrap) for binding in bindings if binding.wrap})
        place: dict[Any, int] = {key: k for k, key in enumerate([*self.sources, *self.wraps])}
        keys = [(b.quantity, b.wrap) if b.wrap else b.quantity for b in bindings]
        self.take: IntArray = np.array([place[key] for key in keys], dtype=np.int64)
        self.pick = itemgetter(*self.sources) if len(self.sources) > 1 else None
        self.gain, self.bias = _row(b.gain for b in bindings), _row(b.bias for b in bindings)
        self.offset, self.scale = _row(s.offset for s in signals), _row(s.scale for s in signals)
        bounds = [_bounds(binding) for binding in bindings]
        self.low, self.high = _row(b[0] for b in bounds), _row(b[1] for b in bounds)
        half = np.abs(self.scale / self.gain) / 2
        self.too_low, self.too_high = self.low - half, self.high + half
        self.absent = _row(s.sna_raw if s.sna_raw is not None else s.start_raw for s in signals)
        self.codes = _inner_codes(signals)
        self.magnitudes: BoolArray = np.array([bool(b.magnitude_sign) for b in bindings], dtype=bool)
        self.has_magnitudes = bool(self.magnitudes.any())
        self.mask: IntArray = np.array([(1 << s.length) - 1 for s in signals], dtype=np.int64)

    def raws(self, values: SignalValues) -> tuple[list[int], list[str]]:
        """Return raw bits in the bindings' order, and the names of saturated signals."""
        given = self._given(values)
        quantity: Array = np.array(given)[self.take]
        if self.has_magnitudes:
            quantity = np.where(self.magnitudes, np.abs(quantity), quantity)
        outside: BoolArray = (quantity < self.too_low) | (quantity > self.too_high)
        inside = np.minimum(np.maximum(quantity, self.low), self.high)
        raw = np.rint((inside * self.gain + self.bias - self.offset) / self.scale)
        for code in self.codes:
            raw += raw == code  # a number never says "not available"
        raw = np.where(np.isnan(raw), self.absent, raw)
        saturated = [self.names[k] for k in np.flatnonzero(outside)] if outside.any() else []
        bits: list[int] = (raw.astype(np.int64) & self.mask).tolist()
        return bits, saturated

    def _given(self, values: SignalValues) -> list[float]:
        """Return the values of all sources, then of the wrapping counts; NaN for those that are not there."""
        try:
            given = list(self.pick(values)) if self.pick else [values[name] for name in self.sources]
        except KeyError:
            given = [values.get(name, math.nan) for name in self.sources]
        for name, modulus in self.wraps:
            value = values.get(name, math.nan)
            given.append(math.fmod(math.floor(value), modulus) if math.isfinite(value) else value)
        return given


def _row(values: Any) -> Array:
    return np.array(list(values), dtype=np.float64)


def _inner_codes(signals: Sequence[SignalLayout]) -> list[Array]:
    """Return rows of the raw values that are no numbers, ascending in each signal; NaN where there is none.

    Those at the ends are left out: the bounds keep numbers away from them.
    """
    ranges = [number_range(signal) for signal in signals]
    inner = [
        sorted(raw for raw in signal.codes if low < raw < high)
        for signal, (low, high) in zip(signals, ranges, strict=True)
    ]
    depth = max((len(raws) for raws in inner), default=0)
    return [_row(raws[k] if k < len(raws) else math.nan for raws in inner) for k in range(depth)]


def _bounds(binding: Binding) -> tuple[float, float]:
    signal = binding.signal
    low, high = number_range(signal)
    ends = sorted((signal.physical(raw) - binding.bias) / binding.gain for raw in (low, high))
    return ends[0], ends[1]

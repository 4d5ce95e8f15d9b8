"""Single signals: values outside of what is declared, codes that nobody knows, numbers at their last bit."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.frames import Frames
from vsensor.codec import BulkReader, SignalLayout, excess_range, number_range
from vsensor.profile import QUANTITIES, Binding, MessagePlan
from vsensor.types import BoolArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """A signal, and the raw values that it may have: a set of codes, or a range."""

    signal: SignalLayout
    codes: IntArray | None
    low: float
    high: float
    is_number: bool

    def outside(self, raw: IntArray) -> BoolArray:
        """Return which raw values (N,) it should not have; SNA and the like are no values."""
        beyond = (raw < self.low) | (raw > self.high)
        wrong = beyond if self.codes is None else ~np.isin(raw, self.codes)
        return np.asarray(wrong & ~np.isin(raw, list(self.signal.codes)))


class Ranges:
    """Watches the signals of one message that carry a quantity."""

    def __init__(self, plan: MessagePlan, book: Book, *, by_range: bool) -> None:
        self._plan, self._book = plan, book
        self._watched = [
            watched
            for binding in plan.bindings
            if not binding.wrap and not binding.parts and not binding.signal.is_float
            for watched in (_watched(binding, by_range),)
        ]
        self.saturated: dict[str, int] = {}

    def judge(self, frames: Frames) -> None:
        """Judge right frames of the message."""
        frames_used = np.flatnonzero(frames.right)
        if not len(frames_used):
            return
        t_ns, reader = frames.t_ns[frames_used], BulkReader(self._plan.layout, frames.data[frames_used])
        for watched in self._watched:
            name = watched.signal.name
            raw = reader.raw(name).astype(np.int64)
            there = reader.selected(watched.signal)
            wrong = there & watched.outside(raw)
            self._book.note("out_of_range", self._plan.layout.name, t_ns[wrong], subject=name)
            if watched.is_number:
                low, high = number_range(watched.signal)
                at_end = there & ((raw == high) | ((raw == low) & watched.signal.signed))
                if count := int(np.count_nonzero(at_end)):
                    self.saturated[name] = self.saturated.get(name, 0) + count


def _watched(binding: Binding, by_range: bool) -> Watched:
    signal = binding.signal
    low, high = _declared(signal) if by_range else (-np.inf, np.inf)
    return Watched(
        signal=signal,
        codes=_codes(binding),
        low=low,
        high=high,
        is_number=binding.raw_of_code is None and QUANTITIES[binding.quantity].unit != "",
    )


def _codes(binding: Binding) -> IntArray | None:
    """Return the raw values that an enumeration knows; None for a number."""
    quantity = QUANTITIES[binding.quantity]
    if binding.raw_of_code is not None:
        special = (binding.other_raw, binding.error_raw, binding.init_raw)
        return np.array([*binding.raw_of_code.values(), *(raw for raw in special if raw is not None)])
    if quantity.codes is None or binding.gain != 1.0 or binding.signal.scale != 1.0:
        return None
    bias = round(binding.bias - binding.signal.offset)
    return np.array([int(code) + bias for code in quantity.codes])


def _declared(signal: SignalLayout) -> tuple[float, float]:
    """Return the raw values of the declared range.

    [0|1] and [0|0] of many bits are placeholders; what exceeds the bits was never thought about, either.
    """
    low, high = signal.minimum, signal.maximum
    placeholder = (low, high) == (0, 1) and signal.length > 1
    if low is None or high is None or high <= low or placeholder or excess_range(signal, 1.5):
        return -np.inf, np.inf
    ends = sorted(((low - signal.offset) / signal.scale, (high - signal.offset) / signal.scale))
    return ends[0] - 0.5, ends[1] + 0.5


def remarks(saturated: Mapping[str, int]) -> list[str]:
    """Return a sentence on signals that stood at their last number."""
    shown = ", ".join(f"{name} {count} times" for name, count in sorted(saturated.items()))
    return [f"at the last number that their bits hold: {shown}"] if shown else []

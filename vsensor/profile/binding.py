"""Signals bound to what they carry: from a quantity to raw bits and back, one value or a column."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsensor.codec import BulkReader, SignalLayout, quantise, to_physical
from vsensor.types import Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Part:
    """A signal that carries the bits of a raw integer from bit `low` on."""

    signal: SignalLayout
    low: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Binding:
    """A signal that carries a quantity: bus value = quantity * gain + bias, modulo `wrap` if that is not 0.

    `raw_of_code` maps enumeration codes to raw values, None for numbers; `other_raw` is for other codes.
    `magnitude_sign` is 0 where the bus has the sign, else the sign that it leaves out. `error_raw` and
    `init_raw` stand for every value while the sensor is blocked or failed, or starts. With `parts`
    (lowest bits first) `signal` is no signal of the message but the raw integer that they make up.
    """

    signal: SignalLayout
    quantity: str
    gain: float = 1.0
    bias: float = 0.0
    wrap: int = 0
    raw_of_code: Mapping[int, int] | None = None
    other_raw: int | None = None
    magnitude_sign: float = 0.0
    error_raw: int | None = None
    init_raw: int | None = None
    parts: tuple[Part, ...] = ()

    @property
    def signals(self) -> tuple[SignalLayout, ...]:
        """The signals of the message that it uses."""
        return tuple(part.signal for part in self.parts) or (self.signal,)

    def raw(self, value: float) -> tuple[int, bool]:
        """Return the raw value of a quantity, and whether it was saturated."""
        if self.raw_of_code is not None and not math.isnan(value):
            code = int(value) if math.isfinite(value) else None
            raw = self.raw_of_code.get(code, self.other_raw) if code is not None else self.other_raw
            return quantise(self.signal, math.nan) if raw is None else (raw, False)
        if self.wrap and math.isfinite(value):
            value = math.fmod(math.floor(value), self.wrap)
        if self.magnitude_sign:
            value = abs(value)
        return quantise(self.signal, value * self.gain + self.bias)

    def value(self, raw: int) -> float:
        """Return the quantity of a raw value; NaN for SNA and the like, and for what the table lacks."""
        if not self.signal.is_float and (raw == self.signal.sna_raw or raw in self.signal.reserved):
            return math.nan
        if self.raw_of_code is not None:
            if raw in (self.error_raw, self.init_raw) and raw not in self.raw_of_code.values():
                return math.nan
            return next((float(code) for code, known in self.raw_of_code.items() if known == raw), math.nan)
        value = (to_physical(self.signal, raw) - self.bias) / self.gain
        return self.magnitude_sign * abs(value) if self.magnitude_sign else value

    def raw_in(self, raws: Mapping[str, int]) -> int | None:
        """Return the raw value among those of a frame's signals; None if the frame does not carry it."""
        if not self.parts:
            return raws.get(self.signal.name)
        whole = 0
        for part in self.parts:
            if part.signal.name not in raws:
                return None
            whole |= (raws[part.signal.name] & ((1 << part.signal.length) - 1)) << part.low
        return whole - (1 << self.signal.length) if whole > self.signal.raw_max else whole

    def column(self, reader: BulkReader) -> Array:
        """Return the quantity (N,) of many frames of the message; NaN where it is not available."""
        physical = self._physical(reader)
        signal = self.signal
        if self.raw_of_code is not None:
            values = np.full(len(physical), np.nan)
            for code, raw in reversed(list(self.raw_of_code.items())):
                values[physical == signal.physical(raw)] = code
        else:
            values = (physical - self.bias) / self.gain
            values = self.magnitude_sign * np.abs(values) if self.magnitude_sign else values
        if not signal.is_float:
            for raw in signal.codes:
                values[physical == signal.physical(raw)] = np.nan
        return values

    def _physical(self, reader: BulkReader) -> Array:
        if not self.parts:
            return reader.physical(self.signal.name)
        whole: Any = np.uint64(0)
        for part in self.parts:
            bits = reader.raw(part.signal.name).astype(np.uint64) & np.uint64((1 << part.signal.length) - 1)
            whole = whole | (bits << np.uint64(part.low))
        if self.signal.signed:
            spare = np.uint64(64 - self.signal.length)
            whole = (whole << spare).view(np.int64) >> np.int64(spare)
        values: Array = whole.astype(np.float64) * self.signal.scale + self.signal.offset
        for part in self.parts:
            values[~reader.selected(part.signal)] = np.nan
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class Validity:
    """A signal that says whether what it is `of` (quantities, lines) is valid: all `needs` have a value."""

    signal: SignalLayout
    of: tuple[str, ...]
    needs: tuple[str, ...]
    valid_raw: int
    invalid_raw: int

    def covers(self, quantity: str) -> bool:
        """Return whether a quantity has no value while this signal says invalid."""
        return quantity in self.of or quantity.partition(".")[0] in self.of

"""Signal values on the bus into raw bits, and those into the bytes of frames."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from operator import itemgetter
from typing import Any

import numpy as np

from vsensor.codec import Layout, SignalLayout, excess_range, float_bits, pack
from vsensor.errors import ConfigError, DbcError
from vsensor.profile import Binding, MessagePlan, Profile
from vsensor.types import Array, BoolArray, Frame, IntArray, SignalValues

_WIDEST_EXACT_BITS = 52  # a float64 holds such integers and their halves


@dataclass(frozen=True, slots=True, kw_only=True)
class _Message:
    """One message ready to be filled: bits that never change, and (place in raws, shift) of the others."""

    plan: MessagePlan
    base: int
    little: tuple[tuple[int, int], ...]
    big: tuple[tuple[int, int], ...]


class Encoder:
    """A profile compiled for encoding; immutable.

    All signals that are plain numbers are rounded in one go in numpy; tables, floats and signals of more
    than 52 bits one by one. Raises ConfigError for what cannot be sent.
    """

    def __init__(self, profile: Profile) -> None:
        bindings = [(plan, b) for plan in profile.messages for b in plan.bindings]
        _require_sendable(profile, bindings)
        fast = [item for item in bindings if _is_plain(item[1])]
        slow = [item for item in bindings if not _is_plain(item[1])]
        self.rounding = _Rounding([binding for _, binding in fast])
        self.slow = tuple(binding for _, binding in slow)
        places = {(plan.layout.name, b.signal.name): k for k, (plan, b) in enumerate([*fast, *slow])}
        validities = [(plan, v) for plan in profile.messages for v in plan.validities]
        self.validities = tuple(validity for _, validity in validities)
        for number, (plan, validity) in enumerate(validities):
            places[plan.layout.name, validity.signal.name] = len(bindings) + number
        self.messages = tuple(_message(plan, places) for plan in profile.messages)

    def raws(self, values: SignalValues) -> tuple[list[int], list[str]]:
        """Return the raw bits of all bindings, fast, slow, validities, and the names of saturated signals."""
        raws, saturated = self.rounding.raws(values)
        for binding in self.slow:
            value = values.get(binding.quantity, math.nan)
            raw, clipped = _slow_bits(binding, value)
            raws.append(raw)
            saturated += [binding.signal.name] * clipped
        for validity in self.validities:
            lost = any(math.isnan(values.get(quantity, math.nan)) for quantity in validity.needs)
            raw = validity.invalid_raw if lost else validity.valid_raw
            raws.append(raw & ((1 << validity.signal.length) - 1))
        return raws, saturated

    def frames(
        self, due: Iterable[int], raws: Sequence[int], counters: Sequence[int], due_ns: int
    ) -> tuple[list[Frame], tuple[int, ...]]:
        """Return the frames of the messages `due` (places in the profile), in order, and the counters after.

        `counters`: of each message of the profile, how many frames of it were sent before; the alive counter
        is that modulo its states.
        """
        after, frames = list(counters), []
        for place in due:
            frames.append(_frame(self.messages[place], raws, after[place], due_ns))
            after[place] += 1
        return frames, tuple(after)


def _frame(message: _Message, raws: Sequence[int], counter: int, due_ns: int) -> Frame:
    layout, guard = message.plan.layout, message.plan.guard
    word = message.base
    for place, shift in message.little:
        word |= raws[place] << shift
    if message.big:
        big = 0
        for place, shift in message.big:
            big |= raws[place] << shift
        word |= int.from_bytes(big.to_bytes(layout.length, "big"), "little")
    if guard is None:
        data = word.to_bytes(layout.length, "little")
    else:
        payload = bytearray(word.to_bytes(layout.length, "little"))
        guard.protect(payload, counter % guard.counter_states)
        data = bytes(payload)
    return Frame(
        due_ns=due_ns,
        arbitration_id=layout.arbitration_id,
        data=data,
        is_extended=layout.is_extended,
        is_fd=layout.is_fd,
        bitrate_switch=layout.is_fd,
    )


def _require_sendable(profile: Profile, bindings: Sequence[tuple[MessagePlan, Binding]]) -> None:
    if profile.role != "sensor":
        raise ConfigError(
            f'{profile.path}: role = "{profile.role}": a profile that is sent has role "sensor"'
        )
    for plan, binding in bindings:
        if binding.signal.mux_signal is not None:
            where = f"{profile.path}: {plan.layout.name}.{binding.signal.name}"
            raise ConfigError(f"{where}: a multiplexed signal can be decoded, not sent")
        if excess := excess_range(binding.signal):
            where = f"{profile.database}: {plan.layout.name}.{binding.signal.name}"
            raise DbcError(f"{where}: {excess}; nobody can tell what an ECU reads there: mend the database")


def _is_plain(binding: Binding) -> bool:
    signal = binding.signal
    return binding.raw_of_code is None and not signal.is_float and signal.length <= _WIDEST_EXACT_BITS


def _slow_bits(binding: Binding, value: float) -> tuple[int, bool]:
    signal = binding.signal
    if signal.is_float:
        return float_bits(signal, value * binding.gain + binding.bias)
    raw, clipped = binding.raw(value)
    return raw & ((1 << signal.length) - 1), clipped


def _message(plan: MessagePlan, places: Mapping[tuple[str, str], int]) -> _Message:
    layout = plan.layout
    little: list[tuple[int, int]] = []
    big: list[tuple[int, int]] = []
    for signal in [*(b.signal for b in plan.bindings), *(v.signal for v in plan.validities)]:
        place, shift = places[layout.name, signal.name], _little_shift(layout, signal)
        if shift is None:
            big.append((place, signal.shift))
        else:
            little.append((place, shift))
    return _Message(
        plan=plan,
        base=int.from_bytes(pack(layout, plan.constants), "little"),
        little=tuple(little),
        big=tuple(big),
    )


def _little_shift(layout: Layout, signal: SignalLayout) -> int | None:
    """Return the shift in the little-endian integer; None for a big-endian signal of several bytes."""
    fits = not signal.big_endian or signal.shift % 8 + signal.length <= 8
    return layout.low_bit(signal) if fits else None


class _Rounding:
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
        inner = [s.sna_raw for s in signals]
        self.sna = _row(math.nan if raw is None else raw for raw in inner)
        self.mask: IntArray = np.array([(1 << s.length) - 1 for s in signals], dtype=np.int64)

    def raws(self, values: SignalValues) -> tuple[list[int], list[str]]:
        """Return raw bits in the bindings' order, and the names of saturated signals."""
        given = self._given(values)
        quantity: Array = np.array(given)[self.take]
        outside: BoolArray = (quantity < self.too_low) | (quantity > self.too_high)
        inside = np.minimum(np.maximum(quantity, self.low), self.high)
        raw = np.rint((inside * self.gain + self.bias - self.offset) / self.scale)
        raw += raw == self.sna  # a number never says "not available"
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


def _bounds(binding: Binding) -> tuple[float, float]:
    signal = binding.signal
    low, high = signal.raw_min, signal.raw_max
    low += signal.sna_raw == low
    high -= signal.sna_raw == high
    ends = sorted((signal.physical(raw) - binding.bias) / binding.gain for raw in (low, high))
    return ends[0], ends[1]

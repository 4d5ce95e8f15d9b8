"""Counts in a message: the image's index and its milliseconds, read as recorded and written anew."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from vsensor.codec import Layout, SignalLayout, unpack
from vsensor.e2e import Field
from vsensor.e2e.field import reader, writer
from vsensor.profile import Binding, MessagePlan

INDEX, STAMP = "image.index", "image.timestamp_ms"


@dataclass(frozen=True, slots=True)
class Count:
    """A quantity that counts: `read(data)` gives it modulo `states` (0: it does not wrap), None for SNA.

    `write(data, value)` puts a whole number, modulo `states`.
    """

    states: int
    read: Callable[[bytes | bytearray], int | None]
    write: Callable[[bytearray, int], None]


def field_of(layout: Layout, signal: SignalLayout) -> Field:
    """Return where a signal lies."""
    return Field(layout.low_bit(signal), signal.length, signal.big_endian)


def counts_of(plan: MessagePlan, quantity: str) -> tuple[Count, ...]:
    """Return where a message carries a count, the widest first; each in frames of any page."""
    found = [_count(plan.layout, binding) for binding in plan.bindings if binding.quantity == quantity]
    return tuple(sorted(found, key=lambda count: count.states or math.inf, reverse=True))


def _count(layout: Layout, binding: Binding) -> Count:
    pieces = [(field_of(layout, signal), low) for signal, low in _pieces(binding)]
    readers = [(reader(field), low) for field, low in pieces]
    writers = [(writer(field), low, (1 << field.length) - 1) for field, low in pieces]
    present = _presence(layout, binding)
    signal = binding.signal
    plain = (binding.gain, binding.bias, signal.scale, signal.offset) == (1.0, 0.0, 1.0, 0.0)
    plain = plain and bool(binding.wrap) and not signal.is_float and not signal.codes
    mask = (1 << signal.length) - 1

    def read(data: bytes | bytearray) -> int | None:
        if present is not None and not present(data):
            return None
        raw = 0
        for get, low in readers:
            raw |= get(bytes(data)) << low
        if plain:
            return raw % binding.wrap
        signed = raw - (1 << signal.length) if signal.signed and raw >> (signal.length - 1) else raw
        value = binding.value(signed)
        return None if math.isnan(value) else round(value)

    def write(data: bytearray, value: int) -> None:
        if present is not None and not present(data):
            return
        raw = value % binding.wrap if plain else binding.raw(float(value))[0]
        raw &= mask
        for put, low, part in writers:
            put(data, raw >> low & part)

    return Count(binding.wrap, read, write)


def _pieces(binding: Binding) -> Sequence[tuple[SignalLayout, int]]:
    if binding.parts:
        return [(part.signal, part.low) for part in binding.parts]
    return [(binding.signal, 0)]


def _presence(layout: Layout, binding: Binding) -> Callable[[bytes | bytearray], bool] | None:
    """Return what says whether a frame carries a multiplexed signal; None if every frame does."""
    names = [signal.name for signal in binding.signals if signal.mux_signal is not None]
    if not names:
        return None
    return lambda data: set(names) <= unpack(layout, bytes(data)).keys()


def page_reader(plan: MessagePlan) -> Callable[[bytes | bytearray], tuple[int, ...]] | None:
    """Return what tells the pages of a multiplexed message apart; None where nothing is multiplexed."""
    layout = plan.layout
    if not layout.muxers:
        return None
    readers = [reader(field_of(layout, layout.signals[name])) for name in sorted(layout.muxers)]
    return lambda data: tuple(read(bytes(data)) for read in readers)

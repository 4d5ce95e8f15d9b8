"""One frame: bytes from numbers and back, in plain integers."""

import math
import struct
from collections.abc import Mapping

from vsensor.codec.layout import Layout, SignalLayout

_FLOAT_FORMATS = {16: "e", 32: "f", 64: "d"}
_FLOAT_LARGEST = {16: 65504.0, 32: (2 - 2**-23) * 2.0**127, 64: (2 - 2**-52) * 2.0**1023}


def quantise(signal: SignalLayout, physical: float) -> tuple[int, bool]:
    """Return the raw value of a physical one, and whether it was saturated; NaN gives SNA or the start value.

    Rounds half to even. A number never becomes SNA or a reserved value: a neighbour is taken.
    """
    if math.isnan(physical):
        return int(signal.sna_raw if signal.sna_raw is not None else signal.start_raw), False
    scaled = (physical - signal.offset) / signal.scale
    low, high = number_range(signal)
    if not low - 0.5 <= scaled <= high + 0.5:
        return (low if scaled < low else high), True
    rounded = raw = min(max(_round(signal, physical, scaled), low), high)
    while raw in signal.codes and raw < high:
        raw += 1
    return raw, raw != rounded


def number_range(signal: SignalLayout) -> tuple[int, int]:
    """Return the lowest and highest raw value that is a number: SNA and reserved values are none."""
    low, high = signal.raw_min, signal.raw_max
    while low in signal.codes and low < high:
        low += 1
    while high in signal.codes and low < high:
        high -= 1
    return low, high


def _round(signal: SignalLayout, physical: float, scaled: float) -> int:
    """Round as cantools does: exactly where scale and offset are whole, for 64-bit counters."""
    whole = float(signal.scale).is_integer() and float(signal.offset).is_integer()
    if whole and float(physical).is_integer():
        quotient, remainder = divmod(int(physical) - int(signal.offset), int(signal.scale))
        if remainder == 0:
            return quotient
    return round(scaled)


def pack(layout: Layout, raws: Mapping[str, int]) -> bytearray:
    """Return the bytes of raw integers (a float signal's are its IEEE bits); what is not named is 0."""
    little = big = 0
    for name, raw in raws.items():
        signal = layout.signals[name]
        bits = (raw & ((1 << signal.length) - 1)) << signal.shift
        if signal.big_endian:
            big |= bits
        else:
            little |= bits
    if big:
        little |= int.from_bytes(big.to_bytes(layout.length, "big"), "little")
    return bytearray(little.to_bytes(layout.length, "little"))


def unpack(layout: Layout, data: bytes) -> dict[str, int]:
    """Return the raw integers of all signals that the frame carries; a multiplexed one only if selected."""
    if len(data) < layout.length:
        raise ValueError(f"{layout.name}: {len(data)} bytes, {layout.length} expected")
    data = data[: layout.length]
    little, big = int.from_bytes(data, "little"), int.from_bytes(data, "big")
    raws: dict[str, int] = {}
    for name, signal in layout.signals.items():
        raw = ((big if signal.big_endian else little) >> signal.shift) & ((1 << signal.length) - 1)
        raws[name] = raw - (1 << signal.length) if signal.signed and raw >> (signal.length - 1) else raw
    return {name: raw for name, raw in raws.items() if layout.is_present(layout.signals[name], raws)}


def encode(layout: Layout, values: Mapping[str, float]) -> tuple[bytearray, tuple[str, ...]]:
    """Return the bytes of physical values, and the names of the signals that were saturated.

    A signal that is not named has its start value. NaN becomes SNA, the start value where there is none.
    """
    raws, saturated = {}, []
    for name, signal in layout.signals.items():
        if signal.is_float:
            raws[name], clipped = float_bits(signal, values.get(name, math.nan))
        elif name in values:
            raws[name], clipped = quantise(signal, values[name])
        else:
            raws[name], clipped = int(signal.start_raw), False
        if clipped:
            saturated.append(name)
    selected = {n: raw for n, raw in raws.items() if layout.is_present(layout.signals[n], raws)}
    return pack(layout, selected), tuple(saturated)


def float_bits(signal: SignalLayout, physical: float) -> tuple[int, bool]:
    """Return the IEEE bits of a float signal: never NaN, never infinite."""
    raw = signal.start_raw if math.isnan(physical) else (physical - signal.offset) / signal.scale
    largest = _FLOAT_LARGEST[signal.length]
    held = min(max(raw, -largest), largest)
    return int.from_bytes(struct.pack(">" + _FLOAT_FORMATS[signal.length], held), "big"), held != raw


def decode(layout: Layout, data: bytes) -> dict[str, float]:
    """Return the physical values of all signals that the frame carries; raises ValueError if it is short."""
    raws = unpack(layout, data)
    return {name: to_physical(layout.signals[name], raw) for name, raw in raws.items()}


def to_physical(signal: SignalLayout, raw: int) -> float:
    """Return the physical value of raw bits."""
    if signal.is_float:
        code = _FLOAT_FORMATS[signal.length]
        return signal.physical(struct.unpack(">" + code, raw.to_bytes(signal.length // 8, "big"))[0])
    return signal.physical(raw)

"""Bus descriptions compiled into our own layouts, and bytes from numbers; the only importer of cantools.

A message of L bytes is one integer of 8 L bits, read twice: little-endian signals are runs of bits of
the little-endian integer, big-endian (Motorola) signals of the big-endian one, so every signal is a
shift and a mask wherever it starts:

    little: start bit 12, length 9      shift = 12
    big:    start bit 2 (MSB), length 5 shift = 8 L - 8 * (2 // 8) - (7 - 2 % 8) - 5

Physical = raw * scale + offset. Encoding rounds (physical - offset) / scale half to even, as cantools
does, and saturates to what the bits hold (never wraps; a declared range narrower than the bits does not
clip: many are placeholders). SNA is the raw value that says "signal not available".
"""

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cantools
import numpy as np
from cantools.database import Database as CanDatabase

from vsensor.errors import DbcError
from vsensor.types import Array, CodeArray

_FLOAT_FORMATS = {16: "e", 32: "f", 64: "d"}
_SUFFIXES = {".dbc", ".arxml", ".kcd", ".sym"}


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalLayout:
    """Where a signal lies in its message and what its bits mean.

    `shift` is its place in the message's integer of its byte order (see the module). `start` is the
    description's own start bit. `raw_min` and `raw_max` are what the bits hold; `minimum` and `maximum`
    the declared physical range, None if there is none. `start_raw` is sent before there is a value,
    `sna_raw` when there is none. A multiplexed signal is present when `mux_signal` has one of `mux_ids`.
    """

    name: str
    start: int
    length: int
    shift: int
    big_endian: bool
    signed: bool
    is_float: bool
    scale: float
    offset: float
    minimum: float | None
    maximum: float | None
    unit: str
    comment: str
    choices: Mapping[int, str]
    start_raw: float
    sna_raw: int | None
    mux_signal: str | None
    mux_ids: frozenset[int]

    @property
    def raw_min(self) -> int:
        """Smallest raw integer of the bits."""
        return -(1 << (self.length - 1)) if self.signed else 0

    @property
    def raw_max(self) -> int:
        """Largest raw integer of the bits."""
        return (1 << (self.length - self.signed)) - 1

    def physical(self, raw: float) -> float:
        """Return the physical value of a raw one."""
        return float(raw * self.scale + self.offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """One message: identity, signals, and what its attributes say about sending and protection.

    Times in milliseconds, 0 = not given; `send_type` "" = not given; `e2e_profile` "" = unprotected.
    """

    name: str
    arbitration_id: int
    is_extended: bool
    is_fd: bool
    length: int
    comment: str
    senders: tuple[str, ...]
    signals: Mapping[str, SignalLayout]
    cycle_ms: int
    start_delay_ms: int
    send_type: str
    e2e_profile: str
    e2e_data_id: int | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Database:
    """A bus description, compiled: messages by name."""

    path: Path
    layouts: Mapping[str, Layout]


# ---- compiling -------------------------------------------------------------------------------------


def load_database(path: Path) -> Database:
    """Read a DBC, ARXML, KCD or SYM file; raises DbcError with the reader's reason in one line."""
    if path.suffix.lower() not in _SUFFIXES:
        raise DbcError(f"{path}: a bus description ends in {', '.join(sorted(_SUFFIXES))}")
    if not path.is_file():
        raise DbcError(f"{path}: no such file")
    try:
        database = cantools.database.load_file(path, strict=False)
    except Exception as error:  # cantools lets through what its parsers raise: KeyError, ValueError, lxml's ...
        reason = " ".join(str(error).split()) or type(error).__name__
        raise DbcError(f"{path}: cantools refuses it: {reason}") from None
    if not isinstance(database, CanDatabase):
        raise DbcError(f"{path}: describes diagnostics, a description of CAN messages was expected")
    return Database(path=path, layouts={m.name: _layout(m, path) for m in database.messages})


def _layout(message: Any, path: Path) -> Layout:
    signals = {s.name: _signal(s, message, path) for s in message.signals}
    data_id = _attribute(message, "E2EDataId")
    e2e_profile = str(_attribute(message, "E2EProfile") or "")
    return Layout(
        name=message.name,
        arbitration_id=message.frame_id,
        is_extended=message.is_extended_frame,
        is_fd=message.is_fd or message.length > 8,
        length=message.length,
        comment=message.comment or "",
        senders=tuple(message.senders),
        signals=signals,
        cycle_ms=int(message.cycle_time or 0),
        start_delay_ms=int(_attribute(message, "GenMsgStartDelayTime") or 0),
        send_type=str(message.send_type or ""),
        e2e_profile=e2e_profile,
        e2e_data_id=int(data_id) if data_id is not None and e2e_profile else None,
    )


def _signal(signal: Any, message: Any, path: Path) -> SignalLayout:
    where = f"{path}: {message.name}.{signal.name}"
    big = signal.byte_order == "big_endian"
    shift = signal.start
    if big:
        shift = 8 * message.length - 8 * (signal.start // 8) - (7 - signal.start % 8) - signal.length
    if shift < 0 or shift + signal.length > 8 * message.length:
        raise DbcError(f"{where}: bit {signal.start}, length {signal.length} does not fit {message.length} bytes")
    if signal.conversion.is_float and signal.length not in _FLOAT_FORMATS:
        raise DbcError(f"{where}: a float of {signal.length} bits, 16, 32 or 64 were expected")
    if signal.length > 64:
        raise DbcError(f"{where}: {signal.length} bits, at most 64 are read")
    if signal.scale == 0:
        raise DbcError(f"{where}: scale is 0")
    return SignalLayout(
        name=signal.name,
        start=signal.start,
        length=signal.length,
        shift=shift,
        big_endian=big,
        signed=signal.is_signed and not signal.conversion.is_float,
        is_float=signal.conversion.is_float,
        scale=signal.scale,
        offset=signal.offset,
        minimum=signal.minimum,
        maximum=signal.maximum,
        unit=signal.unit or "",
        comment=signal.comment or "",
        choices={int(raw): str(name) for raw, name in (signal.choices or {}).items()},
        start_raw=signal.raw_initial if signal.raw_initial is not None else 0,
        sna_raw=_sna(signal, where),
        mux_signal=signal.multiplexer_signal if signal.multiplexer_ids else None,
        mux_ids=frozenset(signal.multiplexer_ids or ()),
    )


def _sna(signal: Any, where: str) -> int | None:
    text = str(_attribute(signal, "GenSigSNA") or "").strip()
    if not text and signal.raw_invalid is not None:
        return int(signal.raw_invalid)
    try:
        return int(text, 0) if text else None
    except ValueError:
        raise DbcError(f"{where}: GenSigSNA is {text!r}, a raw integer was expected") from None


def _attribute(item: Any, name: str) -> Any:
    attributes = getattr(item.dbc, "attributes", None) or {}
    return attributes[name].value if name in attributes else None


# ---- one frame -------------------------------------------------------------------------------------


def quantise(signal: SignalLayout, physical: float) -> tuple[int, bool]:
    """Return the raw value of a physical one, and whether it was saturated; NaN gives SNA or the start value.

    Rounds half to even. A number never becomes the SNA value: its neighbour is taken.
    """
    if math.isnan(physical):
        return int(signal.sna_raw if signal.sna_raw is not None else signal.start_raw), False
    scaled = (physical - signal.offset) / signal.scale
    low, high = signal.raw_min, signal.raw_max
    low += signal.sna_raw == low
    high -= signal.sna_raw == high
    if not low - 0.5 <= scaled <= high + 0.5:
        return (low if scaled < low else high), True
    raw = min(max(_round(signal, physical, scaled), low), high)
    return (raw + 1, True) if raw == signal.sna_raw else (raw, False)


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
    return {name: raw for name, raw in raws.items() if _selected(layout, layout.signals[name], raws)}


def _selected(layout: Layout, signal: SignalLayout, raws: Mapping[str, int]) -> bool:
    if signal.mux_signal is None:
        return True
    parent = layout.signals[signal.mux_signal]
    return raws[parent.name] in signal.mux_ids and _selected(layout, parent, raws)


def encode(layout: Layout, values: Mapping[str, float]) -> tuple[bytearray, tuple[str, ...]]:
    """Return the bytes of physical values, and the names of the signals that were saturated.

    A signal that is not named has its start value. NaN becomes SNA, the start value where there is none.
    """
    raws, saturated = {}, []
    for name, signal in layout.signals.items():
        if signal.is_float:
            raws[name], clipped = _float_bits(signal, values.get(name, math.nan))
        elif name in values:
            raws[name], clipped = quantise(signal, values[name])
        else:
            raws[name], clipped = int(signal.start_raw), False
        if clipped:
            saturated.append(name)
    selected = {n: raw for n, raw in raws.items() if _selected(layout, layout.signals[n], raws)}
    return pack(layout, selected), tuple(saturated)


def _float_bits(signal: SignalLayout, physical: float) -> tuple[int, bool]:
    """Return the IEEE bits of a float signal: never NaN, never infinite."""
    code = _FLOAT_FORMATS[signal.length]
    raw = signal.start_raw if math.isnan(physical) else (physical - signal.offset) / signal.scale
    largest = {"e": 65504.0, "f": float(np.finfo(np.float32).max), "d": float(np.finfo(np.float64).max)}[code]
    held = min(max(raw, -largest), largest)
    return int.from_bytes(struct.pack(">" + code, held), "big"), held != raw


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


# ---- many frames -----------------------------------------------------------------------------------


def decode_bulk(layout: Layout, data: CodeArray, names: tuple[str, ...] | None = None) -> dict[str, Array]:
    """Return the physical values (N,) of the named (default: all) signals of frames `data` (N, >= length).

    NaN where a multiplexed signal is not in the frame.
    """
    reader = _BulkReader(layout, data)
    return {name: reader.physical(name) for name in (names if names is not None else layout.signals)}


class _BulkReader:
    """Reads columns of one message; 8-byte windows are read once per place and byte order."""

    def __init__(self, layout: Layout, data: CodeArray) -> None:
        if data.ndim != 2 or data.shape[1] < layout.length:
            raise ValueError(f"{layout.name}: data of shape {data.shape}, (N, {layout.length}) expected")
        self.layout = layout
        width = max(layout.length, 8)
        self.data = np.zeros((len(data), width), dtype=np.uint8)
        self.data[:, : layout.length] = data[:, : layout.length]
        self.words: dict[tuple[int, bool], Any] = {}

    def raw(self, name: str) -> Any:
        """Return the raw values (N,), int64 if signed, uint64 otherwise."""
        signal = self.layout.signals[name]
        end = 8 * self.layout.length - signal.shift if signal.big_endian else signal.shift + signal.length
        first, last = (end - signal.length) // 8, (end - 1) // 8
        at = min(first, self.data.shape[1] - 8)
        word = self._word(at, signal.big_endian)
        low = 8 * (at + 8) - end if signal.big_endian else end - signal.length - 8 * at
        if low >= 0 and last < at + 8:
            bits = word >> np.uint64(low) if low else word
        elif signal.big_endian:  # nine bytes: the last one holds the lowest bits
            bits = (word << np.uint64(-low)) | (self.data[:, last].astype(np.uint64) >> np.uint64(8 + low))
        else:
            bits = (word >> np.uint64(low)) | (self.data[:, last].astype(np.uint64) << np.uint64(64 - low))
        if signal.length == 64:
            return bits.view(np.int64) if signal.signed else bits
        spare = np.uint64(64 - signal.length)
        if signal.signed:
            return (bits << spare).view(np.int64) >> np.int64(spare)
        return bits & np.uint64((1 << signal.length) - 1)

    def _word(self, at: int, big: bool) -> Any:
        if (at, big) not in self.words:
            window = np.ascontiguousarray(self.data[:, at : at + 8])
            self.words[at, big] = window.view(">u8" if big else "<u8")[:, 0].astype(np.uint64)
        return self.words[at, big]

    def physical(self, name: str) -> Array:
        """Return the physical values (N,), NaN where the signal is not in the frame."""
        signal = self.layout.signals[name]
        raw = self.raw(name)
        if signal.is_float:
            raw = raw.astype(f"u{signal.length // 8}").view(f"f{signal.length // 8}")
        values: Array = raw.astype(np.float64) * signal.scale + signal.offset
        if signal.mux_signal is not None:
            values[~self.selected(signal)] = np.nan
        return values

    def selected(self, signal: SignalLayout) -> Any:
        """Return where (N,) a multiplexed signal is in the frame."""
        if signal.mux_signal is None:
            return np.ones(len(self.data), dtype=bool)
        parent = self.layout.signals[signal.mux_signal]
        return np.isin(self.raw(parent.name), list(signal.mux_ids)) & self.selected(parent)


# ---- audit -----------------------------------------------------------------------------------------


def audit(database: Database) -> list[str]:
    """Return what an ECU could stumble over, one sentence each: ranges, overlaps, start values, timing."""
    found: list[str] = []
    for layout in database.layouts.values():
        if not layout.cycle_ms:
            found.append(f"{layout.name}: no cycle time")
        found += _overlaps(layout)
        for signal in layout.signals.values():
            found += [f"{layout.name}.{signal.name}: {text}" for text in _audit_signal(signal)]
    return found


def _audit_signal(signal: SignalLayout) -> list[str]:
    if signal.is_float:
        return []
    found = []
    ends = sorted((signal.physical(signal.raw_min), signal.physical(signal.raw_max)))
    low, high = signal.minimum, signal.maximum
    half_lsb = abs(signal.scale) / 2
    if low is not None and high is not None and (low < ends[0] - half_lsb or high > ends[1] + half_lsb):
        found.append(f"range [{low:g}|{high:g}] exceeds what {signal.length} bits hold, [{ends[0]:g}|{ends[1]:g}]")
    if (low, high) in ((0, 1), (0, 0)) and signal.length > 1:
        found.append(f"range [{low:g}|{high:g}] is a placeholder, the bits hold [{ends[0]:g}|{ends[1]:g}]")
    for word, raw in (("start value", signal.start_raw), ("SNA value", signal.sna_raw)):
        if raw is not None and not signal.raw_min <= raw <= signal.raw_max:
            found.append(f"{word} {raw:g} (raw) is not among [{signal.raw_min}|{signal.raw_max}]")
    return found


def _overlaps(layout: Layout) -> list[str]:
    owner: dict[int, SignalLayout] = {}
    found: dict[tuple[str, str], None] = {}
    for signal in layout.signals.values():
        for bit in _bits(layout, signal):
            other = owner.setdefault(bit, signal)
            if other is not signal and not _exclusive(other, signal):
                found[other.name, signal.name] = None
    return [f"{layout.name}: signals {a} and {b} overlap" for a, b in found]


def _bits(layout: Layout, signal: SignalLayout) -> list[int]:
    """Return the bits that a signal covers, counted from bit 0 of byte 0 upwards."""
    places = range(signal.shift, signal.shift + signal.length)
    if not signal.big_endian:
        return list(places)
    return [8 * (layout.length - 1 - place // 8) + place % 8 for place in places]


def _exclusive(a: SignalLayout, b: SignalLayout) -> bool:
    return a.mux_signal is not None and a.mux_signal == b.mux_signal and not a.mux_ids & b.mux_ids

"""Bus descriptions compiled into our own layouts; the only importer of cantools."""

import logging
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import cantools
from cantools.database import Database as CanDatabase

from vsensor.codec.sending import SendAttributes, send_attributes
from vsensor.errors import DbcError

# Which messages share a name or an id we say ourselves: load_database refuses, the audit finds.
logging.getLogger("cantools.database.can.database").addFilter(
    lambda record: not record.msg.startswith("Overwriting message")
)

_SUFFIXES = {".dbc", ".arxml", ".kcd", ".sym"}
_FLOAT_BITS = {16, 32, 64}


@dataclass(frozen=True, slots=True, kw_only=True)
class SignalLayout:
    """Where a signal lies in its message and what its bits mean.

    `shift` is its place in the message's integer of its byte order (see the module). `start` is the
    description's own start bit. `raw_min` and `raw_max` are what the bits hold; `minimum` and `maximum`
    the declared physical range, None if there is none. `start_raw` is sent before there is a value,
    `sna_raw` when there is none; `reserved` are other raw values that say something else than a number.
    A multiplexed signal is present when `mux_signal` has one of `mux_ids`.
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
    reserved: tuple[int, ...] = ()

    @property
    def raw_min(self) -> int:
        """Smallest raw integer of the bits."""
        return -(1 << (self.length - 1)) if self.signed else 0

    @property
    def raw_max(self) -> int:
        """Largest raw integer of the bits."""
        return (1 << (self.length - self.signed)) - 1

    @property
    def codes(self) -> frozenset[int]:
        """The raw values that are no numbers: SNA and what is reserved."""
        return frozenset(self.reserved if self.sna_raw is None else (self.sna_raw, *self.reserved))

    def physical(self, raw: float) -> float:
        """Return the physical value of a raw one."""
        return float(raw * self.scale + self.offset)


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """One message: identity, signals, and what its attributes say about sending and protection.

    Times in milliseconds, 0 = not given; `send_type` "" = not given; `e2e_profile` "" = unprotected,
    `e2e_data_id` one or a list of them; `bitrate_switch` None = not given.
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
    e2e_data_id: int | tuple[int, ...] | None
    bitrate_switch: bool | None = None
    sending: SendAttributes = field(default_factory=SendAttributes)

    @property
    def muxers(self) -> frozenset[str]:
        """Names of the signals that say which others are in the frame."""
        return frozenset(s.mux_signal for s in self.signals.values() if s.mux_signal is not None)

    def is_present(self, signal: SignalLayout, raws: Mapping[str, int]) -> bool:
        """Return whether a frame whose multiplexers have these raw values carries the signal."""
        if signal.mux_signal is None:
            return True
        parent = self.signals[signal.mux_signal]
        return raws.get(parent.name) in signal.mux_ids and self.is_present(parent, raws)

    def low_bit(self, signal: SignalLayout) -> int:
        """Return the place of a signal's lowest bit, counted from bit 0 of byte 0 upwards."""
        if not signal.big_endian:
            return signal.shift
        return 8 * (self.length - 1 - signal.shift // 8) + signal.shift % 8


@dataclass(frozen=True, slots=True, kw_only=True)
class Database:
    """A bus description, compiled: messages by name."""

    path: Path
    layouts: Mapping[str, Layout]


def load_database(path: Path) -> Database:
    """Read a DBC, ARXML, KCD or SYM file; raises DbcError with the reader's reason in one line."""
    if path.suffix.lower() not in _SUFFIXES:
        raise DbcError(f"{path}: a bus description ends in {', '.join(sorted(_SUFFIXES))}")
    if not path.is_file():
        raise DbcError(f"{path}: {'is a folder' if path.is_dir() else 'no such file'}")
    try:
        database = cantools.database.load_file(path, strict=False)
    except (
        Exception
    ) as error:  # cantools lets through what its parsers raise: KeyError, ValueError, lxml's ...
        reason = _printable(str(error)) or type(error).__name__
        raise DbcError(f"{path}: cantools refuses it: {reason}") from None
    if not isinstance(database, CanDatabase):
        raise DbcError(f"{path}: describes diagnostics, a description of CAN messages was expected")
    return Database(path=path, layouts=_layouts(database, path))


def _layouts(database: CanDatabase, path: Path) -> dict[str, Layout]:
    """Return the messages by name; a frame that an ARXML has on several buses is one."""
    layouts: dict[str, Layout] = {}
    for message in database.messages:
        layout = _layout(message, path)
        other = layouts.setdefault(layout.name, layout)
        if not _same_frame(layout, other):
            ids = f"{other.arbitration_id:#x} and {layout.arbitration_id:#x}"
            raise DbcError(f"{path}: two messages are named {layout.name}, with ids {ids}; rename one")
    return layouts


def _same_frame(a: Layout, b: Layout) -> bool:
    return (a.arbitration_id, a.is_extended, a.length, a.signals) == (
        b.arbitration_id,
        b.is_extended,
        b.length,
        b.signals,
    )


def _signals(message: Any, path: Path) -> dict[str, SignalLayout]:
    signals: dict[str, SignalLayout] = {}
    for one in message.signals:
        signal = _signal(one, message, path)
        other = signals.setdefault(signal.name, signal)
        if signal != other:
            places = f"start bits {other.start} and {signal.start}"
            raise DbcError(
                f"{path}: {message.name}: two signals are named {signal.name}, {places}; rename one"
            )
    return signals


def _printable(text: str) -> str:
    """Return the text on one line, without what would drive a terminal."""
    return "".join(c if c.isprintable() else "?" for c in " ".join(text.split()))


def _layout(message: Any, path: Path) -> Layout:
    signals = _signals(message, path)
    e2e_profile, data_id = _e2e(message)
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
        sending=send_attributes(message),
        e2e_profile=e2e_profile,
        e2e_data_id=data_id,
        bitrate_switch=_bitrate_switch(message),
    )


def _e2e(message: Any) -> tuple[str, int | tuple[int, ...] | None]:
    """Return profile and data id from the attributes of a DBC, or from the properties of an ARXML."""
    name, data_id = str(_attribute(message, "E2EProfile") or ""), _attribute(message, "E2EDataId")
    if name:
        return name, int(data_id) if data_id is not None else None
    autosar = getattr(message.autosar, "e2e", None)
    number = re.fullmatch(r"(?:PROFILE|E2E)_?0*(\d+)", str(getattr(autosar, "category", "")).upper())
    if autosar is None or number is None:
        return "", None
    ids = tuple(int(one) for one in autosar.data_ids or ())
    return f"P{int(number[1]):02d}", (ids[0] if len(ids) == 1 else ids) or None


def _bitrate_switch(message: Any) -> bool | None:
    switch = _attribute(message, "CANFD_BRS")
    return None if switch is None else str(switch) not in ("0", "")


def _signal(signal: Any, message: Any, path: Path) -> SignalLayout:
    where = f"{path}: {message.name}.{signal.name}"
    big = signal.byte_order == "big_endian"
    shift = signal.start
    if big:
        shift = 8 * message.length - 8 * (signal.start // 8) - (7 - signal.start % 8) - signal.length
    if shift < 0 or shift + signal.length > 8 * message.length:
        raise DbcError(
            f"{where}: bit {signal.start}, length {signal.length} does not fit {message.length} bytes"
        )
    if signal.conversion.is_float and signal.length not in _FLOAT_BITS:
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

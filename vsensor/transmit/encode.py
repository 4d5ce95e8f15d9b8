"""Signal values on the bus into raw bits, and those into the bytes of frames."""

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from vsensor.codec import Layout, SignalLayout, excess_range, float_bits, pack
from vsensor.errors import ConfigError, DbcError
from vsensor.faults import Spoiler
from vsensor.profile import Binding, FrameKey, MessagePlan, Page, Profile
from vsensor.transmit.rounding import WIDEST_EXACT_BITS, Rounding
from vsensor.types import Frame, SensorMode, SignalValues

# A range that ends one step behind the bits, at 2^n instead of 2^n - 1, is a habit and no mistake of layout.
_SLACK_STEPS = 1.0 + 1e-9

Places = Mapping[tuple[str, str], int]
"""(message, signal) -> place of its bits in the list of raw bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class _Page:
    """One frame ready to be filled: bits that never change, and (place in raws, shift) of the others."""

    key: FrameKey
    base: int
    little: tuple[tuple[int, int], ...]
    big: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Message:
    """One message: its pages (one, if nothing is multiplexed), all sent together or one after another."""

    plan: MessagePlan
    pages: tuple[_Page, ...]
    rotates: bool

    def next_pages(self, counter: int) -> tuple[_Page, ...]:
        """Return the pages to be sent after `counter` frames."""
        return (self.pages[counter % len(self.pages)],) if self.rotates else self.pages


class Encoder:
    """A profile compiled for encoding; immutable.

    All signals that are plain numbers are rounded in one go in numpy; tables, floats and signals of more
    than 52 bits one by one. `places`: where the bits of each signal stand in what `raws` returns. Raises
    ConfigError for what cannot be sent.
    """

    def __init__(self, profile: Profile) -> None:
        bindings = [(plan, b) for plan in profile.messages for b in plan.bindings]
        _require_sendable(profile, bindings)
        fast = [item for item in bindings if _is_plain(item[1])]
        slow = [item for item in bindings if not _is_plain(item[1])]
        self.rounding = Rounding([binding for _, binding in fast])
        self.slow = tuple(binding for _, binding in slow)
        ordered = [(plan.layout.name, b) for plan, b in (*fast, *slow)]
        places = {(message, b.signal.name): k for k, (message, b) in enumerate(ordered)}
        validities = [(plan.layout.name, v) for plan in profile.messages for v in plan.validities]
        self.validities = tuple(validity for _, validity in validities)
        for message, validity in validities:
            places[message, validity.signal.name] = len(places)
        parts = [(place, message, part) for place, (message, b) in enumerate(ordered) for part in b.parts]
        self.parts = tuple((place, part.low, (1 << part.signal.length) - 1) for place, _, part in parts)
        for _, message, part in parts:
            places[message, part.signal.name] = len(places)
        self.places: Places = places
        self.by_mode = _by_mode([binding for _, binding in ordered])
        self.messages = tuple(_message(plan, places) for plan in profile.messages)
        self.bursts = profile.bursts

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
        for place, bits in self.by_mode.get(values.get("sensor.state", math.nan), ()):
            raws[place] = bits
        for place, low, mask in self.parts:
            raws.append(raws[place] >> low & mask)
        return raws, saturated

    def frames(
        self,
        due: Iterable[int],
        raws: Sequence[int],
        counters: Sequence[int],
        due_ns: int,
        spoiler: Spoiler | None = None,
    ) -> tuple[list[Frame], tuple[int, ...]]:
        """Return the frames of the messages `due` (places in the profile), in order, and the counters after.

        `counters`: of each message of the profile, how many frames of it were sent before; the alive counter
        is that modulo its states, unless the faults of `spoiler` give it another.
        """
        after = list(counters)
        sent: list[tuple[MessagePlan, FrameKey, int, bytearray]] = []
        for place in due:
            message = self.messages[place]
            for page in message.next_pages(after[place]):
                payload, count = _payload(page, message.plan, raws), after[place]
                if spoiler is not None:
                    count = spoiler.before_protection(place, page.key[1], payload, count)
                _protect(message.plan, payload, count)
                sent.append((message.plan, page.key, count, payload))
                after[place] += 1
        if self.bursts:
            self._seal(sent)
        return [_frame(plan, payload, due_ns) for plan, _, _, payload in sent], tuple(after)

    def contents(self, place: int, raws: Sequence[int]) -> tuple[bytes, ...]:
        """Return the data of all pages of the message at `place`, without counter and checksums."""
        message = self.messages[place]
        return tuple(bytes(_payload(page, message.plan, raws)) for page in message.pages)

    def _seal(self, sent: Sequence[tuple[MessagePlan, FrameKey, int, bytearray]]) -> None:
        """Write the checksums over whole bursts, and once more what protects the frames that carry them."""
        payloads = {key: payload for _, key, _, payload in sent}
        for burst in self.bursts:
            carrier = burst.close(payloads)
            for plan, key, counter, payload in sent:
                if key == carrier:
                    _protect(plan, payload, counter)


def _payload(page: _Page, plan: MessagePlan, raws: Sequence[int]) -> bytearray:
    length = plan.layout.length
    word = page.base
    for place, shift in page.little:
        word |= raws[place] << shift
    if page.big:
        big = 0
        for place, shift in page.big:
            big |= raws[place] << shift
        word |= int.from_bytes(big.to_bytes(length, "big"), "little")
    return bytearray(word.to_bytes(length, "little"))


def _protect(plan: MessagePlan, payload: bytearray, counter: int) -> None:
    guard = plan.guard
    if guard is not None:
        guard.protect(payload, counter % guard.counter_states)


def _frame(plan: MessagePlan, payload: bytearray, due_ns: int) -> Frame:
    layout = plan.layout
    return Frame(
        due_ns=due_ns,
        arbitration_id=layout.arbitration_id,
        data=bytes(payload) + plan.padding,
        is_extended=layout.is_extended,
        is_fd=layout.is_fd,
        bitrate_switch=plan.bitrate_switch,
    )


def _slow_bits(binding: Binding, value: float) -> tuple[int, bool]:
    signal = binding.signal
    if signal.is_float:
        value = abs(value) if binding.magnitude_sign else value
        return float_bits(signal, value * binding.gain + binding.bias)
    raw, clipped = binding.raw(value)
    return raw & ((1 << signal.length) - 1), clipped


# ---- compiling -------------------------------------------------------------------------------------


def _require_sendable(profile: Profile, bindings: Sequence[tuple[MessagePlan, Binding]]) -> None:
    if profile.role != "sensor":
        raise ConfigError(
            f'{profile.path}: role = "{profile.role}": a profile that is sent has role "sensor"'
        )
    for plan, binding in bindings:
        for signal in binding.signals:
            if signal.name in plan.layout.muxers:
                where = f"{profile.path}: {plan.layout.name}.{signal.name}"
                raise ConfigError(
                    f"{where}: the multiplexer says which signals are in the frame and cannot carry "
                    f"{binding.quantity}; leave it out, or give a constant"
                )
            if excess := refused_range(profile, signal):
                where = f"{profile.database}: {plan.layout.name}.{signal.name}"
                raise DbcError(
                    f"{where}: {excess}; nobody can tell what an ECU reads there: mend the database, or say "
                    'wide_ranges = "saturate" in the profile'
                )


def refused_range(profile: Profile, signal: SignalLayout) -> str:
    """Return why the declared range of a signal is not sent; "" if it is."""
    return excess_range(signal, _SLACK_STEPS) if profile.wide_ranges == "refuse" else ""


def _is_plain(binding: Binding) -> bool:
    signal = binding.signal
    return binding.raw_of_code is None and not signal.is_float and signal.length <= WIDEST_EXACT_BITS


def _by_mode(bindings: Sequence[Binding]) -> dict[float, tuple[tuple[int, int], ...]]:
    """Return which raw bits stand for all values in which state of the sensor."""
    raws = {
        key: tuple(
            (place, raw & ((1 << binding.signal.length) - 1))
            for place, binding in enumerate(bindings)
            if (raw := getattr(binding, key)) is not None
        )
        for key in ("error_raw", "init_raw")
    }
    modes = {
        SensorMode.INIT: "init_raw",
        SensorMode.CALIBRATING: "init_raw",
        SensorMode.BLOCKED: "error_raw",
        SensorMode.FAILED: "error_raw",
    }
    return {float(mode): raws[key] for mode, key in modes.items() if raws[key]}


def _message(plan: MessagePlan, places: Places) -> _Message:
    pages = tuple(_page(plan, places, number, page) for number, page in enumerate(plan.pages))
    return _Message(plan=plan, pages=pages, rotates=plan.mux == "rotate")


def _page(plan: MessagePlan, places: Places, number: int, page: Page) -> _Page:
    layout = plan.layout
    constants = {**plan.constants, **page}
    present = {s.name for s in layout.signals.values() if layout.is_present(s, constants)}
    little: list[tuple[int, int]] = []
    big: list[tuple[int, int]] = []
    for signal in _filled(plan):
        if signal.name in present:
            place, shift = places[layout.name, signal.name], _little_shift(layout, signal)
            (big if shift is None else little).append((place, signal.shift if shift is None else shift))
    base = pack(layout, {name: raw for name, raw in constants.items() if name in present})
    return _Page(
        key=(layout.name, number),
        base=int.from_bytes(base, "little"),
        little=tuple(little),
        big=tuple(big),
    )


def _filled(plan: MessagePlan) -> Iterator[SignalLayout]:
    """Yield the signals whose bits are not the same in every frame."""
    for binding in plan.bindings:
        yield from binding.signals
    for validity in plan.validities:
        yield validity.signal


def _little_shift(layout: Layout, signal: SignalLayout) -> int | None:
    """Return the shift in the little-endian integer; None for a big-endian signal of several bytes."""
    fits = not signal.big_endian or signal.shift % 8 + signal.length <= 8
    return layout.low_bit(signal) if fits else None

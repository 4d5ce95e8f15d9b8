"""What faults do to the frames of one tick: bits and counters before protection, frames after it.

    payload --signal faults--> --counter faults--> protect --crc, truncated, doubled, delayed, lost--> bus

So a wrong signal or counter goes out under a right checksum, as from an application in error, and a checksum
is wrong as on a disturbed bus. A frame that is lost counts: the ECU sees the gap. All on copies: `end` gives
the state after the tick.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence

from msgspec.structs import replace

from vsensor.e2e.field import reader, writer
from vsensor.faults.spoiled import NOT_SPOILED, Spoiled
from vsensor.faults.state import Running
from vsensor.profile import MessagePlan
from vsensor.types import Frame, Tick

FD_LENGTHS = (0, 1, 2, 3, 4, 5, 6, 7, 8, 12, 16, 20, 24, 32, 48, 64)


class Spoiler:
    """The faults at work on the frames of one tick; begin each send slot with `begin`."""

    def __init__(self, faults: Sequence[Running], spoiled: Spoiled, messages: Sequence[MessagePlan]) -> None:
        self._faults, self._messages = faults, messages
        self._used, self._held = dict(spoiled.used), dict(spoiled.held)
        self._shifts, self._waiting = dict(spoiled.shifts), spoiled.waiting
        self._t_ns = 0
        self._made: list[tuple[int, int]] = []
        self._leaving: list[Frame] = []

    def begin(self, t_ns: int) -> None:
        """Begin the send slot at `t_ns`."""
        self._t_ns, self._made = t_ns, []

    def before_protection(self, place: int, page: int, payload: bytearray, count: int) -> int:
        """Change the bits of the next frame of a message, and return the alive counter that it gets.

        `count` frames of the message were sent before it; the counter may lie outside of its states.
        """
        self._made.append((place, page))
        for running in self._at_work(place, "signal"):
            if self._patch(running, page, payload):
                self._use(running, place)
        at_work = list(self._at_work(place, "counter"))
        steps = {running.fault.config.kind: running.fault.config.by or 0 for running in at_work}
        if "counter_frozen" in steps:
            steps["counter_frozen"] = (
                -1 if count else 0
            )  # the first frame of all has none before it to repeat
        for running in at_work:
            self._use(running, place)
        shift = self._shifts.get(place, 0) + steps.get("counter_frozen", 0) + steps.get("counter_jumped", 0)
        self._shifts[place] = shift % self._states(place)
        return count + shift + steps.get("counter_offset", 0)

    def content(self, place: int, page: int, payload: bytes) -> bytes:
        """Return the content of a frame as faults of signals change it; nothing is used up by that."""
        changed, held = bytearray(payload), dict(self._held)
        for running in self._at_work(place, "signal"):
            self._patch(running, page, changed)
        self._held = held
        return bytes(changed)

    def after_protection(self, frames: Sequence[Frame]) -> None:
        """Take the frames of the slot, in the order of the calls of before_protection."""
        for (place, page), frame in zip(self._made, frames, strict=True):
            self._leaving += self._on_bus(place, page, frame)

    def end(self, tick: Tick) -> tuple[Spoiled, tuple[Frame, ...]]:
        """Return the state after the tick, and the frames that leave in its time, in order."""
        end_ns = tick.t_ns + tick.period_ns
        frames = sorted((*self._waiting, *self._leaving), key=lambda frame: frame.due_ns)
        bus_off = [running for running in self._faults if running.fault.kind.stage == "bus"]
        leaving = tuple(
            frame
            for frame in frames
            if tick.t_ns <= frame.due_ns < end_ns and not any(one.is_due(frame.due_ns) for one in bus_off)
        )
        going = {running.number for running in self._faults}
        spoiled = Spoiled(
            used={key: count for key, count in self._used.items() if key[0] in going},
            held={number: raw for number, raw in self._held.items() if number in going},
            shifts={place: shift for place, shift in self._shifts.items() if shift},
            waiting=tuple(frame for frame in frames if frame.due_ns >= end_ns),
        )
        return (NOT_SPOILED if spoiled.is_nothing else spoiled), leaving

    def _at_work(self, place: int, stage: str) -> Iterator[Running]:
        """Yield the faults of a stage that act on the next frame of a message."""
        for running in self._faults:
            fault = running.fault
            if (
                fault.kind.stage == stage
                and place in fault.messages
                and running.is_due(self._t_ns)
                and (fault.times is None or self._used.get((running.number, place), 0) < fault.times)
            ):
                yield running

    def _use(self, running: Running, place: int) -> None:
        if running.fault.times is not None:
            key = running.number, place
            self._used[key] = self._used.get(key, 0) + 1

    def _patch(self, running: Running, page: int, payload: bytearray) -> bool:
        """Write a signal's wrong bits; returns whether this page has the signal."""
        patch = running.fault.patch
        if patch is None or page not in patch.pages:
            return False
        raw = patch.raw
        if raw is None:
            raw = self._held.setdefault(running.number, reader(patch.field)(bytes(payload)))
        writer(patch.field)(payload, raw)
        return True

    def _states(self, place: int) -> int:
        guard = self._messages[place].guard
        return 1 if guard is None else guard.counter_states

    def _on_bus(self, place: int, page: int, frame: Frame) -> Iterable[Frame]:
        frames = [frame]
        at_work = {running.fault.config.kind: running for running in self._at_work(place, "frame")}
        for kind, change in _CHANGES.items():
            if kind in at_work:
                self._use(at_work[kind], place)
                frames = change(frames, at_work[kind], (place, page))
        return frames


def _crc_wrong(frames: list[Frame], running: Running, key: tuple[int, int]) -> list[Frame]:
    field = (running.fault.checksums or {}).get(key)
    if field is None:
        return frames
    masks = field.masks()
    data = bytes(byte ^ masks.get(place, 0) for place, byte in enumerate(frames[0].data))
    return [replace(frames[0], data=data)]


def _truncated(frames: list[Frame], running: Running, key: tuple[int, int]) -> list[Frame]:
    frame, length = frames[0], running.fault.config.length
    length = len(frame.data) // 2 if length is None else length
    if frame.is_fd:
        length = max(known for known in FD_LENGTHS if known <= length)
    return [replace(frame, data=frame.data[:length])]


def _doubled(frames: list[Frame], running: Running, key: tuple[int, int]) -> list[Frame]:
    return frames * 2


def _delayed(frames: list[Frame], running: Running, key: tuple[int, int]) -> list[Frame]:
    delay_ns = round((running.fault.config.delay_ms or 0.0) * 1_000_000)
    return [replace(frame, due_ns=frame.due_ns + delay_ns) for frame in frames]


def _lost(frames: list[Frame], running: Running, key: tuple[int, int]) -> list[Frame]:
    return []


_Change = Callable[[list[Frame], Running, tuple[int, int]], list[Frame]]
_CHANGES: Mapping[str, _Change] = {
    "crc_wrong": _crc_wrong,
    "frame_truncated": _truncated,
    "frame_doubled": _doubled,
    "frame_delayed": _delayed,
    "frame_lost": _lost,
}
"""In the order in which they act."""

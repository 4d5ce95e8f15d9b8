"""Frames put together to images: which belong to one, and what is wrong with a burst.

An image ends where a message comes for the second time, or after a pause if the next frame has another
image index. A frame that is there twice, bit by bit, counts once.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.kinds import Kind
from vsensor.codec import BulkReader
from vsensor.profile import MessagePlan, Profile
from vsensor.types import BoolArray, CodeArray, IntArray

_UNTIED = -1


@dataclass(frozen=True, slots=True, kw_only=True)
class Mixed:
    """Frames of all messages (N,) in order.

    `plan` is the message's place in the profile, `kind` a number that pages of it which leave together do
    not share, `tie` its image index as far as all messages carry it, -1
    without one; `data` (N, L), `lengths` (N,) bytes; `right`: length and CRC are.
    """

    t_ns: IntArray
    plan: IntArray
    kind: IntArray
    tie: IntArray
    ids: IntArray
    extended: BoolArray
    data: CodeArray
    lengths: CodeArray
    right: BoolArray

    def __len__(self) -> int:
        return len(self.t_ns)

    def taken(self, rows: IntArray | slice) -> "Mixed":
        """Return the chosen rows."""
        return Mixed(**{name: getattr(self, name)[rows] for name in self.__dataclass_fields__})

    def then(self, other: "Mixed") -> "Mixed":
        """Return these frames and the others after them; data as wide as the wider."""
        width = max(self.data.shape[1], other.data.shape[1])
        parts = {
            name: np.concatenate([getattr(self, name), getattr(other, name)])
            for name in self.__dataclass_fields__
            if name != "data"
        }
        data = [np.pad(m.data, ((0, 0), (0, width - m.data.shape[1]))) for m in (self, other)]
        return Mixed(**parts, data=np.concatenate(data))


@dataclass(frozen=True, slots=True, kw_only=True)
class Tie:
    """The signal of a message that carries the image index, modulo `states`."""

    signal: str
    states: int


def ties_of(profile: Profile) -> tuple[Tie | None, ...]:
    """Return where each message has the image index, modulo what all of those have; None without one."""
    found = [_index_signal(plan) for plan in profile.messages]
    states = min((tie.states for tie in found if tie is not None), default=0)
    return tuple(None if tie is None else Tie(signal=tie.signal, states=states) for tie in found)


def _index_signal(plan: MessagePlan) -> Tie | None:
    for binding in plan.bindings:
        everywhere = not binding.parts and binding.signal.mux_signal is None
        if binding.quantity == "image.index" and binding.wrap and everywhere:
            return Tie(signal=binding.signal.name, states=binding.wrap)
    return None


def tie_column(plan: MessagePlan, tie: Tie | None, data: CodeArray) -> IntArray:
    """Return the image index of frames (N, L) of a message, -1 without one."""
    if tie is None:
        return np.full(len(data), _UNTIED, dtype=np.int64)
    raw = BulkReader(plan.layout, data).raw(tie.signal)
    return np.asarray(raw.astype(np.int64) % tie.states)


def image_numbers(frames: Mixed, pause_ns: int) -> tuple[IntArray, BoolArray]:
    """Return the number (N,) of the image of each frame, from 0, and which frames are there twice."""
    numbers, twice = np.empty(len(frames), dtype=np.int64), np.zeros(len(frames), dtype=bool)
    width = frames.data.shape[1]
    raw, lengths = frames.data.tobytes(), frames.lengths.tolist()
    held: dict[int, bytes] = {}
    number, first_tie, last_ns, begun_ns = -1, _UNTIED, 0, 0
    rows = zip(frames.t_ns.tolist(), frames.kind.tolist(), frames.tie.tolist(), strict=True)
    for row, (t_ns, kind, tie) in enumerate(rows):
        data = raw[row * width : row * width + lengths[row]]
        paused = t_ns - last_ns > pause_ns and (tie != first_tie or tie == _UNTIED)
        if kind in held and held[kind] == data and t_ns - begun_ns <= pause_ns and not paused:
            twice[row] = True
        elif not held or kind in held or paused:
            held, number, first_tie, begun_ns = {kind: data}, number + 1, tie, t_ns
        else:
            held[kind] = data
            first_tie = tie if first_tie == _UNTIED else first_tie
        numbers[row], last_ns = number, t_ns
    return numbers, twice


class Bursts:
    """The messages that leave together with one image index, and what is wrong with their images."""

    def __init__(self, profile: Profile, book: Book) -> None:
        self._plans, self._book = profile.messages, book
        declared = {name for burst in profile.bursts for name in burst.layouts}
        sets: dict[object, list[int]] = {}
        for place, (plan, tie) in enumerate(zip(profile.messages, ties_of(profile), strict=True)):
            if tie is not None and plan.sending.is_cyclic and plan.layout.name not in declared:
                key = plan.sending.cycle_ns, plan.sending.offset_ns
                sets.setdefault(key, []).append(place)
        self.sets = [np.array(places) for places in sets.values() if len(places) > 1]
        self.incomplete: dict[int, int] = {}

    def judge(self, frames: Mixed, numbers: IntArray, inner: slice) -> BoolArray:
        """Judge images 0 to R - 1; returns which (R,) are mixed. Only those in `inner` must be complete."""
        count = int(numbers[-1]) + 1 if len(numbers) else 0
        mixed = np.zeros(count, dtype=bool)
        for places in self.sets:
            rows = np.flatnonzero(np.isin(frames.plan, places) & frames.right)
            if len(rows):
                mixed |= self._mixed(frames, numbers, rows, count)
                self._judge_order(frames, numbers, rows)
            every = np.flatnonzero(np.isin(frames.plan, places))
            self._judge_whole(frames, numbers, every, places, count, inner)
        return mixed

    def _mixed(self, frames: Mixed, numbers: IntArray, rows: IntArray, count: int) -> BoolArray:
        """Return which images have frames of different index; the rarer ones are noted."""
        lowest, highest = np.full(count, np.iinfo(np.int64).max), np.full(count, -1)
        np.minimum.at(lowest, numbers[rows], frames.tie[rows])
        np.maximum.at(highest, numbers[rows], frames.tie[rows])
        mixed = (highest >= 0) & (lowest != highest)
        for number in np.flatnonzero(mixed).tolist():
            mine = rows[numbers[rows] == number]
            ties, counts = np.unique(frames.tie[mine], return_counts=True)
            for row in mine[frames.tie[mine] != ties[counts.argmax()]].tolist():
                self._note("burst_mixed", int(frames.plan[row]), [int(frames.t_ns[row])])
        return np.asarray(mixed)

    def _judge_order(self, frames: Mixed, numbers: IntArray, rows: IntArray) -> None:
        back = (np.diff(frames.plan[rows]) < 0) & (np.diff(numbers[rows]) == 0)
        for row in rows[1:][back].tolist():
            self._note("burst_order", int(frames.plan[row]), [int(frames.t_ns[row])])

    def _judge_whole(
        self, frames: Mixed, numbers: IntArray, rows: IntArray, places: IntArray, count: int, inner: slice
    ) -> None:
        there: BoolArray = np.zeros((count, len(places)), dtype=bool)
        there[numbers[rows], np.searchsorted(places, frames.plan[rows])] = True
        begun = np.zeros(count, dtype=np.int64)
        begun[numbers[::-1]] = frames.t_ns[::-1]
        some: BoolArray = np.any(there, axis=1)
        some[: inner.start] = False
        some[inner.stop :] = False
        for column, place in enumerate(places.tolist()):
            lacking = some & ~there[:, column]
            self._note("burst_incomplete", place, begun[lacking])

    def _note(self, kind: Kind, place: int, t_ns: IntArray | Sequence[int]) -> None:
        self._book.note(kind, self._plans[place].layout.name, t_ns)

"""A log cut at any place is joined so that a sensor's images keep their rhythm, and none is torn.

    log       K....  K....  K..|      |..  K....  K....      K: first frame of an image
    replay    K....  K....             K....  K....          due one interval after the K before it

After a seek, or in the next pass of a loop, nothing is played before the first K; and of an image that ends
where the pass does, nothing is played if frames of it are missing.
"""

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from vsensor.logs import Columns
from vsensor.logs.table import joined
from vsensor.replay.choice import EXTENDED_KEY, keys_of
from vsensor.replay.timeline import Pace, Place, moved, paced
from vsensor.types import IntArray

if TYPE_CHECKING:
    from vsensor.profile import Profile

REMEMBERED = 8192  # more than a player reads ahead
GIVEN_UP = 3  # intervals without a K: then there is no rhythm to keep


class Beat(NamedTuple):
    """The rhythm of a log: `key` comes first of the `frames` of `members` that an image has."""

    key: int
    members: frozenset[int]
    frames: int
    interval_ns: int


def beat_of(
    profiles: Sequence["Profile"], keys: IntArray, m_ns: IntArray, rename: Mapping[int, int]
) -> Beat | None:
    """Return the rhythm of the first profile that has one in these frames (N,); None without any.

    `keys` are those of the log, `rename`d when they are sent.
    """
    found = {rename.get(key, key): key for key in np.unique(keys).tolist()}
    for profile in profiles:
        cycles: dict[int, list[int]] = {}
        for plan in profile.messages:
            key = plan.layout.arbitration_id | EXTENDED_KEY * plan.layout.is_extended
            if plan.sending.is_cyclic and key in found:
                cycles.setdefault(plan.cycle_ns, []).append(found[key])
        for members in sorted(cycles.values(), key=len, reverse=True):
            rows = np.flatnonzero(np.isin(keys, members))
            beat = _beat(members, keys[rows], m_ns[rows])
            if beat is not None:
                return beat
    return None


def _beat(members: list[int], keys: IntArray, m_ns: IntArray) -> Beat | None:
    first = _first(members, keys, m_ns)
    beats = np.flatnonzero(keys == first)
    if len(beats) < 3 or np.median(np.diff(m_ns[beats])) <= 0:
        return None
    frames = int(np.median(np.diff(beats)))
    return Beat(first, frozenset(members), frames, int(np.median(np.diff(m_ns[beats]))))


def _first(members: list[int], keys: IntArray, m_ns: IntArray) -> int:
    """Return the message that mostly comes after the longest pauses between them."""
    steps = np.diff(m_ns)
    if not len(steps):
        return members[0]
    after = keys[1:][steps > steps.max() / 2]
    counts = {key: int(np.count_nonzero(after == key)) for key in members}
    return max(members, key=lambda key: counts[key])


def rest_of_image(beat: Beat, keys: Iterable[int]) -> int:
    """Return how many of the coming frames, of these keys in the log, complete the image that has begun."""
    count = there = 0
    for place, key in enumerate(keys, 1):
        if key == beat.key or there == beat.frames:
            break
        if key in beat.members:
            count, there = place, there + 1
    return count


class InStep:
    """Keeps the passes and seeks of one reel in step with a beat."""

    def __init__(self, beat: Beat, pace: Pace) -> None:
        self._beat, self._pace = beat, pace
        self._dues: deque[int] = deque(maxlen=REMEMBERED)  # of the beats that were played
        self._tail: tuple[Columns, IntArray] | None = None
        self._target_ns: int | None = None  # when the first beat is due; None: nothing is waited for
        self._waited_from_ns: int | None = None
        self.interval_ns = beat.interval_ns * pace.speed.denominator // pace.speed.numerator
        self.dropped = 0

    def take(self, columns: Columns, m_ns: IntArray, place: Place) -> tuple[Columns, IntArray, Place]:
        """Return the frames that are played now, and the place that they are timed from.

        What may be an image that is not complete is kept for the next call.
        """
        if self._tail is not None:
            columns, m_ns = joined([self._tail[0], columns]), np.concatenate([self._tail[1], m_ns])
            self._tail = None
        keys = keys_of(columns)
        if self._target_ns is not None:
            first, place = self._awaited(keys, m_ns, place)
            columns, m_ns, keys = columns.taken(slice(first, None)), m_ns[first:], keys[first:]
        end = self._whole(keys, m_ns)
        if end < len(keys):
            self._tail = columns.taken(slice(end, None)), m_ns[end:]
        columns, m_ns = columns.taken(slice(0, end)), m_ns[:end]
        _, due_ns = paced(self._pace, place, m_ns)
        self._dues.extend(due_ns[keys[:end] == self._beat.key].tolist())
        return columns, m_ns, place

    def _awaited(self, keys: IntArray, m_ns: IntArray, place: Place) -> tuple[int, Place]:
        """Return the first frame that is played, and the place of it."""
        if self._target_ns is None or not len(keys):
            return 0, place
        beats = np.flatnonzero(keys == self._beat.key)
        if len(beats):
            place = moved(self._pace, int(m_ns[beats[0]]), self._target_ns)
            self._target_ns = None
            self.dropped += int(beats[0])
            return int(beats[0]), place
        self._waited_from_ns = int(m_ns[0]) if self._waited_from_ns is None else self._waited_from_ns
        if m_ns[-1] - self._waited_from_ns > GIVEN_UP * self._beat.interval_ns:
            self._target_ns = None
            return 0, place
        self.dropped += len(keys)
        return len(keys), place

    def _whole(self, keys: IntArray, m_ns: IntArray) -> int:
        """Return where the last image begins if frames of it may be missing, else the end."""
        beats = np.flatnonzero(keys == self._beat.key)
        if not len(beats):
            return len(keys)
        last = int(beats[-1])
        there = np.isin(keys[last:], list(self._beat.members))
        is_whole = int(np.count_nonzero(there)) >= self._beat.frames
        is_late = m_ns[-1] - m_ns[last] > self._beat.interval_ns // 2
        return len(keys) if is_whole or is_late else last

    def rest(self) -> tuple[Columns, IntArray] | None:
        """Return what is kept, at the end of the last pass."""
        tail, self._tail = self._tail, None
        return tail

    def turn_over(self, place: Place) -> None:
        """Begin the next pass: its first beat is due in place of a torn one, or an interval after another."""
        if not self._dues:
            self._tail = None
            return
        target_ns = self._dues[-1] + self.interval_ns
        if self._tail is not None:
            self.dropped += len(self._tail[1])
            _, due_ns = paced(self._pace, place, self._tail[1][:1])
            target_ns, self._tail = int(due_ns[0]), None
        self._wait(target_ns, place.due_ns(self._pace))

    def seek(self, due_ns: int) -> None:
        """Go on elsewhere: the first beat is due not before `due_ns`, whole intervals after the last.

        Or at `due_ns` itself, if that is as little late as the beat may have been in whose place it comes.
        """
        self._tail = None
        while self._dues and self._dues[-1] >= due_ns:  # was not sent
            self._dues.pop()
        next_ns = self._dues[-1] + self.interval_ns if self._dues else due_ns
        is_jitter = 0 < due_ns - next_ns <= self.interval_ns // 2
        self._wait(due_ns if is_jitter else next_ns, due_ns)

    def lines(self) -> list[str]:
        """Return what was left out at seams and seeks, as sentences."""
        what = "left out at seams and seeks, so that no image is torn"
        return [f"{self.dropped} frames {what}"] if self.dropped else []

    def _wait(self, target_ns: int, not_before_ns: int) -> None:
        late_ns = max(0, not_before_ns - target_ns)
        self._target_ns = target_ns + -(-late_ns // self.interval_ns) * self.interval_ns
        self._waited_from_ns = None

"""A reel with a lane sensor laid over it: the car's frames and, every 40 ms of replay time, an image's.

    reel ──► car's frames ──► split at the slots ──► frames, [image k], frames, [image k+1], ... ──► merged
                                 │ Wish: the log's time there             ▲ Made
                                 └──────────────► desk (computes) ────────┘

Slot k lies k * period after the replay's beginning, in the log's pace: at speed 10 the 40 ms of the sensor's
clock pass in 4 ms. Its clock, counters and images go on over seams and seeks; the scene is where the log is.
"""

from collections import deque
from collections.abc import Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple

from msgspec.structs import replace

from vsensor.overlay import KEPT, Desk, Made, Wish
from vsensor.replay.images import Images, Slot
from vsensor.replay.reading import Reading
from vsensor.replay.reel import Piece, Reel
from vsensor.replay.steered import Motions, Steered
from vsensor.types import Frame

LOOK_AHEAD = 8
"""Images asked for before the first of them is needed."""
FRAMES_AHEAD = 2048
"""Frames read ahead by the player: as many images, should the log be that quiet, can be taken back."""

assert KEPT > FRAMES_AHEAD + LOOK_AHEAD

LEAD_NS = 15_000_000
"""A steered vehicle's image is asked for so long before its slot, with what the ECU has sent until then."""
FETCH_NS = 2_000_000
"""And fetched so long before; so is every image that is not there yet, as whoever fetches it waits for it."""
SEEK_LEAD_NS = 100_000_000
"""A seek leaves so much time for the first images of the new place, behind those that are made in vain."""


class Lay(NamedTuple):
    """How the sensor lies over the log: its cycle, the replay's speed, the channel of its frames.

    `keys`: its messages (id, is 29-bit); `heard`: those that move its vehicle.
    """

    period_ns: int
    speed: Fraction
    channel: int
    keys: frozenset[tuple[int, bool]]
    heard: frozenset[tuple[int, bool]] = frozenset()


class Overlaid:
    """Pulled like a reel; `seek` needs the frames that were pulled and not sent."""

    most_ahead, lead_ns = FRAMES_AHEAD, SEEK_LEAD_NS

    def __init__(self, reel: Reel, desk: Desk, lay: Lay) -> None:
        self.start_ns = reel.start_ns
        self.ended = False
        self.images = 0
        self._reel, self._desk, self._lay = reel, desk, lay
        self._car = Piece([], [], 0)
        self._at = 0  # place in it
        self._entries: deque[Piece | Slot] = deque()  # frames, or the image of a slot
        self._asked = 0  # slots among them
        self._next = 0  # number of the next slot to be asked for
        self._is_there = False  # the image that is the first of the entries, as far as it is known
        self._made = Images()
        self._heard: list[Frame] = []
        self._passed = Slot(0, reel.start_ns, 0)  # the latest frame of the car that was passed
        self._scene_ns: int | None = None  # the log's time of the latest slot
        self._loop = 0  # and its pass
        self.steered: Steered | None = None
        self._motions = Motions()

    @property
    def grain(self) -> int:
        """About how many frames of the car are pulled at a time."""
        return self._reel.grain

    @grain.setter
    def grain(self, frames: int) -> None:
        self._reel.grain = frames

    @property
    def opens_ns(self) -> int:
        """The replay's time before which there is nothing to pull: an image that may not be asked for yet.

        Or that is not there yet.
        """
        if self._entries:
            first = self._entries[0]
            if not isinstance(first, Slot):
                return 0
            if not self._is_steered():
                self._is_there = self._is_there or self._desk.is_ready
            return 0 if self._is_there else first.due_ns - FETCH_NS
        return self.slot_due_ns(self._next) - LEAD_NS if self._is_steered() and self._is_slot_next() else 0

    def pull(self) -> Piece | None:
        """Return the next few frames; None if there is none yet, or (`ended`) any more."""
        asked = self._next
        while self._asked < LOOK_AHEAD and self._at < len(self._car.frames) and self._may_split():
            self._split()
        if self._next > asked and self._is_steered():
            return None  # it is computed meanwhile
        is_short = self._asked < LOOK_AHEAD and self._at == len(self._car.frames)
        if is_short and not self._reel.ended and not (self._entries and self._is_steered()):
            piece = self._reel.pull()
            if piece is not None:
                self._car, self._at = piece, 0
            return None
        if not self._entries:
            return None if self._at < len(self._car.frames) else self._rest()
        entry = self._entries.popleft()
        if isinstance(entry, Piece):
            return self._merged(self._motions.told_anew(self.steered, entry))
        self._asked, self._is_there = self._asked - 1, False
        return self._image(entry)

    def _is_steered(self) -> bool:
        """Return whether the next slot is one of a steered vehicle."""
        steered = self.steered
        return steered is not None and self._slot_log_ns(self.slot_due_ns(self._next)) >= steered.from_ns

    def _is_slot_next(self) -> bool:
        frames, at = self._car.frames, self._at
        return at < len(frames) and frames[at].due_ns > self.slot_due_ns(self._next)

    def _may_split(self) -> bool:
        """Return whether to go on: a steered vehicle's image waits until all before it is pulled."""
        return not (self._is_steered() and self._entries)

    def reading(self, log_ns: int) -> Reading:
        """Return what can be read up to `log_ns`, little by little, while this plays on: for `seek`."""
        return self._reel.reading(log_ns)

    def seek(
        self,
        log_ns: int,
        due_ns: int,
        loop: int = 0,
        unsent: Sequence[Frame] = (),
        reading: Reading | None = None,
    ) -> None:
        """Go on with the car's first frame not before `log_ns`; the sensor goes on where it is.

        An image of which something was sent is sent to its end.
        """
        self._reel.seek(log_ns, due_ns, loop, reading=reading)
        self.ended = False
        self._next, self._asked = self._made.take_back(unsent), 0
        self._scene_ns = self._made.log_ns
        self._desk.rewind(self._next)
        self._car, self._at = Piece([], [], loop), 0
        self._entries.clear()
        self._heard.clear()
        self._motions.forget()
        self._is_there = False
        self._passed = Slot(due_ns, max(log_ns, self.start_ns), loop)

    def whole(self, frames: Iterable[Frame]) -> int:
        """Return 0: an image that has begun is sent to its end after a seek, on its own times."""
        return 0

    def slot_due_ns(self, index: int) -> int:
        """Return when slot `index` is due."""
        return self._due_of(index * self._lay.period_ns)

    def _due_of(self, sensor_ns: int) -> int:
        speed = self._lay.speed
        return sensor_ns * speed.denominator // speed.numerator

    def _split(self) -> None:
        """Move the car's frames up to the next slot into the entries, or that slot."""
        frames, at = self._car.frames, self._at
        due_ns = self.slot_due_ns(self._next)
        end = at
        while end < len(frames) and frames[end].due_ns <= due_ns:
            end += 1
        if end > at:
            run = Piece(frames[at:end], self._car.log_ns[at:end], self._car.loop)
            self._entries.append(run)
            self._passed = Slot(run.frames[-1].due_ns, run.log_ns[-1], run.loop)
            if self._lay.heard:
                self._hear(run.frames)
            self._at = end
            return
        self._ask(due_ns)

    def _hear(self, frames: Sequence[Frame]) -> None:
        heard = self._lay.heard
        self._heard += [frame for frame in frames if (frame.arbitration_id, frame.is_extended) in heard]

    def _ask(self, due_ns: int) -> None:
        """Ask for the image of the next slot, which is due at `due_ns`."""
        passed, period_ns = self._passed, self._lay.period_ns
        log_ns = self._slot_log_ns(due_ns)
        expected_ns = log_ns if self._scene_ns is None else self._scene_ns + period_ns
        is_cut = abs(log_ns - expected_ns) > period_ns
        if self.steered is not None:
            self._hear(self.steered.ears.taken())
        heard = tuple(self._on_sensor_time(frame) for frame in self._heard)
        self._heard.clear()
        self._desk.ask(Wish(self._next, log_ns, is_cut, is_cut and passed.loop != self._loop, heard))
        self._scene_ns, self._loop = log_ns, passed.loop
        self._entries.append(Slot(due_ns, log_ns, passed.loop))
        self._asked += 1
        self._next += 1

    def _slot_log_ns(self, due_ns: int) -> int:
        """Return the log's time of a slot that is due next."""
        passed, speed = self._passed, self._lay.speed
        return passed.log_ns + (due_ns - passed.due_ns) * speed.numerator // speed.denominator

    def _on_sensor_time(self, frame: Frame) -> Frame:
        speed = self._lay.speed
        return replace(frame, due_ns=frame.due_ns * speed.numerator // speed.denominator)

    def _image(self, slot: Slot) -> Piece | None:
        """Return the frames of the image that was asked for first, and what waited until then."""
        made: Made = self._desk.answer()
        self._motions.take(self.steered, slot.log_ns, made)
        frames = tuple(
            replace(frame, due_ns=self._due_of(frame.due_ns), channel=self._lay.channel)
            for frame in made.frames
        )
        self._made.add(made.number, frames, slot)
        self.images += bool(frames)
        return _piece(self._made.taken(slot.due_ns), slot)

    def _merged(self, run: Piece) -> Piece | None:
        """Return frames of the car, and between them the sensor's that are due there."""
        if not run.frames:
            return None
        ends_ns = run.frames[-1].due_ns
        if not self._made.is_due(ends_ns):
            return run
        own = self._made.taken(ends_ns)
        both = [*zip(run.frames, run.log_ns, strict=True)]
        both += [(frame, self._log_ns(frame, run)) for frame in own]
        both.sort(key=lambda pair: pair[0].due_ns)
        return Piece([frame for frame, _ in both], [log_ns for _, log_ns in both], run.loop)

    def _log_ns(self, frame: Frame, run: Piece) -> int:
        speed = self._lay.speed
        ahead_ns = (run.frames[-1].due_ns - frame.due_ns) * speed.numerator // speed.denominator
        return run.log_ns[-1] - ahead_ns

    def _rest(self) -> Piece | None:
        """Return what still waits when the log has ended."""
        self.ended = True
        return _piece(self._made.taken(1 << 62), self._passed)


def _piece(frames: list[Frame], place: Slot) -> Piece | None:
    return Piece(frames, [place.log_ns] * len(frames), place.loop) if frames else None

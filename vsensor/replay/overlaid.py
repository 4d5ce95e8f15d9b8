"""A reel with a lane sensor laid over it: the car's frames and, every 40 ms of replay time, an image's.

    reel ──► car's frames ──► split at the slots ──► frames, [image k], frames, [image k+1], ... ──► merged
                                 │ Wish: the log's time there             ▲ Made
                                 └──────────────► desk (computes) ────────┘

Slot k lies k * period after the replay's beginning, in the log's pace: at speed 10 the 40 ms of the sensor's
clock pass in 4 ms. Its clock, counters and images go on over seams and seeks; the scene is where the log is.
"""

from collections import deque
from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from typing import NamedTuple, Protocol

from msgspec.structs import replace

from vsensor.overlay import KEPT, Desk, Made, MovedFrames, Wish
from vsensor.replay.reel import Piece, Reel
from vsensor.types import Frame

LOOK_AHEAD = 8
"""Images asked for before the first of them is needed."""
FRAMES_AHEAD = 2048
"""Frames read ahead by the player: as many images, should the log be that quiet, can be taken back."""

assert KEPT > FRAMES_AHEAD + LOOK_AHEAD

LEAD_NS = 15_000_000
"""A steered vehicle's image is asked for so long before its slot, with what the ECU has sent until then."""
FETCH_NS = 2_000_000  # and fetched so long before


class Lay(NamedTuple):
    """How the sensor lies over the log: its cycle, the replay's speed, the channel of its frames.

    `keys`: its messages (id, is 29-bit); `heard`: those that move its vehicle.
    """

    period_ns: int
    speed: Fraction
    channel: int
    keys: frozenset[tuple[int, bool]]
    heard: frozenset[tuple[int, bool]] = frozenset()


class Ears(Protocol):
    """Who hears the ECU."""

    def taken(self) -> Sequence[Frame]:
        """Return what was heard since the last call, times from the replay's beginning."""
        ...


class Steered(NamedTuple):
    """From `from_ns` of the log on an ECU steers: `ears` hear it, `frames` of the car tell the new motion.

    `recorded(log_ns)` and `simulated(made)` give the quantities of MovedFrames.
    """

    from_ns: int
    ears: Ears
    frames: MovedFrames
    recorded: Callable[[int], dict[str, float]]
    simulated: Callable[[Made], dict[str, float]]


class _Passed(NamedTuple):
    """The latest frame of the car that was passed: when it is due, the log's time of it, the pass."""

    due_ns: int
    log_ns: int
    loop: int


class _Image(NamedTuple):
    """An image that was made: its slot's number, its frames, where the log was."""

    number: int
    frames: tuple[Frame, ...]
    slot: _Passed


class Overlaid:
    """Pulled like a reel; `seek` needs the frames that were pulled and not sent."""

    most_ahead = FRAMES_AHEAD

    def __init__(self, reel: Reel, desk: Desk, lay: Lay) -> None:
        self.start_ns = reel.start_ns
        self.ended = False
        self.images = 0
        self._reel, self._desk, self._lay = reel, desk, lay
        self._car = Piece([], [], 0)
        self._at = 0  # place in it
        self._entries: deque[Piece | _Passed] = deque()  # frames, or (where the log is) the image of a slot
        self._asked = 0  # slots among them
        self._next = 0  # number of the next slot to be asked for
        self._waiting: list[Frame] = []  # the sensor's, made and not yet pulled
        self._made: deque[_Image] = deque(maxlen=KEPT)
        self._heard: list[Frame] = []
        self._passed = _Passed(0, reel.start_ns, 0)
        self._scene_ns: int | None = None  # the log's time of the latest slot
        self._loop = 0  # and its pass
        self.steered: Steered | None = None
        self._motions: deque[tuple[int, dict[str, float]]] = deque(maxlen=2)  # of steered slots, log time

    @property
    def opens_ns(self) -> int:
        """The replay's time before which there is nothing to pull: an image that may not be asked for yet."""
        if not self._is_steered():
            return 0
        if self._entries:
            first = self._entries[0]
            return first.due_ns - FETCH_NS if isinstance(first, _Passed) else 0
        return self.slot_due_ns(self._next) - LEAD_NS if self._is_slot_next() else 0

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
            return self._merged(self._told_anew(entry))
        self._asked -= 1
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

    def seek(self, log_ns: int, due_ns: int, loop: int = 0, unsent: Sequence[Frame] = ()) -> None:
        """Go on with the car's first frame not before `log_ns`; the sensor goes on where it is.

        An image of which something was sent is sent to its end.
        """
        self._reel.seek(log_ns, due_ns, loop)
        self.ended = False
        waiting = {id(frame) for frame in (*unsent, *self._waiting)}
        self._waiting, resume = [], self._made[-1].number + 1 if self._made else 0
        for image in self._made:
            left = [frame for frame in image.frames if id(frame) in waiting]
            if image.frames and len(left) == len(image.frames):
                resume = image.number
                break
            self._waiting += left
        self._waiting.sort(key=_due)
        while self._made and self._made[-1].number >= resume:
            self._made.pop()
        self._scene_ns = self._made[-1].slot.log_ns if self._made else None
        self._desk.rewind(resume)
        self._next, self._asked = resume, 0
        self._car, self._at = Piece([], [], loop), 0
        self._entries.clear()
        self._heard.clear()
        self._motions.clear()
        self._passed = _Passed(due_ns, max(log_ns, self.start_ns), loop)

    def unfinished(self, frames: Iterable[Frame]) -> int:
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
            self._passed = _Passed(run.frames[-1].due_ns, run.log_ns[-1], run.loop)
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
        self._entries.append(_Passed(due_ns, log_ns, passed.loop))
        self._asked += 1
        self._next += 1

    def _slot_log_ns(self, due_ns: int) -> int:
        """Return the log's time of a slot that is due next."""
        passed, speed = self._passed, self._lay.speed
        return passed.log_ns + (due_ns - passed.due_ns) * speed.numerator // speed.denominator

    def _told_anew(self, run: Piece) -> Piece:
        """Return the car's frames as they are once the vehicle moves otherwise than recorded."""
        steered = self.steered
        if steered is None or not self._motions:
            return run
        pairs = []
        for frame, log_ns in zip(run.frames, run.log_ns, strict=True):
            moved = frame if log_ns < steered.from_ns else self._told(steered, frame, log_ns)
            if moved is not None:
                pairs.append((moved, log_ns))
        return Piece([frame for frame, _ in pairs], [log_ns for _, log_ns in pairs], run.loop)

    def _told(self, steered: Steered, frame: Frame, log_ns: int) -> Frame | None:
        """Return a frame with the motion of its time, extrapolated from the latest two slots."""
        (first_ns, first), (last_ns, last) = self._motions[0], self._motions[-1]
        part = (log_ns - last_ns) / (last_ns - first_ns) if last_ns > first_ns else 0.0
        recorded = steered.recorded(log_ns)
        changes = {
            name: value + part * (value - first[name]) - recorded[name] for name, value in last.items()
        }
        return steered.frames.moved(frame, changes)

    def _on_sensor_time(self, frame: Frame) -> Frame:
        speed = self._lay.speed
        return replace(frame, due_ns=frame.due_ns * speed.numerator // speed.denominator)

    def _image(self, slot: _Passed) -> Piece | None:
        """Return the frames of the image that was asked for first, and what waited until then."""
        made: Made = self._desk.answer()
        if self.steered is not None and made.is_steered:
            self._motions.append((slot.log_ns, self.steered.simulated(made)))
        else:
            self._motions.clear()
        frames = tuple(
            replace(frame, due_ns=self._due_of(frame.due_ns), channel=self._lay.channel)
            for frame in made.frames
        )
        self._made.append(_Image(made.number, frames, slot))
        self.images += bool(frames)
        self._waiting = sorted((*self._waiting, *frames), key=_due)
        return self._piece(self._taken(slot.due_ns), slot)

    def _merged(self, run: Piece) -> Piece | None:
        """Return frames of the car, and between them the sensor's that are due there."""
        if not run.frames:
            return None
        if not self._waiting or self._waiting[0].due_ns > run.frames[-1].due_ns:
            return run
        own = self._taken(run.frames[-1].due_ns)
        both = [*zip(run.frames, run.log_ns, strict=True)]
        both += [(frame, self._log_ns(frame, run)) for frame in own]
        both.sort(key=lambda pair: pair[0].due_ns)
        return Piece([frame for frame, _ in both], [log_ns for _, log_ns in both], run.loop)

    def _log_ns(self, frame: Frame, run: Piece) -> int:
        speed = self._lay.speed
        ahead_ns = (run.frames[-1].due_ns - frame.due_ns) * speed.numerator // speed.denominator
        return run.log_ns[-1] - ahead_ns

    def _taken(self, due_ns: int) -> list[Frame]:
        """Return what waits and is due by then."""
        count = sum(frame.due_ns <= due_ns for frame in self._waiting)
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def _piece(self, frames: list[Frame], place: _Passed) -> Piece | None:
        return Piece(frames, [place.log_ns] * len(frames), place.loop) if frames else None

    def _rest(self) -> Piece | None:
        """Return what still waits when the log has ended."""
        self.ended = True
        return self._piece(self._taken(1 << 62), self._passed)


def _due(frame: Frame) -> int:
    return frame.due_ns

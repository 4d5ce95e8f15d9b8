"""Sends frames at absolute deadlines; reading, recording and listening are done while there is time.

    log ──► Reel.pull ──► pieces, read ahead ──► stages ──► wait ──► buses ──► recording
            (128 frames)                        (repair..)  until origin + due_ns

One thread, one core `advance`: what it does next depends on the clock alone. Work that can wait is done
when it fits before the next deadline, by what it cost before.
"""

from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import chain, islice
from typing import Any, Protocol

from vsensor.clock import Clock
from vsensor.replay.reel import Piece
from vsensor.replay.report import Report
from vsensor.replay.stages import Chain, Stage
from vsensor.types import Frame

SCARCE = 256  # below it reading comes before everything else that can wait
REST_NS = 20_000_000
"""A longer wait is cut, so that keys and Ctrl-C are heard."""
LISTEN_NS = 20_000_000
"""A full bus brings 160 frames in that time, a socket holds at least 270."""
UNHEARD = 1000  # frames sent without listening, where there is no time at all
RECORDED_AT_ONCE, UNRECORDED = 64, 4096
IMAGE_FRAMES = 256  # that are looked at for the end of an image
AT_ONCE = 16  # frames that were late are sent between two looks at the clock
BREATHLESS, BREATH_NS = 128, 500_000
"""After so many late frames without a wait the processor is given away for so long: a real-time process that
catches up on the only one would starve who listens, and the kernel, which then loses frames."""


class Sending(Protocol):
    """What the player needs of the buses."""

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame (counted, never raised)."""
        ...

    def drain(self) -> Sequence[Frame]:
        """Return what was heard since the last call."""
        ...


class Pulled(Protocol):
    """What the player needs of a reel, or of one with something laid over it."""

    start_ns: int
    ended: bool
    most_ahead: int

    @property
    def opens_ns(self) -> int:
        """The replay's time before which there is nothing to pull."""
        ...

    def pull(self) -> Piece | None:
        """Return the next few frames; None if there is none yet, or (`ended`) any more."""
        ...

    def seek(self, log_ns: int, due_ns: int, loop: int = 0, unsent: Sequence[Frame] = ()) -> None:
        """Go on with the first frame not before `log_ns`, due at `due_ns`; `unsent` were pulled in vain."""
        ...

    def unfinished(self, frames: Iterable[Frame]) -> int:
        """Return how many of the coming frames are to be sent before a seek."""
        ...


class Player:
    """Plays a reel. `advance` until it returns False; between two calls anything may be asked of it.

    `states` are those of the stages. All times are of `clock`; the frame that is due at 0 leaves at
    `origin_ns`; `now_ns` is when it was last looked at, which is seldom: inside user-mode Linux a look takes
    50 us, as long as sending a frame.
    """

    def __init__(
        self,
        reel: Pulled,
        sending: Sending,
        clock: Clock,
        *,
        stages: Sequence[Stage] = (),
        record: Callable[[Frame, int], None] | None = None,
        origin_ns: int | None = None,
        real_time: bool = True,
    ) -> None:
        """Prepare to play; the first frames are read here. Raises LogError if there is nothing to play.

        `record(frame, origin_ns)` gets every frame that was taken, some time after it was sent.
        """
        self.report = Report(real_time=real_time)
        self.states = [stage.state for stage in stages]
        self._chain = Chain(stages)
        self._reel, self._sending, self._clock = reel, sending, clock
        self._record = record
        self._pieces: deque[Piece] = deque()
        self._at = self._ahead = 0  # place in the first piece; frames read and not yet sent
        self._ready: tuple[list[Any], tuple[Frame, ...]] | None = (
            None  # the next frame, changed by the stages
        )
        self._to_record: deque[tuple[Frame, int]] = deque()
        self._unheard, self._heard_ns = 0, 0
        self._breathless = 0
        self._pull_ns = self._listen_ns = self._record_ns = 0  # what they cost
        self._paused_ns: int | None = None
        self._position_ns, self._due_ns = reel.start_ns, 0
        self._fill(at_once=True)
        self.now_ns = clock.now_ns()
        self.origin_ns = self.now_ns if origin_ns is None else origin_ns

    @property
    def position_s(self) -> float:
        """Log time of the latest frame sent, s from the log's start (or --start)."""
        return (self._position_ns - self._reel.start_ns) / 1e9

    @property
    def paused(self) -> bool:
        """Whether it is paused."""
        return self._paused_ns is not None

    def advance(self) -> bool:
        """Send what is due, or work or wait a little (20 ms at most); False when all is sent and recorded."""
        if self._paused_ns is not None:
            self._spend(self.now_ns + REST_NS)
            return True
        next_due_ns = self._next_due()
        if next_due_ns is None:
            self.finish()
            return False
        if not self.report.real_time:
            self._send_piece()
            return True
        due_ns = self.origin_ns + next_due_ns
        if self.now_ns < due_ns:
            self._spend(min(due_ns, self.now_ns + REST_NS))
        if self.now_ns >= due_ns:
            self._send_due()
        return True

    def pause(self) -> None:
        """Hold the next frame back until `resume`."""
        if self._paused_ns is None:
            self.now_ns = self._paused_ns = self._clock.now_ns()

    def resume(self) -> None:
        """Go on: the rest of the interval in which it was paused, then the next frame."""
        if self._paused_ns is not None:
            self.now_ns = self._clock.now_ns()
            self.origin_ns += self.now_ns - self._paused_ns
            self._paused_ns = None

    def step(self, count: int = 1) -> int:
        """Pause, and send the next `count` frames at once; returns how many there were."""
        self.pause()
        for done in range(count):
            if not self._pieces and not self._fill(at_once=True):
                return done
            frame = self._next()
            self._paused_ns = self._clock.now_ns()
            self.origin_ns = self._paused_ns - frame.due_ns
            self._wake_until(frame.due_ns)
            self._send(frame)
        return count

    def seek(self, log_s: float) -> None:
        """Go on with the first frame at or after `log_s`, s from the log's start (or --start).

        The replay's own time goes on: `due_ns` of frames, counters and timestamps of the stages.
        """
        if self._paused_ns is None:
            self._finish_image()
        now_ns = self._clock.now_ns() if self._paused_ns is None else self._paused_ns
        due_ns = max(self._due_ns, now_ns - self.origin_ns)
        loop = self._pieces[0].loop if self._pieces else 0
        unsent = [frame for piece in self._pieces for frame in piece.frames][self._at :]
        self._pieces.clear()
        self._at, self._ahead, self._ready = 0, 0, None
        self._reel.seek(self._reel.start_ns + round(log_s * 1e9), due_ns, loop, unsent)
        self._position_ns = self._reel.start_ns + max(0, round(log_s * 1e9))
        self._fill(at_once=True)  # takes as long as reading up to there: not counted
        self.now_ns = self._clock.now_ns()
        if self._paused_ns is None:
            self.origin_ns = self.now_ns - due_ns
        else:
            self.origin_ns = self._paused_ns - due_ns

    def _finish_image(self) -> None:
        """Send what is left of an image that has begun, where the reel keeps images whole."""
        first = self._at
        coming = chain.from_iterable(
            piece.frames[first * (number == 0) :] for number, piece in enumerate(self._pieces)
        )
        for _ in range(self._reel.unfinished(islice(coming, IMAGE_FRAMES))):
            self._wake_until(self._next().due_ns)
            self._send(self._next())

    def finish(self) -> None:
        """Record and hear what is left: at the end, or instead of playing on."""
        while self._to_record:
            self._write()
        self._listen()

    def _next(self) -> Frame:
        return self._pieces[0].frames[self._at]

    def _next_due(self) -> int | None:
        """Return when the next frame is due, of the log or of a stage; None if there is none any more."""
        times = [self._next().due_ns] if self._pieces or self._fill() else []
        if not self._reel.ended and not self._is_open():  # there will be more to pull, and it is waited for
            times.append(self._reel.opens_ns)
        woken = self._chain.next_wake(self.states)
        return min([*times, *(() if woken is None else woken[:1])], default=None)

    def _wake_until(self, last_ns: int) -> None:
        """Send the stages' own frames that are due before, or at, `last_ns`; what a bus refuses is lost."""
        while self._chain.is_timed and (woken := self._chain.next_wake(self.states)) is not None:
            due_ns, number = woken
            if due_ns > last_ns:
                return
            self.states, frames = self._chain.wake(self.states, number, due_ns)
            self._ready = None  # it was made with the states before
            self.report.order(self._due_ns, due_ns)
            self._due_ns = max(self._due_ns, due_ns)
            if self.report.real_time and self._paused_ns is None:
                self.report.late(self.now_ns - self.origin_ns - due_ns)
            self._give((self.states, frames))

    def _fill(self, *, at_once: bool = False) -> bool:
        """Read until there is a frame to send; False if there is none any more, or (not `at_once`) yet."""
        while not self._pieces and not self._reel.ended and (at_once or self._is_open()):
            self._pull()
        return bool(self._pieces)

    def _is_open(self) -> bool:
        """Return whether it is time to pull; without waiting it always is."""
        opens_ns = self._reel.opens_ns
        return not opens_ns or not self.report.real_time or self.now_ns - self.origin_ns >= opens_ns

    def _pull(self) -> None:
        piece = self._reel.pull()
        if piece is not None:
            self._pieces.append(piece)
            self._ahead += len(piece.frames)

    def _spend(self, until_ns: int) -> None:
        """Do what fits before `until_ns`, then wait for it."""
        if self._paused_ns is None and self._ready is None and self._pieces:
            self._ready = self._chain.through(self.states, (self._next(),))
        while (work := self._work(until_ns - self.now_ns)) is not None:
            before_ns = self.now_ns
            work()
            self.now_ns = self._clock.now_ns()
            self._note_cost(work, self.now_ns - before_ns)
        self.now_ns = self._clock.sleep_until_ns(until_ns)
        self._breathless = 0

    def _work(self, left_ns: int) -> Callable[[], None] | None:
        """Return what is to be done and fits into `left_ns`."""
        may_pull = not self._reel.ended and left_ns > self._pull_ns and self._is_open()
        if may_pull and self._ahead < SCARCE:
            return self._pull
        if self.now_ns - self._heard_ns >= LISTEN_NS and left_ns > self._listen_ns:
            return self._listen
        if self._to_record and left_ns > self._record_ns:
            return self._write
        return self._pull if may_pull and self._ahead < self._reel.most_ahead else None

    def _note_cost(self, work: Callable[[], None], cost_ns: int) -> None:
        """Remember what a work took: the most of late, with a margin; it is forgotten by and by."""
        if work == self._pull:
            self._pull_ns = max(cost_ns * 5 // 4, self._pull_ns * 15 // 16)
        elif work == self._listen:
            self._listen_ns = max(cost_ns * 5 // 4, self._listen_ns * 15 // 16)
        else:
            self._record_ns = max(cost_ns * 5 // 4, self._record_ns * 15 // 16)

    def _listen(self) -> None:
        self._unheard, self._heard_ns = 0, self.now_ns
        self._sending.drain()

    def _write(self) -> None:
        record = self._record
        if record is not None:
            for _ in range(min(RECORDED_AT_ONCE, len(self._to_record))):
                record(*self._to_record.popleft())

    def _send_due(self) -> None:
        """Send the frames whose time has come, and note how late the first of each time left."""
        firsts: list[tuple[int, int]] = []  # place among the frames sent here, due time
        last_ns = self.now_ns - self.origin_ns
        count = 0
        while count < AT_ONCE and self._pieces and (due_ns := self._next().due_ns) <= last_ns:
            if not firsts or due_ns != firsts[-1][1]:
                firsts.append((count, due_ns))
            self._wake_until(due_ns)
            self._send(self._next())
            count += 1
        if not count:
            self._wake_until(last_ns)
            return
        self._breathless += count
        if count == 1:
            self.report.late(last_ns - firsts[0][1])
            self._breathe()
            return
        took_ns = self._clock.now_ns() - self.now_ns
        self.report.timing.burst.add(took_ns)
        for place, due_ns in firsts:  # each frame took its part of the time
            self.report.late(last_ns + took_ns * place // count - due_ns)
        self.now_ns += took_ns
        self._breathe()

    def _breathe(self) -> None:
        """Give the processor away for a moment after a long run of late frames."""
        if self._breathless >= BREATHLESS:
            self._breathless = 0
            self.now_ns = self._clock.sleep_until_ns(self.now_ns + BREATH_NS)

    def _send_piece(self) -> None:
        """Send what is left of the first piece without waiting; after the last, what stages have left."""
        if not self._pieces:
            self._wake_until(self._next_due() or 0)
            return
        piece = self._pieces[0]
        for frame in piece.frames[self._at :]:
            self._wake_until(frame.due_ns)
            self._send(frame)

    def _send(self, frame: Frame) -> None:
        result = self._ready or self._chain.through(self.states, (frame,))
        self._ready = None
        self._advance_place(frame)
        self._give(result)

    def _give(self, result: tuple[list[Any], tuple[Frame, ...]]) -> None:
        """Hand frames to the buses; the states that belong to them count if one of the frames was taken."""
        states, frames = result
        is_gone = not frames
        for one in frames:
            taken = self._sending.send(one)
            self.report.sent(one.channel, taken)
            is_gone |= taken
            if taken and self._record is not None:
                self._to_record.append((one, self.origin_ns))
        if is_gone:  # counters follow what was sent
            self.states = states
        self._unheard += len(frames)
        if self._unheard >= UNHEARD:
            self._listen()
        if len(self._to_record) >= UNRECORDED:
            self._write()

    def _advance_place(self, frame: Frame) -> None:
        piece = self._pieces[0]
        self.report.order(self._due_ns, frame.due_ns)
        self._position_ns, self._due_ns = piece.log_ns[self._at], frame.due_ns
        self._at += 1
        self._ahead -= 1
        if self._at == len(piece.frames):
            self._pieces.popleft()
            self._at = 0


def played(player: Player, stopped: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Yield between any two steps of a player, to its end or until `stopped()`; then all is recorded."""
    while not stopped() and player.advance():
        yield
    player.finish()

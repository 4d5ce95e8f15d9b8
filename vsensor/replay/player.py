"""Sends frames at absolute deadlines; reading, recording and listening are done while there is time.

    log ──► Reel.pull ──► Ahead, read before ──► stages ──► wait ──► buses ──► recording
            (128 frames)                         (repair..)  until origin + due_ns

One thread, one core `advance`: what it does next depends on the clock alone. Work that can wait is done
when it fits before the next deadline, by what it took before.
"""

from collections.abc import Callable, Iterator, Sequence
from typing import Any

from vsensor.clock import Clock
from vsensor.replay.chores import Chore, Chores
from vsensor.replay.pulled import Pulled
from vsensor.replay.report import Report
from vsensor.replay.sender import Sender, Sending
from vsensor.replay.stages import Stage
from vsensor.replay.supply import Supply
from vsensor.types import Frame

REST_NS = 20_000_000
"""A longer wait is cut, so that keys and Ctrl-C are heard."""
SEARCH_NS = 10_000_000  # without any pause in that time a seek takes some, and frames are late
AT_ONCE = 16  # frames that were late are sent between two looks at the clock
BREATHLESS, BREATH_NS = 128, 500_000
"""After so many late frames without a wait the processor is given away for so long: a real-time process that
catches up on the only one would starve who listens, and the kernel, which then loses frames."""


class Player:
    """Plays a reel. `advance` until it returns False; between two calls anything may be asked of it.

    All times are of `clock`; the frame that is due at 0 leaves at `origin_ns`; `now_ns` is when it was last
    looked at, which is seldom: inside user-mode Linux a look takes 50 us, as long as sending a frame.
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
        self._clock = clock
        self._start_ns = reel.start_ns
        self._supply = Supply(reel, real_time=real_time)
        self._sender = Sender(sending, stages, record, self.report)
        self._chores = Chores(self._supply, self._sender, self._search)
        self._breathless = 0
        self._paused_ns: int | None = None
        self._supply.fill()
        self.now_ns = self._sent_ns = clock.now_ns()
        self.origin_ns = self.now_ns if origin_ns is None else origin_ns

    @property
    def states(self) -> list[Any]:
        """Those of the stages."""
        return self._sender.states

    @property
    def position_s(self) -> float:
        """Log time of the latest frame sent, s from the log's start (or --start); where a seek leads to."""
        return (self._supply.position_ns - self._start_ns) / 1e9

    @property
    def wait_s(self) -> float:
        """How long no frame is due from now on; 0 while it is paused, or where nothing is read ahead."""
        due_ns = None if self.paused else self._supply.due_ns(self._at_ns)
        return 0.0 if due_ns is None else max(0, due_ns - self._at_ns) / 1e9

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
        if next_due_ns is None and self._supply.is_searching:
            self._do(self._chores.searching)
        elif next_due_ns is None:
            self.finish()
            return False
        elif not self.report.real_time:
            self._send_piece()
        else:
            self._play(self.origin_ns + next_due_ns)
        return True

    def pause(self) -> None:
        """Hold the next frame back until `resume`; a seek ends at once."""
        if self._paused_ns is None:
            self.now_ns = self._paused_ns = self._clock.now_ns()
            self._jump()

    def resume(self) -> None:
        """Go on: the rest of the interval in which it was paused, then the next frame."""
        if self._paused_ns is not None:
            self.now_ns = self._clock.now_ns()
            self.origin_ns += self.now_ns - self._paused_ns
            self._paused_ns, self._sent_ns = None, self.now_ns

    def step(self, count: int = 1) -> int:
        """Pause, and send the next `count` frames at once; returns how many there were."""
        self.pause()
        for done in range(count):
            if not self._supply.fill():
                return done
            due_ns = self._supply.ahead.first().due_ns
            self._paused_ns = self._clock.now_ns()
            self.origin_ns = self._paused_ns - due_ns
            self._wake_until(due_ns)
            self._send()
        return count

    def seek(self, log_s: float) -> None:
        """Go on with the first frame at or after `log_s`, s from the log's start (or --start).

        What is played goes on until the new place is found; where nothing is played on time (paused, or
        without waiting) that is at once. The replay's own time goes on: `due_ns` of frames, counters and
        timestamps of the stages.
        """
        self._supply.seek(self._start_ns + max(0, round(log_s * 1e9)), self._at_ns)
        self.report.seeks += 1
        if self._paused_ns is not None:
            self._jump()
        while not self.report.real_time and self._supply.is_searching:
            self._search()

    def finish(self) -> None:
        """Record and hear what is left: at the end, or instead of playing on."""
        self._sender.finish()

    @property
    def _at_ns(self) -> int:
        """Now, from the replay's beginning."""
        return (self.now_ns if self._paused_ns is None else self._paused_ns) - self.origin_ns

    def _jump(self) -> None:
        """End a seek while it is paused: the new place is due now."""
        if self._paused_ns is not None and self._supply.is_searching:
            due_ns = max(self._sender.due_ns + 1, self._at_ns)
            self._supply.jump(due_ns)
            self._sender.forget()
            self.origin_ns = self._paused_ns - due_ns

    def _search(self) -> None:
        if self._supply.search(self._at_ns):
            self.now_ns = self._clock.now_ns()
            self._supply.follow(self._sender.due_ns, self._at_ns)
            self._sender.forget()

    def _next_due(self) -> int | None:
        """Return when the next frame is due, of the log or of a stage; None if there is none any more."""
        while self._supply.must_pull(self._at_ns):
            self._do(self._chores.pulling)
        times = (self._supply.due_ns(self._at_ns), self._sender.next_wake_ns())
        return min((due_ns for due_ns in times if due_ns is not None), default=None)

    def _play(self, due_ns: int) -> None:
        """Wait for `due_ns` of the clock, or a part of it, with what there is to do; send what is due."""
        if self.now_ns < due_ns:
            self._spend(min(due_ns, self.now_ns + REST_NS))
        if self.now_ns >= due_ns:
            self._send_due()
        seek = self._supply.seeking
        if seek is not None and seek.is_searching and self._at_ns - seek.looked_ns >= SEARCH_NS:
            self._do(self._chores.searching)

    def _spend(self, until_ns: int) -> None:
        """Do what fits before `until_ns`, then wait for it."""
        if self._paused_ns is None and self._supply.ahead.count:
            self._sender.prepare(self._supply.ahead.first())
        while (chore := self._chores.next(self.now_ns, self._at_ns, until_ns - self.now_ns)) is not None:
            self._do(chore)
            if chore is self._chores.searching and not self._supply.is_searching:
                return  # another frame is the next one
        self.now_ns = self._clock.sleep_until_ns(until_ns)
        self._breathless = 0

    def _do(self, chore: Chore) -> None:
        before_ns = self.now_ns
        chore.do()
        self.now_ns = self._clock.now_ns()
        chore.took(self.now_ns - before_ns)

    def _send_due(self) -> None:
        """Send the frames whose time has come, and note how late the first of each time left."""
        firsts: list[tuple[int, int]] = []  # place among the frames sent here, due time
        last_ns = self.now_ns - self.origin_ns
        if self._supply.seeking is not None:
            self.report.silent(self.now_ns - self._sent_ns)
        count, ahead = 0, self._supply.ahead
        while count < AT_ONCE and ahead.count and (due_ns := ahead.first().due_ns) <= last_ns:
            if not firsts or due_ns != firsts[-1][1]:
                firsts.append((count, due_ns))
            self._wake_until(due_ns)
            self._send()
            count += 1
        self._sent_ns = self.now_ns
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
        ahead = self._supply.ahead
        if not ahead.count:
            self._wake_until(self._next_due() or 0)
        for frame in ahead.piece():
            self._wake_until(frame.due_ns)
            self._send()

    def _wake_until(self, last_ns: int) -> None:
        is_played = self.report.real_time and self._paused_ns is None
        self._sender.wake_until(last_ns, self.origin_ns, self.now_ns if is_played else None)

    def _send(self) -> None:
        self._sender.send(self._supply.take(), self.origin_ns)


def played(player: Player, stopped: Callable[[], bool] = lambda: False) -> Iterator[None]:
    """Yield between any two steps of a player, to its end or until `stopped()`; then all is recorded."""
    while not stopped() and player.advance():
        yield
    player.finish()

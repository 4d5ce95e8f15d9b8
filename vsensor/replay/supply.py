"""The frames that a player sends next: read ahead of a reel, and on to another place of it without a gap.

    seek    |  ...searching, between the frames...   | found        | left
    old     A  B  C  D  E  F  G  H  I  J  K  L  M  N  O  P  Q  (R  S  T: taken back)
    new                                                        a  b  c  d
                                                    `── lead ──┘ in which images of the new place are made

All times are the replay's own, from its beginning.
"""

from dataclasses import dataclass

from vsensor.replay.ahead import Ahead
from vsensor.replay.pulled import Pulled
from vsensor.replay.reading import Reading
from vsensor.types import Frame

SCARCE = 256  # frames; below it reading comes before everything else that can wait
FINEST = 16  # frames pulled at a time, where there is time for no more: they take half as long as 64


@dataclass(slots=True)
class Seek:
    """A seek to `log_ns`: `reading` is read up to there; then `left` frames of the old place are sent."""

    log_ns: int
    reading: Reading
    looked_ns: int  # when it was read last
    left: int | None = None

    @property
    def is_searching(self) -> bool:
        """Whether the place is not found yet."""
        return self.left is None


class Supply:
    """Frames of a reel. With `real_time` a seek takes its time, and images are asked for at theirs."""

    def __init__(self, reel: Pulled, *, real_time: bool) -> None:
        self.reel, self.ahead = reel, Ahead()
        self.seeking: Seek | None = None
        self._real_time = real_time
        self._log_ns = reel.start_ns  # of the latest frame taken
        self._coarsest = reel.grain

    @property
    def position_ns(self) -> int:
        """The log's time of the latest frame taken; where a seek leads to."""
        return self._log_ns if self.seeking is None else self.seeking.log_ns

    @property
    def is_searching(self) -> bool:
        """Whether the place of a seek is not found yet."""
        return self.seeking is not None and self.seeking.is_searching

    @property
    def is_scarce(self) -> bool:
        """Whether little is read ahead."""
        return self.ahead.count < SCARCE

    def finer(self) -> None:
        """Pull fewer frames at a time."""
        self.reel.grain = max(FINEST, self.reel.grain // 2)

    def coarser(self) -> None:
        """Pull more frames at a time, which takes less for each."""
        self.reel.grain = min(self._coarsest, self.reel.grain * 2)

    def due_ns(self, at_ns: int) -> int | None:
        """Return when the next frame is due, or may be asked for; None if there is none any more."""
        times = [self.ahead.first().due_ns] if self.ahead.count else []
        if not self.reel.ended and not self._is_open(at_ns):  # there will be more, and it is waited for
            times.append(self.reel.opens_ns)
        return min(times, default=None)

    def fill(self) -> bool:
        """Read until there is a frame to send, whatever the time; False if there is none any more."""
        while not self.ahead.count and not self.reel.ended:
            self.pull()
        return bool(self.ahead.count)

    def must_pull(self, at_ns: int) -> bool:
        """Return whether nothing is there to send, and something to pull."""
        return not self.ahead.count and not self.reel.ended and self._is_open(at_ns)

    def may_pull(self, at_ns: int) -> bool:
        """Return whether there is something to pull now."""
        return not self.reel.ended and self.ahead.count < self.reel.most_ahead and self._is_open(at_ns)

    def pull(self) -> None:
        """Read the next few frames."""
        piece = self.reel.pull()
        if piece is not None:
            self.ahead.add(piece)

    def take(self) -> Frame:
        """Take the next frame away; there must be one."""
        frame, self._log_ns = self.ahead.take()
        if self.seeking is not None and self.seeking.left is not None:
            self.seeking.left -= 1
            if self.seeking.left < 0:
                self.seeking = None
        return frame

    def seek(self, log_ns: int, at_ns: int) -> None:
        """Begin to seek; then `search`."""
        self.seeking = Seek(log_ns, self.reel.reading(log_ns), at_ns)

    def search(self, at_ns: int) -> bool:
        """Read a little on towards the place of a seek; returns whether it is found."""
        seek = self.seeking
        if seek is None or not seek.is_searching:
            return False
        seek.looked_ns = at_ns
        return seek.reading.skip(seek.log_ns)

    def follow(self, sent_ns: int, at_ns: int) -> None:
        """Let the place that was found follow; `sent_ns`: when the latest frame sent was due."""
        if self.seeking is not None:
            kept, due_ns = self._last_of_old(sent_ns + 1, max(sent_ns + 1, at_ns))
            self._leave(self.seeking, kept, due_ns)

    def jump(self, due_ns: int) -> None:
        """Search to the end; what was read of the old place is not sent, the new one is due at `due_ns`."""
        seek = self.seeking
        if seek is not None and seek.is_searching:
            while not seek.reading.skip(seek.log_ns):
                pass
            self._leave(seek, 0, due_ns)
            self.fill()

    def _last_of_old(self, unsent_ns: int, at_ns: int) -> tuple[int, int]:
        """Return how many frames of the old place are still sent, and when the new place is due.

        Without real time as soon as nothing was sent. What is read ahead may end before the lead does: then
        all of it.
        """
        ends_ns = self.ahead.ends_ns(unsent_ns) + 1
        due_ns = max(at_ns, min(at_ns + self.reel.lead_ns, ends_ns)) if self._real_time else unsent_ns
        kept = self.ahead.before(due_ns)
        if more := self.reel.whole(self.ahead.frames(kept)):
            kept += more
            due_ns = next((frame.due_ns for frame in self.ahead.frames(kept)), ends_ns)
        return kept, due_ns

    def _leave(self, seek: Seek, kept: int, due_ns: int) -> None:
        loop, unsent = self.ahead.loop, self.ahead.cut(kept)
        self.reel.seek(seek.log_ns, due_ns, loop, unsent, seek.reading)
        seek.left = kept

    def _is_open(self, at_ns: int) -> bool:
        """Return whether it is time to pull; without waiting it always is."""
        opens_ns = self.reel.opens_ns
        return not opens_ns or not self._real_time or at_ns >= opens_ns

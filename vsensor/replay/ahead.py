"""What is read ahead of its time and not yet sent: pieces, from which frames are taken one by one."""

from collections import deque
from collections.abc import Iterator
from itertools import chain, islice

from vsensor.replay.reel import Piece
from vsensor.types import Frame


class Ahead:
    """Pieces in the order in which they are sent; none of them is empty. `count`: frames in them."""

    def __init__(self) -> None:
        self._pieces: deque[Piece] = deque()
        self._at = 0  # place in the first piece
        self.count = 0

    def add(self, piece: Piece) -> None:
        """Put a piece behind the others."""
        self._pieces.append(piece)
        self.count += len(piece.frames)

    def first(self) -> Frame:
        """Return the frame that is sent next; there must be one."""
        return self._pieces[0].frames[self._at]

    def take(self) -> tuple[Frame, int]:
        """Take the first frame away; returns it and the log's time of it."""
        piece = self._pieces[0]
        frame, log_ns = piece.frames[self._at], piece.log_ns[self._at]
        self._at += 1
        self.count -= 1
        if self._at == len(piece.frames):
            self._pieces.popleft()
            self._at = 0
        return frame, log_ns

    def ends_ns(self, otherwise_ns: int) -> int:
        """Return when the last frame is due."""
        return self._pieces[-1].frames[-1].due_ns if self._pieces else otherwise_ns

    def piece(self) -> list[Frame]:
        """Return what is left of the first piece, [] if there is none."""
        return self._pieces[0].frames[self._at :] if self._pieces else []

    @property
    def loop(self) -> int:
        """The pass of the first frame; 0 if there is none."""
        return self._pieces[0].loop if self._pieces else 0

    def frames(self, first: int = 0) -> Iterator[Frame]:
        """Yield the frames from number `first` on."""
        return islice(chain.from_iterable(p.frames for p in self._pieces), self._at + first, None)

    def before(self, due_ns: int) -> int:
        """Return how many of the frames are due before `due_ns`."""
        return sum(1 for frame in self.frames() if frame.due_ns < due_ns)

    def cut(self, kept: int) -> list[Frame]:
        """Keep the first frames alone; returns the others."""
        dropped = list(self.frames(kept))
        pieces, left = list(self._pieces), self._at + kept
        self._pieces.clear()
        for piece in pieces:
            if left > 0:
                self._pieces.append(Piece(piece.frames[:left], piece.log_ns[:left], piece.loop))
            left -= len(piece.frames)
        if not kept:
            self._pieces.clear()
            self._at = 0
        self.count = kept
        return dropped

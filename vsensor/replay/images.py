"""The images of a sensor that is laid over a log: which frames still wait, and which can be taken back."""

from collections import deque
from collections.abc import Sequence
from typing import NamedTuple

from vsensor.overlay import KEPT
from vsensor.types import Frame


class Slot(NamedTuple):
    """A time of the replay, the log's time there, the pass."""

    due_ns: int
    log_ns: int
    loop: int


class _Image(NamedTuple):
    number: int
    frames: tuple[Frame, ...]
    log_ns: int  # of its slot


class Images:
    """The latest images that were made, and those of their frames that were not pulled yet."""

    def __init__(self) -> None:
        self._made: deque[_Image] = deque(maxlen=KEPT)
        self._waiting: list[Frame] = []

    @property
    def log_ns(self) -> int | None:
        """The log's time at the latest image; None without one."""
        return self._made[-1].log_ns if self._made else None

    def add(self, number: int, frames: tuple[Frame, ...], slot: Slot) -> None:
        """Take the next image, its times the replay's own."""
        self._made.append(_Image(number, frames, slot.log_ns))
        self._waiting = sorted((*self._waiting, *frames), key=_due)

    def taken(self, due_ns: int) -> list[Frame]:
        """Take away what waits and is due by then."""
        count = sum(frame.due_ns <= due_ns for frame in self._waiting)
        taken, self._waiting = self._waiting[:count], self._waiting[count:]
        return taken

    def is_due(self, due_ns: int) -> bool:
        """Return whether something waits that is due by then."""
        return bool(self._waiting) and self._waiting[0].due_ns <= due_ns

    def take_back(self, unsent: Sequence[Frame]) -> int:
        """Forget the images of which nothing was sent; returns the number of the first one.

        `unsent` was pulled in vain. What is left of an image that has begun waits again.
        """
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
        return resume


def _due(frame: Frame) -> int:
    return frame.due_ns

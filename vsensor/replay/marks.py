"""Places of a log at which reading can go on, remembered as it is read: no seek reads all before it again."""

from bisect import bisect_left
from typing import NamedTuple

from vsensor.logs import Notes
from vsensor.replay.smooth import Smooth
from vsensor.replay.timeline import Order

EVERY = 16_384
"""Frames between two marks, at the beginning: some 20 ms of reading."""
MOST = 1024
"""So many marks take about a megabyte; then every other one goes, and they are twice as far apart."""


class Mark(NamedTuple):
    """Where reading stands behind so many `frames`, the last of which is played at `last_ns`."""

    last_ns: int
    frames: int
    place: tuple[int, ...]
    order: Order
    smooth: Smooth
    notes: Notes


class Marks:
    """The marks of one log."""

    def __init__(self) -> None:
        self._marks: list[Mark] = []
        self._every = EVERY

    def wants(self, count: int) -> bool:
        """Return whether a mark behind `count` frames would be kept."""
        return count >= self._every + (self._marks[-1].frames if self._marks else 0)

    def add(self, mark: Mark) -> None:
        """Keep a mark behind all others."""
        self._marks.append(mark)
        if len(self._marks) > MOST:
            self._marks = self._marks[1::2]
            self._every *= 2

    def before(self, log_ns: int) -> Mark | None:
        """Return the last mark with all frames from `log_ns` on behind it; None: begin at the start."""
        place = bisect_left(self._marks, log_ns, key=lambda mark: mark.last_ns)
        return self._marks[place - 1] if place else None

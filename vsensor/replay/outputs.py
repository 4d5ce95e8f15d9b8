"""Where frames leave: each channel of the log on its bus, frames that no bus takes left out and counted."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from vsensor.logs import Columns
from vsensor.logs.table import ERROR, FD, REMOTE
from vsensor.types import BoolArray, Frame

if TYPE_CHECKING:
    from vsensor.bus import FrameBus


class Outputs:
    """Buses by channel of the log; `rest` takes every other channel, without it they are left out.

    `fd`: the buses that carry CAN FD. Without any bus all frames are taken: they go into a log alone.
    """

    def __init__(
        self,
        channels: Mapping[str, int],
        *,
        by_name: Mapping[str, "FrameBus"] | None = None,
        rest: "FrameBus | None" = None,
        fd: frozenset[str] = frozenset(),
    ) -> None:
        self.buses = list(dict.fromkeys([*(by_name or {}).values(), *([rest] if rest else [])]))
        self.dropped: dict[str, int] = {}
        self._channels, self._by_name, self._rest, self._fd = channels, by_name or {}, rest, fd
        self._by_number: dict[int, FrameBus | None] = {}

    def sendable(self, columns: Columns) -> BoolArray:
        """Return which frames (N,) can be sent; the others are counted."""
        there = set(columns.channel.tolist())
        if not (columns.flags & (ERROR | FD | REMOTE)).any() and self._has_all(there):
            return np.ones(len(columns.t_ns), dtype=bool)
        mask: BoolArray = (columns.flags & ERROR) == 0
        self._count("error frames, which a node cannot send on purpose", ~mask)
        no_frames = mask & ((columns.flags & (FD | REMOTE)) == FD | REMOTE)
        self._count("remote frames of CAN FD, which has none", no_frames)
        mask &= ~no_frames
        if not self.buses:
            return mask
        for number in sorted(there):
            bus = self._bus(number)
            rows = mask & (columns.channel == number)
            if bus is None:
                self._count(f"frames of channel {self.name(number)}, which has no bus", rows)
                mask &= ~rows
            elif bus.name not in self._fd:
                rows &= (columns.flags & FD) != 0
                self._count(f"CAN FD frames for {bus.name}, which carries classic CAN", rows)
                mask &= ~rows
        return mask

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame."""
        bus = self._bus(frame.channel)
        return bus is None or bus.send(frame)

    def drain(self) -> list[Frame]:
        """Return what all buses have heard since the last call."""
        return [frame for bus in self.buses for frame in bus.drain()]

    def report(self) -> list[str]:
        """Return what was left out, and what went wrong on the buses."""
        lost = [f"left out: {count} {what}" for what, count in self.dropped.items()]
        return lost + [line for bus in self.buses for line in bus.report()]

    def name(self, number: int) -> str:
        """Return the log's name of a channel."""
        return next((name for name, n in self._channels.items() if n == number), str(number))

    def _has_all(self, numbers: set[int]) -> bool:
        return not self.buses or all(self._bus(number) is not None for number in numbers)

    def _bus(self, number: int) -> "FrameBus | None":
        if number not in self._by_number:
            self._by_number[number] = self._by_name.get(self.name(number), self._rest)
        return self._by_number[number]

    def _count(self, what: str, rows: BoolArray) -> None:
        if rows.any():
            self.dropped[what] = self.dropped.get(what, 0) + int(np.count_nonzero(rows))

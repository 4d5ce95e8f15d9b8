"""AUTOSAR's receiver over a long stream: only the frames around a fault are looked at one by one."""

from dataclasses import replace

import numpy as np

from vsensor.accept.book import Book
from vsensor.e2e import Guard, ReceiverConfig, ReceiverState, Reception, Status, receive
from vsensor.types import BoolArray, CodeArray, IntArray


class Listener:
    """The receiver of one protected message; tells the book when it no longer trusts the stream."""

    def __init__(self, name: str, guard: Guard, config: ReceiverConfig, book: Book) -> None:
        self._name, self._guard, self._config, self._book = name, guard, config, book
        self._state = ReceiverState()
        self._lost_ns: int | None = None
        size = config.window_size_valid
        self._quiet = (Status.OK,) * size
        self._most = 2 * max(size, config.window_size_init, config.window_size_invalid)

    def take(self, t_ns: IntArray, data: CodeArray, missing: IntArray, fine: BoolArray) -> None:
        """Take in frames (N,), `missing` cycles before each; `fine`: right, and the next by its counter."""
        faults = np.append(np.flatnonzero(~fine), len(fine))
        place = 0
        while place < len(t_ns):
            end = int(faults[np.searchsorted(faults, place)])
            if end > place and self._is_quiet():
                counter = self._guard.counter(data[end - 1].tobytes())
                self._state = replace(self._state, counter=counter)
                place = end
                continue
            self.silence(int(missing[place]), int(t_ns[place]))
            self._step(data[place].tobytes(), int(t_ns[place]))
            place += 1

    def _is_quiet(self) -> bool:
        return self._state.reception is Reception.VALID and self._state.window == self._quiet

    def silence(self, cycles: int, t_ns: int) -> None:
        """Take in cycles without a frame; after some of them more change nothing."""
        for _ in range(min(cycles, self._most)):
            self._step(None, t_ns)

    def end(self, t_ns: int) -> None:
        """Note what is still not trusted at the end of the stream."""
        if self._lost_ns is not None:
            self._note(self._lost_ns, t_ns)
        elif self._state.reception is Reception.INVALID:  # it never was
            self._note(t_ns, t_ns)

    def _step(self, data: bytes | None, t_ns: int) -> None:
        before = self._state.reception
        self._state, check = receive(self._config, self._state, self._guard, data)
        if before is Reception.VALID and check.reception is Reception.INVALID:
            self._lost_ns = t_ns
        elif check.reception is Reception.VALID and self._lost_ns is not None:
            self._note(self._lost_ns, t_ns)
            self._lost_ns = None

    def _note(self, since_ns: int, t_ns: int) -> None:
        worst = [(t_ns - since_ns) / 1e6]
        self._book.note("e2e_invalid", self._name, [since_ns], worst=worst, limit=0.0, unit="ms")

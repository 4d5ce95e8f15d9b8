"""Where images are computed: here, when they are asked for, or in a process that computes them meanwhile.

    ask(Wish) ──► ... ──► answer() -> Made       in order; what was asked for may be taken back with `rewind`

A tick takes some 2 ms of Python. Who sends frames at their time cannot wait for it, so the process of its own
is the rule; the simulated clock computes here. Both give the same frames.
"""

import contextlib
import multiprocessing
import os
import select
import signal
from collections import deque
from multiprocessing.connection import Connection
from typing import Protocol

from vsensor.errors import SessionError
from vsensor.line import LineState
from vsensor.overlay.synth import Made, Synth, Wish

KEPT = 2400
"""States of so many images are kept to go back to: those asked for and not yet sent."""


class Desk(Protocol):
    """Computes images in the order in which they are asked for."""

    def ask(self, wish: Wish) -> None:
        """Ask for the next image."""
        ...

    def answer(self) -> Made:
        """Return the first image that was asked for and not yet returned; waits for it."""
        ...

    @property
    def is_ready(self) -> bool:
        """Whether `answer` would not wait."""
        ...

    def rewind(self, index: int) -> None:
        """Forget all images from `index` on, asked for or returned: they will be asked for again."""
        ...

    def remarks(self) -> tuple[str, ...]:
        """Say what went wrong in the world on the way; nothing may be outstanding."""
        ...

    def close(self) -> None:
        """Release what was taken; closing twice does no harm."""
        ...


class Here:
    """Computes at once, in the caller's thread."""

    def __init__(self, synth: Synth) -> None:
        self._synth = synth
        first = synth.initial()
        self._before: dict[int, tuple[LineState, LineState]] = {0: (first, first)}  # if sent, if lost
        self._last = 0
        self._made: deque[Made] = deque()

    def ask(self, wish: Wish) -> None:
        """Compute an image; numbers that were left out are slots that nobody had time for."""
        before = self._before.get(wish.number) or self._before[self._last]
        sent, lost, made = self._synth.compute(before[wish.is_lost], wish)
        self._before[wish.number + 1], self._last = (sent, lost), wish.number + 1
        self._before.pop(wish.number - KEPT, None)
        self._made.append(made)

    def answer(self) -> Made:
        """Return the oldest image that was not returned."""
        return self._made.popleft()

    @property
    def is_ready(self) -> bool:
        """Whether there is one."""
        return bool(self._made)

    def rewind(self, index: int) -> None:
        """Go back to the state before image `index`."""
        for later in range(index + 1, self._last + 1):
            self._before.pop(later, None)
        self._last = index
        self._made = deque(made for made in self._made if made.number < index)

    def remarks(self) -> tuple[str, ...]:
        """Say what the source says at its end."""
        return self._synth.source.remarks(self._before[self._last][0].source)

    def close(self) -> None:
        """Do nothing: nothing was taken."""


class Elsewhere:
    """Computes in a child process, which ends with its parent: its pipe is then closed."""

    def __init__(self, synth: Synth, nice: int = 0) -> None:
        """Fork; open buses after that, or the child holds them open. `nice`: how far it stands back."""
        context = multiprocessing.get_context("fork")
        self._pipe, theirs = context.Pipe()
        self._process = context.Process(target=_serve, args=(synth, theirs, self._pipe, nice), daemon=True)
        self._process.start()
        theirs.close()
        self._outstanding: deque[int] = deque()  # indices, in order; -1: taken back
        self._look = select.poll()  # the connection's own `poll` takes ten times as long
        self._look.register(self._pipe.fileno(), select.POLLIN)

    def fileno(self) -> int:
        """Return the descriptor that is readable when an answer is there."""
        return self._pipe.fileno()

    @property
    def is_ready(self) -> bool:
        """Whether `answer` would not wait."""
        while self._outstanding and self._outstanding[0] < 0 and self._look.poll(0):
            self._received()
        return bool(self._outstanding) and self._outstanding[0] >= 0 and bool(self._look.poll(0))

    def ask(self, wish: Wish) -> None:
        """Hand over a wish."""
        self._outstanding.append(wish.number)
        self._send(wish)

    def answer(self) -> Made:
        """Return the oldest image that was not returned."""
        while self._outstanding[0] < 0:
            self._received()
        return self._received()

    def rewind(self, index: int) -> None:
        """Let what is under way be thrown away."""
        self._outstanding = deque(-1 if old >= index else old for old in self._outstanding)
        self._send(index)

    def remarks(self) -> tuple[str, ...]:
        """Ask what the source says."""
        while self._outstanding:
            self._received()
        self._send(None)
        said = self._receive()
        return said if isinstance(said, tuple) else ()

    def close(self) -> None:
        """End the child."""
        self._pipe.close()
        self._process.join(timeout=2.0)
        if self._process.is_alive():
            self._process.terminate()
            self._process.join()

    def _received(self) -> Made:
        self._outstanding.popleft()
        made = self._receive()
        if isinstance(made, Made):
            return made
        raise SessionError(f"the sensor's process failed: {made}")

    def _send(self, said: object) -> None:
        try:
            self._pipe.send(said)
        except OSError:
            raise SessionError("the sensor's process has ended") from None

    def _receive(self) -> object:
        try:
            said: object = self._pipe.recv()
        except (EOFError, OSError):
            raise SessionError("the sensor's process has ended") from None
        return said


def _serve(synth: Synth, pipe: Connection, theirs: Connection, nice: int) -> None:
    """Answer until the other end is closed."""
    theirs.close()
    os.nice(nice)
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the parent ends us
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    desk = Here(synth)
    with contextlib.suppress(EOFError, OSError):
        while True:
            said = pipe.recv()
            if isinstance(said, Wish):
                desk.ask(said)
                pipe.send(desk.answer())
            elif said is None:
                pipe.send(desk.remarks())
            else:
                desk.rewind(said)

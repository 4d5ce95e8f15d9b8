"""Keys typed while a replay runs, read without waiting; the terminal is put back whatever happens."""

import contextlib
import os
import select
import signal
import sys
import termios
import tty
from collections.abc import Callable, Iterator
from types import FrameType
from typing import Any

HELP = "keys: space holds and goes on, arrows 5 s back and ahead, s one frame, q ends"
_ARROWS = {b"\x1b[C": "right", b"\x1b[D": "left", b"\x1bOC": "right", b"\x1bOD": "left"}


@contextlib.contextmanager
def terminal_keys(fd: int | None = None) -> Iterator[Callable[[], list[str]] | None]:
    """Yield what returns the keys typed since the last call: " ", "s", "q", "left", "right", ...

    None where `fd` (standard input) is no terminal of ours. Ctrl-C stays a signal; over Ctrl-Z and back
    the terminal is left as it was found.
    """
    fd = _standard_input() if fd is None else fd
    if fd is None or fd < 0 or not os.isatty(fd) or not _in_foreground(fd):
        yield None
        return
    before = termios.tcgetattr(fd)

    def suspend(number: int, frame: FrameType | None) -> None:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)
        os.kill(os.getpid(), signal.SIGSTOP)  # goes on from here with SIGCONT
        if _in_foreground(fd):
            tty.setcbreak(fd, termios.TCSADRAIN)

    handler: Any = signal.signal(signal.SIGTSTP, suspend)
    try:
        tty.setcbreak(fd, termios.TCSADRAIN)
        yield _Keys(fd).typed
    finally:
        termios.tcsetattr(fd, termios.TCSADRAIN, before)
        signal.signal(signal.SIGTSTP, handler)


class _Keys:
    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._rest = b""

    def typed(self) -> list[str]:
        """Return what was typed."""
        if not select.select([self._fd], [], [], 0)[0]:
            return []
        found, self._rest = split_keys(self._rest + os.read(self._fd, 256))
        return found


def split_keys(data: bytes) -> tuple[list[str], bytes]:
    """Return the keys in what a terminal sent, and a piece of an arrow's sequence whose end is missing."""
    keys: list[str] = []
    while data:
        if data[:3] in _ARROWS:
            keys.append(_ARROWS[data[:3]])
            data = data[3:]
        elif data[:1] == b"\x1b" and len(data) < 3 and data in (b"\x1b", b"\x1b[", b"\x1bO"):
            return keys, data
        else:
            keys.append(data[:1].decode("latin-1"))
            data = data[1:]
    return keys, b""


def _standard_input() -> int | None:
    try:
        return sys.stdin.fileno()
    except (AttributeError, OSError, ValueError):  # closed, or a test's
        return None


def _in_foreground(fd: int) -> bool:
    """Return whether the terminal is ours now; who changes it in the background is stopped."""
    try:
        return os.tcgetpgrp(fd) == os.getpgrp()
    except OSError:
        return False

r"""Text logs without times: what `candump can0 > FILE` writes, or a list of frames for cansend.

    can0  123   [8]  11 22 33 44 55 66 77 88        classic
    can0  18EBFF00   [0]  remote request            29-bit, remote
    can0  123  [12]  11 22 33 44 55 66 77 88 99 ..  CAN FD: two digits
    can0 123#1122334455667788                       as cansend takes it; the channel may be missing

Each becomes a line of `candump -L` at time 0, so that one reader reads both; who plays them gives the times.
"""

import io
import re
from typing import TYPE_CHECKING, BinaryIO

if TYPE_CHECKING:
    from _typeshed import WriteableBuffer

_DUMPED = re.compile(
    rb"^[ \t]*(\S+)[ \t]+([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})[ \t]+\[(\d{1,2})\][ \t]*"
    rb"(remote request|(?:[0-9A-Fa-f]{2}(?:[ \t]+|(?=\r?$)))*)[^#]*$"
)
_SENT = re.compile(rb"^[ \t]*(?:([^\s(#]\S*)[ \t]+)?([0-9A-Fa-f]{3}|[0-9A-Fa-f]{8})#(\S*)[ \t]*\r?$")


def is_untimed(line: bytes) -> bool:
    """Return whether a line is a frame without its time."""
    return timed(line) != line


def timed(line: bytes) -> bytes:
    """Return a line with time 0; anything but a frame without time as it is."""
    if found := _SENT.match(line):
        return b"(0.0) %b %b#%b" % (found[1] or b"can0", found[2], found[3])
    found = _DUMPED.match(line)
    if found is None:
        return line
    channel, number, length, data = found.groups()
    if data == b"remote request":
        return b"(0.0) %b %b#R%d" % (channel, number, int(length))
    digits = b"".join(data.split())
    if len(digits) != 2 * int(length):
        return line  # cut off
    return b"(0.0) %b %b#%b%b" % (channel, number, b"#0" if len(length) == 2 else b"", digits)


class TimedLines(io.RawIOBase):
    """A text log as it is read, a time put before each frame that has none."""

    def __init__(self, stream: BinaryIO) -> None:
        super().__init__()
        self._stream = stream
        self._ready = b""

    def readable(self) -> bool:
        """Return True."""
        return True

    def readinto(self, buffer: "WriteableBuffer") -> int:
        """Fill `buffer` with what comes next, 0 at the end."""
        view = memoryview(buffer).cast("B")
        if not self._ready:
            line = self._stream.readline()
            self._ready = timed(line.rstrip(b"\n")) + line[len(line.rstrip(b"\n")) :]
        piece, self._ready = self._ready[: len(view)], self._ready[len(view) :]
        view[: len(piece)] = piece
        return len(piece)

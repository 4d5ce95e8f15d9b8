"""A SocketCAN interface: python-can opens it, frames go through its socket directly.

One system call a frame each way, where python-can takes two and builds a Message: in a user-mode
kernel, where system calls are dear, sending takes 130 instead of 430 us a frame.
"""

import contextlib
import errno
import socket
import struct
from collections.abc import Callable, Iterator

import can
from can.interfaces.socketcan import SocketcanBus

from vsensor.bus.ports import Times
from vsensor.bus.wire import CANFD_SIZE, from_wire, to_wire
from vsensor.types import Frame

SO_TIMESTAMPNS, SO_RXQ_OVFL, SO_RCVBUFFORCE = 35, 40, 33  # asm-generic/socket.h
MSG_CONFIRM = 0x800  # of a received frame: this very socket sent it (raw sockets of CAN)
RECEIVE_BUFFER_BYTES = 1 << 20  # the usual 212992 hold some 270 frames, which is less than a busy cycle has
GONE = (errno.ENODEV, errno.ENXIO, errno.EBADF)
"""The interface was removed: its socket hears of no later one of the same name."""

_ANCILLARY = socket.CMSG_SPACE(16) + socket.CMSG_SPACE(4) if hasattr(socket, "CMSG_SPACE") else 0
_TIMESPEC, _COUNT = struct.Struct("@ll"), struct.Struct("@I")


def errno_of(problem: Exception) -> int:
    """Return the errno of what the kernel or python-can raised, 0 if it has none."""
    return getattr(problem, "errno", None) or getattr(problem, "error_code", None) or 0


class SocketcanPort:
    """A raw CAN socket that also hears, with the kernel's time, when its own frames were on the bus."""

    hears_itself = False

    def __init__(self, channel: str, open_again: Callable[[], SocketcanBus]) -> None:
        """Open through `open_again`, which is called again when the interface has vanished and returned."""
        self._channel, self._open = channel, open_again
        self.lost = 0
        self._use(open_again())

    def _use(self, bus: SocketcanBus) -> None:
        self._bus, self._socket = bus, bus.socket
        self._lost_before = self.lost
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        try:
            self._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, RECEIVE_BUFFER_BYTES)
        except PermissionError:
            self._socket.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, RECEIVE_BUFFER_BYTES)

    def put(self, frame: Frame) -> None:
        """Send without waiting for room."""
        self._socket.send(to_wire(frame), socket.MSG_DONTWAIT)

    def received(self, times: Times) -> Iterator[tuple[Frame, bool]]:
        """Yield frames with the kernel's receive time; own ones when the controller has sent them."""
        receive = self._socket.recvmsg
        while True:
            try:
                data, ancillary, flags, _ = receive(CANFD_SIZE, _ANCILLARY, socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            stamp_ns = times.now_ns
            for _, kind, value in ancillary:
                if kind == SO_TIMESTAMPNS:
                    seconds, nanoseconds = _TIMESPEC.unpack_from(value)
                    stamp_ns = times.monotonic_ns(seconds * 1_000_000_000 + nanoseconds)
                elif kind == SO_RXQ_OVFL:
                    self.lost = self._lost_before + _COUNT.unpack_from(value)[0]
            yield from_wire(data, stamp_ns), bool(flags & MSG_CONFIRM)

    def mend(self, problem: Exception) -> bool:
        """Try again at once after ENETDOWN, which may be old news; open again what has vanished."""
        number = errno_of(problem)
        if number == errno.ENETDOWN:
            return True
        if number not in GONE:
            return False
        try:
            socket.if_nametoindex(self._channel)  # cheap: most cycles of an outage end here
            bus = self._open()
        except (OSError, can.CanError):
            return False
        self.close()
        self._use(bus)
        return True

    def fileno(self) -> int:
        """Return the socket's; another one after `mend`."""
        return self._socket.fileno()

    def close(self) -> None:
        """Close the socket."""
        with contextlib.suppress(OSError):
            self._bus.shutdown()

"""What a bus needs of an interface, and how any interface of python-can gives it."""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol

import can

from vsensor.types import Frame

OTHER_CLOCK_NS = 10_000_000_000  # a receive time this far from now does not count from 1970
INTERRUPTED_NS = 100_000  # reading a clock takes 0.1 us, in a user-mode kernel 10


@dataclass(frozen=True, slots=True)
class Times:
    """Now, and what turns Unix time into the monotonic clock's: read once for all that is received."""

    now_ns: int
    epoch_offset_ns: int

    @classmethod
    def read(cls) -> "Times":
        """Return this moment; read again where something came between the readings of the two clocks."""
        for _ in range(3):
            before_ns, epoch_ns, now_ns = time.monotonic_ns(), time.time_ns(), time.monotonic_ns()
            if now_ns - before_ns < INTERRUPTED_NS:
                break
        return cls(now_ns, epoch_ns - (before_ns + now_ns) // 2)

    def monotonic_ns(self, epoch_ns: int) -> int:
        """Return a stamp in ns since 1970 on the monotonic clock; now, if it counts from elsewhere."""
        stamp_ns = epoch_ns - self.epoch_offset_ns
        return stamp_ns if abs(stamp_ns - self.now_ns) < OTHER_CLOCK_NS else self.now_ns


class Port(Protocol):
    """An open interface.

    `hears_itself`: what it receives includes what it sent, for whoever listens inside this process.
    `lost` counts received frames that nobody read in time.
    """

    hears_itself: bool
    lost: int

    def put(self, frame: Frame) -> None:
        """Hand over one frame without waiting; raises can.CanError, OSError or ValueError if refused."""
        ...

    def received(self, times: Times) -> Iterator[tuple[Frame, bool]]:
        """Yield what has arrived, `due_ns` its receive time (monotonic), and whether this port sent it.

        An error frame has `is_error`, the class bits of linux/can/error.h as id, or 0 where they are not
        known. Raises can.CanError or OSError.
        """
        ...

    def mend(self, problem: Exception) -> bool:
        """Do what can be done at once about a refusal; returns whether another attempt is worth it."""
        ...

    def fileno(self) -> int:
        """Return the descriptor that is readable when something has arrived, -1 if there is none."""
        ...

    def close(self) -> None:
        """Release the interface; closing twice does no harm."""
        ...


class PythonCanPort:
    """Any interface of python-can, through its own sending and receiving."""

    lost = 0

    def __init__(self, bus: can.BusABC, *, hears_itself: bool = False) -> None:
        self._bus = bus
        self.hears_itself = hears_itself
        # A virtual bus waits for a reader whose queue is full; adapters queue, and take 0 for other things.
        self._patience_s = 0.0 if hears_itself else None

    def put(self, frame: Frame) -> None:
        """Send through python-can."""
        self._bus.send(to_message(frame), timeout=self._patience_s)

    def received(self, times: Times) -> Iterator[tuple[Frame, bool]]:
        """Yield what python-can's `recv` returns without waiting."""
        while (message := self._bus.recv(timeout=0)) is not None:
            stamp_ns = times.monotonic_ns(round(message.timestamp * 1e9))
            if message.is_error_frame:  # what its id means differs from adapter to adapter
                yield Frame(due_ns=stamp_ns, arbitration_id=0, data=b"", is_error=True), False
            else:
                yield from_message(message, stamp_ns), not message.is_rx

    def mend(self, problem: Exception) -> bool:
        """Return False: adapters recover by themselves, or not at all."""
        return False

    def fileno(self) -> int:
        """Return python-can's, which some adapters and the virtual bus do not have."""
        try:
            return self._bus.fileno()
        except (NotImplementedError, can.CanError, OSError):
            return -1

    def close(self) -> None:
        """Shut the interface down."""
        self._bus.shutdown()


def to_message(frame: Frame) -> can.Message:
    """Return the python-can form of a frame, without its due time."""
    return can.Message(
        arbitration_id=frame.arbitration_id,
        is_extended_id=frame.is_extended,
        is_fd=frame.is_fd,
        bitrate_switch=frame.bitrate_switch,
        error_state_indicator=frame.error_state_indicator,
        is_remote_frame=frame.is_remote,
        dlc=len(frame.data),
        data=None if frame.is_remote else frame.data,
    )


def from_message(message: can.Message, t_ns: int) -> Frame:
    """Return a received message as a frame of time `t_ns`."""
    return Frame(
        due_ns=t_ns,
        arbitration_id=message.arbitration_id,
        data=bytes(message.dlc) if message.is_remote_frame else bytes(message.data),
        is_extended=message.is_extended_id,
        is_fd=message.is_fd,
        bitrate_switch=message.bitrate_switch,
        error_state_indicator=message.error_state_indicator,
        is_remote=message.is_remote_frame,
    )

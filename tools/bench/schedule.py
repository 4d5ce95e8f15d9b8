"""Our player's schedule itself: `python -m tools.bench.schedule WHO LOG` plays it into a socket.

Prints JSON. On a kernel without CAN, too: frames leave as datagrams on the loopback, one system call each as
on SocketCAN, and the time of each call is noted. Nobody reads them.
"""

import json
import socket
import sys
import time
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path

import numpy as np

from tools.bench.players import read
from tools.bench.queue import Arrived, judged
from vsensor.bus import FrameBus, Times
from vsensor.bus.wire import to_wire
from vsensor.clock import MonotonicClock
from vsensor.logs import iter_frames
from vsensor.realtime import calm_collector, real_time_priority
from vsensor.replay import ReplayOptions, open_outputs, replay_log
from vsensor.replay.session import SPIN_NS
from vsensor.types import Frame

BURST = 5000
LEAD_NS = 100_000_000


class NotingPort:
    """A bus whose other end is a socket that nobody reads; notes when it was called."""

    hears_itself, lost = False, 0

    def __init__(self) -> None:
        self._end = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._end.bind(("127.0.0.1", 0))
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._out.connect(self._end.getsockname())
        self.called_ns: list[int] = []
        self.frames: list[bytes] = []

    def put(self, frame: Frame) -> None:
        """Note, then send one datagram."""
        self.called_ns.append(time.monotonic_ns())
        data = to_wire(frame)
        self._out.send(data, socket.MSG_DONTWAIT)
        self.frames.append(data)

    def received(self, times: Times) -> Iterator[tuple[Frame, bool]]:
        """Yield nothing: nobody else is on this bus."""
        return iter(())

    def mend(self, problem: Exception) -> bool:
        """Nothing can be mended."""
        return False

    def fileno(self) -> int:
        """Nothing arrives."""
        return -1

    def close(self) -> None:
        """Close both sockets."""
        self._end.close()
        self._out.close()


def ours(path: Path, port: NotingPort) -> None:
    """Play a log as `vsensor replay --realtime` does."""
    open_outputs.open_bus = lambda name, fd=False, echo=True: FrameBus(port, name, is_simulated=True)
    replay_log(ReplayOptions(path=path, bus="noting", realtime=True), _tell)


def bare(path: Path, port: NotingPort) -> None:
    """Send the same frames, all made before, with nothing but absolute deadlines: what this machine gives."""
    frames = list(iter_frames(path))
    clock = MonotonicClock(spin_ns=SPIN_NS)
    with calm_collector(), real_time_priority(_tell):
        origin_ns = clock.now_ns() + LEAD_NS - frames[0].due_ns
        for frame in frames:
            clock.sleep_until_ns(origin_ns + frame.due_ns)
            port.put(frame)


WHO = {"ours": ours, "bare": bare}


def schedule(who: str, path: Path) -> dict[str, object]:
    """Play a log; return its figures at the send call."""
    due_ns, sent = read(path)
    with closing(NotingPort()) as port, closing(NotingPort()) as again:
        for _ in range(BURST):
            again.put(Frame(due_ns=0, arbitration_id=0x100, data=bytes(8)))
        WHO[who](path, port)
    cost_ns = int(np.median(np.diff(again.called_ns)))
    arrived = Arrived(np.array(port.called_ns, dtype=np.int64), port.frames)
    return {"cost_us": cost_ns / 1e3, **judged(arrived, due_ns, sent, cost_ns)}


def _tell(text: str) -> None:
    print(text, file=sys.stderr)


if __name__ == "__main__":
    print(json.dumps(schedule(sys.argv[1], Path(sys.argv[2]))))

"""One sender in a process of its own: `python -m tools.bench.senders WHO CYCLE_MS SECONDS BUS`; prints JSON.

BUS is "socketcan:CHANNEL", or "loopback": a UDP socket to one in the same process, which has the kernel's
receive times as SocketCAN has, on a machine whose kernel has no CAN. Everybody sends through the same one.
"""

import json
import re
import socket
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import can
from can.broadcastmanager import ThreadBasedCyclicSendTask
from can.interfaces.socketcan import SocketcanBus

from tools.bench.measure import ROOT
from vsensor.bus import FrameBus, Port, Times, to_message
from vsensor.bus.socketcan import SO_RCVBUFFORCE, SO_TIMESTAMPNS, SocketcanPort
from vsensor.bus.wire import from_wire, to_wire
from vsensor.timing import Samples
from vsensor.types import Frame

FRAME = Frame(due_ns=0, arbitration_id=0x320, data=bytes(8))
LEAD_NS = 100_000_000
ROOM_BYTES = 8 << 20


class LoopbackPort:
    """A bus that is a UDP socket: sending is one system call, what arrives has the kernel's time."""

    hears_itself, lost = False, 0

    def __init__(self) -> None:
        self._in = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._in.bind(("127.0.0.1", 0))
        self._in.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        roomy(self._in)
        self._out = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._out.connect(self._in.getsockname())

    def put(self, frame: Frame) -> None:
        """Send one datagram."""
        self._out.send(to_wire(frame), socket.MSG_DONTWAIT)

    def received(self, times: Times) -> Iterator[tuple[Frame, bool]]:
        """Yield what has arrived; all of it is our own."""
        while True:
            try:
                data, ancillary, _, _ = self._in.recvmsg(72, socket.CMSG_SPACE(16), socket.MSG_DONTWAIT)
            except BlockingIOError:
                return
            seconds, nanoseconds = (int.from_bytes(ancillary[0][2][k : k + 8], sys.byteorder) for k in (0, 8))
            yield from_wire(data, times.monotonic_ns(seconds * 10**9 + nanoseconds)), True

    def mend(self, problem: Exception) -> bool:
        """Nothing can be mended."""
        return False

    def close(self) -> None:
        """Close both sockets."""
        self._in.close()
        self._out.close()


class NotingBus(can.BusABC):
    """Passes on, and notes when it was asked to."""

    def __init__(self, put: Callable[[can.Message], None]) -> None:
        super().__init__("noting")
        self.put, self.called_ns = put, []

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        """Note the time, then pass on."""
        self.called_ns.append(time.monotonic_ns())
        self.put(msg)


def roomy(receiver: socket.socket) -> None:
    """Let a socket hold everything until the end of the measurement, as far as this user may."""
    try:
        receiver.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, ROOM_BYTES)
    except PermissionError:
        receiver.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, ROOM_BYTES)


def sleep_loop(cycle_ms: int, seconds: float, bus: str) -> dict:
    """Send by nothing but time.sleep to absolute deadlines."""
    put, stamps = _bus(bus)
    start_ns, period_ns = time.monotonic_ns() + LEAD_NS, cycle_ms * 1_000_000
    called_ns = []
    for slot in range(round(seconds * 1000 / cycle_ms)):
        time.sleep(max(start_ns + slot * period_ns - time.monotonic_ns(), 0) / 1e9)
        called_ns.append(time.monotonic_ns())
        put(FRAME)
    late = [at - start_ns - slot * period_ns for slot, at in enumerate(called_ns)]
    return {"lateness": _figures(late), "cycle_error": _errors(stamps(), period_ns)}


def thread(cycle_ms: int, seconds: float, bus: str) -> dict:
    """Send by python-can's cyclic task on its thread."""
    put, stamps = _bus(bus, by_python_can=True)
    noting, period_ns = NotingBus(put), cycle_ms * 1_000_000
    task = ThreadBasedCyclicSendTask(noting, threading.Lock(), to_message(FRAME), cycle_ms / 1000)
    time.sleep(seconds)
    task.stop()
    task.thread.join()
    noting.shutdown()
    return {
        "lateness": _figures(_after_best(noting.called_ns, period_ns)),
        "cycle_error": _errors(stamps(), period_ns),
    }


def bcm(cycle_ms: int, seconds: float, bus: str) -> dict:
    """Let the kernel's broadcast manager send: python-can's cyclic task on SocketCAN."""
    _, stamps = _bus(bus)
    period_ns = cycle_ms * 1_000_000
    with SocketcanBus(bus.partition(":")[2]) as sender:
        task = sender.send_periodic(to_message(FRAME), cycle_ms / 1000)
        time.sleep(seconds)
        task.stop()
    at_ns = stamps()
    return {"lateness": _figures(_after_best(at_ns, period_ns)), "cycle_error": _errors(at_ns, period_ns)}


def ours(cycle_ms: int, seconds: float, bus: str, realtime: bool = False) -> dict:
    """Run the demo as `vsensor run` does, all messages every `cycle_ms`."""
    from vsensor import run
    from vsensor.config import load_scenario

    said: list[str] = []
    if bus == "loopback":
        run.open_bus = lambda name, fd=False: FrameBus(LoopbackPort(), "loopback", is_simulated=True)
    with tempfile.TemporaryDirectory() as folder:
        profile = Path(folder) / "native.toml"
        text = (
            (ROOT / "dbc" / "native.toml").read_text().replace('"lds.dbc"', f'"{ROOT / "dbc" / "lds.dbc"}"')
        )
        profile.write_text(re.sub(r"^(\[messages\.\w+\])$", rf"\1\ncycle_ms = {cycle_ms}", text, flags=re.M))
        scenario = load_scenario("highway", {"duration_s": seconds, "cycle_ms": cycle_ms})
        options = run.RunOptions(bus=bus, profile=str(profile), realtime=realtime)
        summary = run.run_scenario(scenario, options, said.append)
    timing = summary.timing
    return {
        "lateness": timing.lateness.figures_ms(),
        "burst": timing.burst.figures_ms(),
        "age": timing.age.figures_ms(),
        "cycle_error": timing.cycle_error.figures_ms(),
        "slots": summary.ticks,
        "slots_dropped": summary.dropped_slots,
        "frames_refused": summary.frames_refused,
        "not_permitted": [text for text in said if "--realtime" in text],
    }


def realtime(cycle_ms: int, seconds: float, bus: str) -> dict:
    """Run the demo with --realtime."""
    return ours(cycle_ms, seconds, bus, realtime=True)


WHO = {"ours": ours, "realtime": realtime, "thread": thread, "bcm": bcm, "sleep": sleep_loop}


def _bus(name: str, by_python_can: bool = False) -> tuple[Callable, Callable[[], list[int]]]:
    """Return what sends one frame, and what ends it all: the times of arrival by the kernel's clock."""
    if name == "loopback":
        port = LoopbackPort()
        return (lambda message: port.put(FRAME)) if by_python_can else port.put, lambda: _arrivals(port)
    channel = name.partition(":")[2]
    listener = SocketcanPort(channel, lambda: SocketcanBus(channel))
    roomy(listener._socket)
    sender = SocketcanBus(channel)
    put = sender.send if by_python_can else SocketcanPort(channel, lambda: sender).put
    return put, lambda: _arrivals(listener, sender.shutdown)


def _arrivals(port: Port, also: Callable[[], None] = lambda: None) -> list[int]:
    arrived_ns = [frame.due_ns for frame, _ in port.received(Times.read())]
    port.close()
    also()
    return arrived_ns


def _after_best(at_ns: list[int], period_ns: int) -> list[int]:
    """Return how much later each is than the best of them, whole periods taken off: its slots are unknown."""
    phase_ns = [at - slot * period_ns for slot, at in enumerate(at_ns)]
    return [phase - min(phase_ns) for phase in phase_ns]


def _errors(stamps_ns: list[int], period_ns: int) -> dict:
    return _figures([abs(after - before - period_ns) for before, after in pairwise(stamps_ns)])


def _figures(values_ns: list[int]) -> dict:
    samples = Samples()
    for value in values_ns:
        samples.add(value)
    return samples.figures_ms()


if __name__ == "__main__":
    who, cycle, duration, where = sys.argv[1:]
    print(json.dumps(WHO[who](int(cycle), float(duration), where)))

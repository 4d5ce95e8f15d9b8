"""Who plays a log: canplayer, python-can's player and ours, each as its users start it, on one vcan.

`python -m tools.bench.players DRIVE STEADY` plays two candump logs on vcan0, the second one by ours alone,
and prints JSON: so it runs inside `tools/vcan`, too. Who listens reads when all is over, and takes no time
from who plays.
"""

import json
import socket
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np

from tools.bench.measure import ROOT
from tools.bench.queue import Arrived, judged, order
from vsensor.bus.socketcan import SO_RCVBUFFORCE, SO_RXQ_OVFL, SO_TIMESTAMPNS
from vsensor.bus.wire import to_wire
from vsensor.logs import iter_frames
from vsensor.types import IntArray

CHANNEL = "vcan0"
ROOM_BYTES = 1 << 29
"""Of the listener: a frame takes 768 bytes of it."""
BURST = 5000
"""Frames sent at once to see what sending costs."""
OURS = [sys.executable, "-m", "vsensor", "replay", "--bus", f"socketcan:{CHANNEL}"]
PYTHON_CAN = [sys.executable, "-m", "can.player", "-i", "socketcan", "-c", CHANNEL]
CANPLAYER = ["canplayer", f"{CHANNEL}=can0"]
PLAYERS = {
    "canplayer": [*CANPLAYER, "-I"],
    "python-can": PYTHON_CAN,
    "ours": OURS,
    "realtime": [*OURS, "--realtime"],
}
HELD = ("canplayer", "ours", "realtime")
"""Who plays the steady log; the last once more without the kernel's limit for real-time processes."""
RT_RUNTIME = Path("/proc/sys/kernel/sched_rt_runtime_us")
"""What real-time processes may take of a second; one that has had it stands until the next (sched(7))."""
WITHOUT_WAITING = {
    "canplayer": [*CANPLAYER, "-t", "-I"],
    "python-can": [*PYTHON_CAN, "--ignore-timestamps"],
    "ours": [*OURS, "--as-fast-as-possible"],
}
_TIMESPEC, _COUNT = struct.Struct("@ll"), struct.Struct("@I")


class Listener:
    """A raw CAN socket with room for everything; `arrived` reads it."""

    def __init__(self, channel: str = CHANNEL) -> None:
        self._socket = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RXQ_OVFL, 1)
        self._socket.setsockopt(socket.SOL_SOCKET, SO_RCVBUFFORCE, ROOM_BYTES)
        self._socket.bind((channel,))

    def arrived(self) -> Arrived:
        """Return all that was on the bus, with the kernel's times, and close."""
        times, frames, missed = [], [], 0
        space = socket.CMSG_SPACE(_TIMESPEC.size) + socket.CMSG_SPACE(_COUNT.size)
        while True:
            try:
                data, ancillary, *_ = self._socket.recvmsg(72, space, socket.MSG_DONTWAIT)
            except BlockingIOError:
                break
            frames.append(data)
            for _, kind, value in ancillary:
                if kind == SO_TIMESTAMPNS:
                    seconds, nanoseconds = _TIMESPEC.unpack(value)
                    times.append(seconds * 10**9 + nanoseconds)
                elif kind == SO_RXQ_OVFL:
                    missed = _COUNT.unpack(value)[0]
        self._socket.close()
        return Arrived(np.array(times, dtype=np.int64), frames, missed)


def read(path: Path) -> tuple[IntArray, list[bytes]]:
    """Return when the frames of a log are due, ns from the first, and what a raw socket sends for them."""
    frames = list(iter_frames(path))
    due_ns = np.array([frame.due_ns for frame in frames], dtype=np.int64)
    return due_ns - due_ns[0], [to_wire(frame) for frame in frames]


def heard(command: list[str]) -> Arrived:
    """Run a player to its end; return what was on the bus."""
    listener = Listener()
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=False)
    if done.returncode:
        raise RuntimeError(f"{' '.join(command)}: {done.stderr[-500:]}")
    return listener.arrived()


def cost_ns() -> int:
    """Return what sending one frame through a raw socket takes, by the kernel's receive times."""
    listener = Listener()
    with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as sender:
        sender.bind((CHANNEL,))
        frame = struct.pack("=IBxxx8s", 0x100, 8, bytes(8))
        for _ in range(BURST):
            sender.send(frame)
    return int(np.median(np.diff(listener.arrived().t_ns)))


def races(drive: Path, steady: Path) -> dict[str, object]:
    """Play `drive` with everybody, on its times and without waiting; `steady` with ours."""
    cost = cost_ns()
    found: dict[str, object] = {"cost_us": cost / 1e3}
    due_ns, sent = read(drive)
    found["drive"] = {
        who: judged(heard([*command, str(drive)]), due_ns, sent, cost) for who, command in PLAYERS.items()
    }
    rates: dict[str, dict[str, float]] = {}
    for who, command in WITHOUT_WAITING.items():
        arrived = heard([*command, str(drive)])
        seconds = float(arrived.t_ns[-1] - arrived.t_ns[0]) / 1e9
        rates[who] = {"frames_per_s": len(arrived.frames) / seconds, **order(arrived.frames, sent)}
    found["without_waiting"] = rates
    due_ns, sent = read(steady)
    found["steady"] = {
        who: judged(heard([*PLAYERS[who], str(steady)]), due_ns, sent, cost) for who in HELD
    } | _unthrottled(lambda: judged(heard([*PLAYERS["realtime"], str(steady)]), due_ns, sent, cost))
    return found


def _unthrottled(play: Callable[[], dict[str, object]]) -> dict[str, dict[str, object]]:
    """Return what `play` finds where no real-time process is ever stopped, if that is allowed."""
    try:
        before = RT_RUNTIME.read_text(encoding="ascii")
        RT_RUNTIME.write_text("-1", encoding="ascii")
    except OSError:
        return {}
    try:
        return {"unthrottled": play()}
    finally:
        RT_RUNTIME.write_text(before, encoding="ascii")


if __name__ == "__main__":
    print(json.dumps(races(Path(sys.argv[1]), Path(sys.argv[2]))))

"""Lateness and cycle error, ours beside others in one run: on this machine's kernel, and on a real vcan.

`python -m tools.bench.timing SECONDS MINUTES BUS` prints the rows of one bus as JSON: so it runs inside
`tools/vcan`, too. Everybody sends for SECONDS in a process of its own, one after the other.
"""

import contextlib
import json
import subprocess
import sys
from collections.abc import Iterator

from tools.bench.measure import ROOT

NAMES = {
    "ours": "vsensor",
    "realtime": "vsensor --realtime",
    "busy": "vsensor --realtime, two busy processes beside",
    "thread": "python-can's thread (ThreadBasedCyclicSendTask)",
    "bcm": "kernel's BCM (python-can's cyclic task on SocketCAN)",
    "sleep": "bare sleep loop",
    "long": "vsensor, the long run",
}
CYCLES_MS = (40, 20, 10)
PEERS = ("ours", "realtime", "thread", "sleep")
PLACES = {
    "loopback": "this machine's kernel, loopback UDP in place of CAN",
    "socketcan:vcan0": "vcan0",
}
TARGETS_MS = {"ours": 0.3, "realtime": 0.1, "busy": 0.3}


def timing(seconds: float = 10.0, minutes: float = 0.0) -> dict[str, object]:
    """Measure everywhere; with `minutes`, also the demo for so long in each place."""
    command = [sys.executable, "-m", "tools.bench.timing", str(seconds), str(minutes)]
    rows = _rows_of([*command, "loopback"])
    try:
        rows += _rows_of([str(ROOT / "tools" / "vcan"), *command, "socketcan:vcan0"])
    except subprocess.CalledProcessError as error:
        return {"rows": rows, "seconds": seconds, "vcan": error.stderr.strip().splitlines()[-1:]}
    return {"rows": rows, "seconds": seconds}


def rows_of(bus: str, seconds: float, minutes: float) -> Iterator[dict]:
    """Yield a row for each sender and cycle on one bus."""
    who_there = PEERS if bus == "loopback" else (*PEERS, "bcm")
    for cycle_ms in CYCLES_MS:
        for who in who_there:
            yield _row(who, who, cycle_ms, seconds, bus)
    with busy(2):
        yield _row("busy", "realtime", CYCLES_MS[-1], seconds, bus)
    if minutes:
        yield _row("long", "ours", CYCLES_MS[0], 60.0 * minutes, bus)


@contextlib.contextmanager
def busy(count: int) -> Iterator[None]:
    """Keep so many processes busy."""
    command = [sys.executable, "-c", "while True: pass"]
    processes = [subprocess.Popen(command) for _ in range(count)]
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.wait()


def _row(name: str, who: str, cycle_ms: int, seconds: float, bus: str) -> dict:
    command = [sys.executable, "-m", "tools.bench.senders", who, str(cycle_ms), str(seconds), bus]
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    found = json.loads(done.stdout.splitlines()[-1])
    return {"who": name, "cycle_ms": cycle_ms, "bus": bus, "seconds": seconds, **found}


def _rows_of(command: list[str]) -> list[dict]:
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    print(json.dumps(list(rows_of(sys.argv[3], float(sys.argv[1]), float(sys.argv[2])))))

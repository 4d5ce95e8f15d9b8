"""candump beside a test: it hears every frame that is sent inside the block."""

import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any

ROOM_BYTES = 64 << 20
"""A socket as it is holds some 270 frames: 0.1 s of 3000 a second. A machine under load stops for longer."""
LONGEST_S = 60.0
END = "7FF#656E64"
"""The frame that says to a recording that it is over."""


@contextmanager
def candump(channel: str, stdout: int | IO[Any] = subprocess.PIPE) -> Iterator[subprocess.Popen[str]]:
    """Run `candump -L channel` while the block runs."""
    before = receivers(channel)
    command = ["candump", "-L", "-r", str(ROOM_BYTES), channel]
    with subprocess.Popen(command, stdout=stdout, text=True) as process:
        try:
            wait_for(lambda: receivers(channel) > before)
            yield process
        finally:
            process.terminate()


@contextmanager
def recorded(channel: str, path: Path) -> Iterator[None]:
    """Let candump write what it hears while the block runs; after it the file holds all of that."""
    with path.open("w") as file, candump(channel, file):
        yield
        subprocess.run(["cansend", channel, END], check=True)
        wait_for(lambda: path.read_text().endswith(f"{END}\n"))
    lines = path.read_text().splitlines(keepends=True)
    path.write_text("".join(line for line in lines if END not in line))


def receivers(channel: str) -> int:
    """Return how many sockets hear every frame of an interface: an open one is not bound yet."""
    return Path("/proc/net/can/rcvlist_all").read_text().split().count(channel)


def wait_for_frames(log: Path, count: int, beyond: int = 0) -> None:
    """Wait until a candump log has so many more frames than `beyond` bytes; each takes some 40."""
    wait_for(lambda: log.exists() and log.stat().st_size >= beyond + 40 * count)


def wait_for(happened: Callable[[], bool]) -> None:
    """Wait until something has happened, much longer than it takes on a machine with time for it."""
    deadline = time.monotonic() + LONGEST_S
    while not happened():
        assert time.monotonic() < deadline, "it never happened"
        time.sleep(0.02)  # one processor for all

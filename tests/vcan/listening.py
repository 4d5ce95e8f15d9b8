"""candump beside a test: it hears every frame that is sent inside the block."""

import os
import subprocess
import time
from collections.abc import Iterator
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
    before = _receivers(channel)
    command = ["candump", "-L", "-r", str(ROOM_BYTES), channel]
    with subprocess.Popen(command, stdout=stdout, text=True) as process:
        try:
            while _receivers(channel) <= before:  # an open socket is not yet bound
                assert process.poll() is None, "candump ended"
                time.sleep(0.005)
            yield process
        finally:
            process.terminate()


@contextmanager
def recorded(channel: str, path: Path) -> Iterator[None]:
    """Let candump write what it hears while the block runs; after it the file holds all of that."""
    with path.open("w") as file, candump(channel, file):
        yield
        subprocess.run(["cansend", channel, END], check=True)
        deadline = time.monotonic() + LONGEST_S
        while not (text := path.read_text()).endswith(f"{END}\n"):
            assert time.monotonic() < deadline, "candump writes no more"
            time.sleep(0.05)
    path.write_text("".join(line for line in text.splitlines(keepends=True) if END not in line))


def has_socket(pid: int) -> bool:
    """Return whether a process has a socket open."""
    folder = f"/proc/{pid}/fd"
    return any("socket:" in _target(f"{folder}/{name}") for name in os.listdir(folder))


def _receivers(channel: str) -> int:
    """Return how many sockets hear every frame of an interface."""
    return Path("/proc/net/can/rcvlist_all").read_text().split().count(channel)


def _target(link: str) -> str:
    """Return what an open file is; "" for one that was closed while we looked."""
    try:
        return os.readlink(link)
    except FileNotFoundError:
        return ""

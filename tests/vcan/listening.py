"""candump, started, its socket open."""

import os
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from typing import IO, Any


@contextmanager
def candump(channel: str, stdout: int | IO[Any] = subprocess.PIPE) -> Iterator[subprocess.Popen[str]]:
    """Run `candump -L channel` while the block runs; it hears every frame sent inside."""
    with subprocess.Popen(["candump", "-L", channel], stdout=stdout, text=True) as process:
        try:
            while not has_socket(process.pid):
                assert process.poll() is None, "candump ended"
            yield process
        finally:
            process.terminate()


def has_socket(pid: int) -> bool:
    """Return whether a process has a socket open."""
    folder = f"/proc/{pid}/fd"
    return any("socket:" in _target(f"{folder}/{name}") for name in os.listdir(folder))


def _target(link: str) -> str:
    """Return what an open file is; "" for one that was closed while we looked."""
    try:
        return os.readlink(link)
    except FileNotFoundError:
        return ""

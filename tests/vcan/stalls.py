"""Whether the machine itself stood still: a process that only sleeps notes when it was not woken in time."""

import subprocess
import sys
from contextlib import contextmanager

WATCH = """
import time
before = time.monotonic_ns()
print(before, before, flush=True)
while True:
    time.sleep(0.01)
    now = time.monotonic_ns()
    if now - before > 40_000_000:
        print(before, now, flush=True)
    before = now
"""
"""It hardly needs time: who computes for long does not keep it waiting, a machine that stops does."""


@contextmanager
def watched():
    """Watch while the block runs; yields a list that then holds the longest stall, ns (0 below 40 ms)."""
    command = [sys.executable, "-S", "-c", WATCH]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        longest = []
        try:
            process.stdout.readline()
            yield longest
        finally:
            process.terminate()
            lines = process.stdout.read().splitlines()
            stalls = [int(now) - int(before) for before, now in map(str.split, lines)]
            longest.append(max(stalls, default=0))

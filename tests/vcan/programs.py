"""Python programs as children of a server that has imported already what they need.

In user-mode Linux the imports of a program take longer than most tests. A child is a process of its own: it
does what `python -m MODULE WORDS...` does, has its own output and signals, and ends with its own status. That
`vsensor` starts by itself as well, a command of README on vcan shows (tests/test_readme.py).
"""

import multiprocessing
import os
import runpy
import sys
from multiprocessing.reduction import DupFd
from pathlib import Path
from threading import Timer
from typing import NamedTuple

PRELOADED = [
    "cantools.subparsers.decode",
    "lxml.etree",
    "scipy.interpolate",
    "vsensor.accept",
    "vsensor.run",
    "vsensor.sinks.log",
    "vsensor.sources.live",
    "vsensor.sources.map_drive",
]


class Done(NamedTuple):
    """What a program left behind, with subprocess's names."""

    returncode: int
    stdout: str
    stderr: str


class Program:
    """`python -m MODULE WORDS...`, or a FILE.py, while the block runs; it is killed at the block's end."""

    def __init__(self, module: object, *words: object, stdin: Path | str = os.devnull) -> None:
        context = multiprocessing.get_context("forkserver")
        context.set_forkserver_preload(PRELOADED)
        out, err = os.pipe(), os.pipe()
        self.stdout, self.stderr = os.fdopen(out[0]), os.fdopen(err[0])
        ends = [DupFd(out[1]), DupFd(err[1])]
        self.process = context.Process(target=_run, args=(str(module), [*map(str, words)], str(stdin), *ends))
        try:
            self.process.start()
        finally:
            os.close(out[1])
            os.close(err[1])

    def __enter__(self) -> "Program":
        return self

    def __exit__(self, *_: object) -> None:
        self.process.kill()
        self.process.join()
        self.stdout.close()
        self.stderr.close()

    def send_signal(self, number: int) -> None:
        """Send a signal."""
        os.kill(self.process.pid, number)

    def ended(self, timeout_s: float = 240.0) -> Done:
        """Wait for its end; after `timeout_s` it is killed."""
        watchdog = Timer(timeout_s, self.process.kill)
        watchdog.start()
        out, err = self.stdout.read(), self.stderr.read()
        self.process.join()
        watchdog.cancel()
        return Done(self.process.exitcode, out, err)


def ran(module: object, *words: object, stdin: Path | str = os.devnull) -> Done:
    """Run a program to its end."""
    with Program(module, *words, stdin=stdin) as program:
        return program.ended()


def _run(module: str, words: list[str], stdin: str, out: DupFd, err: DupFd) -> None:
    """Become the program."""
    for number, fd in enumerate((os.open(stdin, os.O_RDONLY), out.detach(), err.detach())):
        os.dup2(fd, number)
        os.close(fd)
    sys.stdin, sys.stdout, sys.stderr = open(0), open(1, "w"), open(2, "w", buffering=1)  # noqa: SIM115
    sys.argv = [module, *words]
    if module.endswith(".py"):
        runpy.run_path(module, run_name="__main__")
    else:
        runpy.run_module(module, run_name="__main__", alter_sys=True)

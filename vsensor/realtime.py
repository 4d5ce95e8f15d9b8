"""`--realtime`: real-time priority and locked memory where allowed; no garbage collector in the cycle."""

import contextlib
import ctypes
import errno
import gc
import os
import resource
import sys
from collections.abc import Callable, Iterator

PRIORITY = 20
"""Of SCHED_FIFO, 1 to 99: above every ordinary process, below the kernel's interrupt threads at 50."""

MCL_CURRENT, MCL_FUTURE, MCL_ONFAULT = 1, 2, 4  # sys/mman.h
"""On fault: what was touched stays. Everything that is mapped would be 0.6 GB, three times what is used, and
each new large array a pause while its pages are fetched."""
COLLECT_EVERY = 250
"""Ticks between two looks for garbage in cycles: 10 s at 40 ms; one look takes about 1 ms."""


@contextlib.contextmanager
def real_time_priority(say: Callable[[str], None]) -> Iterator[None]:
    """Run the block with SCHED_FIFO and all memory locked; what is not allowed is said with how to allow it.

    Processes that the block starts have neither: SCHED_RESET_ON_FORK, and locks are never inherited.
    """
    before = _schedule(say)
    is_locked = _lock_memory(say)
    try:
        yield
    finally:
        if is_locked:
            ctypes.CDLL(None).munlockall()
        if before is not None:
            os.sched_setscheduler(0, *before)


@contextlib.contextmanager
def calm_collector() -> Iterator[Callable[[int], None]]:
    """Keep the garbage collector out of the cycle; yields what to call after every tick instead.

    What is loaded now is frozen, so that a look meets only what the run has made since.
    """
    gc.collect()
    gc.freeze()
    was_on = gc.isenabled()
    gc.disable()
    try:
        yield _collect
    finally:
        if was_on:
            gc.enable()
        gc.unfreeze()


def _collect(tick: int) -> None:
    if tick % COLLECT_EVERY == 0:
        gc.collect()


def _schedule(say: Callable[[str], None]) -> tuple[int, os.sched_param] | None:
    """Ask for SCHED_FIFO; returns what was before, None if it was refused."""
    if not hasattr(os, "SCHED_FIFO"):
        say("--realtime: this system has no SCHED_FIFO; going on without it")
        return None
    before = os.sched_getscheduler(0), os.sched_getparam(0)
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO | os.SCHED_RESET_ON_FORK, os.sched_param(PRIORITY))
    except PermissionError:
        say(f"--realtime: SCHED_FIFO is not permitted, going on without it; to allow it: {_allow('rtprio')}")
        return None
    return before


def _lock_memory(say: Callable[[str], None]) -> bool:
    """Lock what is mapped and will be; not under a limit, at which a later array would not be had."""
    how = f"going on without it; to allow it: {_allow('memlock')}"
    limit = resource.getrlimit(resource.RLIMIT_MEMLOCK)[0]
    library = ctypes.CDLL(None, use_errno=True)
    if limit != resource.RLIM_INFINITY and not _may_lock_without_limit():
        say(f"--realtime: locking memory is limited to {limit >> 20} MB, {how}")
        return False
    if library.mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT):
        say(f"--realtime: memory cannot be locked ({errno.errorcode.get(ctypes.get_errno())}), {how}")
        return False
    return True


def _may_lock_without_limit() -> bool:
    """Return whether this process has CAP_IPC_LOCK (bit 14 of CapEff, capabilities(7))."""
    with contextlib.suppress(OSError), open("/proc/self/status", encoding="ascii") as status:
        for line in status:
            if line.startswith("CapEff:"):
                return bool(int(line.split()[1], 16) >> 14 & 1)
    return False


def _allow(limit: str) -> str:
    """Return the commands that lift a limit, for this login or for this interpreter."""
    flag, value = {"rtprio": ("-r", str(PRIORITY)), "memlock": ("-l", "unlimited")}[limit]
    return (
        f"{limit} in /etc/security/limits.conf (ulimit {flag} {value}), or "
        f"sudo setcap cap_sys_nice,cap_ipc_lock=ep {os.path.realpath(sys.executable)}"
    )

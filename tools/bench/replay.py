"""Replay and conversion as users run them: on times beside other players, held rates, long logs, memory."""

import contextlib
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from tools.bench.measure import ROOT
from vsensor.logs import Columns, iter_frames, open_log_writer

DRIVE = ROOT.parent / "shared" / "data" / "can" / "rav4_drive.log"
"""A recorded drive of 60 s; without it nothing is measured."""
T0_NS = 1_700_000_000 * 10**9
STEADY_HZ, FULL_HZ = 3000, 8000
MILLION = 1_000_000
LAID_S = {"1": 15.0, "10": 45.0}
"""Speed -> seconds of the drive that a sensor is laid over."""
BLOCK = 100_000
METER = """
import json, resource, subprocess, sys, time
began = time.monotonic()
subprocess.run(sys.argv[1:], check=True, stdout=subprocess.DEVNULL)
most = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
print(json.dumps({"seconds": time.monotonic() - began, "memory_mb": most / 1024}))
"""
"""A small process that measures its child: memory counts from what the parent had."""


def replay(seconds: float = 60.0, million: int = MILLION) -> dict[str, object]:
    """Measure everything: `seconds` of each log played, `million` frames converted, 10 times that read."""
    if not DRIVE.exists():
        return {"error": f"{DRIVE.name} is not there"}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        drive, steady, full = write_logs(folder, seconds)
        found: dict[str, object] = {"seconds": seconds}
        command = [sys.executable, "-m", "tools.bench.players", str(drive), str(steady)]
        try:
            found["vcan"] = _json([str(ROOT / "tools" / "vcan"), *command])
        except subprocess.CalledProcessError as error:
            found["not_on_vcan"] = error.stderr.strip().splitlines()[-1:]
        found["schedule"] = {
            log.stem: {
                who: _json([sys.executable, "-m", "tools.bench.schedule", who, str(log)])
                for who in ("ours", "bare")
            }
            for log in (drive, full)
        }
    found |= laid(min(1.0, seconds / 60.0))
    with tempfile.TemporaryDirectory() as name:
        return {**found, **long_logs(Path(name), million)}


def laid(part: float) -> dict[str, object]:
    """Lay a sensor over the drive at two speeds, and over a car on vcan; `part` of the usual times."""
    here = [sys.executable, "-m", "tools.bench.laid"]
    found: dict[str, object] = {
        "overlay": {
            speed: _json([*here, "overlay", speed, str(DRIVE), str(seconds * part)])
            for speed, seconds in LAID_S.items()
        }
    }
    with contextlib.suppress(subprocess.CalledProcessError):  # that there is no vcan was said before
        found["gateway"] = _json([str(ROOT / "tools" / "vcan"), *here, "gateway", str(15.0 * part)])
    return found


def write_logs(folder: Path, seconds: float) -> tuple[Path, Path, Path]:
    """Write a drive, a steady rate and a full bus as candump logs of `seconds`; return their paths."""
    drive, steady, full = (folder / f"{name}.log" for name in ("drive", "steady", "full"))
    drive.write_text("".join(_beginning(DRIVE, seconds)))
    _write(steady, round(STEADY_HZ * seconds), STEADY_HZ)
    _write(full, round(FULL_HZ * seconds), FULL_HZ)
    return drive, steady, full


def long_logs(folder: Path, million: int) -> dict[str, object]:
    """Convert a log and one of a quarter of its length; play of one of ten times its length the beginning."""
    converted = []
    for count in (million // 4, million):
        _write(folder / f"{count}.blf", count, FULL_HZ)
        converted.append(_timed("convert", folder / f"{count}.blf", folder / f"{count}.mf4"))
    first_s, played = {}, folder / "played.log"
    for name, count in (
        ("short.log", FULL_HZ),
        *((f"long{s}", 10 * million) for s in (".log", ".blf", ".mf4")),
    ):
        log = folder / name
        _write(log, count, FULL_HZ)
        os.sync()  # or the disk is still busy with it
        began_ns = time.time_ns()
        _timed("replay", log, "--bus", "virtual:bench", "--stop", "0.5", "--log", played)
        first_s[name] = (next(iter_frames(played)).due_ns - began_ns) / 1e9
    memory_mb = [
        _timed("replay", log, "--as-fast-as-possible", "--include", "0x100", "--log", played)["memory_mb"]
        for log in (folder / f"{million // 4}.blf", folder / "long.blf")
    ]
    return {"million": million, "convert": converted, "first_frame_s": first_s, "memory_mb": memory_mb}


def _write(path: Path, count: int, rate_hz: int) -> None:
    """Write frames at a rate, numbered in their data, with 1024 ids."""
    with open_log_writer(path) as writer:
        for first in range(0, count, BLOCK):
            numbers = np.arange(first, min(first + BLOCK, count))
            writer.write_columns(
                Columns(
                    T0_NS + numbers * 10**9 // rate_hz,
                    (0x100 + numbers % 1024).astype(np.uint32),
                    np.zeros(len(numbers), dtype=np.uint8),
                    np.zeros(len(numbers), dtype=np.uint8),
                    np.full(len(numbers), 8, dtype=np.uint8),
                    numbers.astype(">u8").view(np.uint8).reshape(-1, 8),
                )
            )


def _timed(*words: object) -> dict[str, float]:
    """Run vsensor; return how long it took, and the most memory, in a process without our own behind it."""
    return _json([sys.executable, "-c", METER, sys.executable, "-m", "vsensor", *map(str, words)])


def _json(command: list[str]) -> dict:
    done = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    return json.loads(done.stdout.splitlines()[-1])


def _beginning(path: Path, seconds: float) -> Iterator[str]:
    """Yield the lines of a candump log's first seconds."""
    start = None
    with path.open() as file:
        for line in file:
            t_s = float(line[1 : line.index(")")])
            start = t_s if start is None else start
            if t_s - start > seconds:
                return
            yield line

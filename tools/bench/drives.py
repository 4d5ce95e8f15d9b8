"""The shipped drive as a user runs it: time per tick, `--fast`, a minute on vcan, memory over an hour."""

import json
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from tools.bench.measure import PERIOD_NS, ROOT, median, one_core, yardstick_ms
from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.line import build_line, tick_count
from vsensor.runner import run_loop


def demo_tick(ticks: int | None = None) -> dict[str, object]:
    """Time every tick of the demo scenario on one core, in three runs; the median run counts."""
    scenario = load_scenario("highway")
    line = build_line(scenario)
    ticks = tick_count(scenario, line.source) if ticks is None else ticks
    rows, yardsticks = [], []
    with one_core():
        for _ in range(3):
            yardsticks.append(yardstick_ms())
            summary = run_loop(line, SimulatedClock(), period_ns=PERIOD_NS, ticks=ticks, real_time=False)
            total = summary.stopwatch.recent_ms().sum(axis=1)
            rows.append((float(np.median(total)), float(np.percentile(total, 99)), summary))
    p50, p99, summary = sorted(rows, key=lambda row: row[0])[1]
    yardstick = float(np.median(yardsticks))
    return {
        "ticks": summary.ticks,
        "p50_ms": p50,
        "p99_ms": p99,
        "p50_ms_of_runs": [row[0] for row in rows],
        "target_p50_ms": 2.0,
        "yardstick_ms": yardstick,
        "p50_per_yardstick": p50 / yardstick,
        "stages_p50_ms": summary.stopwatch.p50_ms(),
    }


def fast_ratio() -> dict[str, object]:
    """Run the demo with --fast as a user does, log and trace included and not, as whole processes."""
    result: dict[str, object] = {"target_times_real_time": 20.0}
    with tempfile.TemporaryDirectory() as folder:
        extra = ["--log", f"{folder}/out.blf", "--trace", f"{folder}/trace.npz"]
        for name, words in (("plain", []), ("with_log_and_trace", extra)):
            ratios, whole = [], []
            for _ in range(3):
                began = time.perf_counter()
                done = vsensor("run", "--fast", "--quiet", *words)
                whole.append(90.0 / (time.perf_counter() - began))
                ratios.append(float(re.search(r"\(([\d.]+) x real time\)", done.stdout)[1]))
            result[name] = {
                "times_real_time": float(np.median(ratios)),
                "with_start_and_end_of_the_process": float(np.median(whole)),
            }
    return result


def on_vcan(seconds: int) -> dict[str, object]:
    """Send for `seconds` on a vcan with candump beside it; an independent reader judges the log."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "candump.log"
        script = Path(folder) / "run.sh"
        script.write_text(
            f"candump -L vcan0 > {log} &\n"
            "reader=$!\nsleep 0.5\n"
            f"{sys.executable} -m vsensor.cli run --bus socketcan:vcan0 --duration {seconds} --quiet\n"
            "status=$?\nsleep 0.5\nkill $reader\nexit $status\n"
        )
        run = subprocess.run(
            [ROOT / "tools" / "vcan", "sh", script], capture_output=True, text=True, cwd=ROOT, check=False
        )
        if run.returncode:
            return {"error": (run.stderr or run.stdout).strip().splitlines()[-1:]}
        judged = subprocess.run(
            [sys.executable, ROOT / "tools" / "independent_reader.py", log, ROOT / "dbc" / "lds.dbc"],
            capture_output=True,
            text=True,
            check=False,
        )
        sums = json.loads(judged.stdout.splitlines()[-1])
    sent = int(re.search(r"frames sent (\d+)", run.stdout)[1])
    late = re.search(r"p50 ([\d.]+), p99 ([\d.]+), p99.9 [\d.]+, max ([\d.]+) ms", run.stdout)
    return {
        "seconds": seconds,
        "kernel": "native" if Path("/sys/class/net/vcan0").exists() else "user-mode Linux",
        "frames_sent": sent,
        "frames_lost": sent - sums["frames"],
        "slots_dropped": int(re.search(r"slots dropped (\d+)", run.stdout)[1]),
        "counter_errors": sums["counter_errors"],
        "crc_errors": sums["crc_errors"],
        "messages": sums["messages"],
        "messages_absent": sums["absent"],
        "lateness_ms": dict(zip(("p50", "p99", "max"), map(float, late.groups()), strict=True)),
    }


def memory(simulated_s: int) -> dict[str, object]:
    """Run `vsensor run --fast` for so long a drive and sample what it holds in memory.

    The first fifth is warm-up; growth is the median of the last fifth less that of the second.
    """
    command = [
        sys.executable,
        "-m",
        "vsensor.cli",
        "run",
        "--fast",
        "--quiet",
        "--duration",
        str(simulated_s),
    ]
    rss_mb = []
    with subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        status = Path(f"/proc/{process.pid}/status")
        while process.poll() is None:
            found = re.search(r"VmRSS:\s*(\d+) kB", status.read_text())
            if found:
                rss_mb.append(int(found[1]) / 1024)
            time.sleep(0.1)
        if process.returncode:
            raise RuntimeError(process.stderr.read())
    fifth = max(len(rss_mb) // 5, 1)
    after_warm_up, at_end = median(rss_mb[fifth : 2 * fifth]), median(rss_mb[-fifth:])
    return {
        "simulated_s": simulated_s,
        "samples": len(rss_mb),
        "after_warm_up_mb": after_warm_up,
        "at_end_mb": at_end,
        "largest_mb": max(rss_mb),
        "growth_mb": at_end - after_warm_up,
        "target_growth_mb": 5.0,
    }


def vsensor(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run a vsensor command as a process."""
    command = [sys.executable, "-m", "vsensor.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, check=True)

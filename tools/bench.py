"""`make bench`: the project's figures, measured in one run, as a table and JSON in report/.

Times on a shared machine mean little alone, so each stands beside a yardstick measured in the same run:
a fixed numpy workload (sorting 100,000 float64). The demo runs on one core.

    python -m tools.bench [--seconds N] [--no-vcan] [--out report]
"""

import argparse
import json
import os
import platform
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from vsensor.clock import SimulatedClock
from vsensor.config import load_scenario
from vsensor.line import build_line, tick_count
from vsensor.runner import STAGES, run_loop

ROOT = Path(__file__).parents[1]
PERIOD_NS = 40_000_000


def yardstick_ms() -> float:
    """Return the median time of sorting 100,000 numbers: what this machine gives just now."""
    values = np.random.default_rng(0).random(100_000)
    times = []
    for _ in range(15):
        began = time.perf_counter_ns()
        np.sort(values)
        times.append((time.perf_counter_ns() - began) / 1e6)
    return float(np.median(times))


def demo_tick() -> dict[str, object]:
    """Time every tick of the demo scenario on one core, in runs of a minute; the median run counts."""
    os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
    scenario = load_scenario("highway")
    line = build_line(scenario)
    ticks = tick_count(scenario, line.source)
    rows, yardsticks = [], []
    for _ in range(3):
        yardsticks.append(yardstick_ms())
        summary = run_loop(line, SimulatedClock(), period_ns=PERIOD_NS, ticks=ticks, real_time=False)
        total = summary.stopwatch.recent_ms().sum(axis=1)
        rows.append((float(np.median(total)), float(np.percentile(total, 99)), summary))
    p50, p99, summary = sorted(rows, key=lambda row: row[0])[1]
    return {
        "ticks": summary.ticks,
        "p50_ms": p50,
        "p99_ms": p99,
        "p50_ms_of_runs": [row[0] for row in rows],
        "target_p50_ms": 2.0,
        "yardstick_ms": float(np.median(yardsticks)),
        "p50_per_yardstick": p50 / float(np.median(yardsticks)),
        "stages_p50_ms": dict(
            zip(STAGES, np.median(summary.stopwatch.recent_ms(), axis=0).tolist(), strict=True)
        ),
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
    late = re.search(r"p50 ([\d.]+), p99 ([\d.]+), max ([\d.]+) ms", run.stdout)
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


def vsensor(*words: str) -> "subprocess.CompletedProcess[str]":
    """Run a vsensor command as a process."""
    command = [sys.executable, "-m", "vsensor.cli", *words]
    return subprocess.run(command, capture_output=True, text=True, check=True)


def markdown(report: dict[str, dict]) -> str:
    """Return the report as a table."""
    demo, fast = report["demo_tick"], report["fast"]
    lines = [
        "# Measured",
        "",
        f"{report['machine']['processor']}, {report['machine']['cores']} cores, "
        f"Python {report['machine']['python']}, numpy {report['machine']['numpy']}",
        "",
        "| figure | target | measured |",
        "|---|---|---|",
        f"| demo tick, one core, p50 | 2 ms | {demo['p50_ms']:.2f} ms (p99 {demo['p99_ms']:.2f}); "
        f"{demo['p50_per_yardstick']:.2f} x sorting 100,000 numbers |",
        f"| `--fast`, the loop | 20 x real time | {fast['plain']['times_real_time']:.1f} x |",
        f"| the same with BLF log and trace | | {fast['with_log_and_trace']['times_real_time']:.1f} x |",
        f"| `--fast`, whole process | | {fast['plain']['with_start_and_end_of_the_process']:.1f} x |",
    ]
    vcan = report.get("vcan")
    if vcan and "error" not in vcan:
        late = vcan["lateness_ms"]
        lines += [
            f"| vcan ({vcan['kernel']}), {vcan['seconds']} s: slots dropped | 0 | {vcan['slots_dropped']} |",
            f"| the same: frames lost | 0 | {vcan['frames_lost']} of {vcan['frames_sent']} |",
            f"| the same: counter, CRC errors | 0, 0 | {vcan['counter_errors']}, {vcan['crc_errors']} |",
            f"| the same: lateness p50, p99, max | | {late['p50']}, {late['p99']}, {late['max']} ms |",
        ]
    stages = [f"| {stage} | {ms:.3f} |" for stage, ms in demo["stages_p50_ms"].items()]
    return "\n".join([*lines, "", "| stage | p50 ms |", "|---|---|", *stages, ""])


def machine() -> dict[str, object]:
    """Name the machine."""
    info = Path("/proc/cpuinfo").read_text() if Path("/proc/cpuinfo").exists() else ""
    model = re.search(r"model name\s*: (.*)", info)
    return {
        "processor": model[1] if model else platform.processor(),
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "numpy": np.__version__,
    }


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seconds", type=int, default=60, help="length of the run on vcan")
    parser.add_argument("--no-vcan", action="store_true", help="leave the run on vcan out")
    parser.add_argument("--out", type=Path, default=ROOT / "report", help="folder of the report")
    arguments = parser.parse_args()
    affinity = os.sched_getaffinity(0)
    report: dict[str, dict] = {"machine": machine(), "demo_tick": demo_tick()}
    os.sched_setaffinity(0, affinity)
    report["fast"] = fast_ratio()
    if not arguments.no_vcan:
        report["vcan"] = on_vcan(arguments.seconds)
    arguments.out.mkdir(parents=True, exist_ok=True)
    (arguments.out / "bench.json").write_text(json.dumps(report, indent=2) + "\n")
    text = markdown(report)
    (arguments.out / "bench.md").write_text(text)
    print(text)
    vcan = report.get("vcan", {})
    if "error" in vcan:
        print(f"vcan: {vcan['error']}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())

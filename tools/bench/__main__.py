"""`python -m tools.bench [--only demo,fast,...] [--seconds N] [--full] [--out report]`."""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path

from tools.bench import (
    codec,
    drives,
    errors,
    frontier,
    growth,
    looking,
    loop,
    peers,
    pictures,
    reference,
    replay,
    scans,
    timing,
    tuning,
    world,
)
from tools.bench.measure import ROOT, machine
from tools.bench.report import markdown

SECTIONS = (
    *("demo", "fast", "encoding", "decoding", "errors", "vcan", "loop", "timing", "replay"),
    *("reference", "frontier", "growth", "memory", "hard", "scan", "tune", "world", "examine"),
)


def main(words: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(
        prog="python -m tools.bench", description="measure the project's figures"
    )
    parser.add_argument("--only", default=",".join(SECTIONS), help=f"some of {','.join(SECTIONS)}")
    parser.add_argument("--seconds", type=int, default=60, help="length of the run on vcan")
    parser.add_argument(
        "--timing-seconds", type=float, default=10.0, help="length of each sender's turn in timing"
    )
    parser.add_argument("--replay-seconds", type=float, default=60.0, help="length of the logs in replay")
    parser.add_argument(
        "--full",
        action="store_true",
        help="memory over a simulated hour, not ten minutes; ten minutes of the demo in timing; "
        "94 million rows in tune",
    )
    parser.add_argument("--out", type=Path, default=ROOT / "report", help="folder of the report")
    arguments = parser.parse_args(words)
    only = arguments.only.split(",")
    unknown = sorted(set(only) - set(SECTIONS))
    if unknown:
        parser.error(f"--only {','.join(unknown)}: some of {','.join(SECTIONS)} were expected")
    arguments.out.mkdir(parents=True, exist_ok=True)
    works: dict[str, tuple[str, Callable[[], dict]]] = {
        "demo": ("demo_tick", drives.demo_tick),
        "fast": ("fast", drives.fast_ratio),
        "vcan": ("vcan", lambda: drives.on_vcan(arguments.seconds)),
        "loop": ("closed_loop", loop.closed_loop),
        "encoding": ("encoding", codec.encoding),
        "decoding": ("decoding", codec.decoding),
        "errors": ("errors", errors.errors),
        "timing": (
            "timing",
            lambda: timing.timing(arguments.timing_seconds, 10.0 if arguments.full else 0.0),
        ),
        "replay": ("replay", lambda: replay.replay(arguments.replay_seconds)),
        "reference": ("reference", reference.against_p1),
        "frontier": ("frontier", frontier.frontier),
        "growth": ("growth", growth.growth),
        "memory": ("memory", lambda: drives.memory(3600 if arguments.full else 600)),
        "hard": ("hard_cases", hard_cases),
        "scan": ("scan", scans.scans),
        "tune": ("tune", lambda: tuning.tunings(full=arguments.full)),
        "world": ("world", world.world),
        "examine": ("examine", looking.examined),
    }
    report: dict[str, dict] = {"machine": machine()}
    for section, (key, work) in works.items():
        if section in only:
            began = time.perf_counter()
            report[key] = work()
            print(f"{section}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
    if "reference" in report:
        report["occlusion"] = peers.occlusion()
    for name, draw in (
        ("frontier", pictures.frontier),
        ("growth", pictures.growth),
        ("timing", pictures.timing),
    ):
        if name in report:
            draw(report[name], arguments.out / f"{name}.png")
    (arguments.out / "bench.json").write_text(json.dumps(report, indent=2) + "\n")
    text = markdown(report)
    (arguments.out / "bench.md").write_text(text)
    print(text)
    vcan = report.get("vcan", {})
    if "error" in vcan:
        print(f"vcan: {vcan['error']}", file=sys.stderr)
        return 1
    return 0


def hard_cases() -> dict[str, object]:
    """Return the worst error of every hard case, against higher precision."""
    from tests.hard_cases.table import rows

    return {"rows": [row._asdict() for row in rows()]}


if __name__ == "__main__":
    sys.exit(main())

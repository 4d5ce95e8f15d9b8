"""Run all tests in three parts: those of the bus on a real vcan, timing-sensitive ones alone, the rest.

Arguments go to pytest in every part. The exit status is 0 only if every part passed; pytest's own
closing line at the end counts all of them. In CI (environment CI) a vcan test that was skipped fails.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
NO_TESTS = 5  # pytest's exit status where nothing matched


def run(title: str, before: list[str], arguments: list[str]) -> int:
    """Run pytest once; returns its exit status."""
    print(f"---- {title}", flush=True)
    command = [*before, sys.executable, "-m", "pytest", "-p", "tools.parts_plugin", *arguments, *sys.argv[1:]]
    environment = dict(os.environ, VSENSOR_NEEDS_VCAN="1")
    return subprocess.run(
        command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, check=False
    ).returncode


def not_run(part: Path) -> str:
    """Say what is wrong if a vcan test did not run; "" if all did."""
    if not part.exists():
        return "the part on vcan did not come to its end"
    reports = json.loads(part.read_text())
    if not reports["passed"] + reports["failed"]:
        return "no test ran on vcan"
    if os.environ.get("CI") and reports["skipped"]:
        return f"{len(reports['skipped'])} tests on vcan were skipped"
    return ""


def main() -> int:
    """Run the parts, the largest last, so that its closing line is that of all."""
    with tempfile.TemporaryDirectory(prefix="vsensor-test-") as name:
        vcan, timing = Path(name, "vcan.json"), Path(name, "timing.json")
        statuses = [
            run("on vcan", ["tools/vcan"], ["-m", "vcan", f"--part-out={vcan}"]),
            run("timing-sensitive, alone", [], ["-m", "timing and not vcan", f"--part-out={timing}"]),
        ]
        earlier = [f"--part-in={part}" for part in (vcan, timing) if part.exists()]
        problem = "" if sys.argv[1:] else not_run(vcan)
        if problem:
            print(f"---- FAILED: {problem}", flush=True)
        statuses.append(
            run("the rest, and the sum", [], ["-n", "2", "-m", "not vcan and not timing", *earlier])
        )
    if sys.argv[1:]:  # a selection may leave a part empty
        statuses = [status for status in statuses if status != NO_TESTS] or [NO_TESTS]
    if problem or any(statuses):
        statuses.append(1)
    return 130 if 130 in statuses else max(statuses)


if __name__ == "__main__":
    sys.exit(main())

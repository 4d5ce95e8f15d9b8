"""Run all tests in three parts: on a real vcan, beside them the rest, then those that want to be alone.

Those on vcan mostly wait for a bus in real time, the rest computes: side by side they take the time of the
longer. The rest gives way (nice), so that it makes no frame late. Alone and in one process run the timing-
sensitive ones and those in a browser: beside the others these took minutes, and each process would start a
browser of its own. Arguments go to pytest in every part. The exit status is 0 only if every part passed;
pytest's own closing line at the end counts all of them. In CI (environment CI) a vcan test that was skipped
fails.
"""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import IO

ROOT = Path(__file__).resolve().parent.parent
NO_TESTS = 5  # pytest's exit status where nothing matched
WORKERS = min(max(os.cpu_count() or 1, 2), 4)


def start(before: list[str], arguments: list[str], output: IO[str] | None = None) -> subprocess.Popen[bytes]:
    """Start pytest once; `wait()` gives its exit status."""
    command = [*before, sys.executable, "-m", "pytest", "-p", "tools.parts_plugin", *arguments, *sys.argv[1:]]
    environment = dict(os.environ, VSENSOR_NEEDS_VCAN="1")
    return subprocess.Popen(
        command, cwd=ROOT, env=environment, stdin=subprocess.DEVNULL, stdout=output, stderr=output
    )


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


def build_ecu() -> None:
    """Build the ECU before both parts want it; what is wrong with it their tests say."""
    subprocess.run(
        [sys.executable, "-m", "tests.ecu.building"], cwd=ROOT, stderr=subprocess.DEVNULL, check=False
    )


def side_by_side(vcan: Path, rest: Path, said: Path) -> list[int]:
    """Run both large parts; returns their exit statuses."""
    print("---- the rest, and beside it those on vcan", flush=True)
    workers = ["-n", str(WORKERS), "--dist", "worksteal", "-m", "not vcan and not timing and not browser"]
    with said.open("w") as output:
        on_vcan = start(["tools/vcan"], ["-m", "vcan", f"--part-out={vcan}"], output)
        beside = start(["nice"], [*workers, f"--part-out={rest}"])
        statuses = [beside.wait(), on_vcan.wait()]
    print("---- on vcan", said.read_text(errors="replace"), sep="\n", flush=True)
    return statuses


def main() -> int:
    """Run the parts; the closing line of the last one is that of all."""
    build_ecu()
    with tempfile.TemporaryDirectory(prefix="vsensor-test-") as name:
        vcan, rest = Path(name, "vcan.json"), Path(name, "rest.json")
        statuses = side_by_side(vcan, rest, Path(name, "vcan.txt"))
        earlier = [f"--part-in={part}" for part in (vcan, rest) if part.exists()]
        problem = "" if sys.argv[1:] else not_run(vcan)
        if problem:
            print(f"---- FAILED: {problem}", flush=True)
        print("---- timing-sensitive ones and those in a browser, alone, and the sum", flush=True)
        statuses.append(start([], ["-m", "(timing or browser) and not vcan", *earlier]).wait())
    if sys.argv[1:]:  # a selection may leave a part empty
        statuses = [status for status in statuses if status != NO_TESTS] or [NO_TESTS]
    if problem or any(statuses):
        statuses.append(1)
    return 130 if 130 in statuses else max(statuses)


if __name__ == "__main__":
    try:
        sys.exit(main())
    except KeyboardInterrupt:
        sys.exit(130)

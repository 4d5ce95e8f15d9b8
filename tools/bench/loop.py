"""The closed loop with the lane keeping ECU on a vcan, as `make bench` reports it."""

import json
import subprocess
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from tools.bench.measure import ROOT

SECONDS = 300
TARGET_ERRORS = ("crc", "counter_repeated", "counter_lost", "counter_wrong_sequence", "timeout")


def closed_loop(seconds: float = SECONDS) -> dict[str, object]:
    """Run it; the tool's own line of JSON, or "error" where it could not run."""
    command = [ROOT / "tools" / "vcan", sys.executable, "-m", "tools.ecu.closed_loop"]
    run = subprocess.run(
        [*command, "--seconds", str(seconds)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    if not run.stdout.startswith("{"):
        return {"error": (run.stderr or run.stdout).strip().splitlines()[-1:]}
    found = dict(json.loads(run.stdout))
    errors = found["ecu"]["errors"]
    return {**found, "seconds": seconds, "errors": {name: errors[name] for name in TARGET_ERRORS}}


def targets(found: Mapping[str, Any]) -> list[Sequence[object]]:
    """Return the rows of the table of targets."""
    errors = sum(found["errors"].values())
    margin_m = found["margin_m"]
    return [
        (
            f"closed loop on vcan, {found['seconds']:g} s: CRC, counter and timeout errors seen by the ECU",
            "0",
            f"{errors} in {found['ecu']['frames']} frames",
            errors == 0,
        ),
        (
            f"the same, {found['driven_m'] / 1e3:.1f} km, up to {found['lateral_mps2']:.1f} m/s²: "
            "least distance to a line",
            "over 0 m",
            f"{margin_m:.2f} m",
            margin_m > 0,
        ),
        ("the same: slots dropped", "", found["slots_dropped"], None),
    ]

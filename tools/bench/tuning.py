"""What tuning costs on drawn tables: time and memory against rows, up to P1's 94 million with --full.

One log of 30 minutes is drawn (two lines, 50 ranges, speeds of 5 to 35 m/s, errors of a known law), and
repeated under other names to tables of several sizes. Each is tuned in a process of its own, on all cores:
the whole time from the table to the models, the loop through the fit apart, and the largest memory. A second
process that only imports and reads the table once says what of it is not ours.
"""

import json
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tests.field.made_tables import Law, columns_of, write_log
from tools.bench.growth import exponent
from tools.bench.measure import ROOT, elapsed_ms
from tools.bench.tables import table

ROWS = (3_000_000, 9_000_000, 24_000_000)
PUBLISHED_ROWS = 94_000_000
DRAWN_S = 1800.0
TARGET_S, TARGET_GIB, TARGET_STREAMING_GIB = 20.0, 2.0, 0.3

_RUN = """
import json, sys, time
from pathlib import Path
from vsensor.field.table import open_table
from vsensor.field.tune import TuneOptions, tune_table
from vsensor.field.tune.reading import read_log

table = open_table([Path(sys.argv[1])])
began = time.perf_counter()
rows = 0
if sys.argv[2] == "read":
    for file in table.files:
        for part in read_log(file):
            rows += len(part.t_ns)
else:
    rows = tune_table(table, TuneOptions(close_loop=False, least_seconds=5.0)).survey.rows
took = time.perf_counter() - began
status = Path("/proc/self/status").read_text()
peak = 1024 * int(status.split("VmHWM:")[1].split()[0])
print(json.dumps({"rows": rows, "seconds": took, "peak_bytes": peak}))
"""


def tunings(sizes: Sequence[int] = ROWS, *, full: bool = False, drawn_s: float = DRAWN_S) -> dict[str, Any]:
    """Measure all sizes, with `full` P1's too."""
    with TemporaryDirectory() as name:
        folder = Path(name)
        columns = columns_of(np.random.default_rng(1), Law(), drawn_s)
        found = []
        for rows in (*sizes, *((PUBLISHED_ROWS,) if full else ())):
            place = folder / str(rows)
            _lay(place, columns, rows)
            found.append({**_measured(place, "tune"), "read": _measured(place, "read")})
        return {"sizes": found, "loop_s": _loop_s(folder / str(sizes[0])), **_growth(found)}


def _growth(found: Sequence[Mapping[str, Any]]) -> dict[str, float]:
    """Return the straight line through time over rows, and the power of what comes on top of its start."""
    rows, seconds = ([one[name] for one in found] for name in ("rows", "seconds"))
    if len(found) < 2:
        return {"per_row_ns": float("nan"), "fixed_s": float("nan"), "exponent": float("nan")}
    slope, fixed = np.polyfit(rows, seconds, 1)
    above = [1e3 * max(one - fixed, 1e-3) for one in seconds]
    return {"per_row_ns": 1e9 * slope, "fixed_s": float(fixed), "exponent": exponent(rows, above)}


def _lay(folder: Path, columns: Mapping[str, Any], rows: int) -> None:
    """Write so many rows as logs of the same columns."""
    size, number = len(columns["t_ns"]), 0
    while rows > 0:
        part = {name: values[: min(size, rows)] for name, values in columns.items()}
        write_log(folder, f"drive_{number}", part)
        rows, number = rows - size, number + 1


def _measured(folder: Path, what: str) -> dict[str, Any]:
    done = subprocess.run(
        [sys.executable, "-c", _RUN, str(folder), what],
        cwd=ROOT,
        env={"OPENBLAS_NUM_THREADS": "1", "PATH": "/usr/bin:/bin"},
        capture_output=True,
        text=True,
        check=True,
    )
    return json.loads(done.stdout)


def _loop_s(folder: Path) -> float:
    """Return what closing the loop takes: it does not depend on the rows."""
    from vsensor.field.table import open_table
    from vsensor.field.tune import TuneOptions, tune_table
    from vsensor.field.tune.loop import close_loop
    from vsensor.field.virtual import FitSetting

    options = TuneOptions(close_loop=False, least_seconds=5.0)
    model = tune_table(open_table([folder]), options).library.models["all"]
    return elapsed_ms(lambda: close_loop(model, FitSetting())) / 1e3


def targets(found: Mapping[str, Any]) -> list[Sequence[object]]:
    """Return the rows of the report; smaller tables are extended to P1's rows by their own growth."""
    last = found["sizes"][-1]
    is_whole = last["rows"] >= 0.9 * PUBLISHED_ROWS
    seconds = last["seconds"] if is_whole else found["fixed_s"] + 1e-9 * found["per_row_ns"] * PUBLISHED_ROWS
    gib = last["peak_bytes"] / 2**30
    how = "measured" if is_whole else f"from {last['rows'] / 1e6:.0f} million"
    return [
        (
            "tune, six levels, 94 million rows",
            f"{TARGET_S:.0f} s and {TARGET_GIB:.0f} GiB, or {TARGET_STREAMING_GIB} GiB",
            f"{seconds:.0f} s ({how}), {gib:.2f} GiB with Python and polars "
            f"(reading alone {last['read']['peak_bytes'] / 2**30:.2f}); {found['per_row_ns']:.0f} ns a row, "
            f"time above its start ~ rows^{found['exponent']:.2f}",
            (seconds <= TARGET_S and gib <= TARGET_GIB) or gib <= TARGET_STREAMING_GIB,
        )
    ]


def page(found: Mapping[str, Any]) -> str:
    """Return the section of the report."""
    rows = [
        (
            f"{one['rows'] / 1e6:.1f}",
            f"{one['seconds']:.1f}",
            f"{one['read']['seconds']:.1f}",
            f"{one['peak_bytes'] / 2**20:.0f}",
            f"{one['read']['peak_bytes'] / 2**20:.0f}",
        )
        for one in found["sizes"]
    ]
    head = ("million rows", "tune, s", "reading once, s", "most memory, MiB", "reading, MiB")
    text = f"{__doc__.strip().split(chr(10) * 2, 1)[1]}\n\nClosing the loop: {found['loop_s']:.1f} s."
    return f"## Tuning\n\n{text}\n\n{table(head, rows)}"


if __name__ == "__main__":
    began = time.perf_counter()
    measured = tunings(full="--full" in sys.argv)
    print(page(measured))
    print(targets(measured), f"{time.perf_counter() - began:.0f} s in all")

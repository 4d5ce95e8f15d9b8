"""What the examiner costs on an hour's log: until its first view, from slider to picture, memory.

The program runs as a user starts it, in a process of its own; Debian's chromium looks at it. From slider to
picture: from the slider's event to the frame after the one in which the view from above was drawn, in the
browser. Memory: the program's largest resident set, decoding included; the browser's is not counted.
"""

import re
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from tests.apps.pages import chromium, opened
from tools.bench.measure import yardstick_ms
from tools.bench.scans import repeated, wavy_drive

FIRST_VIEW_S, SLIDER_MS, MEMORY_GIB = 5.0, 150.0, 1.5
BASE_S, HOUR = 100.0, 36
MOVES = 100
_IS_VIEW = """window.vsensorExamine && window.vsensorExamine.shown === 0
  && document.querySelector('#analysis .js-plotly-plot')?._fullLayout"""
_SLIDE = """async (places) => {
  const slider = document.getElementById('slider'), took = [];
  const frame = () => new Promise((done) => requestAnimationFrame(done));
  for (const place of places) {
    const began = performance.now();
    slider.value = place;
    slider.dispatchEvent(new Event('input'));
    while (window.vsensorExamine.shown !== place) await frame();
    await frame();
    took.push(performance.now() - began);
  }
  return took;
}"""


def examined(repeats: int = HOUR, base_s: float = BASE_S) -> dict[str, Any]:
    """Measure all of it on one log; times in s and ms, memory in GiB."""
    with TemporaryDirectory() as name:
        base = wavy_drive(1000.0, 20.0, 0.12, seconds=base_s).write(Path(name, "base.blf"))
        log = repeated(base, Path(name, "drive.blf"), repeats)
        with chromium() as browser:
            began = time.perf_counter()
            with _program(log) as (url, process):
                loaded = time.perf_counter()
                with opened(browser, url) as page:
                    page.wait_for_function(_IS_VIEW)
                    first_view = time.perf_counter()
                    took_ms = slider_ms(page, MOVES)
                    images = page.evaluate("Number(document.getElementById('slider').max) + 1")
                memory_gib = _largest_gib(process.pid)
    return {
        "images": images,
        "loading_s": loaded - began,
        "first_view_s": first_view - loaded,
        "slider_p50_ms": float(np.percentile(took_ms, 50)),
        "slider_p95_ms": float(np.percentile(took_ms, 95)),
        "memory_gib": memory_gib,
        "yardstick_ms": yardstick_ms(),
    }


def slider_ms(page: Any, moves: int) -> np.ndarray:
    """Return the times (moves,) from moving a loaded page's slider, all over the drive, to the picture."""
    last = page.evaluate("Number(document.getElementById('slider').max)")
    places = np.random.default_rng(0).permutation(last)[:moves] + 1
    return np.array(page.evaluate(_SLIDE, places.tolist()))


def targets(found: Mapping[str, Any]) -> list[Sequence[object]]:
    """Return the rows of the report."""
    hours = found["images"] * 0.04 / 3600
    shown = [
        ("from its address to the first view", FIRST_VIEW_S, found["first_view_s"], "s"),
        ("from slider to picture, p95", SLIDER_MS, found["slider_p95_ms"], "ms"),
        ("memory", MEMORY_GIB, found["memory_gib"], "GiB"),
    ]
    return [
        (f"examiner, {hours:.2g} h: {what}", f"{most:g} {unit}", f"{value:.3g} {unit}", value <= most)
        for what, most, value, unit in shown
    ]


@contextmanager
def _program(log: Path) -> Iterator[tuple[str, "subprocess.Popen[str]"]]:
    """Start `vsensor examine`; give its address, once it is there, and the process."""
    command = [sys.executable, "-m", "vsensor.cli", "examine", str(log), "--no-browser", "--port", "0"]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    try:
        assert process.stdout is not None
        said = process.stdout.readline()
        found = re.search(r"http://\S+/", said)
        if found is None:
            raise RuntimeError(f"vsensor examine did not say where it is: {said!r}")
        yield found[0], process
    finally:
        process.terminate()
        process.communicate()


def _largest_gib(pid: int) -> float:
    status = Path(f"/proc/{pid}/status").read_text()
    found = re.search(r"VmHWM:\s*(\d+) kB", status)
    return int(found[1]) / 2**20 if found else float("nan")

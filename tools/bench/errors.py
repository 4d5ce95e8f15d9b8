"""What the errors of an image cost: 4 lines of 1000 points, every mode, and what is lost of the report.

The model is the known law of made drives: 59 signed quantiles, losses, range and quality. Points as the
bypassed camera gives them, every 0.1 m up to 100 m; each call is one image after the other.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from tools.bench.measure import PERIOD_NS, in_turns, median, one_core, yardstick_ms
from tools.made_law import student_model
from vsensor.draws import Draws
from vsensor.error_model import (
    Conditions,
    ErrorModelConfig,
    apply,
    compile_law,
    initial_state,
    library_of,
    reach,
    report,
)
from vsensor.types import Boundary, Colour, LaneEstimate, LinePoints, MarkingKind, Side, Tick, frozen

MODES = ("extreme", "levels", "volume")
LINES, POINTS = 4, 1000
TARGET_US = 150.0
CONDITIONS = Conditions(speed_mps=27.0)
IMAGES = 2000


def errors(images: int = IMAGES) -> dict[str, object]:
    """Time region, errors and report of one image in turns over the modes, on one core."""
    works = {mode: Images(mode) for mode in MODES}
    with one_core():
        yardstick = yardstick_ms()
        times = in_turns(works, images)
        yardstick = float(np.median([yardstick, yardstick_ms()]))
    rows = {
        mode: {
            "p50_us": 1e3 * median(ms),
            "p99_us": 1e3 * float(np.percentile(ms, 99)),
            "p50_per_yardstick": median(ms) / yardstick,
        }
        for mode, ms in times.items()
    }
    return {"modes": rows, "target_us": TARGET_US, "yardstick_ms": yardstick, "images": images}


def targets(found: Mapping[str, Any]) -> list[Sequence[object]]:
    """Return the rows of the report."""
    rows: list[Sequence[object]] = []
    for mode, row in found["modes"].items():
        measured = (
            f"{row['p50_us']:.0f} us (p99 {row['p99_us']:.0f}); "
            f"{row['p50_per_yardstick']:.3f} x sorting 100,000 numbers"
        )
        what = f"errors and losses of an image, 4 lines of 1000 points, {mode}, p50"
        rows.append((what, f"{found['target_us']:.0f} us", measured, row["p50_us"] <= found["target_us"]))
    return rows


class Images:
    """One image after the other: call it for the next one."""

    def __init__(self, mode: str) -> None:
        self._law = compile_law(ErrorModelConfig(mode=mode), library_of(student_model(), ""))
        self._draws, self._index = Draws(1), 0
        self._errors, self._reports = initial_state(), None
        self._lines, self._estimate = _lines(), _estimate()

    def __call__(self) -> tuple[LinePoints, LaneEstimate]:
        """Return the moved points and the report of the next image."""
        tick = Tick(index=self._index, t_ns=self._index * PERIOD_NS, period_ns=PERIOD_NS)
        found = reach(self._law, CONDITIONS)
        self._errors, lines = apply(
            self._law, self._errors, self._draws, tick, CONDITIONS, (0, 1, 2, 3), self._lines
        )
        self._reports, estimate = report(
            self._law, self._reports, self._draws, tick, CONDITIONS, self._estimate, found.range_m
        )
        self._index += 1
        return lines, estimate


def _lines() -> LinePoints:
    x = np.tile(0.1 * np.arange(POINTS), LINES)
    y = np.repeat([5.4, 1.8, -1.8, -5.4], POINTS) + x**2 / 2000.0
    return LinePoints(
        marking=frozen(np.arange(LINES), np.int64),
        starts=frozen(POINTS * np.arange(LINES + 1), np.int64),
        index=frozen(np.tile(np.arange(POINTS), LINES), np.int64),
        points_ego_m=np.array([x, y, 0.0 * x]).T,  # contiguous along x, y and z, as scene.near gives them
    )


def _estimate() -> LaneEstimate:
    lines = (
        Boundary(
            side=side,
            coefficients=frozen([1.8, 0.0, 0.0, 0.0]),
            covariance=frozen(np.eye(4)),
            x_min_m=0.0,
            x_max_m=99.9,
            quality=4,
            kind=MarkingKind.SOLID,
            colour=Colour.WHITE,
            width_m=0.15,
            measured=True,
            marking=int(side),
            points=int(side),
        )
        for side in Side
    )
    return LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=tuple(lines))

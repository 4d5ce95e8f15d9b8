"""What cannot be true of one image: quantities that contradict each other."""

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.config import LimitsConfig
from vsensor.accept.rows import Rows
from vsensor.profile import Profile
from vsensor.types import Array, BoolArray, SensorMode

_NUMBERS = ("offset_m", "heading", "curvature_per_m", "c2_per_m", "x_min_m", "x_max_m")
_FARTHEST_AXLE_M = 5.0  # from the origin of the polynomial
_BENDS = {
    "curvature_per_m": _FARTHEST_AXLE_M,
    "c2_per_m": 2 * _FARTHEST_AXLE_M,
    "curvature_rate_per_m2": _FARTHEST_AXLE_M**2,
    "c3_per_m2": 6 * _FARTHEST_AXLE_M**2,
}
"""Quantity -> what it may add to the slope up to there, at most."""
_LEAST_COSINE = 0.9
_BLIND = [float(mode) for mode in SensorMode if not mode.reports_lines]


class Contradictions:
    """Looks for them; `told` are the quantities whose signals can say that they have no value."""

    def __init__(self, profile: Profile, limits: LimitsConfig, book: Book) -> None:
        self._limits, self._book = limits, book
        self._message = {b.quantity: plan.layout.name for plan in profile.messages for b in plan.told}
        bindings = [b for plan in profile.messages for b in plan.told]
        self._has_sna = {b.quantity for b in bindings if b.signal.sna_raw is not None}
        self.modes = np.zeros(len(SensorMode), dtype=np.int64)  # images in each state of the sensor
        self._step = {b.quantity: abs(b.signal.scale / b.gain) for b in bindings if b.raw_of_code is None}

    def judge(self, rows: Rows) -> None:
        """Note the contradictions of each image."""
        if rows.has("sensor.state"):
            for mode in SensorMode:
                self.modes[mode] += np.count_nonzero(rows.values["sensor.state"] == mode)
        for line in rows.lines():
            self._judge_line(rows, line)
        if rows.has("left.offset_m", "right.offset_m"):
            both = rows.available("left") & rows.available("right") & self._near(rows)
            gap_m = rows.values["left.offset_m"] - rows.values["right.offset_m"]
            text = "left line is right of the right line"
            self._note(rows, both & (gap_m <= 0), "left.offset_m", text, -gap_m)
        if rows.has("lane.width_m", "left.lane_offset_m", "right.lane_offset_m"):
            self._judge_width(rows)

    def remarks(self) -> list[str]:
        """Return a sentence on a sensor that was not available all the time."""
        images = int(self.modes.sum())
        if images == self.modes[SensorMode.AVAILABLE]:
            return []
        shown = [f"{mode.name.lower()} {self.modes[mode]}" for mode in SensorMode if self.modes[mode]]
        return [f"images by the sensor's state: {', '.join(shown)}"]

    def _near(self, rows: Rows) -> BoolArray:
        """Return in which images left and right line are near and good enough to say where they are."""
        near = np.ones(len(rows.t_ns), dtype=bool)
        for line in ("left", "right"):
            if rows.has(f"{line}.x_min_m"):
                near &= ~(rows.values[f"{line}.x_min_m"] > self._limits.near_m)
            if rows.has(f"{line}.quality"):
                near &= ~(rows.values[f"{line}.quality"] < self._limits.least_quality)
        return near

    def _judge_line(self, rows: Rows, line: str) -> None:
        there = rows.available(line)
        if rows.has(f"{line}.available"):
            flag = f"{line}.available"
            for name in (f"{line}.{number}" for number in _NUMBERS):
                if rows.has(name):
                    both, known = rows.both(flag, name), ~np.isnan(rows.values[name])
                    self._note(rows, both & there & ~known, name, f"{line} available, but {name} is not")
                    if name in self._has_sna:
                        text = f"{line} not available, but {name} is a number"
                        self._note(rows, both & ~there & known, name, text)
            self._judge_flags(rows, line, there)
        if rows.has("sensor.state"):
            state = rows.values["sensor.state"]
            text = f"{line} reported while the sensor sees nothing"
            self._note(rows, np.isin(state, _BLIND) & there, "sensor.state", text)
        ends = f"{line}.x_min_m", f"{line}.x_max_m"
        if rows.has(*ends):
            past_m = rows.values[ends[0]] - rows.values[ends[1]]
            slack_m = sum(self._step.get(end, 0.0) for end in ends) / 2 + 1e-9
            self._note(rows, there & (past_m > slack_m), ends[0], f"{line} begins behind its end", past_m)

    def _judge_flags(self, rows: Rows, line: str, there: BoolArray) -> None:
        flag = f"{line}.available"
        for name, text in (
            (f"{line}.measured", f"{line} measured, but not available"),
            (f"{line}.quality", f"{line} has a quality, but is not available"),
        ):
            if rows.has(name):
                self._note(rows, rows.both(flag, name) & ~there & (rows.values[name] > 0), name, text)
        quality = f"{line}.quality"
        if rows.has(quality):
            none = rows.both(flag, quality) & there & (rows.values[quality] == 0)
            self._note(rows, none, quality, f"{line} available, but its quality is 0")

    def _judge_width(self, rows: Rows) -> None:
        """Compare the width, which is across the lane, with the offsets, which are along y."""
        names = "lane.width_m", "left.lane_offset_m", "right.lane_offset_m"
        width, left, right = (rows.values[name] for name in names)
        least, most = _cosines(rows)
        gap_m = np.maximum(left - right, 0.0)
        error_m = np.maximum(width - gap_m * most, gap_m * least - width)
        slack_m = sum(self._step.get(name, 0.0) for name in names) / 2 + self._limits.lane_width_error_m
        wrong = rows.both(*names) & (error_m > slack_m)
        self._note(rows, wrong, names[0], "lane width is not left minus right lane offset", error_m, slack_m)

    def _note(
        self,
        rows: Rows,
        wrong: BoolArray,
        quantity: str,
        text: str,
        size: Array | None = None,
        limit: float = 0.0,
    ) -> None:
        self._book.note(
            "contradiction",
            self._message.get(quantity, ""),
            rows.t_ns[wrong],
            subject=text,
            worst=None if size is None else size[wrong],
            limit=None if size is None else limit,
            unit="" if size is None else "m",
        )


def _cosines(rows: Rows) -> tuple[Array, Array]:
    """Return the least and the greatest cosine that the lane's direction may have at the front axle."""
    slopes = [rows.values[name] for name in ("left.heading", "right.heading") if rows.has(name)]
    if not slopes:
        return np.full(len(rows.t_ns), _LEAST_COSINE), np.ones(len(rows.t_ns))
    slope = np.abs(np.add.reduce(slopes) / len(slopes))
    bend = np.zeros(len(slope))
    for line in ("left", "right"):
        for name, factor in _BENDS.items():
            if rows.has(f"{line}.{name}"):
                bend = np.maximum(bend, np.abs(rows.values[f"{line}.{name}"]) * factor)
    return 1 / np.hypot(1.0, slope + bend), 1 / np.hypot(1.0, np.maximum(slope - bend, 0.0))

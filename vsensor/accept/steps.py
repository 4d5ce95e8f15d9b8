"""From image to image: jumps, signals that stand still, an image index that does."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vsensor.accept.book import Book
from vsensor.accept.config import LimitsConfig
from vsensor.accept.kinds import Kind
from vsensor.accept.rows import Rows
from vsensor.profile import Profile
from vsensor.types import Array, BoolArray, IntArray

_COMPARED_IMAGES = 3.5  # after a longer gap nothing is compared
_NEXT_IMAGE = 1.5
_MOVING = ("offset_m", "heading", "curvature_per_m", "c2_per_m")
_FINE = {"offset_m": 0.005, "heading": 5e-4, "curvature_per_m": 2e-6, "c2_per_m": 1e-6}
"""A signal that is coarser may well stand still while its line moves."""


@dataclass(frozen=True, slots=True)
class Still:
    """Since when something has not moved, and over how many images."""

    since_ns: int
    images: int


class Steps:
    """Compares each image with the one before it; keeps the last of each quantity."""

    def __init__(self, profile: Profile, limits: LimitsConfig, book: Book) -> None:
        self._limits, self._book = limits, book
        bindings = [(plan.layout.name, b) for plan in profile.messages for b in plan.told]
        self._message = {b.quantity: name for name, b in bindings}
        self._step = {b.quantity: abs(b.signal.scale / b.gain) for _, b in bindings}
        self._wrap = {b.quantity: b.wrap for _, b in bindings}
        self._tells_changes = "lane.change" in self._message
        self._last: dict[str, Rows] = {}
        self._still: dict[str, Still] = {}
        self._noted: dict[str, int] = {}  # quantity -> begin of the last time that it was noted
        self.lane_changes = 0

    def judge(self, rows: Rows) -> None:
        """Judge the next images."""
        for line in rows.lines():
            self._judge_line(rows, line)
        for name in ("image.index", "image.timestamp_ms"):
            if rows.has(name):
                self._judge_count(rows, name)
        if rows.has("lane.width_m"):
            self._judge_width(rows)

    # ---- jumps ----

    def _judge_line(self, rows: Rows, line: str) -> None:
        limits = {
            "offset_m": self._limits.offset_step_m,
            "heading": self._limits.heading_step,
            "curvature_per_m": self._limits.curvature_step_per_m,
            "c2_per_m": self._limits.curvature_step_per_m / 2,
        }
        names = [name for name in limits if rows.has(f"{line}.{name}")]
        for name in names:
            self._judge_jump(rows, line, name, limits[name])
        for name in names:
            self._judge_stuck(rows, line, name, [other for other in names if other != name])

    def _judge_jump(self, rows: Rows, line: str, name: str, limit: float) -> None:
        quantity = f"{line}.{name}"
        near = self._comparable(rows, line)
        pair = self._pairs(rows, quantity, near, f"jump.{quantity}")
        changes = self._changes(pair)
        step = np.abs(np.diff(pair.values[quantity]))
        images = self._images(pair)
        jumped = self._both(pair) & ~changes & (images <= _COMPARED_IMAGES)
        jumped &= step > limit * np.maximum(images, 1.0)
        if name == "offset_m":
            narrow, wide = self._limits.lane_width_m
            swap = (step >= narrow) & (step <= wide)
            swap &= (images > _NEXT_IMAGE) | (not self._tells_changes)
            self.lane_changes += int(np.count_nonzero(jumped & swap))
            jumped &= ~swap
        self._note("jump", quantity, pair.t_ns[1:][jumped], step[jumped], limit)

    def _judge_width(self, rows: Rows) -> None:
        name, limit = "lane.width_m", self._limits.width_step_m
        near = self._comparable(rows, "left") & self._comparable(rows, "right")
        pair = self._pairs(rows, name, near, f"jump.{name}")
        step, images = np.abs(np.diff(pair.values[name])), self._images(pair)
        jumped = self._both(pair) & ~self._changes(pair) & (images <= _COMPARED_IMAGES)
        jumped &= step > limit * np.maximum(images, 1.0)
        self._note("jump", name, pair.t_ns[1:][jumped], step[jumped], limit)

    def _measured(self, rows: Rows, line: str) -> BoolArray:
        """Return in which images a line is available and not predicted."""
        there, measured = rows.available(line), f"{line}.measured"
        return there & (rows.values[measured] != 0) if rows.has(measured) else there

    def _comparable(self, rows: Rows, line: str) -> BoolArray:
        """Return in which images a line is measured, good and near enough to be compared."""
        good = self._measured(rows, line)
        quality, start = f"{line}.quality", f"{line}.x_min_m"
        if rows.has(quality):
            good = good & ~(rows.values[quality] < self._limits.least_quality)
        if rows.has(start):
            good = good & ~(rows.values[start] > self._limits.near_m)
        return good

    def _pairs(self, rows: Rows, quantity: str, good: BoolArray, key: str) -> Rows:
        """Return the images that have a quantity after the last one before; `sent["good"]`: comparable."""
        mask = rows.sent[quantity]
        change = rows.values.get("lane.change", np.full(len(mask), np.nan))
        mine = Rows(
            t_ns=rows.t_ns[mask],
            values={quantity: rows.values[quantity][mask], "lane.change": change[mask]},
            sent={"good": good[mask] & ~np.isnan(rows.values[quantity][mask])},
        )
        joined = mine.since(self._last.get(key))
        if len(joined.t_ns):
            self._last[key] = _tail(joined)
        return joined

    def _both(self, pair: Rows) -> BoolArray:
        good = pair.sent["good"]
        return np.asarray(good[1:] & good[:-1])

    def _images(self, pair: Rows) -> Array:
        return np.asarray(np.diff(pair.t_ns) / self._limits.ns("image_ms"))

    def _changes(self, pair: Rows) -> BoolArray:
        return np.asarray(pair.values["lane.change"][1:] > 0)

    # ---- standing still ----

    def _judge_stuck(self, rows: Rows, line: str, name: str, others: list[str]) -> None:
        """Note a number that does not move by a bit while the others of its line do."""
        quantity = f"{line}.{name}"
        if self._step.get(quantity, 1.0) > _FINE[name]:
            return
        moving = [other for other in others if self._step.get(f"{line}.{other}", 1.0) <= _FINE[other]]
        mask = rows.sent[quantity]
        names = [quantity, *(f"{line}.{other}" for other in moving)]
        good = self._measured(rows, line) & ~self._is_flat(rows, line, name)
        mine = Rows(
            t_ns=rows.t_ns[mask],
            values={n: rows.values[n][mask] for n in names},
            sent={"good": good[mask]},
        ).since(self._last.get(f"stuck.{quantity}"))
        if len(mine.t_ns) < 2:
            if len(mine.t_ns):
                self._last[f"stuck.{quantity}"] = mine
            return
        self._last[f"stuck.{quantity}"] = _tail(mine)
        moved = np.zeros(len(mine.t_ns) - 1, dtype=bool)
        for other in names[1:]:
            moved |= np.abs(np.diff(mine.values[other])) > 0
        same = (np.diff(mine.values[quantity]) == 0) & moved & self._both(mine)
        runs = self._runs(f"stuck.{quantity}", same, mine.t_ns)
        long = [(begun, images) for begun, _, images in runs if images >= self._limits.stuck_images]
        self._note_runs("stuck", quantity, long, float(self._limits.stuck_images), "images")

    def _is_flat(self, rows: Rows, line: str, name: str) -> BoolArray:
        """Return where a straight polynomial has no curvature to move."""
        if name not in ("curvature_per_m", "c2_per_m"):
            return np.zeros(len(rows.t_ns), dtype=bool)
        flat = rows.values[f"{line}.{name}"] == 0.0
        return np.asarray(flat | (rows.values[f"{line}.order"] < 2) if rows.has(f"{line}.order") else flat)

    def _judge_count(self, rows: Rows, name: str) -> None:
        mask = rows.sent[name] & ~np.isnan(rows.values[name])
        mine = Rows(t_ns=rows.t_ns[mask], values={name: rows.values[name][mask]}, sent={})
        mine = mine.since(self._last.get(name))
        if len(mine.t_ns) < 2:
            if len(mine.t_ns):
                self._last[name] = mine
            return
        self._last[name] = _tail(mine)
        wrap = self._wrap.get(name, 0)
        step = np.diff(mine.values[name])
        step = np.mod(step, wrap) if wrap else step
        back = step > wrap / 2 if wrap else step < 0
        if name == "image.index":
            self._note("image_backwards", name, mine.t_ns[1:][back], None, None)
        runs = self._runs(name, step == 0, mine.t_ns)
        limit_ns = self._limits.ns("frozen_ms")
        long = [(begun, (end - begun) / 1e6) for begun, end, _ in runs if end - begun > limit_ns]
        self._note_runs("image_frozen", name, long, limit_ns / 1e6, "ms")

    def _runs(self, key: str, same: BoolArray, t_ns: IntArray) -> list[tuple[int, int, int]]:
        """Return begin, end and length of each time that `same` (N - 1,) held without a break.

        One that goes on in the next images is returned again with them, longer, with the same begin.
        """
        before = self._still.get(key, Still(since_ns=0, images=0))
        ends = np.append(np.flatnonzero(~same), len(same))
        begins = np.concatenate([[0], ends[:-1] + 1])
        images, since = ends - begins, t_ns[begins].copy()
        if before.images:
            images[0] += before.images
            since[0] = before.since_ns
        self._still[key] = Still(since_ns=int(since[-1]), images=int(images[-1]))
        found = zip(since.tolist(), t_ns[ends].tolist(), images.tolist(), strict=True)
        return [run for run in found if run[2]]

    def _note_runs(
        self, kind: Kind, quantity: str, runs: Sequence[tuple[int, float]], limit: float, unit: str
    ) -> None:
        for begun_ns, size in runs:
            is_new = self._noted.get(quantity) != begun_ns
            self._noted[quantity] = begun_ns
            self._book.note(
                kind,
                self._message.get(quantity, ""),
                [begun_ns],
                subject=quantity,
                worst=[size],
                count=int(is_new),
                limit=limit,
                unit=unit,
            )

    def _note(
        self, kind: Kind, quantity: str, t_ns: IntArray, size: Array | None, limit: float | None
    ) -> None:
        self._book.note(
            kind, self._message.get(quantity, ""), t_ns, subject=quantity, worst=size, limit=limit
        )


def _tail(rows: Rows) -> Rows:
    return Rows(
        t_ns=rows.t_ns[-1:],
        values={name: values[-1:] for name, values in rows.values.items()},
        sent={name: values[-1:] for name, values in rows.sent.items()},
    )

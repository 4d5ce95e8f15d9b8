"""The errors of events by light, road and driving, in the form of P2's table 3.2."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsensor.types import Array
from vsensor.video.evaluate.pairing import Reference
from vsensor.video.evaluate.statistics import OUTWARD, Moments, Pooled, pooled


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Compared:
    """One method on one event against one reference: errors (N, 2) in m, positive too far out."""

    event: str
    reference: Reference
    error_m: Array


def compared(event: str, reference: Reference, video_m: Array, offset_m: Array | None = None) -> Compared:
    """Compare a video's offsets (N, 2) with the CAN log's, or with others at the same times (2.27)."""
    against = reference.offset_m if offset_m is None else offset_m
    return Compared(event=event, reference=reference, error_m=OUTWARD * (video_m - against))


Chooser = Callable[[Compared], Array]
"""Which errors (N, 2) of an event belong to a category: True, False."""


def _light(word: str) -> Chooser:
    return lambda one: np.full(one.error_m.shape, one.reference.light == word)


def _where(name: str, value: float) -> Chooser:
    return lambda one: np.repeat((getattr(one.reference, name) == value)[:, None], 2, axis=1)


def _side(column: int) -> Chooser:
    return lambda one: np.broadcast_to(np.arange(2) == column, one.error_m.shape)


CATEGORIES: Mapping[str, Chooser] = {
    "general": lambda one: np.ones(one.error_m.shape, dtype=bool),
    "daytime": _light("day"),
    "nighttime": _light("night"),
    "straight": _where("is_curvy", 0.0),
    "curvy": _where("is_curvy", 1.0),
    "constant speed": _where("is_changing", 0.0),
    "non-constant speed": _where("is_changing", 1.0),
    "left": _side(0),
    "right": _side(1),
}
"""P2's types of case, in its order, and the two sides: a wrong yaw moves both to the same one."""

PUBLISHED: Mapping[str, tuple[int, int, float, float]] = {
    "general": (818, 173231, 0.2557, 0.525),
    "daytime": (598, 126950, 0.2464, 0.5131),
    "nighttime": (171, 36243, 0.2909, 0.557),
    "straight": (818, 138628, 0.2502, 0.5184),
    "curvy": (677, 34603, 0.2778, 0.5155),
    "constant speed": (818, 103737, 0.2556, 0.5125),
    "non-constant speed": (816, 69494, 0.2559, 0.5353),
}
"""P2's own figures (table 3.2): cases, measurements, mean and standard deviation in m, of its own drives."""


def errors_in(category: str, events: Sequence[Compared]) -> list[Array]:
    """Return the errors (M,) of each event that belong to a category, without what is not known."""
    choose = CATEGORIES[category]
    parts = [one.error_m[choose(one)] for one in events]
    return [part[np.isfinite(part)] for part in parts]


def by_category(events: Sequence[Compared]) -> dict[str, Pooled]:
    """Return the figures of every category."""
    found = {}
    for category in CATEGORIES:
        errors = errors_in(category, events)
        found[category] = pooled([Moments.of(part) for part in errors], errors)
    return found


COLUMNS: Mapping[str, tuple[str, str]] = {
    "cases": ("cases", "d"),
    "count": ("measurements", "d"),
    "mean_m": ("mean", ".4f"),
    "within_m": ("standard deviation", ".4f"),
    "between_m": ("between events", ".4f"),
    "rms_m": ("total RMS", ".4f"),
    "abs_95_m": ("95 % of |e|", ".4f"),
}
"""Of the table: a figure's name, its heading, its form. The first four are P2's."""


def table_of(figures: Mapping[str, Pooled]) -> list[list[str]]:
    """Return the table as words: headings, then a row per category that has a value."""
    rows = [["type of case", *(heading for heading, _ in COLUMNS.values())]]
    for category, one in figures.items():
        words = {name: _word(getattr(one, name), form) for name, (_, form) in COLUMNS.items()}
        if one.cases < 2:
            words["between_m"] = "-"
        rows.append([category, *words.values()])
    return rows


def published_table() -> list[list[str]]:
    """Return P2's own table in the same words."""
    rows = [["type of case", *(heading for heading, _ in list(COLUMNS.values())[:4])]]
    rows += [[name, str(a), str(b), f"{c:.4f}", f"{d:.4f}"] for name, (a, b, c, d) in PUBLISHED.items()]
    return rows


def csv_rows(method: str, against: str, figures: Mapping[str, Pooled]) -> list[dict[str, Any]]:
    """Return the same as rows of a CSV; None where there is nothing."""
    return [
        {
            "method": method,
            "against": against,
            "type_of_case": category,
            **{name: _plain(getattr(one, name)) for name in COLUMNS},
        }
        for category, one in figures.items()
    ]


def _plain(value: float) -> float | int | None:
    return None if value != value else value


def _word(value: float, form: str) -> str:
    return "-" if value != value else format(value, form)

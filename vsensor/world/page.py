"""Borders of several blocks joined into long arrays, from which a window is cut as views."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from vsensor.types import Array, BoolArray, CodeArray, Curve, Marking, MarkingKind, Stripe, frozen
from vsensor.world.borders import BorderLine


@dataclass(frozen=True, slots=True)
class Strip:
    """The borders of one block at `count` stations from station `first` on, by group.

    `extra` are lines that are no borders, each from a station of its own on.
    """

    first: int
    count: int
    borders: Mapping[int, BorderLine]
    extra: Mapping[int, tuple[int, BorderLine]]


@dataclass(frozen=True, slots=True)
class LongLine:
    """One stripe from station `first` on, over all blocks of the page that it runs through."""

    id: int
    group: int
    stripe: Stripe
    first: int
    points_world_m: Array
    painted: BoolArray
    kind: CodeArray
    colour: CodeArray
    width_m: Array
    contrast: Array | None
    wear: Array | None
    valid: BoolArray | None


@dataclass(frozen=True, slots=True)
class Page:
    """Long lines, ordered by id."""

    lines: tuple[LongLine, ...]

    def window(self, first: int, end: int, curve: Curve | None = None) -> tuple[Marking, ...]:
        """Return the stations first to end - 1 of each line as views; lines without any are left out.

        `curve` is what the lines lie on.
        """
        found = []
        for line in self.lines:
            low, high = max(first - line.first, 0), end - line.first
            if high > low and low < len(line.painted):
                found.append(
                    Marking(
                        id=line.id,
                        group=line.group,
                        stripe=line.stripe,
                        points_world_m=line.points_world_m[low:high],
                        painted=line.painted[low:high],
                        kind=line.kind[low:high],
                        colour=line.colour[low:high],
                        width_m=line.width_m[low:high],
                        contrast=1.0 if line.contrast is None else line.contrast[low:high],
                        wear=0.0 if line.wear is None else line.wear[low:high],
                        valid=True if line.valid is None else line.valid[low:high],
                        curve=curve,
                        station=line.first + low,
                    )
                )
        return tuple(found)


def join(strips: Sequence[Strip], own: Collection[int]) -> Page:
    """Join the strips' borders by group; those without any mark only if they are in `own`."""
    runs: dict[int, list[tuple[int, BorderLine]]] = {}
    for strip in strips:
        for group, border in strip.borders.items():
            if strip.count:
                runs.setdefault(group, []).append((strip.first, border))
        for group, (first, line) in strip.extra.items():
            runs.setdefault(group, []).append((first, line))
    lines = [line for group in sorted(runs) for line in _lines(group, runs[group], group in own)]
    return Page(tuple(lines))


def _lines(group: int, run: list[tuple[int, BorderLine]], keep: bool) -> list[LongLine]:
    borders = [border for _, border in run]
    if not keep and not any((border.kind != MarkingKind.NONE).any() for border in borders):
        return []
    double = any(border.is_double for border in borders)
    kind = frozen(np.concatenate([border.kind for border in borders]), np.uint8)
    colour = frozen(np.concatenate([border.colour for border in borders]), np.uint8)
    counts = [len(border.kind) for border in borders]
    contrast = _joined([border.contrast for border in borders], counts, 1.0, np.float64)
    wear = _joined([border.wear for border in borders], counts, 0.0, np.float64)
    valid = _joined([border.valid for border in borders], counts, True, np.bool_)
    lines = []
    for which in (Stripe.LEFT, Stripe.RIGHT) if double else (Stripe.SINGLE,):
        parts = [border.stripe(which) for border in borders]
        lines.append(
            LongLine(
                id=group * len(Stripe) + which,
                group=group,
                stripe=which,
                first=run[0][0],
                points_world_m=frozen(np.concatenate([part.points_world_m for part in parts])),
                painted=frozen(np.concatenate([part.painted for part in parts]), np.bool_),
                kind=kind,
                colour=colour,
                width_m=frozen(np.concatenate([part.width_m for part in parts])),
                contrast=contrast,
                wear=wear,
                valid=valid,
            )
        )
    return lines


def _joined(parts: Sequence[Any], counts: Sequence[int], otherwise: Any, dtype: Any) -> Any:
    """Return the parts in one array, `otherwise` where one is None; None if all are."""
    if all(part is None for part in parts):
        return None
    whole = [
        np.full(count, otherwise) if part is None else part for part, count in zip(parts, counts, strict=True)
    ]
    return frozen(np.concatenate(whole), dtype)

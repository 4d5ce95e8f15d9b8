"""The quantities of images as columns, a row for each image."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from vsensor.accept.images import Mixed
from vsensor.profile import LINES, Profile
from vsensor.types import Array, BoolArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Rows:
    """R images: times `t_ns` (R,) of their first frames, and columns of quantities.

    `values`: quantity -> (R,), NaN = not available, or not sent; `sent`: quantity -> (R,), whether the image
    has it at all.
    """

    t_ns: IntArray
    values: Mapping[str, Array]
    sent: Mapping[str, BoolArray]

    def has(self, *quantities: str) -> bool:
        """Return whether the profile has all these quantities."""
        return all(quantity in self.values for quantity in quantities)

    def both(self, *quantities: str) -> BoolArray:
        """Return which images (R,) have all these quantities."""
        return np.asarray(np.all([self.sent[quantity] for quantity in quantities], axis=0))

    def available(self, line: str) -> BoolArray:
        """Return in which images (R,) a line is reported: by its flag, else by its offset."""
        if self.has(f"{line}.available"):
            return np.asarray(self.values[f"{line}.available"] == 1.0)
        if self.has(f"{line}.offset_m"):
            return ~np.isnan(self.values[f"{line}.offset_m"])
        return np.zeros(len(self.t_ns), dtype=bool)

    def lines(self) -> Iterator[str]:
        """Yield the lines that have an offset or a flag."""
        for line in LINES:
            if self.has(f"{line}.offset_m") or self.has(f"{line}.available"):
                yield line

    def since(self, before: "Rows | None") -> "Rows":
        """Return these images after the ones `before`, which have the same quantities."""
        if before is None:
            return self
        return Rows(
            t_ns=np.concatenate([before.t_ns, self.t_ns]),
            values={name: np.concatenate([before.values[name], self.values[name]]) for name in self.values},
            sent={name: np.concatenate([before.sent[name], self.sent[name]]) for name in self.sent},
        )


def rows_of(profile: Profile, frames: Mixed, numbers: IntArray, mixed: BoolArray) -> Rows:
    """Return the quantities of images 0 to R - 1 from their right frames; nothing of `mixed` ones (R,)."""
    begun = np.zeros(len(mixed), dtype=np.int64)
    begun[numbers[::-1]] = frames.t_ns[::-1]
    use = frames.right & ~mixed[numbers]
    numbers = numbers[use]
    columns = profile.decode_arrays(
        frames.ids[use].astype(np.uint32),
        frames.data[use],
        frames.lengths[use],
        extended=frames.extended[use],
    )
    quantities = {binding.quantity for plan in profile.messages for binding in plan.told}
    values = {quantity: np.full(len(mixed), np.nan) for quantity in quantities}
    sent = {quantity: np.zeros(len(mixed), dtype=bool) for quantity in quantities}
    for quantity, column in columns.items():
        values[quantity][numbers[column.rows]] = column.values
        sent[quantity][numbers[column.rows]] = True
    return Rows(t_ns=begun, values=values, sent=sent)

"""What a translation loses: decoded from the target less decoded from the source, in SI units."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from vsensor.types import SignalValues

NOISE = 1e-9  # of the arithmetic
COUNTS = ("image.index", "image.timestamp_ms")


class Loss(NamedTuple):
    """Of one quantity: in how many images it was compared, the largest difference, the sum of their squares.

    `unlike` of them differed; `lost`: it was there and is not available any more.
    """

    images: int = 0
    largest: float = 0.0
    squares: float = 0.0
    unlike: int = 0
    lost: int = 0

    @property
    def rms(self) -> float:
        """Root of the mean square."""
        return math.sqrt(self.squares / self.images) if self.images else 0.0

    def with_pair(self, before: float, after: float) -> "Loss":
        """Return it with one more image."""
        if math.isnan(after):
            return self._replace(lost=self.lost + 1)
        off = abs(after - before)
        return Loss(
            self.images + 1,
            max(self.largest, off),
            self.squares + off * off,
            self.unlike + (off > NOISE * abs(before) + NOISE**2),
            self.lost,
        )

    def and_also(self, other: "Loss") -> "Loss":
        """Return both together."""
        largest = max(self.largest, other.largest)
        sums = (a + b for a, b in zip(self, other, strict=True))
        return Loss(*sums)._replace(largest=largest)  # type: ignore[arg-type]


def with_image(
    losses: Mapping[str, Loss], names: frozenset[str], before: SignalValues, after: SignalValues
) -> dict[str, Loss]:
    """Return the losses with one more image; of `names`, those that were there before are compared."""
    found = dict(losses)
    for name in names:
        value = before.get(name, math.nan)
        if not math.isnan(value) and name not in COUNTS:
            found[name] = found.get(name, Loss()).with_pair(value, after.get(name, math.nan))
    return found

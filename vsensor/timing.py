"""How well frames kept their time: distributions in nanoseconds, in memory that stays flat."""

from array import array
from collections.abc import Iterator

import numpy as np

RECENT = 1 << 18
"""So many latest values are kept, 2 MB: 3 hours of images at 40 ms, 44 minutes at 10 ms."""

PERCENTILES = (50.0, 99.0, 99.9)


class Samples:
    """Nanoseconds: percentiles are those of the latest RECENT values, the maximum that of all."""

    def __init__(self, recent: int = RECENT) -> None:
        self._values: array[int] = array("q")
        self._recent = recent
        self.count = 0
        self.max_ns = 0

    def add(self, value_ns: int) -> None:
        """Take one more value."""
        if len(self._values) < self._recent:
            self._values.append(value_ns)
        else:
            self._values[self.count % self._recent] = value_ns
        self.max_ns = value_ns if self.count == 0 else max(self.max_ns, value_ns)
        self.count += 1

    def __iter__(self) -> Iterator[int]:
        return iter(self._values)

    def __len__(self) -> int:
        return self.count

    def figures_ms(self) -> dict[str, float]:
        """Return p50, p99, p99.9 and max in ms; empty if there is no value."""
        if not self.count:
            return {}
        at = np.percentile(np.frombuffer(self._values, dtype=np.int64), PERCENTILES) / 1e6
        return dict(zip(("p50", "p99", "p99.9", "max"), (*at.tolist(), self.max_ns / 1e6), strict=True))

    def text(self) -> str:
        """Return the figures as a person reads them."""
        return ", ".join(f"{name} {value:.3f}" for name, value in self.figures_ms().items()) + " ms"


class Timing:
    """Lateness, length and age of bursts; a burst is what is due at one time.

    Those of the send call are times of our own clock before the first and after the last call of a
    burst. Those on the bus are the kernel's or controller's: a frame's time as it came back to us.
    """

    def __init__(self) -> None:
        self.lateness = Samples()  # first frame of a burst less its due time, at the send call
        self.burst = Samples()  # from the first frame's call to the return of the last one's
        self.age = Samples()  # from the exposure of an image to the last of its frames
        self.bus_lateness = Samples()  # first frame of a burst less its due time, on the bus
        self.cycle_error = Samples()  # interval of first frames on the bus less that of their due times
        self._due_ns: int | None = None
        self._stamp_ns = 0

    def on_bus(self, due_ns: int, stamp_ns: int) -> None:
        """Note that a frame due at `due_ns` was on the bus at `stamp_ns`; the first of each burst counts."""
        if due_ns == self._due_ns:
            return
        self.bus_lateness.add(stamp_ns - due_ns)
        if self._due_ns is not None:
            self.cycle_error.add(abs(stamp_ns - self._stamp_ns - (due_ns - self._due_ns)))
        self._due_ns, self._stamp_ns = due_ns, stamp_ns

    def named(self) -> dict[str, Samples]:
        """Return what was measured under the names that a person reads."""
        everything = {
            "lateness of the first frame": self.lateness,
            "burst, first to last frame": self.burst,
            "age, exposure to last frame": self.age,
            "lateness on the bus, kernel's clock": self.bus_lateness,
            "cycle error on the bus, kernel's clock": self.cycle_error,
        }
        return {name: samples for name, samples in everything.items() if samples.count}

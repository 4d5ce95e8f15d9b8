"""What went wrong on the way: each thing once, when it began first and how often."""

from collections.abc import Mapping
from dataclasses import dataclass, field


@dataclass(frozen=True, slots=True)
class Troubles:
    """`met`: what -> (t_ns of the first time, number of times); `present` are those at the last tick."""

    met: Mapping[str, tuple[int, int]] = field(default_factory=dict[str, tuple[int, int]])
    present: tuple[str, ...] = ()

    def noted(self, present: tuple[str, ...], t_ns: int) -> "Troubles":
        """Return them with those of a tick; one that was not there at the tick before counts."""
        new = [name for name in present if name not in self.present]
        if not new:
            return self if present == self.present else Troubles(self.met, present)
        met = dict(self.met)
        for name in new:
            first_ns, count = met.get(name, (t_ns, 0))
            met[name] = (first_ns, count + 1)
        return Troubles(met, present)

    def sentences(self) -> tuple[str, ...]:
        """Return each as a sentence: what, how often, when first."""
        return tuple(f"{name} {self.when(name)}" for name in self.met)

    def when(self, name: str) -> str:
        """Return how often and when first, as a person says it."""
        first_ns, count = self.met[name]
        return f"{'once,' if count == 1 else f'{count} times, first'} at {first_ns / 1e9:.2f} s"


NO_TROUBLES = Troubles()

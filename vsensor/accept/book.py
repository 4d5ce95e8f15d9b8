"""What is found, counted by kind, message and subject: in constant memory, however long the stream is."""

from collections.abc import Sequence
from dataclasses import dataclass

from vsensor.accept.kinds import CONSUMER, Kind
from vsensor.types import Array, IntArray

_RANK = {kind: place for place, kind in enumerate(CONSUMER)}


@dataclass(frozen=True, slots=True, kw_only=True)
class Finding:
    """One thing that is wrong with one message, `count` times, from `first_ns` to `last_ns` of the stream.

    `subject` is the signal, quantity or sentence that it is about. `worst` is the largest size of what was
    found in `unit`, and `limit` what would have passed; None where there is no size.
    """

    kind: Kind
    message: str
    subject: str
    count: int
    first_ns: int
    last_ns: int
    worst: float | None = None
    limit: float | None = None
    unit: str = ""

    @property
    def rank(self) -> tuple[int, int, str, str]:
        """Sorts the worst first."""
        return _RANK[self.kind], -self.count, self.message, self.subject

    @property
    def consumer(self) -> str:
        """What an ECU does about it."""
        return CONSUMER[self.kind]


class Book:
    """Adds up findings; the order in which they come in does not matter."""

    def __init__(self) -> None:
        self._found: dict[tuple[Kind, str, str], Finding] = {}

    def note(
        self,
        kind: Kind,
        message: str,
        t_ns: IntArray | Sequence[int],
        *,
        subject: str = "",
        worst: Array | Sequence[float] | None = None,
        count: int | None = None,
        limit: float | None = None,
        unit: str = "",
    ) -> None:
        """Note what was found at the times `t_ns` (N,), of the sizes `worst` (N,); `count` if not N."""
        if not len(t_ns):
            return
        key = kind, message, subject
        before = self._found.get(key)
        first, last = int(min(t_ns)), int(max(t_ns))
        size = None if worst is None else float(max(worst))
        number = len(t_ns) if count is None else count
        if before is not None:
            first, last = min(first, before.first_ns), max(last, before.last_ns)
            number += before.count
            size = before.worst if size is None else max(size, before.worst or 0.0)
        self._found[key] = Finding(
            kind=kind,
            message=message,
            subject=subject,
            count=number,
            first_ns=first,
            last_ns=last,
            worst=size,
            limit=limit,
            unit=unit,
        )

    def of(self, kind: Kind, message: str) -> list[Finding]:
        """Return what was found of a kind in a message."""
        return [found for found in self._found.values() if (found.kind, found.message) == (kind, message)]

    def drop(self, kind: Kind, message: str) -> int:
        """Forget what was found of a kind in a message; return how much that was."""
        dropped = self.of(kind, message)
        for found in dropped:
            del self._found[kind, message, found.subject]
        return sum(found.count for found in dropped)

    def findings(self) -> tuple[Finding, ...]:
        """Return all that was found, the worst first."""
        return tuple(sorted(self._found.values(), key=lambda found: found.rank))

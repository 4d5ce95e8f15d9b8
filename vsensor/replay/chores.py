"""Work that can wait: it is done when it fits before the next deadline, by what it took before."""

from collections.abc import Callable


class Chore:
    """One kind of work. `cost_ns`: the most that it took of late, with a margin, forgotten by and by."""

    __slots__ = ("cost_ns", "do")

    def __init__(self, do: Callable[[], object]) -> None:
        self.do = do
        self.cost_ns = 0

    def fits(self, left_ns: int) -> bool:
        """Return whether it can be expected to end within `left_ns`.

        Where it never does, one bad moment is not remembered for ever: each time a little is forgotten.
        """
        if left_ns > self.cost_ns:
            return True
        self.cost_ns -= self.cost_ns >> 6
        return False

    def took(self, cost_ns: int) -> None:
        """Remember what it took."""
        self.cost_ns = max(cost_ns * 5 // 4, self.cost_ns * 15 // 16)

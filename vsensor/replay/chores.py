"""Work that can wait: it is done when it fits before the next deadline, by what it took before."""

from collections.abc import Callable

from vsensor.replay.sender import Sender
from vsensor.replay.supply import Supply

LISTEN_NS = 20_000_000
"""A full bus brings 160 frames in that time, a socket holds at least 270."""


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


class Chores:
    """What a player does while no frame is due: read ahead, listen, look for the place of a seek, record."""

    def __init__(self, supply: Supply, sender: Sender, search: Callable[[], object]) -> None:
        self.pulling, self.searching = Chore(supply.pull), Chore(search)
        self._listening, self._recording = Chore(sender.listen), Chore(sender.write)
        self._supply, self._sender = supply, sender
        self._heard_ns = 0

    def next(self, now_ns: int, at_ns: int, left_ns: int) -> Chore | None:
        """Return what is to be done and fits into `left_ns`; `at_ns` is now, from the replay's beginning."""
        supply = self._supply
        may_pull = supply.may_pull(at_ns) and self._may_pull_within(left_ns)
        if may_pull and supply.is_scarce:
            return self.pulling
        if now_ns - self._heard_ns >= LISTEN_NS and self._listening.fits(left_ns):
            self._heard_ns = now_ns
            return self._listening
        if supply.is_searching and self.searching.fits(left_ns):
            return self.searching
        if self._sender.has_unrecorded and self._recording.fits(left_ns):
            return self._recording
        return self.pulling if may_pull else None

    def _may_pull_within(self, left_ns: int) -> bool:
        """Return whether a pull fits into `left_ns`; with little ahead, pulls get smaller until one does."""
        if self.pulling.fits(left_ns):
            if left_ns > 4 * self.pulling.cost_ns:
                self._supply.coarser()
            return True
        if self._supply.is_scarce:
            self._supply.finer()
        return False

"""Frames that the kernel took and the bus did not: nobody acknowledges, and they pile up in its queue."""

SILENT_NS = 200_000_000
"""A frame comes back at once when it was on the bus, on a busy kernel a cycle later."""
SILENT_CYCLES = 3
PROBE_NS = 500_000_000
"""One frame is tried that often, in case the kernel threw away those whose return is waited for."""


class Silence:
    """Says when to hold frames back: what is in the queue now leaves late, all of it, once somebody listens.

    Only for a bus whose own frames come back (`comes_back` was called); others are never held back.
    """

    def __init__(self) -> None:
        self._hears = False
        self._since_ns: int | None = None  # the first cycle that was sent and did not come back
        self._cycles = 0
        self._probed_ns = 0

    def comes_back(self) -> None:
        """Note that an own frame was on the bus."""
        self._hears, self._since_ns, self._cycles = True, None, 0

    def forget(self) -> None:
        """Start again: the interface was down, its queue is empty."""
        self._since_ns, self._cycles = None, 0

    def cycle_ends(self, sent_ns: int | None) -> None:
        """Note a cycle whose first frame was handed over at `sent_ns`; None if it had none."""
        if self._hears and sent_ns is not None:
            self._cycles += 1
            self._since_ns = sent_ns if self._since_ns is None else self._since_ns

    def holds_back(self, now_ns: int) -> bool:
        """Return whether the frame that is due now must stay; every PROBE_NS one may go."""
        if self._since_ns is None or self._cycles < SILENT_CYCLES or now_ns - self._since_ns < SILENT_NS:
            return False
        if now_ns - self._probed_ns < PROBE_NS:
            return True
        self._probed_ns = now_ns
        return False

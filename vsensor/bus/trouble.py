"""Bus trouble as a tester hears of it: when it begins, when it is over, and in figures at the end."""

import errno
import os
from collections.abc import Callable

from vsensor.bus.socketcan import errno_of

SAID_OUTAGES = 5
"""A bus that comes and goes all night is told of so many times, then only counted."""

_ADVICE = {
    errno.ENETDOWN: "ip link set {channel} up",
    errno.ENOBUFS: "nobody acknowledges, or the queue is short: ip link set {channel} txqueuelen 1000",
}


def reason_of(problem: Exception, channel: str) -> str:
    """Return why a frame was refused, with the command that helps."""
    number = errno_of(problem)
    if not number:
        return str(problem)
    text = f"{os.strerror(number)} ({errno.errorcode.get(number, number)})"
    advice = _ADVICE.get(number)
    return f"{text}: {advice.format(channel=channel)}" if advice else text


class Outages:
    """When frames were refused, cycle by cycle: an outage ends with a cycle that was sent in full."""

    def __init__(self, name: str, say: Callable[[str], None]) -> None:
        self.count = 0
        self.longest_ns = 0
        self.reasons: dict[str, int] = {}
        self._name, self._say = name, say
        self._began_ns: int | None = None
        self._back_ns: int | None = None
        self._refused = self._refused_in_cycle = 0

    @property
    def is_out(self) -> bool:
        """Whether an outage is going on."""
        return self._began_ns is not None

    def refused(self, reason: str, now_ns: int) -> None:
        """Count a frame that the bus did not take."""
        self.reasons[reason] = self.reasons.get(reason, 0) + 1
        self._refused_in_cycle += 1
        self._refused += 1
        self._back_ns = None
        if self._began_ns is None:
            self._began_ns, self._refused = now_ns, 1
            self.count += 1
            if self.count <= SAID_OUTAGES:
                self._say(f"{self._name}: {reason}; the run goes on, what is refused is not sent later")

    def taken(self, now_ns: int) -> None:
        """Note a frame that the bus took during an outage: from here on it may be over."""
        if self._back_ns is None:
            self._back_ns = now_ns

    def cycle_ends(self, now_ns: int) -> None:
        """Judge the cycle: the outage is over if something was sent and nothing refused."""
        if self._began_ns is None:
            return
        end_ns = now_ns if self._back_ns is None else self._back_ns
        self.longest_ns = max(self.longest_ns, end_ns - self._began_ns)
        if self._back_ns is not None and not self._refused_in_cycle:
            self._over(self._back_ns - self._began_ns)
        self._refused_in_cycle = 0

    def _over(self, lasted_ns: int) -> None:
        self._began_ns = self._back_ns = None
        if self.count <= SAID_OUTAGES:
            more = "; further outages are only counted" if self.count == SAID_OUTAGES else ""
            self._say(
                f"{self._name} is back after {lasted_ns / 1e9:.2f} s, {self._refused} frames refused{more}"
            )

    def text(self) -> str:
        """Return outages and reasons in one line, "" if there were none."""
        if not self.count:
            return ""
        reasons = "; ".join(f"{count} x {text}" for text, count in self.reasons.items())
        still = ", the last one not over" if self.is_out else ""
        outages = "1 outage" if self.count == 1 else f"{self.count} outages"
        return (
            f"{self._name} refused {sum(self.reasons.values())} frames in {outages}, "
            f"longest {self.longest_ns / 1e9:.2f} s{still}: {reasons}"
        )

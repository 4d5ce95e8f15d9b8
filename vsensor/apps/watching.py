"""What one message of a bus does, frame by frame: cycle, counter, checksum, and what an ECU makes of it.

frame --length, CRC--> counted --counter--> receiver's state     `take`, at every frame
                                                  |
silent? cycle off? what was wrong since then? --> status         `looked`, whenever somebody looks
"""

from collections import deque
from dataclasses import dataclass, replace
from math import nan
from statistics import median

from vsensor.accept import LimitsConfig
from vsensor.codec import unpack
from vsensor.e2e import ReceiverState, Reception, Status, receive
from vsensor.profile import MessagePlan, Profile
from vsensor.sources.listening import CYCLES_MISSED
from vsensor.types import Frame

LIMITS = LimitsConfig()
"""Tolerances of `vsensor accept`: both say the same of a bus."""
RECENT = 50
"""Intervals that the cycle time is the median of: 2 s of a camera's messages; a pause does not move it."""
ENOUGH = 8
FINE = "ok"
NEVER = "never heard"


@dataclass(slots=True, kw_only=True)
class Troubles:
    """What was wrong with the frames of a message: how many of each kind."""

    short: int = 0
    wrong_crc: int = 0
    repeated: int = 0
    lost: int = 0
    jumped: int = 0

    def since(self, before: "Troubles") -> str:
        """Return the worst that came since `before`, "" if nothing did."""
        lost = self.lost - before.lost
        words = {
            "too short": self.short - before.short,
            "wrong CRC": self.wrong_crc - before.wrong_crc,
            "counter jumped": self.jumped - before.jumped,
            "counter stands": self.repeated - before.repeated,
            f"{lost} lost": lost,
        }
        return next((word for word, count in words.items() if count), "")

    def copied(self) -> "Troubles":
        """Return them as they are now."""
        return replace(self)


class MessageWatch:
    """One message of a profile as it is heard; times are those of the frames, in ns.

    `longest_ns`: the longest interval so far. `quality`: the least quality of a line that the last frame
    tells, NaN if it tells none.
    """

    def __init__(self, profile: Profile, plan: MessagePlan) -> None:
        self.profile, self.plan = profile, plan
        self.frames = 0
        self.troubles = Troubles()
        self.counter: int | None = None
        self.quality = nan
        self.longest_ns = 0
        self.last_ns: int | None = None
        self._state = ReceiverState()
        self._damaged = 0  # frames since the last right one
        self._intervals: deque[int] = deque(maxlen=RECENT)
        self._paced_ns: int | None = None
        self._seen = Troubles()

    @property
    def reception(self) -> Reception:
        """Whether a receiver of AUTOSAR's kind trusts the stream."""
        return self._state.reception

    @property
    def is_protected(self) -> bool:
        """Whether it has a checksum or a counter."""
        return self.plan.guard is not None

    @property
    def cycle_ms(self) -> float:
        """Median of the recent intervals, NaN before the second frame."""
        return median(self._intervals) / 1e6 if self._intervals else nan

    def take(self, frame: Frame) -> dict[str, float] | None:
        """Take in a frame of this message; return its quantities, None if it is damaged."""
        self.frames += 1
        self.last_ns = max(frame.due_ns, self.last_ns or frame.due_ns)
        self._pace(frame)
        if len(frame.data) < self.plan.layout.length:
            self.troubles.short += 1
            self._damaged += 1
            return None
        if self.plan.guard is not None and not self._is_right(frame.data[: self.plan.layout.length]):
            return None
        values = self.profile.decode(frame) or {}
        told = [value for name, value in values.items() if name.endswith(".quality") and value == value]
        self.quality = min(told, default=nan)
        return values

    def age_ns(self, now_ns: int) -> int | None:
        """Return how long ago the last frame came, None before the first."""
        return None if self.last_ns is None else max(0, now_ns - self.last_ns)

    def is_silent(self, now_ns: int) -> bool:
        """Return whether no frame came for longer than a consumer waits; never, if it has no cycle."""
        age_ns = self.age_ns(now_ns)
        return age_ns is not None and 0 < CYCLES_MISSED * self.plan.cycle_ns < age_ns

    def looked(self, now_ns: int) -> str:
        """Return the status, of what came since the last look the worst; "ok" if nothing is wrong."""
        since = self.troubles.since(self._seen)
        self._seen = self.troubles.copied()
        if self.last_ns is None:
            return NEVER
        if self.is_silent(now_ns):
            return "silent"
        return since or self._not_trusted() or self._cycle_off() or FINE

    def _is_right(self, data: bytes) -> bool:
        assert self.plan.guard is not None
        self._state, check = receive(LIMITS.receiver, self._state, self.plan.guard, data)
        if check.status is Status.WRONG_CRC:
            self.troubles.wrong_crc += 1
            self._damaged += 1
            return False
        self.counter = self.plan.guard.counter(data)
        self.troubles.repeated += check.status is Status.REPEATED
        self.troubles.jumped += check.status is Status.WRONG_SEQUENCE
        self.troubles.lost += max(0, check.lost - self._damaged)  # these came, and are counted already
        self._damaged = 0
        return True

    def _pace(self, frame: Frame) -> None:
        """Note the interval; of pages that leave together the first one has the cycle."""
        if len(self.plan.pages) > 1 and self.plan.mux == "together":
            if len(frame.data) < self.plan.layout.length:
                return
            raws = unpack(self.plan.layout, frame.data[: self.plan.layout.length])
            if any(raws.get(name) != raw for name, raw in self.plan.pages[0].items()):
                return
        if self._paced_ns is not None:
            interval_ns = frame.due_ns - self._paced_ns
            self._intervals.append(interval_ns)
            self.longest_ns = max(self.longest_ns, interval_ns)
        self._paced_ns = frame.due_ns

    def _not_trusted(self) -> str:
        return "not trusted" if self.is_protected and self.reception is Reception.INVALID else ""

    def _cycle_off(self) -> str:
        cycle_ms = self.plan.cycle_ns / 1e6
        if not self.plan.sending.is_cyclic or not cycle_ms or len(self._intervals) < ENOUGH:
            return ""
        return "cycle off" if abs(self.cycle_ms / cycle_ms - 1) > LIMITS.cycle_tolerance else ""

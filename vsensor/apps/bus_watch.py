"""A bus as heard through profiles: messages, quantities, lines, and what changed since the last look."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isfinite, isnan, nan

from vsensor.apps.watching import FINE, NEVER, MessageWatch
from vsensor.profile import QUANTITIES, Profile
from vsensor.sinks.table_view import TableLine
from vsensor.types import SIDE_NAMES, Frame, MarkingKind, Side


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """A message whose status is another one from `t_ns` on."""

    t_ns: int
    watch: MessageWatch
    status: str


class BusWatch:
    """All messages of the profiles on one bus; of several messages the latest tells a quantity.

    `statuses`: that of each watch in `watches` when somebody looked last. `foreign`: id -> frames that no
    profile knows. A line is as the bus describes it (its origin, its edge), in SI and the model's signs.
    """

    def __init__(self, profiles: Sequence[Profile]) -> None:
        self.watches = [MessageWatch(profile, plan) for profile in profiles for plan in profile.messages]
        self._by_id: dict[tuple[int, bool], list[MessageWatch]] = {}
        for watch in self.watches:
            layout = watch.plan.layout
            self._by_id.setdefault((layout.arbitration_id, layout.is_extended), []).append(watch)
        self.statuses = [NEVER] * len(self.watches)
        self.frames = 0
        self.foreign: Counter[tuple[int, bool]] = Counter()
        self._told: dict[str, tuple[float, MessageWatch]] = {}

    def take(self, frames: Sequence[Frame]) -> None:
        """Take in what was heard, in order; error and remote frames carry nothing."""
        for frame in frames:
            if frame.is_error or frame.is_remote:
                continue
            self.frames += 1
            key = frame.arbitration_id, frame.is_extended
            for watch in self._by_id.get(key, ()):
                for name, value in (watch.take(frame) or {}).items():
                    self._told[name] = value, watch
            if key not in self._by_id:
                self.foreign[key] += 1

    def looked(self, now_ns: int) -> list[Change]:
        """Look at every message; return those whose status has changed."""
        before = self.statuses
        self.statuses = [watch.looked(now_ns) for watch in self.watches]
        return [
            Change(t_ns=now_ns, watch=watch, status=status)
            for watch, status, old in zip(self.watches, self.statuses, before, strict=True)
            if status != old
        ]

    @property
    def troubled(self) -> list[str]:
        """The names of the messages that are not as they should be."""
        pairs = zip(self.watches, self.statuses, strict=True)
        return [watch.plan.layout.name for watch, status in pairs if status != FINE]

    def value(self, name: str, now_ns: int) -> float:
        """Return a quantity's last value, NaN if it has none or its message has fallen silent."""
        value, watch = self._told.get(name, (nan, None))
        return nan if watch is None or watch.is_silent(now_ns) else value

    def lines(self, now_ns: int) -> list[TableLine | None]:
        """Return the lines in the order of Side, None = not reported, or silent."""
        return [self._line(SIDE_NAMES[side], now_ns) for side in Side]

    def others(self, now_ns: int) -> Iterator[tuple[str, str]]:
        """Yield name and value, with unit or as a code's word, of what was told beside lines; "-" = none."""
        for name, quantity in QUANTITIES.items():
            if name in self._told and name.partition(".")[0] not in SIDE_NAMES.values():
                value = self.value(name, now_ns)
                codes = quantity.codes
                if isnan(value):
                    yield name, "-"
                elif codes is not None and value in set(codes):
                    yield name, codes(int(value)).name.lower()
                else:
                    yield name, f"{value:.6g} {quantity.unit}".rstrip()

    def _line(self, word: str, now_ns: int) -> TableLine | None:
        def told(name: str, default: float = nan) -> float:
            value = self.value(f"{word}.{name}", now_ns)
            return default if isnan(value) else value

        offset_m = told("offset_m")
        if not isfinite(offset_m) or told("available", 1.0) == 0.0:
            return None
        kind = told("kind", float(MarkingKind.UNKNOWN))
        return TableLine(
            offset_m=offset_m,
            heading=told("heading"),
            curvature_per_m=told("curvature_per_m", 2 * told("c2_per_m")),
            curvature_rate_per_m2=told("curvature_rate_per_m2", 6 * told("c3_per_m2")),
            x_min_m=told("x_min_m"),
            x_max_m=told("x_max_m"),
            quality=int(told("quality", 0.0)),
            kind=int(kind) if kind in set(MarkingKind) else MarkingKind.UNKNOWN,
            measured=int(told("measured", 1.0)),
        )

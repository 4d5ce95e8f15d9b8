"""`[[ego.manoeuvre]]`: what a driver is told to do, as a speed over time and shifts along the road."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import Annotated, Literal

import msgspec

from vsensor.errors import ConfigError
from vsensor.schema import Config
from vsensor.sources.traffic import MPS_PER_KMH
from vsensor.world.profiles import LinearProfile, Points

USUAL_MPS2 = {"accelerate": 1.5, "brake": 3.0}
USUAL_S = 5.0


class ManoeuvreConfig(Config, frozen=True, kw_only=True):
    """`[[ego.manoeuvre]]`: one of them; it begins `at_s`, or where the one before it has ended.

    "hold" keeps the speed `for_s`. "accelerate" and "brake" go evenly `to_kmh` with `acceleration_mps2` (1.5
    and 3 where it is not given). "lane_change" goes `lanes_left` (negative: right), or `offset_m` to the
    left, on a smooth path that takes `over_s` (5), or `over_m` of road.
    """

    kind: Literal["hold", "accelerate", "brake", "lane_change"]
    at_s: Annotated[float, msgspec.Meta(ge=0, le=31_536_000)] | None = None
    for_s: Annotated[float, msgspec.Meta(gt=0, le=31_536_000)] | None = None
    to_kmh: Annotated[float, msgspec.Meta(ge=0, le=540)] | None = None
    acceleration_mps2: Annotated[float, msgspec.Meta(gt=0, le=15)] | None = None
    lanes_left: Annotated[int, msgspec.Meta(ge=-8, le=8)] | None = None
    offset_m: Annotated[float, msgspec.Meta(ge=-20, le=20)] | None = None
    over_s: Annotated[float, msgspec.Meta(ge=0.5, le=600)] | None = None
    over_m: Annotated[float, msgspec.Meta(ge=5, le=10_000)] | None = None


TAKES = {
    "hold": ("for_s",),
    "accelerate": ("to_kmh", "acceleration_mps2"),
    "brake": ("to_kmh", "acceleration_mps2"),
    "lane_change": ("lanes_left", "offset_m", "over_s", "over_m"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """From `start_m` to `end_m` of the route the path goes over by lanes and metres, left positive."""

    start_m: float
    end_m: float
    lanes_left: int = 0
    offset_m: float = 0.0
    key: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """What the driver wants: speed in m/s over time, and shifts in the order in which they begin."""

    speeds: LinearProfile
    shifts: tuple[Shift, ...]
    speed_kmh: Points


def planned(speed_kmh: Points, offset_m: Points, manoeuvres: Sequence[ManoeuvreConfig]) -> Plan:
    """Return the plan of `[ego]`; raises ConfigError naming the manoeuvre that cannot be."""
    maker = _Maker(speed_kmh)
    for number, one in enumerate(manoeuvres):
        maker.add(f"ego.manoeuvre[{number}]", one)
    points: Points = maker.speeds if len(maker.speeds) > 1 else speed_kmh
    speeds = LinearProfile.of(points, "ego.speed_kmh", MPS_PER_KMH)
    wished = LinearProfile.of(offset_m, "ego.offset_m")
    shifts = [Shift(start_m=0.0, end_m=0.0, offset_m=wished.values[0])] if wished.values[0] else []
    for k in range(1, len(wished.values)):
        start_m, end_m = (speeds.integral(wished.times_s[j]) for j in (k - 1, k))
        step_m = wished.values[k] - wished.values[k - 1]
        if step_m:
            shifts.append(Shift(start_m=start_m, end_m=end_m, offset_m=step_m, key="ego.offset_m"))
    shifts += [change.shift(speeds) for change in maker.changes]
    return Plan(speeds=speeds, shifts=tuple(shifts), speed_kmh=points)


@dataclass(frozen=True, slots=True)
class _Change:
    """A lane change that begins at a time."""

    key: str
    config: ManoeuvreConfig
    at_s: float

    def shift(self, speeds: LinearProfile) -> Shift:
        start_m = speeds.integral(self.at_s)
        one = self.config
        end_m = speeds.integral(self.at_s + (one.over_s or USUAL_S))
        if one.over_m is not None:
            end_m = start_m + one.over_m
        if end_m - start_m < 1.0:
            raise ConfigError(f"{self.key}: a vehicle that stands changes no lane")
        return Shift(
            start_m=start_m,
            end_m=end_m,
            lanes_left=one.lanes_left or 0,
            offset_m=one.offset_m or 0.0,
            key=self.key,
        )


class _Maker:
    """Puts manoeuvres one after the other."""

    def __init__(self, speed_kmh: Points) -> None:
        self._given = speed_kmh
        first = speed_kmh[0][1] if isinstance(speed_kmh, list) and speed_kmh else speed_kmh
        self.speeds: list[tuple[float, float]] = [(0.0, float(first))]  # type: ignore[arg-type]
        self.changes: list[_Change] = []
        self._end_s = 0.0
        self._changed_s = self._steady_s = 0.0

    def add(self, key: str, one: ManoeuvreConfig) -> None:
        """Add one; raises ConfigError."""
        _require_keys(key, one)
        if self._end_s == inf and one.at_s is None:
            raise ConfigError(f"{key}: the one before it has no end: for_s there, or at_s here was expected")
        at_s = self._end_s if one.at_s is None else one.at_s
        if one.kind == "lane_change":
            self._end_s = self._change(key, one, at_s)
        elif one.kind == "hold":
            self._end_s = at_s + one.for_s if one.for_s is not None else inf
        else:
            self._end_s = self._speed(key, one, at_s)

    def _speed(self, key: str, one: ManoeuvreConfig, at_s: float) -> float:
        if isinstance(self._given, list) and len(self._given) > 1:
            raise ConfigError(f"{key}: ego.speed_kmh is one number, where manoeuvres change the speed")
        if at_s < self._steady_s:
            raise ConfigError(f"{key}: begins at {at_s:g} s, before the change of speed ends before it")
        assert one.to_kmh is not None
        now = self.speeds[-1][1]
        if (one.to_kmh > now) != (one.kind == "accelerate") or one.to_kmh == now:
            raise ConfigError(f"{key}.to_kmh = {one.to_kmh:g}: {one.kind} from {now:g} km/h?")
        rate = one.acceleration_mps2 or USUAL_MPS2[one.kind]
        end_s = at_s + abs(one.to_kmh - now) * MPS_PER_KMH / rate
        if at_s > self.speeds[-1][0]:
            self.speeds.append((at_s, now))
        self.speeds.append((end_s, one.to_kmh))
        self._steady_s = end_s
        return end_s

    def _change(self, key: str, one: ManoeuvreConfig, at_s: float) -> float:
        if at_s < self._changed_s:
            raise ConfigError(f"{key}: begins at {at_s:g} s, before the lane change before it ends")
        change = _Change(key, one, at_s)
        points: Points = self.speeds if len(self.speeds) > 1 else self._given
        speeds = LinearProfile.of(points, "ego.speed_kmh", MPS_PER_KMH)
        end_m = change.shift(speeds).end_m
        self.changes.append(change)
        self._changed_s = at_s + one.over_s if one.over_s is not None else _time_at(speeds, at_s, end_m)
        return self._changed_s


def _require_keys(key: str, one: ManoeuvreConfig) -> None:
    """Raise ConfigError for keys that the kind does not take, lacks, or that contradict each other."""
    for name in {name for names in TAKES.values() for name in names} - {*TAKES[one.kind]}:
        if getattr(one, name) is not None:
            raise ConfigError(f'{key}.{name}: kind = "{one.kind}" takes {", ".join(TAKES[one.kind])}')
    if one.kind in USUAL_MPS2 and one.to_kmh is None:
        raise ConfigError(f'{key}: kind = "{one.kind}" needs to_kmh')
    if one.kind != "lane_change":
        return
    if not one.lanes_left and not one.offset_m:
        raise ConfigError(f'{key}: kind = "lane_change" needs lanes_left or offset_m')
    for a, b in (("lanes_left", "offset_m"), ("over_s", "over_m")):
        if getattr(one, a) is not None and getattr(one, b) is not None:
            raise ConfigError(f"{key}: {a} or {b}, not both")


def _time_at(speeds: LinearProfile, from_s: float, place_m: float) -> float:
    """Return when the profile has come so far; raises nothing: beyond a day it never does."""
    low, high = from_s, from_s + 86_400.0
    if speeds.integral(high) < place_m:
        return inf
    for _ in range(60):
        middle = (low + high) / 2.0
        low, high = (middle, high) if speeds.integral(middle) < place_m else (low, middle)
    return high

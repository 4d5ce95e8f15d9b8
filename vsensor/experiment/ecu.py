"""ECUs that stand on the bus of a simulated run: they take the sensor's frames and answer with their own.

For the ECU under test take a real bus (`--bus`). These show what a test says: `reference` warns and keeps the
lane, `late` does both too late, `none` only says that it asks for nothing.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Protocol

from vsensor.codec import pack
from vsensor.profile import LaneWarning, MessagePlan, Profile, load_profile
from vsensor.types import Frame

REQUEST, WARNING = "ego.steering_request_rad", "ego.lane_warning"
ECU_CYCLE_NS = 20_000_000


class Ecu(Protocol):
    """Answers to what it has heard, every ECU_CYCLE_NS."""

    def answer(self, heard: Mapping[str, float], t_ns: int) -> Mapping[str, float]:
        """Return the quantities that it sends at `t_ns`, NaN = not available; `heard`: the latest of each."""
        ...


@dataclass(slots=True)
class BenchBus:
    """A bus of a simulated run with one ECU on it; what the ECU has sent is kept in `answered`.

    Frames reach the ECU when they are sent; it answers in its own cycle until the next image.
    """

    ecu: Ecu
    sensor: Profile
    vehicle: Profile
    period_ns: int
    answered: list[Frame] = field(default_factory=list)
    _heard: dict[str, float] = field(default_factory=dict)
    _counter: int = 0
    _now_ns: int = 0

    def send(self, frame: Frame) -> bool:
        """Take a frame of the sensor."""
        values = self.sensor.decode(frame, check=True)
        if values is not None:
            self._heard.update(values)
        return True

    def drain(self) -> Sequence[Frame]:
        """Return what the ECU has sent in the image's cycle."""
        first, self._now_ns = self._now_ns, self._now_ns + self.period_ns
        frames = [self._frame(t_ns) for t_ns in range(first, self._now_ns, ECU_CYCLE_NS)]
        self.answered += frames
        return frames

    def confirmed(self) -> Sequence[tuple[int, int]]:
        """Return nothing: no time passes on this bus."""
        return ()

    def _frame(self, t_ns: int) -> Frame:
        plan = _plan_of(self.vehicle, REQUEST)
        values = self.ecu.answer(self._heard, t_ns)
        raws = {signal.name: int(signal.start_raw) for signal in plan.layout.signals.values()}
        for binding in plan.bindings:
            value = values.get(binding.quantity, math.nan)
            if not math.isnan(value):
                raws[binding.signal.name] = binding.raw(value)[0]
        data = bytearray(pack(plan.layout, raws))
        if plan.guard is not None:
            plan.guard.protect(data, self._counter % plan.guard.counter_states)
        self._counter += 1
        return Frame(due_ns=t_ns, arbitration_id=plan.layout.arbitration_id, data=bytes(data))


def _plan_of(profile: Profile, quantity: str) -> MessagePlan:
    for plan in profile.messages:
        if any(binding.quantity == quantity for binding in plan.bindings):
            return plan
    raise KeyError(quantity)


def bench(name: str, sensor: Profile, period_ns: int, vehicle_width_m: float) -> BenchBus:
    """Return a bus with the ECU of that name on it."""
    return BenchBus(ECUS[name](vehicle_width_m), sensor, load_profile("vehicle"), period_ns)


class NoEcu:
    """Asks for nothing and warns of nothing."""

    def answer(self, heard: Mapping[str, float], t_ns: int) -> Mapping[str, float]:
        """Return that nothing is asked for."""
        return {REQUEST: math.nan, WARNING: float(LaneWarning.NONE)}


@dataclass(frozen=True, slots=True, kw_only=True)
class KeeperConfig:
    """When the lane keeper warns and steers, and how; distances from the tyre to the line's inner border."""

    warns_at_m: float = 0.05
    steers_at_m: float = 0.25
    steers_within_s: float = 0.9  # of the time to crossing
    keeps_m: float = 0.35  # where it brings the tyre
    stiffness_per_s2: float = 0.5
    damping_per_s: float = 1.5
    most_mps2: float = 1.8
    most_mps3: float = 3.0
    wheelbase_m: float = 2.8
    understeer_s2pm: float = 0.0026
    least_quality: float = 1.0


@dataclass(slots=True)
class LaneKeeper:
    """Warns near a line; steers back from it on a damped course, lateral acceleration and jerk limited."""

    vehicle_width_m: float
    config: KeeperConfig = KeeperConfig()
    _side: int = 0  # +1: keeps off the left line, -1: off the right one, 0: does not steer
    _asked_mps2: float = 0.0

    def answer(self, heard: Mapping[str, float], t_ns: int) -> Mapping[str, float]:
        """Return the steering request and the warning."""
        distances = {side: self._distance(heard, side) for side in (1, -1)}
        lateral = _known(heard, "lane.lateral_speed_mps")
        near = min(distances, key=lambda side: distances[side])
        warning = LaneWarning.NONE
        if distances[near] <= self.config.warns_at_m:
            warning = LaneWarning.LEFT if near > 0 else LaneWarning.RIGHT
        self._choose(distances, lateral)
        if not self._side:
            self._asked_mps2 = 0.0
            return {REQUEST: math.nan, WARNING: float(warning)}
        return {REQUEST: self._steer(heard, distances[self._side], lateral), WARNING: float(warning)}

    def _choose(self, distances: Mapping[int, float], lateral: float) -> None:
        """Begin to steer where a line comes near; end where the vehicle is back and hardly moves across."""
        config = self.config
        for side, distance in distances.items():
            towards = side * lateral
            if self._side or towards <= 0.05:
                continue
            if distance < config.steers_at_m or distance < config.steers_within_s * towards:
                self._side = side
        if self._side and distances[self._side] > config.keeps_m - 0.05 and abs(lateral) < 0.05:
            self._side = 0

    def _steer(self, heard: Mapping[str, float], distance: float, lateral: float) -> float:
        """Return the angle of the front wheels that brings the tyre back."""
        config, side = self.config, self._side
        offset = side * (config.keeps_m - distance) if math.isfinite(distance) else 0.0
        wanted = -config.stiffness_per_s2 * offset - config.damping_per_s * lateral
        wanted = min(max(wanted, -config.most_mps2), config.most_mps2)
        step = config.most_mps3 * ECU_CYCLE_NS * 1e-9
        self._asked_mps2 += min(max(wanted - self._asked_mps2, -step), step)
        speed = max(_known(heard, "ego.speed_mps", 20.0), 5.0)
        line = "left" if side > 0 else "right"
        acceleration = self._asked_mps2 + _known(heard, f"{line}.curvature_per_m") * speed**2
        bend = acceleration / speed**2
        return math.atan(config.wheelbase_m * bend) + config.understeer_s2pm * acceleration

    def _distance(self, heard: Mapping[str, float], side: int) -> float:
        """Return the tyre's distance to a line's inner border, infinite where no line is known."""
        line = "left" if side > 0 else "right"
        if (
            _known(heard, f"{line}.available") < 1.0
            or _known(heard, f"{line}.quality") < self.config.least_quality
        ):
            return math.inf
        offset = heard.get(f"{line}.lane_offset_m", math.nan)
        return side * offset - self.vehicle_width_m / 2.0 if math.isfinite(offset) else math.inf


def _known(heard: Mapping[str, float], name: str, default: float = 0.0) -> float:
    value = heard.get(name, math.nan)
    return value if math.isfinite(value) else default


LATE = replace(KeeperConfig(), warns_at_m=-0.6, steers_at_m=-0.15, steers_within_s=-1.0)

ECUS: Mapping[str, Callable[[float], Ecu]] = {
    "reference": LaneKeeper,
    "late": lambda width_m: LaneKeeper(width_m, LATE),
    "none": lambda width_m: NoEcu(),
}
"""Names of the ECUs that `[loop] ecu` and --ecu know; each is made for a vehicle's width."""

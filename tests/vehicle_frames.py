"""Frames of vehicle.dbc as a gateway or an ECU sends them, made by hand around codec and guard."""

from dataclasses import dataclass, field

from vsensor.codec import pack
from vsensor.profile import load_profile
from vsensor.types import Frame

VEHICLE = load_profile("vehicle")
PLANS = {plan.layout.name: plan for plan in VEHICLE.messages}
CYCLE_NS = 20_000_000


@dataclass
class Gateway:
    """Sends messages of vehicle.dbc; every message has its own alive counter."""

    counters: dict[str, int] = field(default_factory=dict)

    def frame(self, message, t_ns=0, **values):
        """Return the next frame of a message; its quantities without "ego.", those left out are SNA."""
        plan = PLANS[message]
        known = {f"ego.{name}": value for name, value in values.items()}
        assert known.keys() <= {binding.quantity for binding in plan.bindings}
        raws = {s.name: int(s.start_raw) for s in plan.layout.signals.values()}
        raws |= {
            binding.signal.name: binding.raw(known[binding.quantity])[0]
            for binding in plan.bindings
            if binding.quantity in known
        }
        for validity in plan.validities:
            is_valid = known.keys() >= set(validity.needs)
            raws[validity.signal.name] = validity.valid_raw if is_valid else validity.invalid_raw
        counter = self.counters.get(message, 0)
        self.counters[message] = counter + 1
        data = bytearray(pack(plan.layout, raws))
        plan.guard.protect(data, counter % plan.guard.counter_states)
        return Frame(due_ns=t_ns, arbitration_id=plan.layout.arbitration_id, data=bytes(data))

    def motion(self, t_ns, speed_mps, yaw_rate_radps):
        """Return the frame with speed and yaw rate."""
        return self.frame("VEH_Motion", t_ns, speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps)

    def pose(self, t_ns, x_m, y_m, yaw_rad, **more):
        """Return the three frames of a pose, 0.2 ms apart."""
        return [
            self.frame("VEH_PositionX", t_ns, x_m=x_m),
            self.frame("VEH_PositionY", t_ns + 200_000, y_m=y_m),
            self.frame("VEH_Attitude", t_ns + 400_000, yaw_rad=yaw_rad, **more),
        ]

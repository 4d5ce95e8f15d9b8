"""`transmit`: the values of one image into the frames of one send slot."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from vsensor.profile import Profile
from vsensor.signals import VehicleConfig, to_bus
from vsensor.transmit.encode import Encoder
from vsensor.transmit.schedule import is_due
from vsensor.types import Frame, SignalValues, Tick


@dataclass(frozen=True, slots=True, kw_only=True)
class TransmitState:
    """Frames sent of each message and of all, and how often each signal was saturated."""

    counters: tuple[int, ...]
    frames: int
    saturated: Mapping[str, int]


class Transmitter:
    """A profile compiled for sending; immutable. Raises ConfigError for what cannot be sent."""

    def __init__(self, profile: Profile, vehicle: VehicleConfig, camera_x_m: float | None = None) -> None:
        self.profile, self.vehicle, self.camera_x_m = profile, vehicle, camera_x_m
        to_bus(profile.geometry, vehicle, _nothing(profile), camera_x_m)  # a missing camera is told here
        self.encoder = Encoder(profile)

    def raws(self, values: SignalValues) -> tuple[list[int], list[str]]:
        """Return the raw bits of all bindings and the names of saturated signals, see Encoder.raws."""
        return self.encoder.raws(values)


def initial_state(transmitter: Transmitter) -> TransmitState:
    """Return the state before the first frame: all counters start at 0."""
    return TransmitState(counters=(0,) * len(transmitter.profile.messages), frames=0, saturated={})


def transmit(
    transmitter: Transmitter, state: TransmitState, values: SignalValues, slot: Tick
) -> tuple[TransmitState, tuple[Frame, ...]]:
    """Return the frames that are due in this slot, in the profile's order, all due at the slot's time."""
    plans = transmitter.profile.messages
    due = [k for k, plan in enumerate(plans) if is_due(plan, slot)]
    if not due:
        return state, ()
    encoder = transmitter.encoder
    on_bus = to_bus(transmitter.profile.geometry, transmitter.vehicle, values, transmitter.camera_x_m)
    raws, saturated = encoder.raws(on_bus)
    frames, counters = encoder.frames(due, raws, state.counters, slot.t_ns)
    after = TransmitState(
        counters=counters, frames=state.frames + len(frames), saturated=_counted(state, saturated)
    )
    return after, tuple(frames)


def _counted(state: TransmitState, saturated: Sequence[str]) -> Mapping[str, int]:
    if not saturated:
        return state.saturated
    counts = dict(state.saturated)
    for name in saturated:
        counts[name] = counts.get(name, 0) + 1
    return counts


def _nothing(profile: Profile) -> SignalValues:
    return dict.fromkeys(profile.quantities(), math.nan)

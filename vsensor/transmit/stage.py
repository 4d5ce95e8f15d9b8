"""`transmit`: the values of one image into the frames of one send slot."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from vsensor.codec import to_physical, unpack
from vsensor.faults import NOT_SPOILED, Running, Spoiled, Spoiler
from vsensor.profile import MessagePlan, Profile
from vsensor.signals import VehicleConfig, to_bus
from vsensor.transmit.encode import Encoder
from vsensor.transmit.schedule import Happening, MessageState, common_ns, due_in, slot_period_ns, step
from vsensor.types import Frame, SignalValues, Tick


@dataclass(frozen=True, slots=True, kw_only=True)
class TransmitState:
    """Frames sent of each message and of all, and how often each signal was saturated.

    `messages`: what those remember that more than time sends, in the order of `Transmitter.eventful`.
    `spoiled`: what faults have done so far; frames that they took away are not counted as sent.
    """

    counters: tuple[int, ...]
    frames: int
    saturated: Mapping[str, int]
    messages: tuple[MessageState, ...] = ()
    spoiled: Spoiled = NOT_SPOILED


class Transmitter:
    """A profile compiled for sending; immutable. Raises ConfigError for what cannot be sent.

    `cyclic` are the places in the profile of the messages that time alone sends, by their offset and cycle;
    `eventful` the others.
    """

    def __init__(self, profile: Profile, vehicle: VehicleConfig, camera_x_m: float | None = None) -> None:
        self.profile, self.vehicle, self.camera_x_m = profile, vehicle, camera_x_m
        to_bus(profile.geometry, vehicle, _nothing(profile), camera_x_m)  # a missing camera is told here
        self.encoder = Encoder(profile)
        places = range(len(profile.messages))
        self._common_ns = common_ns(profile.messages)
        self.cyclic = _by_time(profile)
        self.eventful = tuple(k for k in places if not profile.messages[k].sending.is_cyclic)

    def raws(self, values: SignalValues) -> tuple[list[int], list[str]]:
        """Return the raw bits of all bindings and the names of saturated signals, see Encoder.raws."""
        return self.encoder.raws(values)

    def slot_period_ns(self, image_period_ns: int) -> int:
        """Return the time between send slots where images are taken every `image_period_ns`."""
        return slot_period_ns(self._common_ns, image_period_ns)


def initial_state(transmitter: Transmitter) -> TransmitState:
    """Return the state before the first frame: all counters start at 0."""
    return TransmitState(
        counters=(0,) * len(transmitter.profile.messages),
        frames=0,
        saturated={},
        messages=(MessageState(),) * len(transmitter.eventful),
    )


def restarted(transmitter: Transmitter, state: TransmitState) -> TransmitState:
    """Return the state of a sender that starts anew: as before the first frame, but for what is counted."""
    fresh = initial_state(transmitter)
    spoiled = replace(state.spoiled, shifts={}, waiting=())
    return replace(fresh, frames=state.frames, saturated=state.saturated, spoiled=spoiled)


def transmit(
    transmitter: Transmitter, state: TransmitState, values: SignalValues, slot: Tick
) -> tuple[TransmitState, tuple[Frame, ...]]:
    """Return the frames that are due in this slot, in the profile's order, all due at the slot's time."""
    return _send(transmitter, state, _Image(transmitter, values), slot)


def transmit_image(
    transmitter: Transmitter,
    state: TransmitState,
    values: SignalValues,
    tick: Tick,
    faults: Sequence[Running] = (),
) -> tuple[TransmitState, tuple[Frame, ...]]:
    """Return the frames of all send slots from this image to the next, in order, each due at its slot.

    `tick` is the image's; the slots divide its period (Transmitter.slot_period_ns). The same frames as of
    `transmit` slot by slot with the same values, as `faults` change them.
    """
    spoiler = None
    if faults or not state.spoiled.is_nothing:
        spoiler = Spoiler(faults, state.spoiled, transmitter.profile.messages)
        spoiler.begin(tick.t_ns)
    before, period_ns = state.frames, transmitter.slot_period_ns(tick.period_ns)
    slots, image, frames = tick.period_ns // period_ns, _Image(transmitter, values, spoiler), list[Frame]()
    for k in range(slots):
        slot = Tick(index=tick.index * slots + k, t_ns=tick.t_ns + k * period_ns, period_ns=period_ns)
        state, sent = _send(transmitter, state, image, slot)
        frames += sent
    if spoiler is None:
        return state, tuple(frames)
    spoiled, leaving = spoiler.end(tick)
    return replace(state, frames=before + len(leaving), spoiled=spoiled), leaving


class _Image:
    """The values of one image, encoded once, when the first slot asks."""

    def __init__(
        self, transmitter: Transmitter, values: SignalValues, spoiler: Spoiler | None = None
    ) -> None:
        self._transmitter, self._values, self.spoiler = transmitter, values, spoiler
        self._raws: list[int] | None = None
        self._saturated: list[str] = []
        self._happenings: tuple[Happening, ...] | None = None

    def raws(self) -> list[int]:
        """Return the raw bits of all bindings."""
        if self._raws is None:
            sender = self._transmitter
            on_bus = to_bus(sender.profile.geometry, sender.vehicle, self._values, sender.camera_x_m)
            self._raws, self._saturated = sender.encoder.raws(on_bus)
        return self._raws

    def saturated(self) -> list[str]:
        """Return the names of saturated signals, once: they count by images sent."""
        names, self._saturated = self._saturated, []
        return names

    def happenings(self) -> tuple[Happening, ...]:
        """Return what there is to each eventful message."""
        if self._happenings is None:
            sender = self._transmitter
            self._happenings = tuple(
                _happening(sender.profile.messages[k], self._contents(k), self._values)
                for k in sender.eventful
            )
        return self._happenings

    def _contents(self, place: int) -> tuple[bytes, ...]:
        pages = self._transmitter.encoder.contents(place, self.raws())
        if self.spoiler is None:
            return pages
        return tuple(self.spoiler.content(place, page, data) for page, data in enumerate(pages))


def _send(
    transmitter: Transmitter, state: TransmitState, image: _Image, slot: Tick
) -> tuple[TransmitState, tuple[Frame, ...]]:
    due: list[int] = []
    for (offset_ns, cycle_ns), places in transmitter.cyclic.items():
        if due_in(slot, offset_ns, cycle_ns):
            due += places
    messages = state.messages
    if transmitter.eventful:
        messages, more = _step_all(transmitter, messages, image, slot)
        due += more
    due.sort()
    if not due:
        return (state if messages == state.messages else replace(state, messages=messages)), ()
    if image.spoiler is not None:
        image.spoiler.begin(slot.t_ns)
    frames, counters = transmitter.encoder.frames(due, image.raws(), state.counters, slot.t_ns, image.spoiler)
    if image.spoiler is not None:
        image.spoiler.after_protection(frames)
    after = TransmitState(
        counters=counters,
        frames=state.frames + len(frames),
        saturated=_counted(state, image.saturated()),
        messages=messages,
        spoiled=state.spoiled,
    )
    return after, tuple(frames)


def _by_time(profile: Profile) -> Mapping[tuple[int, int], tuple[int, ...]]:
    """Return the places of the messages that time alone sends, by offset and cycle."""
    places: dict[tuple[int, int], tuple[int, ...]] = {}
    for place, plan in enumerate(profile.messages):
        if plan.sending.is_cyclic:
            time = plan.sending.offset_ns, plan.sending.cycle_ns
            places[time] = (*places.get(time, ()), place)
    return places


def _step_all(
    transmitter: Transmitter, messages: tuple[MessageState, ...], image: _Image, slot: Tick
) -> tuple[tuple[MessageState, ...], list[int]]:
    after, due = [], []
    for place, state, happening in zip(transmitter.eventful, messages, image.happenings(), strict=True):
        state, leaves = step(transmitter.profile.messages[place].sending, state, happening, slot)
        after.append(state)
        due += [place] * leaves
    return tuple(after), due


def _happening(plan: MessagePlan, pages: tuple[bytes, ...], values: SignalValues) -> Happening:
    on_bus = {name: raw for data in pages for name, raw in unpack(plan.layout, data).items()}
    active = any(
        condition.holds(
            _physical(plan, condition.subject, on_bus)
            if condition.is_signal
            else values.get(condition.subject, math.nan)
        )
        for condition in plan.sending.active
    )
    return Happening(
        watched=tuple(map(on_bus.get, plan.sending.watched)),
        written=values.get("image.index", 0.0),
        active=active,
    )


def _physical(plan: MessagePlan, name: str, raws: Mapping[str, int]) -> float:
    """Return the value of a signal in its unit on the bus; NaN for SNA, or where it is not in the frame."""
    return to_physical(plan.layout.signals[name], raws[name]) if name in raws else math.nan


def _counted(state: TransmitState, saturated: Sequence[str]) -> Mapping[str, int]:
    if not saturated:
        return state.saturated
    counts = dict(state.saturated)
    for name in saturated:
        counts[name] = counts.get(name, 0) + 1
    return counts


def _nothing(profile: Profile) -> SignalValues:
    return dict.fromkeys(profile.quantities(), math.nan)

"""`--from SOURCE --as TARGET`: the source's lane frames leave the stream, the target's come into it.

log ──► frame of the source? ─no──────────────────────────────────────────────► on
             │ yes: removed
             ▼
        image whole ──► from_bus ──► completed ──► values ──► transmit at the target's own slots ──► on
"""

from collections.abc import Mapping
from typing import NamedTuple

from msgspec.structs import replace

from vsensor.errors import ConfigError
from vsensor.profile import Profile
from vsensor.replay.stages import Stage
from vsensor.replay.translate.gather import Gathered, Gatherer, Whole, gathered
from vsensor.replay.translate.loss import Loss, with_image
from vsensor.replay.translate.values import completed, known_of
from vsensor.signals import VehicleConfig, from_bus, origin_x_m, to_bus
from vsensor.transmit import TransmitState, Transmitter, initial_state, transmit
from vsensor.types import Frame, SignalValues, Tick

IMAGE_NS = 40_000_000  # of a source that has no cycle
FRESH = 2.5  # intervals of images; after a longer silence of the source the target is silent, too
FOLLOWED, MOST_FOLLOWED_NS = 8, 1_000_000
"""The target's slots follow images of the same rate: by a part of what they are off, by 1 ms at most."""


class TranslateState(NamedTuple):
    """What a translation remembers. The next slot is due at `grid_ns` + `slot` * the slots' period.

    `whole_ns`: when the latest image was whole. `clashing`: frames of the log that had an id of the target.
    """

    gathered: Gathered = Gathered()
    values: SignalValues | None = None
    grid_ns: int = 0
    slot: int = 0
    whole_ns: int = 0
    channel: int = 0
    sent: TransmitState | None = None
    losses: Mapping[str, Loss] = {}
    images: int = 0
    removed: int = 0
    clashing: int = 0


class Translate:
    """Two profiles compiled for translating; immutable. Raises ConfigError for those that cannot be.

    `speed` of the replay; `camera_x_m` of the camera ahead of the rear axle, where a profile counts from it.
    """

    def __init__(
        self,
        source: Profile,
        target: Profile,
        *,
        vehicle: VehicleConfig | None = None,
        camera_x_m: float | None = None,
        speed: float = 1.0,
    ) -> None:
        self.source, self.target = source, target
        self.vehicle, self.camera_x_m = vehicle or VehicleConfig(), camera_x_m
        self.gatherer = Gatherer(source)
        if not self.gatherer.of_image:
            raise ConfigError(f"--from {source.path}: carries no lane, so there is nothing to translate")
        origin_x_m(source.geometry, self.vehicle, camera_x_m)  # a missing camera is told here
        self.transmitter = Transmitter(target, self.vehicle, camera_x_m)
        self.known, self.target_known = known_of(source), known_of(target)
        cycles = [p.cycle_ns for p in source.messages if p.layout.name in self.gatherer.of_image]
        self.image_ns = max(cycles, default=0) or IMAGE_NS
        self.slot_ns = self.transmitter.slot_period_ns(self.image_ns)
        self.fresh_ns = round(FRESH * self.image_ns / speed)
        even = all(_fits(plan.cycle_ns, self.image_ns) for plan in target.messages if plan.cycle_ns)
        self.follows = speed == 1.0 and even
        self.margin_ns = self.image_ns // 4 if self.follows else 0

    def stage(self) -> Stage:
        """Return it as a stage of a player."""
        from vsensor.replay.translate.told import told

        return Stage(
            lambda state, frame: translated(self, state, frame),
            TranslateState(),
            due=lambda state: next_slot_ns(self, state),
            wake=lambda state, due_ns: sent_in_slot(self, state, due_ns),
            told=lambda state: told(self, state),
        )


def _fits(cycle_ns: int, image_ns: int) -> bool:
    return cycle_ns % image_ns == 0 or image_ns % cycle_ns == 0


def translated(
    translate: Translate, state: TranslateState, frame: Frame
) -> tuple[TranslateState, Frame | tuple[Frame, ...]]:
    """Return the state after a frame of the log, and the frame unless it is the source's."""
    key = frame.arbitration_id, frame.is_extended
    if key not in translate.source.by_id:
        if key in translate.target.by_id:
            return state._replace(clashing=state.clashing + 1), ()
        return state, frame
    progress, whole = gathered(translate.gatherer, state.gathered, frame)
    state = state._replace(gathered=progress, removed=state.removed + 1, channel=frame.channel)
    return (state if whole is None else _with_image(translate, state, whole, frame.due_ns)), ()


def _with_image(translate: Translate, state: TranslateState, whole: Whole, due_ns: int) -> TranslateState:
    """Return the state with the values of an image, and the slots in step with it."""
    model = _model(translate, translate.source, whole.told)
    values = completed(translate.known, translate.vehicle, model, whole.number, whole.milliseconds)
    after = _model(translate, translate.target, _on_target(translate, values))
    grid_ns, slot = _in_step(translate, state, due_ns)
    return state._replace(
        values=values,
        grid_ns=grid_ns,
        slot=slot,
        whole_ns=due_ns,
        sent=state.sent or initial_state(translate.transmitter),
        losses=with_image(state.losses, frozenset(translate.target.quantities()), values, after),
        images=state.images + 1,
    )


def _model(translate: Translate, profile: Profile, told: SignalValues) -> SignalValues:
    return from_bus(profile.geometry, translate.vehicle, told, translate.camera_x_m)


def _on_target(translate: Translate, values: SignalValues) -> SignalValues:
    """Return what a receiver decodes from the target's frames of these values."""
    target, encoder = translate.target, translate.transmitter.encoder
    raws, _ = encoder.raws(to_bus(target.geometry, translate.vehicle, values, translate.camera_x_m))
    told: dict[str, float] = {}
    for place, plan in enumerate(target.messages):
        for data in encoder.contents(place, raws):
            frame = Frame(
                due_ns=0,
                arbitration_id=plan.layout.arbitration_id,
                is_extended=plan.layout.is_extended,
                data=data,
            )
            told |= target.decode(frame) or {}
    return told


def _in_step(translate: Translate, state: TranslateState, due_ns: int) -> tuple[int, int]:
    """Return when slot 0 was, as the next ones have it, and the next slot, after an image at `due_ns`."""
    if state.values is None:
        return due_ns + translate.margin_ns, 0
    grid_ns, slot = state.grid_ns, state.slot
    if translate.follows:
        off_ns = (grid_ns - due_ns - translate.margin_ns) % translate.image_ns
        off_ns -= translate.image_ns if off_ns > translate.image_ns // 2 else 0
        grid_ns -= max(-MOST_FOLLOWED_NS, min(MOST_FOLLOWED_NS, off_ns // FOLLOWED))
    if next_slot_ns(translate, state) is None:  # it was silent: the slots that have passed are not made up
        slot = max(slot, -((grid_ns - due_ns) // translate.slot_ns))
    return grid_ns, slot


def next_slot_ns(translate: Translate, state: TranslateState) -> int | None:
    """Return when the target's next slot is due; None while the source is silent."""
    if state.values is None:
        return None
    due_ns = state.grid_ns + state.slot * translate.slot_ns
    return due_ns if due_ns <= state.whole_ns + translate.fresh_ns else None


def sent_in_slot(
    translate: Translate, state: TranslateState, due_ns: int
) -> tuple[TranslateState, tuple[Frame, ...]]:
    """Return the state after a slot, and the frames that the target sends in it."""
    assert state.values is not None
    assert state.sent is not None
    period_ns = translate.slot_ns
    tick = Tick(index=state.slot, t_ns=state.slot * period_ns, period_ns=period_ns)
    sent, frames = transmit(translate.transmitter, state.sent, state.values, tick)
    leaving = tuple(replace(frame, due_ns=due_ns, channel=state.channel) for frame in frames)
    return state._replace(sent=sent, slot=state.slot + 1), leaving

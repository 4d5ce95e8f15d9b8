"""Which faults there are at a tick, as a value: those of the timeline, those injected since, until they end.

commands --+
           v
FaultState ---advance---> FaultState, Effects      Effects: what the stages of this tick do about it
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace

from vsensor.faults.fault import Fault
from vsensor.faults.spoiled import Spoiled
from vsensor.types import Tick


@dataclass(frozen=True, slots=True)
class Inject:
    """The command to let a fault happen; its number is the state's `next_number` then."""

    fault: Fault


@dataclass(frozen=True, slots=True)
class Clear:
    """The command to end a fault, or (None) all that have begun."""

    number: int | None = None


Command = Inject | Clear


@dataclass(frozen=True, slots=True, kw_only=True)
class Running:
    """A fault that has not ended: from `from_ns` until before `until_ns` (None: something else ends it).

    `images` it acted on so far.
    """

    number: int
    fault: Fault
    from_ns: int
    until_ns: int | None
    images: int = 0

    def is_due(self, t_ns: int) -> bool:
        """Return whether `t_ns` lies in its time."""
        return self.from_ns <= t_ns and (self.until_ns is None or t_ns < self.until_ns)


@dataclass(frozen=True, slots=True, kw_only=True)
class FaultState:
    """Faults to come, or not ended; `was_off`: a reset had silenced the sensor at the last tick."""

    running: tuple[Running, ...] = ()
    next_number: int = 0
    was_off: bool = False

    @property
    def is_quiet(self) -> bool:
        """Whether nothing can happen without a command."""
        return not self.running and not self.was_off

    def active(self, t_ns: int) -> tuple[Running, ...]:
        """Return the faults that have begun."""
        return tuple(running for running in self.running if running.is_due(t_ns))


@dataclass(frozen=True, slots=True, kw_only=True)
class Effects:
    """What the faults of one tick do: to the sensor, its lines, its image, its values, its frames.

    `restarts`: the sensor starts anew in this tick. `is_off`: it does nothing at all. `is_deaf`: it hears
    nothing from the bus. `frames` act on frames one by one, see Spoiler.
    """

    is_covered: bool = False
    has_failed: bool = False
    restarts: bool = False
    is_off: bool = False
    is_deaf: bool = False
    is_frozen: bool = False
    lines: tuple[Fault, ...] = ()
    overrides: Mapping[str, float] = field(default_factory=dict[str, float])
    frames: tuple[Running, ...] = ()


NO_FAULTS = FaultState()
NO_EFFECTS = Effects()


def initial_state(timeline: Iterable[Fault] = ()) -> FaultState:
    """Return the state before the first tick, with the faults of a scenario."""
    return _injected(NO_FAULTS, timeline, 0) if timeline else NO_FAULTS


def advance(
    state: FaultState, commands: Sequence[Command], tick: Tick, spoiled: Spoiled
) -> tuple[FaultState, Effects]:
    """Return the state at `tick` after `commands`, and what its faults do.

    `spoiled` knows of which frames the faults of frames have had.
    """
    for command in commands:
        if isinstance(command, Inject):
            state = _injected(state, (command.fault,), tick.t_ns)
        else:
            state = _cleared(state, command.number, tick.t_ns)
    if state.is_quiet:
        return state, NO_EFFECTS
    going = tuple(running for running in state.running if not _has_ended(running, tick.t_ns, spoiled))
    active = {running.number for running in going if running.is_due(tick.t_ns)}
    effects = _effects([running for running in going if running.number in active], going, tick, state.was_off)
    counted = tuple(
        replace(one, images=one.images + 1) if one.number in active and one.fault.times is not None else one
        for one in going
    )
    return FaultState(running=counted, next_number=state.next_number, was_off=effects.is_off), effects


def _injected(state: FaultState, faults: Iterable[Fault], now_ns: int) -> FaultState:
    running, number = list(state.running), state.next_number
    for fault in faults:
        from_ns = now_ns if fault.from_ns is None else max(fault.from_ns, now_ns)
        until_ns = None if fault.for_ns is None else from_ns + fault.for_ns
        running.append(Running(number=number, fault=fault, from_ns=from_ns, until_ns=until_ns))
        number += 1
    return replace(state, running=tuple(running), next_number=number)


def _cleared(state: FaultState, number: int | None, t_ns: int) -> FaultState:
    kept = (
        one for one in state.running if one.number != number and (number is not None or one.from_ns > t_ns)
    )
    return replace(state, running=tuple(kept))


def _has_ended(running: Running, t_ns: int, spoiled: Spoiled) -> bool:
    if running.until_ns is not None and t_ns >= running.until_ns:
        return True
    fault = running.fault
    if fault.times is None:
        return False
    if fault.kind.is_of_frames:
        return all(spoiled.used.get((running.number, k), 0) >= fault.times for k in fault.messages)
    return running.images >= fault.times


def _effects(active: Sequence[Running], going: Sequence[Running], tick: Tick, was_off: bool) -> Effects:
    kinds = {running.fault.config.kind for running in active}
    resets = [running for running in active if running.fault.config.kind == "reset"]
    is_off = any(running.fault.for_ns is not None for running in resets)
    end_ns = tick.t_ns + tick.period_ns
    return Effects(
        is_covered="sensor_blocked" in kinds,
        has_failed="sensor_failed" in kinds,
        restarts=not is_off and (was_off or bool(resets)),
        is_off=is_off,
        is_deaf="bus_off" in kinds or is_off,
        is_frozen="image_frozen" in kinds,
        lines=tuple(running.fault for running in active if running.fault.kind.stage == "line"),
        overrides={
            running.fault.config.quantity: running.fault.config.value
            for running in active
            if running.fault.config.quantity is not None and running.fault.config.value is not None
        },
        frames=tuple(
            running
            for running in going
            if running.from_ns < end_ns
            and (running.fault.kind.is_of_frames or running.fault.kind.stage == "bus")
        ),
    )

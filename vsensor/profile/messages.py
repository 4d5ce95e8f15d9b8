"""Messages of a profile file bound to those of its database; every mistake in one line."""

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vsensor.codec import Database, Layout, SignalLayout, overlaps, shared_ids
from vsensor.errors import ConfigError
from vsensor.profile.bind import binding_of, constant_raw, hint, signal_of, start_bits, validity_of
from vsensor.profile.bind_bursts import burst_of, with_bursts
from vsensor.profile.binding import Binding, Validity
from vsensor.profile.compiled import Profile
from vsensor.profile.config import MessageConfig, ProfileConfig, SignalConfig
from vsensor.profile.node import node_messages
from vsensor.profile.pages import pages_of
from vsensor.profile.parts import whole_of
from vsensor.profile.plan import MessagePlan
from vsensor.profile.protection import guard_of, protecting
from vsensor.profile.send_plan import group_phases, message_plan

_FD_LENGTHS = (*range(9), 12, 16, 20, 24, 32, 48, 64)


def compile_profile(path: Path, config: ProfileConfig, database: Database) -> Profile:
    """Return the profile at work; raises ConfigError naming file, message, signal."""
    if not config.messages and config.node is None:
        raise ConfigError(f"{path}: messages: at least one was expected")
    messages = with_bursts(config.messages, config.bursts, str(path))
    messages |= node_messages(config, database, str(path))
    group_phases(config.groups, messages, str(path))
    plans = _tell_once(
        [_message(path, config, database, name, message) for name, message in messages.items()]
    )
    for a, b in shared_ids([plan.layout for plan in plans]):
        raise ConfigError(f"{path}: messages.{b}: has the id of {a}, so a receiver cannot tell them apart")
    bursts = [burst_of(name, burst, plans, str(path)) for name, burst in config.bursts.items()]
    return Profile(
        name=path.stem,
        path=path,
        role=config.role,
        description=config.description,
        database=database.path,
        geometry=config.geometry,
        messages=plans,
        by_id={(p.layout.arbitration_id, p.layout.is_extended): p for p in plans},
        bursts=tuple(bursts),
        wide_ranges=config.wide_ranges,
    )


@dataclass
class _Carried:
    """What the signals of one message carry, while it is put together."""

    constants: dict[str, int]
    bindings: list[Binding] = field(default_factory=list[Binding])
    validities: list[Validity] = field(default_factory=list[Validity])
    pieces: dict[str, list[tuple[SignalLayout, SignalConfig]]] = field(
        default_factory=dict[str, list[tuple[SignalLayout, SignalConfig]]]
    )
    fixed: dict[str, int] = field(default_factory=dict[str, int])


def _message(
    path: Path, profile: ProfileConfig, database: Database, name: str, config: MessageConfig
) -> MessagePlan:
    layout = database.layouts.get(name)
    where = f"{path}: {name}"
    if layout is None:
        near = hint(name, database.layouts)
        raise ConfigError(f"{path}: messages.{name}: not a message of {database.path}{near}")
    guard = guard_of(layout, config.e2e, where) if config.e2e else None
    carried = _carried(profile, layout, config, where)
    bindings = tuple(carried.bindings)
    filled = [s.name for b in bindings for s in b.signals] + [v.signal.name for v in carried.validities]
    _require_apart(layout, bindings, where)
    rest = {k: v for k, v in carried.constants.items() if k not in (*filled, *protecting(config.e2e))}
    muxers = {name: raw for name, raw in carried.fixed.items() if name in layout.muxers}
    said = [*filled, *(name for name in carried.fixed if name not in muxers)]
    return MessagePlan(
        layout=layout,
        sending=message_plan(path, profile, layout, config, bindings),
        bindings=bindings,
        told=bindings,
        validities=tuple(carried.validities),
        constants=rest,
        guard=guard,
        pages=pages_of(layout, said, muxers, where),
        mux=config.mux,
        padding=_padding(profile, layout, config),
        bitrate_switch=layout.is_fd and _bitrate_switch(profile, layout, config),
        unnamed=_unnamed(layout, config),
    )


def _unnamed(layout: Layout, config: MessageConfig) -> tuple[str, ...]:
    said = {*config.signals, *protecting(config.e2e), *layout.muxers}
    return tuple(name for name in layout.signals if name not in said)


def _carried(profile: ProfileConfig, layout: Layout, config: MessageConfig, message: str) -> _Carried:
    """Return what the profile says of each signal of a message; the others have their start values."""
    carried = _Carried(constants={signal.name: start_bits(signal) for signal in layout.signals.values()})
    for name, item in config.signals.items():
        where = f"{message}.{name}"
        signal = signal_of(layout, name, where)
        wanted = SignalConfig(quantity=item) if isinstance(item, str) else item
        if signal.name in protecting(config.e2e):
            raise ConfigError(f"{where}: is the CRC or counter of this message and cannot carry a value")
        _require_one_role(wanted, where)
        if wanted.quantity is not None and wanted.bits is not None:
            carried.pieces.setdefault(wanted.quantity, []).append((signal, wanted))
        elif wanted.quantity is not None:
            carried.bindings.append(binding_of(profile, signal, wanted, where))
        elif wanted.valid_of is not None:
            carried.validities.append(validity_of(signal, wanted, where))
        else:
            carried.fixed[name] = carried.constants[name] = constant_raw(signal, wanted, where)
    for quantity, pieces in carried.pieces.items():
        carried.bindings.append(whole_of(profile, pieces, f"{message}: {quantity}"))
    return carried


def _require_one_role(config: SignalConfig, where: str) -> None:
    roles = [role is not None for role in (config.quantity, config.constant, config.valid_of)]
    if sum(roles) != 1:
        raise ConfigError(f"{where}: just one of quantity, constant, valid_of was expected")


def _padding(profile: ProfileConfig, layout: Layout, config: MessageConfig) -> bytes:
    """Return what follows the data of a CAN FD message up to a length that CAN FD has."""
    byte = profile.padding_byte if config.padding_byte is None else config.padding_byte
    whole = next((length for length in _FD_LENGTHS if length >= layout.length), layout.length)
    return bytes([byte]) * (whole - layout.length)


def _bitrate_switch(profile: ProfileConfig, layout: Layout, config: MessageConfig) -> bool:
    said = (config.bitrate_switch, profile.bitrate_switch, layout.bitrate_switch)
    return next((switch for switch in said if switch is not None), True)


def _tell_once(plans: Sequence[MessagePlan]) -> tuple[MessagePlan, ...]:
    """Decode a wrapping count only from its widest signals: the low bits of it elsewhere tell less."""
    widest: dict[str, int] = {}
    for binding in (b for plan in plans for b in plan.bindings if b.wrap):
        widest[binding.quantity] = max(widest.get(binding.quantity, 0), binding.wrap)
    return tuple(
        dataclasses.replace(
            plan, told=tuple(b for b in plan.bindings if not b.wrap or b.wrap == widest[b.quantity])
        )
        for plan in plans
    )


def _require_apart(layout: Layout, bindings: Sequence[Binding], where: str) -> None:
    """Refuse two quantities on the same bits, and one quantity twice in a message unless by tables."""
    seen: dict[str, Binding] = {}
    for binding in bindings:
        other = seen.setdefault(binding.quantity, binding)
        if other is not binding and not _may_share(binding, other):
            names = f"{other.signal.name} and {binding.signal.name}"
            raise ConfigError(f"{where}: {names} both carry {binding.quantity}")
    carried = {s.name for binding in bindings for s in binding.signals}
    for pair in overlaps(layout):
        if carried.issuperset(pair):
            raise ConfigError(
                f"{where}: {pair[0]} and {pair[1]} share bits, so they cannot carry two quantities"
            )


def _may_share(binding: Binding, other: Binding) -> bool:
    if binding.wrap or binding.signal.mux_signal is not None:
        return True
    return binding.raw_of_code is not None or other.raw_of_code is not None

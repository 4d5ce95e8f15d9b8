"""Messages of a profile file bound to those of its database; every mistake in one line."""

import dataclasses
from collections.abc import Sequence
from pathlib import Path

from vsensor.codec import Database, Layout, overlaps
from vsensor.e2e import Field, Guard, guard
from vsensor.errors import ConfigError
from vsensor.profile.bind import binding_of, constant_raw, hint, signal_of, start_bits, validity_of
from vsensor.profile.binding import Binding, Validity
from vsensor.profile.compiled import MessagePlan, Profile
from vsensor.profile.config import E2eConfig, MessageConfig, ProfileConfig, SignalConfig
from vsensor.profile.send_plan import group_phases, message_plan


def compile_profile(path: Path, config: ProfileConfig, database: Database) -> Profile:
    """Return the profile at work; raises ConfigError naming file, message, signal."""
    if not config.messages:
        raise ConfigError(f"{path}: messages: at least one was expected")
    group_phases(config.groups, config.messages, str(path))
    plans = _tell_once(
        [_message(path, config, database, name, message) for name, message in config.messages.items()]
    )
    return Profile(
        name=path.stem,
        path=path,
        role=config.role,
        description=config.description,
        database=database.path,
        geometry=config.geometry,
        messages=plans,
        by_id={(p.layout.arbitration_id, p.layout.is_extended): p for p in plans},
    )


def _message(
    path: Path, profile: ProfileConfig, database: Database, name: str, config: MessageConfig
) -> MessagePlan:
    layout = database.layouts.get(name)
    if layout is None:
        near = hint(name, database.layouts)
        raise ConfigError(f"{path}: messages.{name}: not a message of {database.path}{near}")
    protection = _guard(path, layout, config.e2e) if config.e2e else None
    protecting = [config.e2e.crc, config.e2e.counter] if config.e2e else []
    bindings: list[Binding] = []
    validities: list[Validity] = []
    constants = {signal.name: start_bits(signal) for signal in layout.signals.values()}
    for signal_name, item in config.signals.items():
        where = f"{path}: {name}.{signal_name}"
        signal = signal_of(layout, signal_name, where)
        wanted = SignalConfig(quantity=item) if isinstance(item, str) else item
        if signal.name in protecting:
            raise ConfigError(f"{where}: is the CRC or counter of this message and cannot carry a value")
        _require_one_role(wanted, where)
        if wanted.quantity is not None:
            bindings.append(binding_of(profile, signal, wanted, where))
        elif wanted.valid_of is not None:
            validities.append(validity_of(signal, wanted, where))
        else:
            constants[signal.name] = constant_raw(signal, wanted, where)
    _require_apart(layout, bindings, f"{path}: {name}")
    carried = [*(b.signal.name for b in bindings), *(v.signal.name for v in validities)]
    carried += protecting
    return MessagePlan(
        layout=layout,
        sending=message_plan(path, profile, layout, config, bindings),
        bindings=tuple(bindings),
        told=tuple(bindings),
        validities=tuple(validities),
        constants={key: raw for key, raw in constants.items() if key not in carried},
        guard=protection,
    )


def _require_one_role(config: SignalConfig, where: str) -> None:
    roles = [role is not None for role in (config.quantity, config.constant, config.valid_of)]
    if sum(roles) != 1:
        raise ConfigError(f"{where}: just one of quantity, constant, valid_of was expected")


def _guard(path: Path, layout: Layout, config: E2eConfig) -> Guard:
    where = f"{path}: {layout.name}"
    name = config.profile if config.profile is not None else layout.e2e_profile
    data_id = config.data_id if config.data_id is not None else layout.e2e_data_id
    if data_id is None and name.startswith("P"):
        raise ConfigError(f"{where}: no E2EDataId in the database; give e2e.data_id")
    crc, counter = (signal_of(layout, signal, where) for signal in (config.crc, config.counter))
    try:
        return guard(
            name,
            length=layout.length,
            arbitration_id=layout.arbitration_id,
            data_id=data_id,
            checksum=Field(layout.low_bit(crc), crc.length, crc.big_endian),
            counter=Field(layout.low_bit(counter), counter.length, counter.big_endian),
        )
    except ConfigError as error:
        raise ConfigError(f"{where} ({crc.name}, {counter.name}): {error}") from None


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
        may_share = binding.wrap or binding.signal.mux_signal is not None
        may_share = may_share or (binding.raw_of_code is not None and other.raw_of_code is not None)
        if other is not binding and not may_share:
            names = f"{other.signal.name} and {binding.signal.name}"
            raise ConfigError(f"{where}: {names} both carry {binding.quantity}")
    carried = {binding.signal.name for binding in bindings}
    for pair in overlaps(layout):
        if carried.issuperset(pair):
            raise ConfigError(
                f"{where}: {pair[0]} and {pair[1]} share bits, so they cannot carry two quantities"
            )

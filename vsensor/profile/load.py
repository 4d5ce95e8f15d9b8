"""Profile files into compiled profiles; every mistake in one line that names file, message and signal."""

import dataclasses
import difflib
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path

from vsensor.codec import Database, Layout, SignalLayout, float_bits, load_database, overlaps, quantise
from vsensor.e2e import PROTECTIONS
from vsensor.errors import ConfigError
from vsensor.profile.compiled import Binding, Guard, MessagePlan, Profile, Validity
from vsensor.profile.config import E2eConfig, MessageConfig, ProfileConfig, SignalConfig
from vsensor.profile.quantities import QUANTITIES, UNITS, Quantity
from vsensor.schema import check_schema, convert, read_toml

SCHEMA = "vsensor.profile/1"
SHIPPED = Path(__file__).parents[1] / "dbc"
"""Folder of the shipped profiles and databases, in a checkout and in a wheel."""

_NS_PER_MS = 1_000_000


def shipped_profiles() -> list[str]:
    """Return the names of the profiles that come with the program."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def load_profile(name: str | Path, dbc: Path | None = None) -> Profile:
    """Load a shipped profile by name, or a file by path; `dbc` replaces the database it names.

    Raises ConfigError (file, message, signal, what was expected) or DbcError.
    """
    path = _find(name)
    config = convert(check_schema(read_toml(path), SCHEMA, str(path)), ProfileConfig, str(path))
    if dbc is None and config.database is None:
        raise ConfigError(f"{path}: maps a database that is not shipped; give it with --dbc FILE")
    database = load_database(dbc if dbc is not None else path.parent / str(config.database))
    return _Compiler(path, config, database).profile()


def load_profiles(names: Sequence[str | Path], dbc: Path | None = None) -> list[Profile]:
    """Load several profiles; of several, `dbc` goes to those that name no database of their own."""
    if len(names) == 1:
        return [load_profile(names[0], dbc)]
    return [load_profile(name, None if "database" in read_toml(_find(name)) else dbc) for name in names]


def _find(name: str | Path) -> Path:
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        return path
    shipped = SHIPPED / f"{name}.toml"
    if shipped.is_file():
        return shipped
    raise ConfigError(
        f"profile {str(name)!r}: not shipped{_hint(str(name), shipped_profiles())}; or give a file"
    )


def _hint(wrong: str, known: Iterable[str]) -> str:
    names = sorted(known)
    near = difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    return f"; did you mean {near[0]}?" if near else f"; known: {', '.join(names[:12])}"


class _Compiler:
    """Holds what every message needs while a profile is compiled."""

    def __init__(self, path: Path, config: ProfileConfig, database: Database) -> None:
        self.path, self.config, self.database = path, config, database

    def profile(self) -> Profile:
        if not self.config.messages:
            raise ConfigError(f"{self.path}: messages: at least one was expected")
        plans = _tell_once([self.message(name, message) for name, message in self.config.messages.items()])
        return Profile(
            name=self.path.stem,
            path=self.path,
            role=self.config.role,
            description=self.config.description,
            database=self.database.path,
            geometry=self.config.geometry,
            messages=plans,
            by_id={(p.layout.arbitration_id, p.layout.is_extended): p for p in plans},
        )

    def message(self, name: str, config: MessageConfig) -> MessagePlan:
        layout = self.database.layouts.get(name)
        if layout is None:
            hint = _hint(name, self.database.layouts)
            raise ConfigError(f"{self.path}: messages.{name}: not a message of {self.database.path}{hint}")
        guard = self.guard(layout, config.e2e) if config.e2e else None
        bindings: list[Binding] = []
        validities: list[Validity] = []
        constants = {signal.name: _start_bits(signal) for signal in layout.signals.values()}
        for signal_name, item in config.signals.items():
            where = f"{self.path}: {name}.{signal_name}"
            signal = _signal(layout, signal_name, where)
            wanted = SignalConfig(quantity=item) if isinstance(item, str) else item
            if guard and signal.name in (guard.crc.name, guard.counter.name):
                raise ConfigError(f"{where}: is the CRC or counter of this message and cannot carry a value")
            self.require_one_role(wanted, where)
            if wanted.quantity is not None:
                bindings.append(self.binding(signal, wanted, where))
            elif wanted.valid_of is not None:
                validities.append(_validity(signal, wanted, where))
            else:
                constants[signal.name] = _constant(signal, wanted, where)
        _require_apart(layout, bindings, f"{self.path}: {name}")
        carried = [*(b.signal.name for b in bindings), *(v.signal.name for v in validities)]
        carried += [guard.crc.name, guard.counter.name] if guard else []
        cycle_ms = config.cycle_ms if config.cycle_ms is not None else layout.cycle_ms
        delay_ms = config.start_delay_ms if config.start_delay_ms is not None else layout.start_delay_ms
        if not cycle_ms and self.config.role == "sensor":
            raise ConfigError(f"{self.path}: {name}: no cycle time in {self.database.path}; give cycle_ms")
        return MessagePlan(
            layout=layout,
            cycle_ns=round(cycle_ms * _NS_PER_MS),
            start_delay_ns=round(delay_ms * _NS_PER_MS),
            bindings=tuple(bindings),
            told=tuple(bindings),
            validities=tuple(validities),
            constants={key: raw for key, raw in constants.items() if key not in carried},
            guard=guard,
        )

    def require_one_role(self, config: SignalConfig, where: str) -> None:
        roles = [role is not None for role in (config.quantity, config.constant, config.valid_of)]
        if sum(roles) != 1:
            raise ConfigError(f"{where}: just one of quantity, constant, valid_of was expected")

    def binding(self, signal: SignalLayout, config: SignalConfig, where: str) -> Binding:
        name = str(config.quantity)
        quantity = _quantity(name, where)
        if config.factor == 0:
            raise ConfigError(f"{where}: factor = 0: a number other than 0 was expected")
        if config.sna is not None:
            if not signal.raw_min <= config.sna <= signal.raw_max:
                raise ConfigError(
                    f"{where}: sna = {config.sna}: the bits hold {signal.raw_min} to {signal.raw_max}"
                )
            signal = dataclasses.replace(signal, sna_raw=config.sna)
        mirrored = quantity.lateral and self.config.geometry.positive == "right"
        gain = config.factor * _unit_size(signal, quantity, config, where) * (-1.0 if mirrored else 1.0)
        codes, other = self.codes(signal, quantity, config, where)
        return Binding(
            signal=signal,
            quantity=name,
            gain=gain,
            bias=config.shift,
            wrap=1 << signal.length if config.wrap else 0,
            raw_of_code=codes,
            other_raw=other,
        )

    def codes(
        self, signal: SignalLayout, quantity: Quantity, config: SignalConfig, where: str
    ) -> tuple[Mapping[int, int] | None, int | None]:
        table = config.table
        if isinstance(table, str):
            if table not in self.config.tables:
                raise ConfigError(f"{where}: table {table!r} is not there{_hint(table, self.config.tables)}")
            table = self.config.tables[table]
        if table is None:
            return None, None
        known = {code.name.lower(): int(code) for code in quantity.codes or ()} or {"no": 0, "yes": 1}
        raws = {key.lower(): _raw_choice(signal, value, where) for key, value in table.items()}
        other = raws.pop("other", None)
        if wrong := [key for key in raws if key not in known and not key.isdigit()]:
            raise ConfigError(f"{where}: table has no use for {wrong[0]!r}{_hint(wrong[0], known)}")
        codes = {known[key] if key in known else int(key): raw for key, raw in raws.items()}
        missing = [name for name, code in known.items() if code not in codes]
        if missing and other is None:
            raise ConfigError(f"{where}: table lacks {', '.join(missing)} (or a value for `other`)")
        return codes, other

    def guard(self, layout: Layout, config: E2eConfig) -> Guard:
        where = f"{self.path}: {layout.name}"
        name = config.profile if config.profile is not None else layout.e2e_profile
        if name not in PROTECTIONS:
            raise ConfigError(f"{where}: e2e profile {name!r} is not known{_hint(name, PROTECTIONS)}")
        data_id = config.data_id if config.data_id is not None else layout.e2e_data_id
        if data_id is None:
            raise ConfigError(f"{where}: no E2EDataId in {self.database.path}; give e2e.data_id")
        protection = PROTECTIONS[name]
        crc = _signal(layout, config.crc, where)
        counter = _signal(layout, config.counter, where)
        offset = (crc.start - protection.crc_start) // 8
        for signal, start, bits in (
            (crc, protection.crc_start, protection.crc_bits),
            (counter, protection.counter_start, protection.counter_bits),
        ):
            if (signal.shift != start + 8 * offset and not signal.big_endian) or signal.length != bits:
                raise ConfigError(
                    f"{where}: {signal.name} has {signal.length} bits at {signal.start}, e2e {name} puts "
                    f"{bits} bits at {start + 8 * offset}"
                )
        return Guard(protection=protection, data_id=data_id, crc=crc, counter=counter, offset=offset)


def _signal(layout: Layout, name: str, where: str) -> SignalLayout:
    if name not in layout.signals:
        raise ConfigError(f"{where}: {layout.name} has no signal {name}{_hint(name, layout.signals)}")
    return layout.signals[name]


def _quantity(name: str, where: str) -> Quantity:
    if name not in QUANTITIES:
        raise ConfigError(f"{where}: quantity {name!r} is not known{_hint(name, QUANTITIES)}")
    return QUANTITIES[name]


def _unit_size(signal: SignalLayout, quantity: Quantity, config: SignalConfig, where: str) -> float:
    """Return the size of the bus's unit; without a word in the profile the database's, if it is known."""
    units = UNITS[quantity.unit]
    if config.unit is None:
        return units.get(signal.unit, 1.0)
    if config.unit not in units:
        raise ConfigError(f"{where}: unit {config.unit!r} does not fit; {', '.join(units)} were expected")
    return units[config.unit]


def _raw_choice(signal: SignalLayout, value: int | str, where: str) -> int:
    if isinstance(value, int):
        if not signal.raw_min <= value <= signal.raw_max:
            raise ConfigError(
                f"{where}: raw value {value}: the bits hold {signal.raw_min} to {signal.raw_max}"
            )
        return value
    names = {name: raw for raw, name in signal.choices.items()}
    if value not in names:
        raise ConfigError(f"{where}: the signal has no value named {value!r}{_hint(value, names)}")
    return names[value]


def _validity(signal: SignalLayout, config: SignalConfig, where: str) -> Validity:
    _quantity(str(config.valid_of), where)
    for raw in (config.valid_raw, config.invalid_raw):
        _raw_choice(signal, raw, where)
    if config.valid_raw == config.invalid_raw:
        raise ConfigError(f"{where}: valid_raw and invalid_raw are both {config.valid_raw}")
    return Validity(
        signal=signal,
        quantity=str(config.valid_of),
        valid_raw=config.valid_raw,
        invalid_raw=config.invalid_raw,
    )


def _start_bits(signal: SignalLayout) -> int:
    return float_bits(signal, math.nan)[0] if signal.is_float else int(signal.start_raw)


def _constant(signal: SignalLayout, config: SignalConfig, where: str) -> int:
    physical = float(config.constant or 0.0)
    raw, saturated = float_bits(signal, physical) if signal.is_float else quantise(signal, physical)
    if saturated:
        raise ConfigError(
            f"{where}: constant = {config.constant}: the bits hold {signal.physical(signal.raw_min):g}"
            f" to {signal.physical(signal.raw_max):g}"
        )
    return raw


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

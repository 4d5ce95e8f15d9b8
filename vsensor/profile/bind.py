"""One signal of a profile file bound to what it carries; every mistake in one line."""

import dataclasses
import difflib
import math
from collections.abc import Iterable, Mapping

from vsensor.codec import Layout, SignalLayout, float_bits, quantise
from vsensor.errors import ConfigError
from vsensor.profile.compiled import Binding, Validity
from vsensor.profile.config import ProfileConfig, SignalConfig
from vsensor.profile.quantities import QUANTITIES, UNITS, Quantity


def hint(wrong: str, known: Iterable[str]) -> str:
    """Return the end of a message: the nearest known name, or the known ones."""
    names = sorted(known)
    near = difflib.get_close_matches(wrong, names, n=1, cutoff=0.5)
    return f"; did you mean {near[0]}?" if near else f"; known: {', '.join(names[:12])}"


def signal_of(layout: Layout, name: str, where: str) -> SignalLayout:
    """Return a signal by name; raises ConfigError naming the nearest one."""
    if name not in layout.signals:
        raise ConfigError(f"{where}: {layout.name} has no signal {name}{hint(name, layout.signals)}")
    return layout.signals[name]


def quantity_of(name: str, where: str) -> Quantity:
    """Return a quantity by name; raises ConfigError naming the nearest one."""
    if name not in QUANTITIES:
        raise ConfigError(f"{where}: quantity {name!r} is not known{hint(name, QUANTITIES)}")
    return QUANTITIES[name]


def binding_of(profile: ProfileConfig, signal: SignalLayout, config: SignalConfig, where: str) -> Binding:
    """Return the binding of a signal that carries a quantity."""
    name = str(config.quantity)
    quantity = quantity_of(name, where)
    if config.factor == 0:
        raise ConfigError(f"{where}: factor = 0: a number other than 0 was expected")
    if config.sna is not None:
        if not signal.raw_min <= config.sna <= signal.raw_max:
            raise ConfigError(
                f"{where}: sna = {config.sna}: the bits hold {signal.raw_min} to {signal.raw_max}"
            )
        signal = dataclasses.replace(signal, sna_raw=config.sna)
    mirrored = quantity.lateral and profile.geometry.positive == "right"
    size = _unit_size(signal, quantity, config, where)
    if name.endswith(".heading") and size != 1.0 and profile.geometry.heading == "slope":
        raise ConfigError(f'{where}: a slope has no angular unit; give geometry.heading = "angle"')
    gain = config.factor * size * (-1.0 if mirrored else 1.0)
    codes, other = _codes(profile, signal, quantity, config, where)
    return Binding(
        signal=signal,
        quantity=name,
        gain=gain,
        bias=config.shift,
        wrap=1 << signal.length if config.wrap else 0,
        raw_of_code=codes,
        other_raw=other,
    )


def _codes(
    profile: ProfileConfig, signal: SignalLayout, quantity: Quantity, config: SignalConfig, where: str
) -> tuple[Mapping[int, int] | None, int | None]:
    table = config.table
    if isinstance(table, str):
        if table not in profile.tables:
            raise ConfigError(f"{where}: table {table!r} is not there{hint(table, profile.tables)}")
        table = profile.tables[table]
    if table is None:
        return None, None
    known = _known_codes(quantity)
    raws = {key.lower(): _raw_choice(signal, value, where) for key, value in table.items()}
    other = raws.pop("other", None)
    if wrong := [key for key in raws if key not in known and not key.isdigit()]:
        raise ConfigError(f"{where}: table has no use for {wrong[0]!r}{hint(wrong[0], known)}")
    codes = {known[key] if key in known else int(key): raw for key, raw in raws.items()}
    missing = [name for name, code in known.items() if code not in codes]
    if missing and other is None:
        raise ConfigError(f"{where}: table lacks {', '.join(missing)} (or a value for `other`)")
    return codes, other


def _known_codes(quantity: Quantity) -> dict[str, int]:
    if quantity.codes is not None:
        return {code.name.lower(): int(code) for code in quantity.codes}
    if quantity.levels > 2:
        return {str(level): level for level in range(quantity.levels)}
    return {"no": 0, "yes": 1}


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
        raise ConfigError(f"{where}: the signal has no value named {value!r}{hint(value, names)}")
    return names[value]


def validity_of(signal: SignalLayout, config: SignalConfig, where: str) -> Validity:
    """Return what a validity signal says."""
    quantity_of(str(config.valid_of), where)
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


def start_bits(signal: SignalLayout) -> int:
    """Return the raw start value (a float signal's IEEE bits)."""
    return float_bits(signal, math.nan)[0] if signal.is_float else int(signal.start_raw)


def constant_raw(signal: SignalLayout, config: SignalConfig, where: str) -> int:
    """Return the raw value of a constant; raises ConfigError if the bits do not hold it."""
    physical = float(config.constant or 0.0)
    raw, saturated = float_bits(signal, physical) if signal.is_float else quantise(signal, physical)
    if saturated:
        raise ConfigError(
            f"{where}: constant = {config.constant}: the bits hold {signal.physical(signal.raw_min):g}"
            f" to {signal.physical(signal.raw_max):g}"
        )
    return raw

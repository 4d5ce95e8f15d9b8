"""One signal of a profile file bound to what it carries; every mistake in one line."""

import dataclasses
import difflib
import math
from collections.abc import Iterable, Mapping

from vsensor.codec import Layout, SignalLayout, float_bits, quantise
from vsensor.errors import ConfigError
from vsensor.profile.binding import Binding, Validity
from vsensor.profile.config import ProfileConfig, SignalConfig
from vsensor.profile.quantities import LINES, QUANTITIES, UNITS, Quantity


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
    signal, error, init = _with_codes(signal, config, where)
    sign = _side_sign(name, quantity, where) if config.magnitude else 0.0
    mirrored = quantity.lateral and profile.geometry.positive == "right" and not sign
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
        magnitude_sign=sign,
        error_raw=error,
        init_raw=init,
    )


def _with_codes(
    signal: SignalLayout, config: SignalConfig, where: str
) -> tuple[SignalLayout, int | None, int | None]:
    """Return the signal knowing which raw values are no numbers, and those for error and init."""
    given = {key: getattr(config, key) for key in ("sna", "error", "init")}
    if signal.is_float and (wrong := [key for key, raw in given.items() if raw is not None]):
        raise ConfigError(f"{where}: {wrong[0]} is a raw integer, but this signal is a float")
    raws = {
        key: None if raw is None else _raw_choice(signal, raw, f"{where}: {key}")
        for key, raw in given.items()
    }
    reserved = tuple(raw for key, raw in raws.items() if raw is not None and key != "sna")
    sna = raws["sna"] if raws["sna"] is not None else signal.sna_raw
    if len({sna, *reserved}) > signal.raw_max - signal.raw_min:
        raise ConfigError(f"{where}: sna, error and init leave no raw value for a number")
    if config.table is not None or (sna is None and not reserved):
        return dataclasses.replace(signal, sna_raw=sna), raws["error"], raws["init"]
    return dataclasses.replace(signal, sna_raw=sna, reserved=reserved), raws["error"], raws["init"]


def _side_sign(name: str, quantity: Quantity, where: str) -> float:
    """Return the model's sign of a line's distance: the side tells what a magnitude leaves out."""
    side, _, what = name.partition(".")
    if what not in ("offset_m", "lane_offset_m") or not quantity.lateral or side == "centre":
        raise ConfigError(
            f"{where}: magnitude: the sign of {name} cannot be told from its side; "
            "offset_m and lane_offset_m of a line can"
        )
    return 1.0 if side.endswith("left") else -1.0


def _codes(
    profile: ProfileConfig, signal: SignalLayout, quantity: Quantity, config: SignalConfig, where: str
) -> tuple[Mapping[int, int] | None, int | None]:
    table = config.table
    if isinstance(table, str):
        if table not in profile.tables:
            raise ConfigError(f"{where}: table {table!r} is not there{hint(table, profile.tables)}")
        table = profile.tables[table]
    if table is None:
        if profile.role == "sensor":
            _require_room(signal, quantity, config, where)
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


def _require_room(signal: SignalLayout, quantity: Quantity, config: SignalConfig, where: str) -> None:
    """Refuse codes that would saturate: without a table they are the model's own numbers."""
    low, high = sorted((signal.physical(signal.raw_min), signal.physical(signal.raw_max)))
    if quantity.codes is None or signal.is_float:
        return
    missing = [c.name.lower() for c in quantity.codes if not low <= config.factor * c + config.shift <= high]
    if missing:
        raise ConfigError(
            f"{where}: the bits hold {low:g} to {high:g}, no room for {', '.join(missing)}; give a table"
        )


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
    """Return what a validity signal says; a line's name stands for all its quantities."""
    named = (config.valid_of,) if isinstance(config.valid_of, str) else config.valid_of or ()
    if not named:
        raise ConfigError(f"{where}: valid_of names nothing; a quantity or a line was expected")
    for name in named:
        if name not in LINES:
            quantity_of(name, where)
    for raw in (config.valid_raw, config.invalid_raw):
        _raw_choice(signal, raw, where)
    if config.valid_raw == config.invalid_raw:
        raise ConfigError(f"{where}: valid_raw and invalid_raw are both {config.valid_raw}")
    return Validity(
        signal=signal,
        of=named,
        needs=tuple(f"{name}.offset_m" if name in LINES else name for name in named),
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

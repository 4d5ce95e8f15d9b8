"""One quantity whose raw integer lies in several signals: split high and low bits, in any byte order."""

import dataclasses
from collections.abc import Sequence

from vsensor.codec import SignalLayout
from vsensor.errors import ConfigError
from vsensor.profile.bind import binding_of
from vsensor.profile.binding import Binding, Part
from vsensor.profile.config import ProfileConfig, SignalConfig


def whole_of(
    profile: ProfileConfig, items: Sequence[tuple[SignalLayout, SignalConfig]], where: str
) -> Binding:
    """Return the binding of a quantity to the signals that together carry it, each with its `bits`.

    The signal with bit 0 says scale, offset, unit and codes, the one with the highest bit whether it is
    signed. Raises ConfigError unless the bits follow each other without gap or overlap.
    """
    ordered = sorted(items, key=lambda item: _low(item[1]))
    expected = 0
    for signal, config in ordered:
        high, low = config.bits or (0, 0)
        if high - low + 1 != signal.length:
            raise ConfigError(f"{where}: bits = [{high}, {low}]: {signal.name} has {signal.length} bits")
        if low != expected:
            raise ConfigError(
                f"{where}: {signal.name} starts at bit {low} of {config.quantity}, not {expected}"
            )
        if signal.is_float:
            raise ConfigError(f"{where}: {signal.name} is a float and cannot be a part of a number")
        expected = high + 1
    (first, told), (last, _) = ordered[0], ordered[-1]
    for signal, config in ordered[1:]:
        if _says_more(config, told):
            raise ConfigError(
                f"{where}: {signal.name}: only {first.name}, which has bit 0 of {told.quantity}, says more "
                "than quantity and bits"
            )
    start = sum(
        (int(signal.start_raw) & ((1 << signal.length) - 1)) << _low(config) for signal, config in ordered
    )
    whole = dataclasses.replace(
        first,
        name="+".join(signal.name for signal, _ in reversed(ordered)),
        length=expected,
        shift=0,
        signed=last.signed,
        minimum=None,
        maximum=None,
        choices={},
        sna_raw=None,
        start_raw=start - (1 << expected) if last.signed and start >> (expected - 1) else start,
    )
    parts = tuple(Part(signal=signal, low=_low(config)) for signal, config in ordered)
    return dataclasses.replace(binding_of(profile, whole, told, where), parts=parts)


def _says_more(config: SignalConfig, told: SignalConfig) -> bool:
    """Return whether a part says more than its quantity and bits, and that not as the first part does."""
    plain = SignalConfig(quantity=config.quantity, bits=config.bits)
    return config not in (plain, _with_bits(told, config))


def _with_bits(told: SignalConfig, config: SignalConfig) -> SignalConfig:
    fields = {name: getattr(told, name) for name in told.__struct_fields__}
    return SignalConfig(**{**fields, "bits": config.bits})


def _low(config: SignalConfig) -> int:
    return config.bits[1] if config.bits is not None else 0

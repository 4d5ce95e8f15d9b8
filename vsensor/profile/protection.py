"""`e2e` of a message: its CRC and alive counter, at whatever signals they are."""

from collections.abc import Sequence

from vsensor.codec import Layout
from vsensor.e2e import Field, Guard, guard
from vsensor.errors import ConfigError
from vsensor.profile.bind import signal_of
from vsensor.profile.config import E2eConfig


def guard_of(layout: Layout, config: E2eConfig, where: str) -> Guard:
    """Return the protection of a message; raises ConfigError naming it."""
    name = config.profile if config.profile is not None else layout.e2e_profile
    if not name and config.crc is None:
        name = "counter"
    if not name:
        raise ConfigError(f"{where}: no E2EProfile in the database; give e2e.profile")
    data_id = config.data_id if config.data_id is not None else layout.e2e_data_id
    if name == "counter":
        data_id = config.data_id
    if data_id is None and name.startswith("P"):
        raise ConfigError(f"{where}: no E2EDataId in the database; give e2e.data_id")
    try:
        return guard(
            name,
            length=layout.length,
            arbitration_id=layout.arbitration_id,
            data_id=data_id,
            checksum=_field(layout, config.crc, where),
            counter=_field(layout, config.counter, where),
            counter_states=config.counter_states,
            offset=config.offset,
            data_id_mode=config.data_id_mode,
            start=config.start,
            final_xor=config.final_xor,
            skip=config.skip,
        )
    except ConfigError as error:
        if str(error).startswith(where):
            raise
        named = ", ".join(protecting(config))
        raise ConfigError(f"{where} ({named}): {error}") from None


def protecting(config: E2eConfig | None) -> Sequence[str]:
    """Return the signals that the protection fills."""
    return [] if config is None else [name for name in (config.crc, config.counter) if name is not None]


def _field(layout: Layout, name: str | None, where: str) -> Field | None:
    if name is None:
        return None
    signal = signal_of(layout, name, where)
    if signal.mux_signal is not None:
        raise ConfigError(
            f"{where}: {name} is multiplexed; a CRC or counter is in every frame of its message"
        )
    return Field(layout.low_bit(signal), signal.length, signal.big_endian)

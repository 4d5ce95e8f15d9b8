"""What a profile file says: schema "vsensor.profile/1"."""

from typing import Annotated, Literal

import msgspec

from vsensor.profile.burst_config import BurstConfig
from vsensor.profile.sending import GroupConfig, SendConfig
from vsensor.schema import Config

_HOUR_MS = 3_600_000
_Bit = Annotated[int, msgspec.Meta(ge=0, le=63)]
_DataId = Annotated[int, msgspec.Meta(ge=0, le=0xFFFFFFFF)]
_Byte = Annotated[int, msgspec.Meta(ge=0, le=255)]


class GeometryConfig(Config, frozen=True, kw_only=True):
    """`[geometry]`: how this bus describes a line, where that is not the model's way.

    `positive` to the left or right; `origin` of the polynomial on the vehicle's centreline (or
    `origin_x_m`, ahead of the rear axle); `edge` of the marking; `heading` a slope or an angle;
    `curvature` 2 c2 or the true 2 c2 / (1 + c1^2)^1.5; `range_start` measured or always zero;
    `pose` of the vehicle that a line is described from: at the exposure, or motion-compensated to the
    send time (it tells only where the output has a latency).
    """

    positive: Literal["left", "right"] = "left"
    origin: Literal["rear_axle", "front_axle", "bumper", "camera"] = "rear_axle"
    origin_x_m: Annotated[float, msgspec.Meta(ge=-5, le=15)] | None = None
    edge: Literal["centre", "inner"] = "centre"
    heading: Literal["slope", "angle"] = "slope"
    curvature: Literal["2c2", "true"] = "2c2"
    range_start: Literal["measured", "zero"] = "measured"
    pose: Literal["exposure", "send"] = "exposure"


class SignalConfig(Config, frozen=True, kw_only=True):
    """What one signal carries: just one of `quantity`, `constant` (physical) and `valid_of`.

    bus value = quantity * (size of `unit`) * `factor` + `shift`; of its magnitude alone with `magnitude`.
    `table` maps codes to raw values or value names. `wrap` counts modulo what the bits hold. `sna` is the
    raw value for "not available", `error` that of a blocked or failed sensor, `init` that of one that is
    starting. `bits` [highest, lowest] of the quantity's raw integer lie here, the others in other signals.
    A signal with `valid_of` (quantities or whole lines) is `valid_raw` while all of them have a value and
    `invalid_raw` otherwise.
    """

    quantity: str | None = None
    unit: str | None = None
    factor: float = 1.0
    shift: float = 0.0
    table: dict[str, int | str] | str | None = None
    wrap: bool = False
    sna: int | str | None = None
    error: int | str | None = None
    init: int | str | None = None
    magnitude: bool = False
    bits: tuple[_Bit, _Bit] | None = None
    constant: float | None = None
    valid_of: str | tuple[str, ...] | None = None
    valid_raw: int = 1
    invalid_raw: int = 0


class E2eConfig(Config, frozen=True, kw_only=True):
    """Protection of a message: signals of CRC and alive counter, either may be absent.

    `profile` (an AUTOSAR profile or a plain checksum), `data_id` (one, or a list): if the DBC has none.
    `counter_states`: values that the counter runs through, without a word all that its bits hold or what
    the AUTOSAR profile says. The others: see `vsensor.e2e.guard`.
    """

    crc: str | None = None
    counter: str | None = None
    profile: str | None = None
    data_id: _DataId | tuple[_DataId, ...] | None = None
    counter_states: Annotated[int, msgspec.Meta(ge=1)] | None = None
    data_id_mode: str | None = None
    offset: Annotated[int, msgspec.Meta(ge=0, le=63)] | None = None
    start: Annotated[int, msgspec.Meta(ge=0)] | None = None
    final_xor: Annotated[int, msgspec.Meta(ge=0)] | None = None
    skip: tuple[Annotated[int, msgspec.Meta(ge=0, le=63)], ...] = ()


class MessageConfig(Config, frozen=True, kw_only=True):
    """One message: its signals (a string is short for a quantity), protection, timing if the DBC has none.

    `mux`: the pages of a multiplexed message leave together, or one after another from time to time.
    `padding_byte` and `bitrate_switch`: see ProfileConfig.
    """

    signals: dict[str, SignalConfig | str] = msgspec.field(default_factory=dict)
    e2e: E2eConfig | None = None
    cycle_ms: Annotated[float, msgspec.Meta(ge=1, le=_HOUR_MS)] | None = None
    start_delay_ms: Annotated[float, msgspec.Meta(ge=0, le=_HOUR_MS)] | None = None
    send: SendConfig | None = None
    mux: Literal["together", "rotate"] = "together"
    padding_byte: _Byte | None = None
    bitrate_switch: bool | None = None


class ProfileConfig(Config, frozen=True, kw_only=True):
    """A whole profile. `role` "sensor": what the sensor sends; "vehicle": what it listens to.

    `node`: all messages of this sender are sent, those that are not named with their start values.
    `padding_byte` fills a CAN FD message up to a length that CAN FD has; `bitrate_switch` of CAN FD
    messages, without a word what the DBC says, else on. A declared range that the bits cannot hold is
    refused when sending, or saturates as `wide_ranges` says.
    """

    messages: dict[str, MessageConfig] = msgspec.field(default_factory=dict)
    description: str = ""
    role: Literal["sensor", "vehicle"] = "sensor"
    database: str | None = None
    geometry: GeometryConfig = GeometryConfig()
    node: str | None = None
    padding_byte: _Byte = 0
    bitrate_switch: bool | None = None
    wide_ranges: Literal["refuse", "saturate"] = "refuse"
    bursts: dict[str, BurstConfig] = msgspec.field(default_factory=dict)
    groups: dict[str, GroupConfig] = msgspec.field(default_factory=dict)
    tables: dict[str, dict[str, int | str]] = msgspec.field(default_factory=dict)

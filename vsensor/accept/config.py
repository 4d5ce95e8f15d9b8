"""The limits that a stream is judged by: schema "vsensor.accept/1", every key has a default."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from vsensor.accept.kinds import Kind
from vsensor.e2e import ReceiverConfig
from vsensor.errors import ConfigError
from vsensor.schema import Config, check_schema, convert, read_toml

SCHEMA = "vsensor.accept/1"

_Millis = Annotated[float, msgspec.Meta(ge=0, le=3_600_000)]
_Metres = Annotated[float, msgspec.Meta(ge=0, le=1000)]
_Count = Annotated[int, msgspec.Meta(ge=0)]


class LimitsConfig(Config, frozen=True, kw_only=True):
    """What still passes.

    An interval may last `cycle_ms` * (1 + `cycle_tolerance`) + `jitter_ms`; longer ones are late frames if
    the stream is back on time within `settle_frames`, else frames are missing. `timestamps` "batched": the
    recorder stamps frames in batches, so late ones are its own; "auto" finds that out. `burst_ms` is the
    longest pause within a burst, `image_ms` the time from image to image, for which the `..._step` limits
    hold. Lines are compared while they begin before `near_m` with `least_quality` or more; a step of the
    offset as wide as a lane (`lane_width_m`) is a lane change where the bus does not tell those. `ranges`:
    whether declared ranges of signals count. `allow`: how many of a kind pass, in each message.
    """

    timestamps: Literal["auto", "exact", "batched"] = "auto"
    cycle_tolerance: Annotated[float, msgspec.Meta(ge=0, le=0.5)] = 0.1
    jitter_ms: _Millis = 5.0
    settle_frames: Annotated[int, msgspec.Meta(ge=1, le=1000)] = 16
    burst_ms: _Millis = 10.0
    image_ms: Annotated[float, msgspec.Meta(gt=0, le=10_000)] = 40.0
    frozen_ms: _Millis = 200.0
    stuck_images: Annotated[int, msgspec.Meta(ge=2)] = 25
    offset_step_m: _Metres = 0.5
    heading_step: Annotated[float, msgspec.Meta(ge=0)] = 0.1
    curvature_step_per_m: Annotated[float, msgspec.Meta(ge=0)] = 0.02
    width_step_m: _Metres = 0.5
    near_m: Annotated[float, msgspec.Meta(ge=-100, le=1000)] = 12.0
    least_quality: Annotated[int, msgspec.Meta(ge=0, le=4)] = 2
    lane_width_m: tuple[_Metres, _Metres] = (2.0, 5.5)
    lane_width_error_m: _Metres = 0.05
    ranges: bool = True
    bitrate_kbps: Annotated[float, msgspec.Meta(gt=0, le=10_000)] = 500.0
    receiver: ReceiverConfig = ReceiverConfig()
    allow: dict[Kind, _Count] = msgspec.field(default_factory=dict)

    def ns(self, name: str) -> int:
        """Return a limit that is a time, in nanoseconds."""
        return round(float(getattr(self, name)) * 1e6)


def load_limits(path: Path | None) -> LimitsConfig:
    """Read a limits file; the defaults without one. Raises ConfigError naming file and key."""
    if path is None:
        return LimitsConfig()
    limits = convert(check_schema(read_toml(path), SCHEMA, str(path)), LimitsConfig, str(path))
    if limits.lane_width_m[0] > limits.lane_width_m[1]:
        shown = list(limits.lane_width_m)
        raise ConfigError(f"{path}: lane_width_m = {shown}: the least and the greatest width were expected")
    return limits

"""What a scan is told: thresholds in a TOML file (schema "vsensor.scan/1"), the rest on the command line."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec

from vsensor.camera import CameraConfig
from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.signals import VehicleConfig

SCHEMA = "vsensor.scan/1"
_Seconds = Annotated[float, msgspec.Meta(ge=0, le=3600)]
_Metres = Annotated[float, msgspec.Meta(ge=0, le=1000)]


class ScanLimits(Config, frozen=True, kw_only=True):
    """`--limits FILE`: what is masked, how the reference is made; keys that are left out keep their defaults.

    Masked: below `low_speed_kmh`; `lane_change_s` around a lane change, which is told by the sensor or by an
    offset that jumps by `offset_jump_m`; `reset_s` after a reset of sensor or clock. Offsets make a reference
    where they are measured with `reference_quality` (0 to 4) and not farther apart than `reference_gap_m`;
    they are smoothed over `smooth_m` of the way (0: not at all). A vehicle signal that is silent for
    `silence_s` leaves the path unknown. `yaw_rate_offset_degps` is taken off, "auto" estimates it;
    `speed_factor` multiplies the speed. `image_clock`: an image's time is when its first frame was recorded,
    that "smoothed" by the image's own time stamp, or the time stamp of a "sensor" that runs on the recorder's
    clock; less `latency_ms` but for the last. `camera_x_m` ahead of the rear axle and `vehicle` are needed
    where the profile has its origin there.
    """

    low_speed_kmh: Annotated[float, msgspec.Meta(ge=0, le=300)] = 15.0
    lane_change_s: _Seconds = 2.0
    offset_jump_m: Annotated[float, msgspec.Meta(gt=0, le=10)] = 0.6
    reset_s: _Seconds = 2.0
    reference_quality: Annotated[int, msgspec.Meta(ge=0, le=4)] = 2
    reference_gap_m: Annotated[float, msgspec.Meta(gt=0, le=1000)] = 15.0
    smooth_m: _Metres = 10.0
    silence_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 1.0
    yaw_rate_offset_degps: Annotated[float, msgspec.Meta(ge=-20, le=20)] | Literal["auto"] = "auto"
    speed_factor: Annotated[float, msgspec.Meta(ge=0.5, le=2)] = 1.0
    image_clock: Literal["recorder", "smoothed", "sensor"] = "smoothed"
    latency_ms: Annotated[float, msgspec.Meta(ge=0, le=2000)] = 0.0
    camera_x_m: Annotated[float, msgspec.Meta(ge=-5, le=15)] = CameraConfig().position_m[0]
    vehicle: VehicleConfig = VehicleConfig()


def load_scan_limits(path: Path | None) -> ScanLimits:
    """Read a limits file, the defaults without one; raises ConfigError."""
    if path is None:
        return ScanLimits()
    return convert(check_schema(read_toml(path), SCHEMA, str(path)), ScanLimits, str(path))

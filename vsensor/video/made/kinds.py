"""The two data sets of P2 as cameras: Eyes on Road (tables 2.1 to 2.3) and Lytx (2.5, 2.6)."""

from collections.abc import Mapping
from typing import Any, Literal, NamedTuple

import numpy as np

from vsensor.signals import VehicleConfig

VEHICLE = VehicleConfig(wheelbase_m=2.776, width_m=1.87)
"""A Volvo V60 of 2014, the vehicle of P2's data: its wheelbase and width."""

BEHIND_AXLE_M = 1.0
"""The camera is so far behind the front axle (P2 2.5.2.2.4)."""


class Kind(NamedTuple):
    """A kind of events: frames per second, channels, intrinsics, and how exactly its mount is known."""

    rate_hz: int
    channels: Literal["grey", "rgb"]
    intrinsics: Mapping[str, float]
    is_mount_known: bool


KINDS: Mapping[str, Kind] = {
    "eor": Kind(
        rate_hz=10,
        channels="grey",
        # 355 columns in P2; a video file has even sizes, so there is one more at the right.
        intrinsics={
            "width_px": 356,
            "height_px": 288,
            "fx_px": 255.82,
            "fy_px": 280.99,
            "cx_px": 179.39,
            "cy_px": 143.19,
        },
        is_mount_known=True,
    ),
    "lytx": Kind(
        rate_hz=4,
        channels="rgb",
        intrinsics={
            "width_px": 620,
            "height_px": 352,
            "fx_px": 534.00,
            "fy_px": 522.99,
            "cx_px": 313.90,
            "cy_px": 174.68,
        },
        is_mount_known=False,
    ),
}


def camera_table(kind: Kind, rng: np.random.Generator) -> dict[str, Any]:
    """Return the `[camera]` of one event, as it truly stands.

    Eyes on Road: 1.36 m up, 0.19 m to the left (P2 names no side), no angles (table 2.2). Lytx: unknown and
    different from video to video, so it is drawn.
    """
    x_m = round(VEHICLE.wheelbase_m - BEHIND_AXLE_M, 3)
    if kind.is_mount_known:
        return {**kind.intrinsics, "position_m": [x_m, 0.19, 1.36]}
    left_m, up_m = rng.uniform(-0.25, 0.25), rng.uniform(1.2, 1.6)
    angles = dict(zip(("roll_deg", "pitch_deg", "yaw_deg"), rng.normal(0.0, (0.3, 1.0, 0.7)), strict=True))
    return {
        **kind.intrinsics,
        "position_m": [x_m, round(left_m, 3), round(up_m, 3)],
        **{key: round(float(value), 2) for key, value in angles.items()},
    }

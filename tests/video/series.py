"""CAN logs as their series, without a file."""

from pathlib import Path

import numpy as np

from vsensor.video.can_signals import CanSignals


def can(seconds, step_s=0.1, **columns):
    """Return a log of 20 m/s in a lane of 3.5 m; `columns` (dots as __) differ: numbers or (N,)."""
    t = np.arange(round(seconds / step_s) + 1) * step_s
    values = {
        "left.lane_offset_m": 1.75,
        "right.lane_offset_m": -1.75,
        "lane.width_m": 3.5,
        "left.quality": 4.0,
        "right.quality": 4.0,
        "sensor.light": 0.0,
        "ego.speed_mps": 20.0,
        "ego.yaw_rate_radps": 0.0,
        "ego.acceleration_mps2": 0.0,
        **{name.replace("__", "."): value for name, value in columns.items()},
    }
    series = {name: (t, np.broadcast_to(value, t.shape).astype(float)) for name, value in values.items()}
    return CanSignals(path=Path("made.blf"), seconds=float(t[-1]), series=series)

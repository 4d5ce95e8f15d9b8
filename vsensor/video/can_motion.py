"""How the vehicle moved when the pictures were taken, as a CAN log says it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.profile import Profile
from vsensor.types import Array
from vsensor.video.can_signals import read_can
from vsensor.video.types import Motion

QUANTITIES = {
    "speed_mps": "ego.speed_mps",
    "yaw_rate_radps": "ego.yaw_rate_radps",
    "acceleration_mps2": "ego.acceleration_mps2",
}


def read_motions(log: Path, profiles: Sequence[Profile], t_s: Array) -> list[Motion]:
    """Return the motion at the times (N,) of pictures, which count from the log's first frame.

    Raises LogError where the log has none of the quantities, or none of the time.
    """
    signals = read_can(log, profiles)
    signals.require_overlap(float(t_s[0]), float(t_s[-1]))
    found = {field: signals.linear(name, t_s) for field, name in QUANTITIES.items()}
    if not any(np.isfinite(values).any() for values in found.values()):
        raise LogError(f"{log}: says nothing of {', '.join(QUANTITIES.values())} during the video")
    rows = zip(*(values.tolist() for values in found.values()), strict=True)
    return [Motion(**dict(zip(found, row, strict=True))) for row in rows]

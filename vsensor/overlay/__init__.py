"""A lane sensor that comes onto the traffic of a car which has none: computed image by image, when asked.

A replay (`vsensor replay --overlay`) asks along the log's times, a gateway along the bus's.
"""

from vsensor.overlay.build import camera_keys, heard_keys, synth_of, vehicle_profiles
from vsensor.overlay.desk import KEPT, Desk, Elsewhere, Here
from vsensor.overlay.moved_frames import LATERAL, MovedFrames
from vsensor.overlay.synth import Made, Synth, Wish
from vsensor.overlay.taking_over import TakingOver

__all__ = [
    "KEPT",
    "LATERAL",
    "Desk",
    "Elsewhere",
    "Here",
    "Made",
    "MovedFrames",
    "Synth",
    "TakingOver",
    "Wish",
    "camera_keys",
    "heard_keys",
    "synth_of",
    "vehicle_profiles",
]

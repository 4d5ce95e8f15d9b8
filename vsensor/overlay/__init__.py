"""A lane sensor that comes onto the traffic of a car which has none: computed image by image, when asked.

A replay (`vsensor replay --overlay`) asks along the log's times, a gateway along the bus's.
"""

from vsensor.overlay.build import camera_keys, heard_keys, synth_of
from vsensor.overlay.desk import KEPT, Desk, Elsewhere, Here
from vsensor.overlay.synth import Made, Synth, Wish

__all__ = [
    "KEPT",
    "Desk",
    "Elsewhere",
    "Here",
    "Made",
    "Synth",
    "Wish",
    "camera_keys",
    "heard_keys",
    "synth_of",
]

"""What passes between the parts of the video package.

frames            method                    rows                    outputs
Picture ────────► LaneEstimate ───────────► offset at the front ──► Parquet, CSV, MF4
  + Motion        (lines in the ego frame,  axle, width, heading,   CAN frames through a profile
  (from CAN,      quality = confidence      confidence
   if there is)   0 to 4)
"""

from dataclasses import dataclass
from typing import Protocol, TypeVar

import numpy as np
from numpy.typing import NDArray

from vsensor.types import LaneEstimate

State = TypeVar("State")


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """One frame of a video as it was recorded, distortion and all.

    `grey` (H, W) and `bgr` (H, W, 3) are levels 0 to 255; a video without colour has no `bgr`. `t_ns` counts
    from the video's beginning, by its own timestamps where it has them, else by its rate.
    """

    index: int
    t_ns: int
    grey: NDArray[np.uint8]
    bgr: NDArray[np.uint8] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What CAN says of the vehicle when a picture was taken; NaN where it says nothing."""

    speed_mps: float = float("nan")
    yaw_rate_radps: float = float("nan")
    acceleration_mps2: float = float("nan")


class Method(Protocol[State]):
    """A way from pictures to lines; all memory between pictures is in the state."""

    def begin(self) -> State:
        """Return the state before the first picture."""
        ...

    def look(self, state: State, picture: Picture, motion: Motion) -> tuple[State, LaneEstimate]:
        """Return the lines of one picture: ego frame, centres of the markings, quality 0 to 4.

        A side that is not seen is not in the estimate.
        """
        ...

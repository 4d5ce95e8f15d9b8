"""What tuning is asked for, and what it gives."""

from dataclasses import dataclass, field

import numpy as np

from vsensor.error_model import ErrorLibrary, ErrorModel
from vsensor.field.tune.blocks import BlockSums
from vsensor.field.tune.loop import Closed
from vsensor.field.tune.surface import (
    Intervals,
)
from vsensor.field.tune.survey import Survey
from vsensor.field.virtual import FitSetting
from vsensor.types import Array

LEVELS = (0.5, 0.8, 0.9, 0.95, 0.97, 0.99)
SHOWN_M = 20.0
"""Range of the picture over speed, as P1's fig. 3.10."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneOptions:
    """What the command line says. A cell with less than `least_seconds` of driving is blind."""

    levels: tuple[float, ...] = LEVELS
    by: str = ""
    step_mps: float = 0.5
    order: int = 10
    cutoff_s_per_m: float = 0.2
    region_level: float = 0.95
    block_s: float = 60.0
    least_seconds: float = 60.0
    close_loop: bool = True
    setting: FitSetting = field(default_factory=FitSetting)
    seed: int = 0
    scheduler: str | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """One condition's model with what is told about it.

    `unfiltered_m` (L, V): quantiles of each speed alone, before the low-pass, at the range `SHOWN_M`.
    """

    name: str
    model: ErrorModel
    spread: Intervals
    closed: Closed | None
    sums: BlockSums
    place: int
    unfiltered_m: Array


@dataclass(frozen=True, slots=True, kw_only=True)
class Tuned:
    """What tuning found; `skipped` are combinations of conditions that the table does not have.

    `block_s` is how long the blocks were that the intervals come from.
    """

    library: ErrorLibrary
    conditions: tuple[Condition, ...]
    skipped: tuple[str, ...]
    survey: Survey
    block_s: float


def shown_row(model: ErrorModel) -> int:
    """Return the place of the range whose course over speed is shown."""
    return int(np.argmin(np.abs(model.range_m - SHOWN_M)))

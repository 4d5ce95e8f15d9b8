"""Random numbers that depend on (seed, stage, tick) and nothing else.

A repositioned Philox costs 2 us where `default_rng([seed, stage, tick])` costs 37 us, and any tick
can be drawn without the ones before it, so a run restarts at any tick with the same numbers.
"""

from enum import IntEnum

import numpy as np


class Stage(IntEnum):
    """The stage that draws; numbers are part of the recorded runs and are never reused."""

    SOURCE = 1
    CAMERA = 2
    REGION = 3
    ERROR_MODEL = 4
    FAULTS = 5
    IMAGE = 6
    REPORT = 7


class Draws:
    """A generator that is placed, not advanced: `at(stage, tick)` always gives the same stream."""

    def __init__(self, seed: int) -> None:
        """Keep one Philox for the run; `seed` is any integer from 0 to 2^64 - 1."""
        self._bits = np.random.Philox(key=np.array([seed & 0xFFFF_FFFF_FFFF_FFFF, 0], np.uint64))
        self._state = self._bits.state  # of the start: no word left over in its buffer
        self._generator = np.random.Generator(self._bits)

    def at(self, stage: Stage, tick_index: int, part: int = 0) -> np.random.Generator:
        """Return the generator placed at the start of the stream of (seed, stage, tick, part).

        `part` separates what must not depend on each other's presence, such as the lines of an
        image. The object is shared: use it up before the next call.
        """
        state = self._state
        state["state"]["counter"][:] = (0, part & 0xFFFF_FFFF_FFFF_FFFF, int(stage), tick_index)
        self._bits.state = state
        return self._generator

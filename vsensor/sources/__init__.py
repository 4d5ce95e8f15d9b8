"""Where snapshots come from: a drive over a map, a recorded drive.

A source is a value machine: `advance(state, tick, inputs)` returns the next state and the truth at
`tick.t_ns`, or None in place of the truth when the road or the recording has ended.
"""

from collections.abc import Sequence
from typing import Any, Protocol

from vsensor.types import Frame, Snapshot, Tick

Inputs = Sequence[Frame]
"""What came from the bus since the last tick."""


class Source(Protocol):
    """Gives the truth, tick by tick; the state may be saved and the run restarted from it.

    `notes` say what was loaded, `findings` what is wrong with it, as sentences; `duration_s` may be inf.
    """

    @property
    def notes(self) -> tuple[str, ...]:
        """What was loaded."""
        ...

    @property
    def findings(self) -> tuple[str, ...]:
        """What is wrong with it."""
        ...

    @property
    def duration_s(self) -> float:
        """Time until the drive ends."""
        ...

    def initial_state(self) -> Any:
        """Return the state before the first tick."""
        ...

    def advance(self, state: Any, tick: Tick, inputs: Inputs) -> tuple[Any, Snapshot | None]:
        """Return the new state and the truth at `tick.t_ns`; None once the drive has ended."""
        ...

    def remarks(self, state: Any) -> tuple[str, ...]:
        """Say what went wrong on the way, for the end of a run."""
        ...


MAP_SUFFIXES = (".xodr",)
STORY_SUFFIXES = (".xosc",)
LOG_SUFFIXES = (".log", ".asc", ".blf", ".mf4", ".trc", ".csv", ".gz")

__all__ = ["LOG_SUFFIXES", "MAP_SUFFIXES", "STORY_SUFFIXES", "Inputs", "Source"]

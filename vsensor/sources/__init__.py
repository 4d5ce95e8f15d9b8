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
    """Gives the truth, tick by tick; the state may be saved and the run restarted from it."""

    def initial_state(self) -> Any:
        """Return the state before the first tick."""
        ...

    def advance(self, state: Any, tick: Tick, inputs: Inputs) -> tuple[Any, Snapshot | None]:
        """Return the new state and the truth at `tick.t_ns`; None once the drive has ended."""
        ...


MAP_SUFFIXES = (".xodr",)
LOG_SUFFIXES = (".log", ".asc", ".blf", ".mf4", ".trc", ".csv", ".gz")

SOURCES = {
    "map": "vsensor.sources.map_drive:MapDrive",
    "log": "vsensor.sources.drive:RecordedDrive",
}
"""Kind of source -> "module:Class"; the kind follows from the suffix of the scenario's `source`."""

__all__ = ["LOG_SUFFIXES", "MAP_SUFFIXES", "SOURCES", "Inputs", "Source"]

"""A drive over a map as a source that is laid over: it hears what is played or passed on."""

from dataclasses import dataclass, replace
from typing import Any

from vsensor.overlay.synth import Wish
from vsensor.sources import Inputs
from vsensor.sources.driven import DrivenDrive
from vsensor.sources.live import LiveDrive
from vsensor.sources.map_drive import MapDrive
from vsensor.types import EgoState, Scene, Snapshot, Tick

ENDED = "the route has ended: nothing is seen beyond it"


@dataclass(frozen=True, slots=True, kw_only=True)
class OnMapState:
    """The drive's own state; the vehicle as it was seen last; whether the route has ended."""

    drive: Any
    ego: EgoState
    has_ended: bool = False


class OnMap:
    """The source: a map, and the vehicle that the frames (or the scenario alone) move on it."""

    def __init__(self, drive: LiveDrive | DrivenDrive | MapDrive) -> None:
        self.drive = drive

    @property
    def notes(self) -> tuple[str, ...]:
        """Where the drive begins and what is listened to."""
        return self.drive.notes

    @property
    def findings(self) -> tuple[str, ...]:
        """What was found in the map."""
        return self.drive.findings

    @property
    def duration_s(self) -> float:
        """For ever: beyond the route's end nothing is seen."""
        return float("inf")

    def initial_state(self) -> OnMapState:
        """Return the state before the first tick."""
        return OnMapState(drive=self.drive.initial_state(), ego=self.drive.start())

    def placed(self, state: OnMapState, wish: Wish) -> OnMapState:
        """Return the state; where the log begins again, the vehicle is back at the start."""
        return self.initial_state() if wish.is_start and wish.is_cut else state

    def steering(self, state: OnMapState) -> float | None:
        """Return None: what is heard moves the vehicle."""
        return None

    def remarks(self, state: OnMapState) -> tuple[str, ...]:
        """Say what went wrong on the way."""
        said = self.drive.remarks(state.drive)
        return (*said, ENDED) if state.has_ended else said

    def advance(self, state: OnMapState, tick: Tick, inputs: Inputs) -> tuple[OnMapState, Snapshot]:
        """Return the truth at the tick; beyond the route's end a place without markings."""
        after, snapshot = self.drive.advance(state.drive, tick, inputs)
        if snapshot is None:
            ego = replace(state.ego, t_ns=tick.t_ns)
            return OnMapState(drive=after, ego=ego, has_ended=True), Snapshot(
                t_ns=tick.t_ns, ego=ego, scene=Scene(markings=())
            )
        return OnMapState(drive=after, ego=snapshot.ego, has_ended=state.has_ended), snapshot

"""Recorded drives as CAN traffic: a log, or a part of it, on its own times onto one or more buses."""

from typing import TYPE_CHECKING

from vsensor.replay.options import ReplayOptions
from vsensor.replay.outputs import Outputs
from vsensor.replay.player import Player, played
from vsensor.replay.reading import Cut, survey
from vsensor.replay.reel import Reel
from vsensor.replay.report import Report
from vsensor.replay.session import replay_log
from vsensor.replay.stages import Stage

if TYPE_CHECKING:
    from vsensor.replay.repair import Repair
    from vsensor.replay.translate import Translate

__all__ = [
    "Cut",
    "Outputs",
    "Player",
    "Reel",
    "Repair",
    "ReplayOptions",
    "Report",
    "Stage",
    "Translate",
    "played",
    "replay_log",
    "survey",
]


def __getattr__(name: str) -> object:
    """Import what knows profiles when it is asked for: a log is played without."""
    if name == "Repair":
        from vsensor.replay.repair import Repair

        return Repair
    if name == "Translate":
        from vsensor.replay.translate import Translate

        return Translate
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

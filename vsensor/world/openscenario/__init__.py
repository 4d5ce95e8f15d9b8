"""OpenSCENARIO 1.x: a storyboard read from its file, and played as a value machine."""

from vsensor.world.openscenario.bodies import Body, Motion, motion_of, spot_of
from vsensor.world.openscenario.boxes import boxes_near
from vsensor.world.openscenario.load import load_story
from vsensor.world.openscenario.machine import Machine
from vsensor.world.openscenario.model import Story
from vsensor.world.openscenario.state import STEP_NS, StoryState
from vsensor.world.openscenario.tracks import Tracks
from vsensor.world.openscenario.work import Work

__all__ = [
    "STEP_NS",
    "Body",
    "Machine",
    "Motion",
    "Story",
    "StoryState",
    "Tracks",
    "Work",
    "boxes_near",
    "load_story",
    "motion_of",
    "spot_of",
]

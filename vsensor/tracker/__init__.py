"""The tracker: which line is left, right, next left, next right, and where one is that is not seen.

   seen `confirm_images` times          not seen               share used up, or behind
new ─────────────────────────► confirmed ────────► coasted ─────────────────────────────► dropped
 │  (a miss takes one back)    reported:  ◄──────── reported: predicted, moved by
 └► forgotten, memory_s        measured   matched   speed and yaw rate, quality falls
"""

from vsensor.tracker.assign import Assignment, assign
from vsensor.tracker.config import TrackerConfig
from vsensor.tracker.state import Track, TrackerState, initial_state

__all__ = ["Assignment", "Track", "TrackerConfig", "TrackerState", "assign", "initial_state"]

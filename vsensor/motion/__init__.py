"""How the body moves on its springs and shakes, and the camera with it."""

from vsensor.motion.config import BumpConfig, MotionConfig
from vsensor.motion.recording import Recording, load_recording
from vsensor.motion.stage import Motion, MotionState, advance, initial_state, load_motion
from vsensor.motion.vibration import PRESETS_MRAD, Vibration

__all__ = [
    "PRESETS_MRAD",
    "BumpConfig",
    "Motion",
    "MotionConfig",
    "MotionState",
    "Recording",
    "Vibration",
    "advance",
    "initial_state",
    "load_motion",
    "load_recording",
]

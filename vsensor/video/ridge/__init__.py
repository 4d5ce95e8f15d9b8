"""Our own method: paint looked for on the road, lines fitted together, pitch from where they meet.

picture ──► grid on the road ──► stripes ──► lines of one road ──► fit of all ──► sides ──► LaneEstimate
            ground.py            paint.py    search.py             road.py        lines.py, vsensor.tracker
"""

from vsensor.video.ridge.confidence import BOUNDS_M
from vsensor.video.ridge.config import RidgeConfig
from vsensor.video.ridge.method import Look, Ridge, RidgeState

__all__ = ["BOUNDS_M", "Look", "Ridge", "RidgeConfig", "RidgeState"]

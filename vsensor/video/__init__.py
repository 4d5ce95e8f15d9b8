"""Lane offset from a front video: pictures to lane estimates, and what they are worth against CAN (P2)."""

from vsensor.video.types import Method, Motion, Picture

__all__ = ["Method", "Motion", "Picture"]

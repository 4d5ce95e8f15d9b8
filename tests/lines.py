"""Line points for tests of the stages that need nothing else."""

import numpy as np

from vsensor.types import EgoState, LinePoints, Tick, frozen


def line_points(*lines):
    """Return LinePoints of lines given as (x, y) arrays."""
    lengths = [len(x) for x, _ in lines]
    xyz = [np.column_stack([x, y, np.zeros(len(x))]) for x, y in lines]
    return LinePoints(
        marking=frozen(np.arange(len(lines)), np.int64),
        starts=frozen(np.concatenate([[0], np.cumsum(lengths)]), np.int64),
        index=frozen(np.concatenate([np.arange(n) for n in lengths] or [[]]), np.int64),
        points_ego_m=frozen(np.concatenate(xyz) if xyz else np.zeros((0, 3))),
    )


def points_of(lines, k):
    """Return the points (N, 3) of line k."""
    return lines.points_ego_m[lines.starts[k] : lines.starts[k + 1]]


def tick(index, period_ns=40_000_000):
    return Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)


def ego(speed_mps=30.0, yaw_rate_radps=0.0):
    return EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=speed_mps, yaw_rate_radps=yaw_rate_radps)

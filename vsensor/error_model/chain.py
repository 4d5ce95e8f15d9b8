"""Markov chains of few states, stepped by one uniform number each."""

from bisect import bisect_right

import numpy as np

from vsensor.types import NANOSECONDS_PER_SECOND, Array, IntArray, Tick, frozen


def stationary(step: Array) -> Array:
    """Return the share (N,) of each state in the long run; `step` (N, N) has rows that sum to 1."""
    size = len(step)
    if size == 0:
        return frozen(np.zeros(0))
    equations = np.vstack([step.T - np.eye(size), np.ones(size)])
    share = np.linalg.lstsq(equations, np.append(np.zeros(size), 1.0), rcond=None)[0]
    share = np.maximum(share, 0.0)
    return frozen(share / share.sum())


def steps_between(before: int, tick: Tick, period_s: float) -> int:
    """Return how many steps of a chain with this period fall after tick `before`, up to `tick`."""
    period_ns = max(round(period_s * NANOSECONDS_PER_SECOND), 1)
    return tick.index * tick.period_ns // period_ns - before * tick.period_ns // period_ns


def drawn(share: Array, uniform: Array) -> IntArray:
    """Return states (K,) drawn from one distribution (N,) or one a row (K, N)."""
    states: IntArray = (uniform[:, None] >= share.cumsum(axis=-1)).sum(axis=1)
    return np.asarray(np.minimum(states, share.shape[-1] - 1))


def below(step: Array) -> tuple[list[float], ...]:
    """Return for each state the sums of the steps to a state and all below it, as `once` reads them."""
    return tuple(step.cumsum(axis=-1).tolist())


def once(below: tuple[list[float], ...], state: int, uniform: float) -> int:
    """Return the state after one step: `stepped` for a single number, in a tenth of the time."""
    last = len(below) - 1
    return min(bisect_right(below[min(state, last)], uniform), last)


def stepped(step: Array, states: IntArray, count: int, uniform: Array) -> IntArray:
    """Return the states (K,) after `count` steps, drawn by `uniform` (K,); none drawn without a step."""
    if count <= 0:
        return states
    matrix = step if count == 1 else np.linalg.matrix_power(step, count)
    return drawn(matrix[np.minimum(states, len(step) - 1)], uniform)

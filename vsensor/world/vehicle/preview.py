"""Steering gains of a driver who looks ahead: discrete linear quadratic control with preview.

    state x     lateral speed, yaw rate, front wheels, offset and heading from the path, wheels asked for
    control u   change of the wheels asked for, once a period
    ahead d_i   by how much the path turns in each period to come, i = 0, 1, ...

    cost        offset^2 + 3 (offset')^2 / w^2 + 3 (offset'')^2 / w^4 + (lateral jerk)^2 / w^6

A vehicle that goes sideways as it is asked to has with this cost three real poles at -w: it comes back to the
path without swinging over it. Nothing of the cost is left in a steady bend, so it is followed without an
offset. The optimal control is u = -K x - sum_i g_i d_i, the path going on as it last turned beyond what is
seen. R. S. Sharp, V. Valtetsis, Optimal preview car steering control, 2001, is the same with other costs.
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array
from vsensor.world.vehicle.single_track import SingleTrack

STATES = 6
LATERAL, YAW_RATE, WHEELS, OFFSET, HEADING, ASKED = range(STATES)
SHORTEST_LAG_S = 1e-3
"""Wheels that follow at once are given this lag: a thousandth of a driver's time changes no gain."""


@dataclass(frozen=True, slots=True, eq=False)
class Gains:
    """At one speed: `feedback` (STATES,), `preview` (N,) of the turns ahead, `pull` of the road's tilt."""

    feedback: Array
    preview: Array
    pull: float


def gains_at(vehicle: SingleTrack, speed_mps: float, period_s: float, count: int, quickness: float) -> Gains:
    """Return the gains at a speed for `count` periods of preview; `quickness` is w, rad/s."""
    from scipy.linalg import solve_discrete_are

    a, b, e, w = _plant(vehicle, speed_mps, period_s)
    c, d, f, g = _cost(vehicle, speed_mps, period_s, quickness)
    p = solve_discrete_are(a, b, c.T @ c, d.T @ d, s=c.T @ d)
    inner = 1.0 / float((d.T @ d + b.T @ p @ b)[0, 0])
    feedback = inner * (d.T @ c + b.T @ p @ a)
    closed = a - b @ feedback
    kept = c - d @ feedback

    def first_and_later(into: Array, costs: Array) -> tuple[float, Array]:
        now = inner * float((d.T @ costs + b.T @ p @ into)[0, 0])
        return now, closed.T @ p @ into + kept.T @ costs

    def for_ever(later: Array) -> float:
        return inner * float((b.T @ np.linalg.solve(np.eye(STATES) - closed.T, later))[0, 0])

    first, later = first_and_later(e, f)
    preview = [first]
    for _ in range(count - 1):
        preview.append(inner * float((b.T @ later)[0, 0]))
        later = closed.T @ later
    preview[-1] += for_ever(later)  # the last turn goes on
    first, later = first_and_later(w, g)
    return Gains(feedback[0], np.array(preview), first + for_ever(later))


def _plant(vehicle: SingleTrack, speed: float, period_s: float) -> tuple[Array, Array, Array, Array]:
    """Return A (6, 6), B, E, W (6, 1) of x[k + 1] = A x + B u + E d + W pull."""
    from scipy.linalg import expm

    lag = max(vehicle.actuators.steering_lag_s, SHORTEST_LAG_S)
    rates = np.zeros((8, 8))  # the state, what is asked for held; the path's rate of turning; the pull
    rates[LATERAL, :3], rates[YAW_RATE, :3] = _accelerations(vehicle, speed)
    rates[WHEELS, WHEELS], rates[WHEELS, ASKED] = -1.0 / lag, 1.0 / lag
    rates[OFFSET, [LATERAL, YAW_RATE, HEADING]] = 1.0, -vehicle.rear_m, speed
    rates[HEADING, YAW_RATE], rates[HEADING, 6], rates[LATERAL, 7] = 1.0, -1.0, 1.0
    step = expm(rates * period_s)
    return step[:6, :6], step[:6, [ASKED]], step[:6, [6]] / period_s, step[:6, [7]]


def _accelerations(vehicle: SingleTrack, speed: float) -> tuple[Array, Array]:
    """Return lateral and yaw acceleration by lateral speed, yaw rate and front wheels."""
    a11, a12, a21, a22 = vehicle.matrix(speed)
    push = vehicle.front_stiffness
    return (
        np.array([a11, a12, push / vehicle.mass]),
        np.array([a21, a22, vehicle.front_m * push / vehicle.inertia]),
    )


def _cost(vehicle: SingleTrack, speed: float, period_s: float, w: float) -> tuple[Array, Array, Array, Array]:
    """Return C (4, 6), D, F, G (4, 1): the cost of a period is |C x + D u + F d + G pull|^2."""
    lateral, yaw = _accelerations(vehicle, speed)
    c, (d, f, g) = np.zeros((4, 6)), np.zeros((3, 4, 1))
    c[0, OFFSET] = 1.0
    c[1, [LATERAL, YAW_RATE, HEADING]] = 1.0, -vehicle.rear_m, speed
    c[2, :3] = lateral - vehicle.rear_m * yaw
    c[2, YAW_RATE] += speed
    f[2, 0], g[2, 0] = -speed / period_s, 1.0
    d[3, 0] = speed * vehicle.steady_yaw_rate(speed, 1.0) / period_s
    weights = np.sqrt([1.0, 3.0 / w**2, 3.0 / w**4, 1.0 / w**6])[:, None]
    return c * weights, d * weights, f * weights, g * weights

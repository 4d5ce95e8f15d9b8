"""References in 120 decimal digits (mpmath): rotations, poses, projection, least squares, boxes, arcs.

Plain textbook forms on the float64 inputs as they are, so that a difference is the error of the
arithmetic under test and of nothing else. So many digits, as normal equations of order 9 over 5 m at
100 m have a condition of 1e60, and weights over 12 decades come squared on top.
"""

from typing import NamedTuple

import mpmath
import numpy as np

mp = mpmath.mp.clone()
mp.dps = 120


class Row(NamedTuple):
    """The worst error of one case: `bound` is what the tests hold it to, `reference` what it is against."""

    case: str
    quantity: str
    worst: float
    unit: str
    bound: float
    reference: str


def matrix(array):
    """Return a float64 array (N,) or (N, M) as a matrix of exact values."""
    return mp.matrix(np.asarray(array, dtype=float).tolist())


def largest(differences):
    """Return the largest absolute value as a float; 0 of none."""
    return float(max((abs(d) for d in differences), default=mp.mpf(0)))


def rotation(roll, pitch, yaw):
    """Return Rz(yaw) Ry(pitch) Rx(roll) as three products."""
    c, s = mp.cos, mp.sin
    r, p, y = mp.mpf(roll), mp.mpf(pitch), mp.mpf(yaw)
    rz = mp.matrix([[c(y), -s(y), 0], [s(y), c(y), 0], [0, 0, 1]])
    ry = mp.matrix([[c(p), 0, s(p)], [0, 1, 0], [-s(p), 0, c(p)]])
    rx = mp.matrix([[1, 0, 0], [0, c(r), -s(r)], [0, s(r), c(r)]])
    return rz * ry * rx


def in_frame(turn, origin, point):
    """Return a world point in the frame of rotation `turn` (3 x 3, exact) at `origin`."""
    return turn.T * (matrix(point) - matrix(origin))


def _normal(x, order, sigma):
    """Return the rows of powers (N, order + 1), and the same times the weights 1 / sigma^2, transposed."""
    weights = [mp.mpf(1)] * len(x) if sigma is None else [1 / mp.mpf(float(s)) ** 2 for s in sigma]
    powers = [[mp.mpf(float(at)) ** k for k in range(order + 1)] for at in x]
    weighted = [[w * power for power in row] for w, row in zip(weights, powers, strict=True)]
    return mp.matrix(powers), mp.matrix(weighted).T


def least_squares(x, y, order, sigma=None):
    """Return c0..c_order of the weighted least-squares polynomial, by the normal equations."""
    rows, weighted = _normal(x, order, sigma)
    return list(mp.lu_solve(weighted * rows, weighted * mp.matrix([mp.mpf(float(at)) for at in y])))


def covariance(x, order, sigma):
    """Return the covariance of the coefficients of points with these standard deviations."""
    rows, weighted = _normal(x, order, sigma)
    return mp.inverse(weighted * rows)


def value_at(coefficients, x):
    """Return y of a polynomial with exact coefficients, c0 first."""
    at, y = mp.mpf(float(x)), mp.mpf(0)
    for coefficient in reversed(coefficients):
        y = y * at + coefficient
    return y


def is_hidden(eye, point, box, grown_m, far_limit):
    """Return whether the segment from `eye`, up to `far_limit` of it, meets a box (slab test).

    `box` is (centre, size, exact rotation); every face is moved outwards by `grown_m`.
    """
    centre, size, turn = box
    start, end = in_frame(turn, centre, eye), in_frame(turn, centre, point)
    first, last = mp.mpf(0), mp.mpf(far_limit)
    for axis in range(3):
        half = abs(mp.mpf(float(size[axis]))) / 2 + mp.mpf(grown_m)
        step = end[axis] - start[axis]
        if half < 0 or (step == 0 and abs(start[axis]) > half):
            return False
        if step != 0:
            enter, leave = sorted(((-half - start[axis]) / step, (half - start[axis]) / step))
            first, last = max(first, enter), min(last, leave)
    return first <= last


def arc_end(speed, rate, seconds):
    """Return x, y of a vehicle after a time at constant speed and turn rate, from (0, 0) along x."""
    v, w, t = (mp.mpf(value) for value in (speed, rate, seconds))
    if w == 0:
        return v * t, mp.mpf(0)
    return v / w * mp.sin(w * t), v / w * 2 * mp.sin(w * t / 2) ** 2

"""The course of a lane departure: how far the tyre is from the lane's edge, what the ECU did, the figures.

Words, after the standards:

- *DTLE*, distance to lane edge: from the outer side of the front tyre to the inner border of the marking
  that the vehicle drifts to (to the lane's border where nothing is painted), across it; negative beyond it.
- *departure*: the front axle's speed across the edge when the robot lets go, by heading and yaw rate, for the
  tyres do not slip yet and what an ECU does at once does not count.
- *time to line crossing*: DTLE over the speed at which it shrinks.
- *lateral acceleration* of the rear axle, speed times yaw rate, less its value when the robot let go: what
  the lane keeping action adds. *Jerk*: its change over half a second, the moving average that ISO 11270 and
  UN R79 speak of.
- *returning speed*: at which the vehicle moves back from the edge 2 s after the least DTLE; *beyond*: how
  much more it is than the speed of departure, or 0.3 m/s where that was less.
"""

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from vsensor.config import Scenario
from vsensor.experiment.ecu import REQUEST, WARNING
from vsensor.profile import LaneWarning, Profile
from vsensor.types import Array, Frame, Output, Snapshot
from vsensor.world.lane_edge import TyreToEdge, edge_beside, tyre_to_edge

JERK_OVER_S = 0.5
RETURNING_AFTER_S = 2.0
SLOW_RETURN_MPS = 0.3
GONE_M = 0.8
"""Once the tyre is that far beyond the edge the test is over."""
COURSE_COLUMNS = ("t_s", "dtle_m", "other_dtle_m", "lateral_mps2", "towards_mps")

LOOP_FIGURES = (
    *("departure_mps", "dtle_min_m", "other_dtle_min_m", "warning_s", "dtle_at_warning_m"),
    *("beyond_marking_at_warning_m", "time_to_crossing_at_warning_s", "intervention_s"),
    *("dtle_at_intervention_m", "lateral_acceleration_max_mps2", "lateral_jerk_max_mps3", "returning_mps"),
    "returning_beyond_mps",
)
"""Columns of the table that a closed loop adds; times count from when the robot lets go."""


class CourseSink:
    """A sink that keeps both front tyres' distances to the lane's edges, and the lateral acceleration."""

    def __init__(self, scenario: Scenario, speed_mps: float) -> None:
        config = scenario.config
        self.release_s = config.departure.release_s(speed_mps)
        self._is_left = config.departure.is_left
        self._axle_m, self._width_m = config.vehicle.wheelbase_m, config.vehicle.width_m
        self._edges: dict[bool, int | None] | None = None
        self._rows: list[tuple[float, ...]] = []
        self.marking_m = 0.0

    def write(self, output: Output) -> None:
        """Keep one tick."""
        snapshot = output.snapshot
        if self._edges is None:
            self._edges = {left: edge_beside(snapshot, left, self._axle_m) for left in (True, False)}
        ego = snapshot.ego
        tyres = [self._tyre(snapshot, self._is_left), self._tyre(snapshot, not self._is_left)]
        distances = [math.nan if tyre is None else tyre.distance_m for tyre in tyres]
        towards_mps = math.nan
        if tyres[0] is not None:
            self.marking_m = tyres[0].width_m
            angle, sign = tyres[0].towards_rad, 1.0 if self._is_left else -1.0
            swings_mps = sign * self._axle_m * ego.yaw_rate_radps  # the front axle about the rear one
            towards_mps = ego.speed_mps * math.sin(angle) + swings_mps * math.cos(angle)
        turning = ego.speed_mps * ego.yaw_rate_radps
        self._rows.append((output.tick.t_ns * 1e-9, *distances, turning, towards_mps))

    def _tyre(self, snapshot: Snapshot, is_left: bool) -> TyreToEdge | None:
        edge = None if self._edges is None else self._edges[is_left]
        if edge is None:
            return None
        return tyre_to_edge(snapshot, edge, is_left, self._axle_m, self._width_m)

    def is_over(self) -> bool:
        """Return whether the vehicle has left the lane, or has turned back and what is judged is past."""
        if not self._rows or self._rows[-1][0] <= self.release_s + RETURNING_AFTER_S:
            return bool(self._rows) and self._rows[-1][1] < -GONE_M
        t_s, dtle = self._rows[-1][:2]
        after = [row for row in self._rows if row[0] >= self.release_s]
        least = min(after, key=lambda row: row[1])
        return dtle < -GONE_M or t_s > least[0] + RETURNING_AFTER_S + 0.2

    def close(self) -> None:
        """Nothing to close."""

    def course(self) -> Array:
        """Return (ticks, COURSE_COLUMNS)."""
        return np.array(self._rows, dtype=np.float64).reshape(-1, len(COURSE_COLUMNS))


def told(frames: Sequence[Frame], profiles: Sequence[Profile]) -> dict[str, Array]:
    """Return {quantity: (N, 2) of time in s and value} that the ECU's intact frames told."""
    found: dict[str, list[tuple[float, float]]] = {REQUEST: [], WARNING: []}
    for frame in frames:
        for profile in profiles:
            for name, value in (profile.decode(frame, check=True) or {}).items():
                if name in found:
                    found[name].append((frame.due_ns * 1e-9, value))
    return {name: np.array(rows, dtype=np.float64).reshape(-1, 2) for name, rows in found.items()}


def loop_figures(
    course: Array, ecu: Mapping[str, Array], release_s: float, marking_m: float, is_left: bool
) -> dict[str, float]:
    """Return LOOP_FIGURES of a course (ticks, columns) and what the ECU told; NaN where it did nothing."""
    t, dtle, other, acceleration, towards = course.T
    after = t >= release_s - 1e-9
    least = int(np.nanargmin(np.where(after, dtle, np.inf)))
    side = LaneWarning.LEFT if is_left else LaneWarning.RIGHT
    # A little before the robot lets go counts: a warning may come while it still steers.
    warned = _first(ecu[WARNING], lambda value: value == side, 0.0)
    steered = _first(ecu[REQUEST], np.isfinite, release_s)
    shrinks = -np.gradient(dtle, t)
    distance, speed = _at(t, dtle, warned), _at(t, shrinks, warned)
    added = np.where(after, acceleration - acceleration[int(after.argmax())], 0.0)
    departure = float(towards[int(after.argmax())])
    returning = _at(t, -shrinks, t[least] + RETURNING_AFTER_S)
    return {
        "departure_mps": departure,
        "dtle_min_m": float(dtle[least]),
        "other_dtle_min_m": float(np.nanmin(np.where(after, other, np.nan))) if after.any() else math.nan,
        "warning_s": warned - release_s,
        "dtle_at_warning_m": distance,
        "beyond_marking_at_warning_m": -distance - marking_m,
        "time_to_crossing_at_warning_s": distance / speed if speed > 1e-3 else math.nan,
        "intervention_s": steered - release_s,
        "dtle_at_intervention_m": _at(t, dtle, steered),
        "lateral_acceleration_max_mps2": float(np.abs(added).max()),
        "lateral_jerk_max_mps3": _jerk(t, added),
        "returning_mps": returning,
        "returning_beyond_mps": returning - max(departure, SLOW_RETURN_MPS),
    }


def _first(told_: Array, holds: Any, from_s: float) -> float:
    """Return the time of the first value from a time on that holds, NaN without any."""
    chosen = told_[(told_[:, 0] >= from_s - 1e-9) & holds(told_[:, 1])]
    return float(chosen[0, 0]) if len(chosen) else math.nan


def _at(t: Array, values: Array, when_s: float) -> float:
    """Return a value at a time, linear between ticks; NaN outside of the run."""
    if not t[0] <= when_s <= t[-1]:
        return math.nan
    return float(np.interp(when_s, t, values))


def _jerk(t: Array, acceleration: Array) -> float:
    """Return the largest mean jerk over JERK_OVER_S: the acceleration's change in that time, over it.

    Exact for an acceleration that is linear between ticks: its change turns where either end meets a tick.
    """
    ends = np.concatenate([t, t + JERK_OVER_S])
    change = np.interp(ends, t, acceleration) - np.interp(ends - JERK_OVER_S, t, acceleration)
    return float(np.abs(change).max() / JERK_OVER_S)

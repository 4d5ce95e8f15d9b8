"""Logs of drives whose truth is known in closed form: straights, arcs, clothoids, driven and logged.

The reported lines are the least-squares cubics of the true ones plus a given error; what a profile's bus
rounds is the only other error in them. Speed, yaw rate and, if asked for, the pose come in frames of
vehicle.dbc, the yaw rate as coarse and noisy as is said.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from tests.vehicle_frames import Gateway
from vsensor.logs import open_log_writer
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit
from vsensor.types import (
    Boundary,
    Colour,
    EgoState,
    LaneEstimate,
    MarkingKind,
    SensorMode,
    Side,
    Tick,
    frozen,
)

CYCLE_NS = 40_000_000
HALF_LANE_M = 1.75
RAV4_STEP_DEGPS = 0.244


class Road:
    """A centreline of pieces (length_m, curvature at the start, at the end), from (0, 0) to the east."""

    def __init__(self, *pieces, step_m=0.05):
        self.s = np.arange(0.0, sum(length for length, *_ in pieces) + step_m, step_m)
        edges = np.cumsum([0.0] + [length for length, *_ in pieces])
        kappa = np.zeros(len(self.s))
        for (length, first, last), start in zip(pieces, edges[:-1], strict=True):
            inside = (self.s >= start) & (self.s <= start + length)
            kappa[inside] = first + (last - first) * (self.s[inside] - start) / length
        self.kappa = kappa
        turn = (kappa[1:] + kappa[:-1]) / 2 * step_m
        self.yaw = np.concatenate([[0.0], np.cumsum(turn)])
        chord = step_m * np.sinc(turn / 2 / np.pi)
        middle = self.yaw[:-1] + turn / 2
        self.x = np.concatenate([[0.0], np.cumsum(chord * np.cos(middle))])
        self.y = np.concatenate([[0.0], np.cumsum(chord * np.sin(middle))])

    def line(self, offset_m):
        """Return points (N, 2) of the line so far to the left."""
        return np.column_stack([self.x - offset_m * np.sin(self.yaw), self.y + offset_m * np.cos(self.yaw)])

    def seen_from(self, offset_m, x, y, yaw, x_max_m):
        """Return x and y in the ego frame of the line's points, each metre, up to the range."""
        k = int(np.argmin((self.x - x) ** 2 + (self.y - y) ** 2))
        part = slice(max(k - 20, 0), k + int((1.3 * x_max_m + 10) / 0.05), 20)
        sin, cos = np.sin(self.yaw[part]), np.cos(self.yaw[part])
        east, north = self.x[part] - offset_m * sin - x, self.y[part] + offset_m * cos - y
        ahead, left = east * np.cos(yaw) + north * np.sin(yaw), north * np.cos(yaw) - east * np.sin(yaw)
        keep = (ahead >= -0.6) & (ahead <= x_max_m)
        return ahead[keep], left[keep]

    def at(self, s, offset):
        """Return x, y, heading at distances (N,), offsets (N,) to the left."""
        x, y, yaw = (np.interp(s, self.s, values) for values in (self.x, self.y, self.yaw))
        return x - offset * np.sin(yaw), y + offset * np.cos(yaw), yaw


STRAIGHT = Road((2000.0, 0.0, 0.0))


def nothing(side, t_s, x_m):
    """Return no error."""
    return np.zeros_like(x_m)


@dataclass(kw_only=True)
class Drive:
    """How a road is driven, seen and logged; `error` (side, t_s, x_m) comes before the fit.

    `seen` (side, t_s): the line is reported; `lines` (t_s): offsets of left and right line from the road's
    middle; `beside` (t_s): where the vehicle runs; `jitter_ns`: of its frames' times.
    """

    road: Road = STRAIGHT
    seconds: float = 30.0
    speed_mps: Callable | float = 20.0
    start_m: float = 10.0
    beside: Callable = np.zeros_like
    lines: Callable = lambda t_s: (HALF_LANE_M, -HALF_LANE_M)
    error: Callable = nothing
    seen: Callable = lambda side, t_s: True
    x_max_m: float = 80.0
    profile: str = "native"
    dbc: Path | None = None
    yaw_step_degps: float = 0.0
    yaw_noise_degps: float = 0.0
    yaw_offset_degps: float = 0.0
    motion_ns: int = 12_000_000
    jitter_ns: float = 0.0
    pose: bool = False
    start_ns: int = 0
    order: int = 3
    body: dict = field(default_factory=dict)
    seed: int = 1
    latency_ns: int = 0
    mode: Callable = lambda t_s: SensorMode.AVAILABLE

    def motion(self):
        """Return times (s) every 2 ms, x, y, yaw, speed, yaw rate (N,) of the rear axle."""
        t = np.arange(0.0, self.seconds + 0.002, 0.002)
        speed = self.speed_mps(t) if callable(self.speed_mps) else np.full_like(t, self.speed_mps)
        s = self.start_m + np.concatenate([[0.0], np.cumsum((speed[1:] + speed[:-1]) / 2 * 0.002)])
        x, y, heading = self.road.at(s, self.beside(t))
        across = np.gradient(self.beside(t), t)
        along = speed * (1.0 - np.interp(s, self.road.s, self.road.kappa) * self.beside(t))
        yaw = heading + np.arctan2(across, np.maximum(along, 1e-9))
        return t, x, y, yaw, np.hypot(along, across), np.gradient(yaw, t)

    def frames(self):
        """Return all frames in order of time."""
        t, *motion = self.motion()

        def at(when_s):
            """Return x, y, yaw, speed, yaw rate (5, N) at times."""
            return np.array([np.interp(when_s, t, values) for values in motion])

        frames = [*self._vehicle_frames(at), *self._lane_frames(at)]
        return sorted(frames, key=lambda frame: frame.due_ns)

    def write(self, path):
        """Write the log; return its path."""
        with open_log_writer(path) as writer:
            for frame in self.frames():
                writer.write(frame, self.start_ns)
        return path

    def _vehicle_frames(self, at):
        random, gateway = np.random.default_rng(self.seed), Gateway()
        count = int(self.seconds * 1e9 // self.motion_ns)
        due = np.arange(count) * self.motion_ns
        sampled = due + np.round(random.normal(0.0, self.jitter_ns, count) if self.jitter_ns else 0).astype(
            int
        )
        noise = random.normal(0.0, 1.0, count) * np.radians(self.yaw_noise_degps)
        step = np.radians(self.yaw_step_degps)
        *_, speed, rate = at(np.clip(sampled / 1e9, 0.0, self.seconds))
        rate = rate + noise + np.radians(self.yaw_offset_degps)
        rate = np.round(rate / step) * step if step else rate
        x, y, yaw, *_ = at(due / 1e9)
        yaw = np.arctan2(np.sin(yaw), np.cos(yaw))
        for k in range(count):
            t_ns = int(due[k])
            yield gateway.motion(int(max(sampled[k], 0)), float(speed[k]), float(rate[k]))
            if self.pose and k % 2 == 0:
                yield from gateway.pose(t_ns, float(x[k]), float(y[k]), float(yaw[k]))
            if self.body and k % 8 == 0:
                yield gateway.frame("VEH_Body", t_ns, **self.body)

    def _lane_frames(self, at):
        transmitter = Transmitter(load_profile(self.profile, self.dbc), VehicleConfig(), 1.9)
        state = initial_state(transmitter)
        count = int(self.seconds * 1e9 // CYCLE_NS)
        due = np.arange(count) * CYCLE_NS
        for k, (x, y, yaw, speed, rate) in enumerate(
            at(np.maximum(due - self.latency_ns, 0) / 1e9).T.tolist()
        ):
            t_ns, t_s = int(due[k]), due[k] / 1e9
            ego = EgoState(
                t_ns=t_ns,
                position_world_m=frozen([x, y, 0.0]),
                yaw_rad=yaw,
                speed_mps=speed,
                yaw_rate_radps=rate,
            )
            lines = tuple(self._boundaries(t_s, x, y, yaw))
            exposed_ns = max(t_ns - self.latency_ns, 0)
            estimate = LaneEstimate(exposed_at_ns=exposed_ns, image_index=k, boundaries=lines)
            values = values_from(VehicleConfig(), estimate, ego, self.mode(t_s))
            state, frames = transmit(transmitter, state, values, Tick(index=k, t_ns=t_ns, period_ns=CYCLE_NS))
            yield from frames

    def _boundaries(self, t_s, x, y, yaw):
        for side, offset in zip((Side.LEFT, Side.RIGHT), self.lines(t_s), strict=True):
            if not self.seen(side, t_s):
                continue
            ahead, left = self.road.seen_from(offset, x, y, yaw, self.x_max_m)
            left = left + self.error(side, t_s, ahead)
            powers = np.arange(self.order + 1)
            scaled = np.vander(ahead / self.x_max_m, self.order + 1, increasing=True)
            c = np.linalg.lstsq(scaled, left, rcond=None)[0] / self.x_max_m**powers
            yield Boundary(
                side=side,
                coefficients=frozen(c),
                covariance=frozen(np.eye(len(c)) * 1e-6),
                x_min_m=0.0,
                x_max_m=self.x_max_m,
                quality=4,
                kind=MarkingKind.SOLID,
                colour=Colour.WHITE,
                width_m=0.15,
                measured=True,
                marking=0,
                points=0,
            )


def write_lines(path, road, offsets=(HALF_LANE_M, -HALF_LANE_M), every=10):
    """Write the true left and right line of a road as a reference file; return its path."""
    rows = ["side,x_m,y_m"]
    for side, offset in zip(("left", "right"), offsets, strict=True):
        rows += [f"{side},{x:.5f},{y:.5f}" for x, y in road.line(offset)[::every].tolist()]
    path.write_text("\n".join(rows) + "\n")
    return path

"""Turn rates down to 1e-12 rad/s, and a clock that has run for 24 hours."""

from functools import cache
from pathlib import Path

import numpy as np

import vsensor.scenarios
from tests.hard_cases import chain, exact
from tests.hard_cases.exact import Row
from tests.roads import ego, snapshot, straight
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.types import NANOSECONDS_PER_SECOND, Environment
from vsensor.world.dead_reckoning import integrated

HOUR_S = 3600
DAY_NS = 24 * HOUR_S * NANOSECONDS_PER_SECOND
RATES = (0.0, 1e-300, *(sign * 10.0**-k for k in (12, 9, 6, 3, 1) for sign in (1, -1)))
SPEED_MPS = 40.0
PERIODS_NS = (40_000_000, 10_000_000)
MAP = Path(vsensor.scenarios.__file__).parent / "highway.xodr"


def dead_reckoning_error_m():
    """Return the error of an hour's path at 40 m/s in samples of 20 ms, and of poses between samples."""
    t_ns = np.arange(0, HOUR_S * 50 + 1, dtype=np.int64) * 20_000_000
    worst = 0.0
    for rate in RATES:
        path = integrated(t_ns, np.full(len(t_ns), SPEED_MPS), np.full(len(t_ns), rate))
        for at_ns in (int(t_ns[-1]), int(t_ns[-1]) - 13_000_001, 1_234_567_891_234):
            pose = path.at(at_ns)
            x, y = exact.arc_end(SPEED_MPS, rate, exact.mp.mpf(at_ns) / NANOSECONDS_PER_SECOND)
            worst = max(worst, exact.largest([x - exact.mp.mpf(pose.x_m), y - exact.mp.mpf(pose.y_m)]))
    return worst


def relative_bend_error():
    """Return the error of y over y itself where next to nothing is turned: 1e-12 rad/s for a minute."""
    t_ns = np.arange(0, 3001, dtype=np.int64) * 20_000_000
    path = integrated(t_ns, np.full(3001, SPEED_MPS), np.full(3001, 1e-12))
    _, y = exact.arc_end(SPEED_MPS, 1e-12, 60)
    return float(abs((exact.mp.mpf(float(path.y_m[-1])) - y) / y))


def frames_changed_by_turning():
    """Return how many frames differ between a yaw rate of 1e-12 rad/s and none, tracker and signals on."""
    lines = [straight(y, number) for number, y in enumerate((1.8, -1.7, 5.4, -5.3))]
    shots = [snapshot(lines, (), ego(yaw_rate_radps=rate)) for rate in (0.0, 1e-12, -1e-12)]
    still, left, right = (chain.bits(chain.shown(shot, ticks=3)[0]) for shot in shots)
    return float(sum(a != b or a != c for a, b, c in zip(still, left, right, strict=True)))


@cache
def endless_drive():
    """Return a drive on the closed circuit at a steady speed that is no round number."""
    return MapDrive.load(MAP, EgoConfig(road="1", lane=-3, speed_kmh=31.4159), (), Environment(), 100.0)


def pose_error_m(period_ns):
    """Return how far poses around 24 h are from those of the first lap at the same place, and of markings."""
    source = endless_drive()
    lap_m = lap_length_m()
    speed = exact.mp.mpf(source._speed.values[0])
    worst = 0.0
    for index in (DAY_NS // period_ns + k for k in (0, 1, 1000)):
        _, shot = source.advance(None, chain.tick_at(index, period_ns), ())
        driven = speed * exact.mp.mpf(index * period_ns) / NANOSECONDS_PER_SECOND
        there = source.corridor.poses(np.array([float(driven % exact.mp.mpf(lap_m))])).position_world_m[0]
        worst = max(worst, float(np.abs(shot.ego.position_world_m - there).max()))
    return worst


@cache
def lap_length_m():
    """Return the circuit's length: where the first metre comes round again, by bisection on the pose."""
    corridor = endless_drive().corridor
    start = corridor.poses(np.array([5.0]))
    forward = np.array([np.cos(start.yaw_rad[0]), np.sin(start.yaw_rad[0]), 0.0])
    s = 5.0 + np.arange(1000.0, 20000.0, 1.0)
    away = np.linalg.norm(corridor.poses(s).position_world_m - start.position_world_m, axis=1)
    near = float(s[np.argmax(away < 1.0)])
    low, high = near - 2.0, near + 2.0
    for _ in range(60):
        middle = (low + high) / 2.0
        ahead = (corridor.poses(np.array([middle])).position_world_m[0] - start.position_world_m[0]) @ forward
        low, high = (middle, high) if ahead < 0.0 else (low, middle)
    return (low + high) / 2.0 - 5.0


def count_errors(first, period_ns):
    """Return how many ticks from `first` on put another index or time on the bus than integers say."""
    lines = [straight(y, number) for number, y in enumerate((1.8, -1.7))]

    def shot_at(tick):
        shot = snapshot(lines)
        return type(shot)(t_ns=tick.t_ns, ego=shot.ego, scene=shot.scene)

    wrong = 0
    for output, values in chain.drive(chain.line_of(shot_at), 9, first=first, period_ns=period_ns):
        if not values:
            continue  # in ticks of 10 ms every fourth slot sends
        index = output.tick.index
        time_ms = index * period_ns // 1_000_000 % 2**32
        wrong += (values["image.index"], values["image.timestamp_ms"]) != (index % 2**16, time_ms)
        wrong += {frame.due_ns for frame in output.frames} != {index * period_ns}
    return float(wrong)


def rows():
    found = [
        Row(
            "turn rates 0, 1e-300, 1e-12 to 0.1 rad/s",
            "place after an hour at 40 m/s",
            dead_reckoning_error_m(),
            "m",
            3e-6,
            "120 digits",
        ),
        Row(
            "turn rate 1e-12 rad/s",
            "the bend itself, after a minute",
            relative_bend_error(),
            "",
            1e-9,
            "120 digits",
        ),
        Row(
            "turn rate 1e-12 rad/s",
            "frames that differ",
            frames_changed_by_turning(),
            "frames",
            0.0,
            "no turn",
        ),
    ]
    for period_ns in PERIODS_NS:
        case = f"24 h in ticks of {period_ns // 1_000_000} ms"
        found.append(Row(case, "place on the circuit", pose_error_m(period_ns), "m", 1e-6, "the first lap"))
        for name, first in (
            ("at 24 h", DAY_NS // period_ns),
            ("where the index wraps", 2**16 - 2),
            ("where the time wraps", 2**32 * 1_000_000 // period_ns - 1),
        ):
            found.append(
                Row(
                    case,
                    f"index, time, due time, {name}",
                    count_errors(first, period_ns),
                    "ticks wrong",
                    0.0,
                    "integers",
                )
            )
    return found

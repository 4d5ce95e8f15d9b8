"""The reference scene by our line and by P1's algorithms in numpy, in turns, tick by tick."""

import itertools
import time
from collections.abc import Sequence
from dataclasses import dataclass
from math import atan

import cantools
import numpy as np

from tests import p1
from tools.bench.measure import ROOT, median, one_core
from tools.bench.scene import boxes_in_view, reference_line, ticks_at
from vsensor.camera import Camera
from vsensor.line import Computed, Line
from vsensor.runner import STAGES, Stopwatch
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Array, BoolArray, Frame, Output, Snapshot, Unseen

TARGET_RATIO = 40.0
TARGET_P99_PER_P50 = 2.5
P1_FROM_BODY = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]])
"""P1's camera frame against forward-left-up: x right, y up, looking along -z."""


@dataclass(frozen=True)
class P1Frame:
    """What P1's algorithms make of a snapshot: `seen` of all points, a cubic per line, bytes per message."""

    seen: BoolArray
    cubics: tuple[Array, ...]
    payloads: tuple[bytes, ...]


class P1Sensor:
    """A whole frame in numpy with P1's algorithms as written (2.1), np.polyfit and cantools.

    It makes no errors and tracks nothing, which ours does: the ratio says too little rather than too much.
    """

    def __init__(self, camera: Camera, range_m: float) -> None:
        """Take optics and place of `camera`, which looks straight ahead, without distortion."""
        config = camera.config
        self.columns, self.rows, self.focal_px = config.width_px, config.height_px, camera.fx_px
        self.alpha = atan(config.width_px / 2 / camera.fx_px)
        self.position_m = np.array(config.position_m)
        self.sight_m = range_m - config.position_m[0]
        database = cantools.database.load_file(ROOT / "dbc" / "lds.dbc")
        self.messages = {message.frame_id: message for message in database.messages}

    def signals(self, frames: Sequence[Frame]) -> list[tuple[int, dict]]:
        """Return what is to be sent as numbers, so that encoding them can be timed."""
        return [
            (
                frame.arbitration_id,
                self.messages[frame.arbitration_id].decode(frame.data, decode_choices=False),
            )
            for frame in frames
        ]

    def frame(self, snapshot: Snapshot, values: Sequence[tuple[int, dict]]) -> P1Frame:
        """Compute one frame."""
        yaw = snapshot.ego.yaw_rad
        camera_from_world = P1_FROM_BODY @ rotation_from_rpy(0.0, 0.0, yaw).T
        eye_world_m = (
            snapshot.ego.position_world_m + rotation_from_rpy(0.0, 0.0, yaw) @ self.position_m
        )  # eq. 2.4-2.6
        chains = [line.points_world_m for line in snapshot.scene.markings]
        points = (np.concatenate(chains) - eye_world_m) @ camera_from_world.T
        seen = p1.is_in_field_of_view(points, self.alpha, self.columns, self.rows, self.sight_m)
        boxes = [
            (
                camera_from_world @ (box.centre_world_m - eye_world_m),
                np.array(box.size_m),
                camera_from_world @ rotation_from_rpy(box.roll_rad, box.pitch_rad, box.yaw_rad),
            )
            for box in snapshot.scene.obstacles
        ]
        inside = seen.nonzero()[0]
        seen[inside] = ~p1.hidden(np.zeros(3), points[inside], boxes)
        cubics = self._cubics(points, seen, np.cumsum([0, *map(len, chains)]))
        payloads = tuple(self.messages[number].encode(signals) for number, signals in values)
        return P1Frame(seen, cubics, payloads)

    def _cubics(self, points: Array, seen: BoolArray, edges: Array) -> tuple[Array, ...]:
        """Return the cubic of each line through its points on the pixel grid, in the ego frame."""
        depth = -points[:, 2]
        with np.errstate(divide="ignore", invalid="ignore"):
            u = np.rint(self.focal_px * points[:, 0] / depth + (self.columns - 1) / 2)
            v = np.rint(-self.focal_px * points[:, 1] / depth + (self.rows - 1) / 2)
        right = (u - (self.columns - 1) / 2) * depth / self.focal_px
        up = -(v - (self.rows - 1) / 2) * depth / self.focal_px
        ego = np.column_stack([depth, -right, up]) + self.position_m
        cubics = []
        for start, stop in itertools.pairwise(edges):
            chosen = ego[start:stop][seen[start:stop]]
            if len(chosen) >= 8:
                cubics.append(np.polyfit(chosen[:, 0], chosen[:, 1], 3))
        return tuple(cubics)


def seen_by_us(output: Output, points: int) -> BoolArray:
    """Return which points of all lines, in their order, our camera saw."""
    seen = np.zeros(points * len(output.snapshot.scene.markings), dtype=bool)
    observed = output.observation
    edges = observed.candidates.starts.tolist()
    for place, start, stop in zip(observed.candidates.marking.tolist(), edges, edges[1:], strict=False):
        index = observed.candidates.index[start:stop]
        seen[place * points + index] = observed.reason[start:stop] == Unseen.SEEN
    return seen


def against_p1(rounds: int = 15, ticks_a_round: int = 40) -> dict[str, object]:
    """Time whole frames, ours and P1's, in turns: some of ours, two of P1's."""
    line = reference_line()
    other = P1Sensor(line.sensor.camera, line.sensor.config.scene.range_m)
    state, watch = line.initial_state(), Stopwatch()
    ours_ms, ours_cpu_ms, theirs_ms, ratios, cpu_ratios = [], [], [], [], []
    hidden, in_view, unlike = [], [], 0
    with one_core():
        for number in range(rounds + 1):
            block_ms, block_cpu_ms = [], []
            for tick in ticks_at(range(number * ticks_a_round, (number + 1) * ticks_a_round)):
                computed, wall_ms, cpu_ms = _timed(line, state, tick, watch)
                state = computed.state_if_sent
                block_ms.append(wall_ms)
                block_cpu_ms.append(cpu_ms)
            output = computed.output
            values = other.signals(output.frames)
            began, began_cpu = time.perf_counter_ns(), time.thread_time_ns()
            for _ in range(2):
                frame = other.frame(line.source.advance(None, output.tick, ())[1], values)
            cpu_ms = (time.thread_time_ns() - began_cpu) / 2e6
            wall_ms = (time.perf_counter_ns() - began) / 2e6
            if not number:
                continue  # the first round warms up
            ours_ms += block_ms
            ours_cpu_ms += block_cpu_ms
            theirs_ms.append(wall_ms)
            ratios.append(wall_ms / np.median(block_ms))
            cpu_ratios.append(cpu_ms / np.median(block_cpu_ms))
            unlike += int((frame.seen != seen_by_us(output, len(frame.seen) // 4)).sum())
            hidden.append(float((output.observation.reason == Unseen.OCCLUDED).mean()))
            in_view.append(boxes_in_view(line.sensor.camera, output.snapshot))
    assert min(in_view) >= 25, f"only {min(in_view)} boxes in view"
    assert min(hidden) >= 0.3, f"only {min(hidden):.0%} of the points hidden"
    return {
        "points": 4000,
        "boxes": len(output.snapshot.scene.obstacles),
        "boxes_in_view_at_least": min(in_view),
        "hidden_at_least": min(hidden),
        "frames_a_tick": len(output.frames),
        "ours_p50_ms": median(ours_ms),
        "ours_p99_ms": float(np.percentile(ours_ms, 99)),
        "ours_cpu_p50_ms": median(ours_cpu_ms),
        "ours_cpu_p99_ms": float(np.percentile(ours_cpu_ms, 99)),
        "p1_p50_ms": median(theirs_ms),
        "ratio": median(ratios),
        "ratio_of_cpu_time": median(cpu_ratios),
        "target_ratio": TARGET_RATIO,
        "p99_per_p50": float(np.percentile(ours_ms, 99) / np.median(ours_ms)),
        "p99_per_p50_of_cpu_time": float(np.percentile(ours_cpu_ms, 99) / np.median(ours_cpu_ms)),
        "target_p99_per_p50": TARGET_P99_PER_P50,
        "points_seen_by_one_only": unlike / (4000 * rounds),
        "stages_p50_ms": {stage: ms for stage, ms in watch.p50_ms().items() if stage in STAGES[:-1]},
    }


def _timed(line: Line, state, tick, watch: Stopwatch) -> tuple[Computed, float, float]:
    watch.start()
    began, began_cpu = time.perf_counter_ns(), time.thread_time_ns()
    computed = line.compute(state, tick, (), watch.lap)
    cpu_ms = (time.thread_time_ns() - began_cpu) / 1e6
    return computed, (time.perf_counter_ns() - began) / 1e6, cpu_ms

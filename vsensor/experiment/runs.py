"""One run of an experiment: a scenario, what is kept of it, its figures.

Simulated time, without a bus or with an ECU of `experiment.ecu` on one; or real time with the ECU under test.
"""

import contextlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from msgspec import structs

from vsensor.bus import open_bus
from vsensor.clock import Clock, MonotonicClock, SimulatedClock
from vsensor.config import Scenario
from vsensor.experiment.conditions import ConditionSink, binned
from vsensor.experiment.course import CourseSink, loop_figures, told
from vsensor.experiment.ecu import bench
from vsensor.line import Line, build_line, tick_count
from vsensor.runner import FrameBus, Summary, run_loop
from vsensor.runner.outputs import open_images, open_trace, open_truth
from vsensor.score import Trace, score_trace
from vsensor.sinks import Sink
from vsensor.sinks.log import LogSink
from vsensor.sources.live import LiveDrive
from vsensor.sources.profiles import profiles_of
from vsensor.study.folder import own_folder
from vsensor.study.scenario_cells import TraceInMemory, figures, scenario_of
from vsensor.study.store import Result, cell_key
from vsensor.types import Frame

START_UP_NS = 200_000_000

FILES: Mapping[str, str] = {
    "trace": "trace.parquet",
    "truth": "truth.parquet",
    "log": "bus.blf",
    "images": "images",
}
"""What is kept -> its name in the run's folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Every:
    """Of so many ticks one has an image, and the points of the true lines."""

    images: int = 25
    truth: int = 1


EVERY = Every()


@dataclass(frozen=True, slots=True)
class ExperimentCell:
    """Runs a cell in a worker.

    `folders`: where relative names of each scenario start from. `out`: where what is kept goes, a folder
    for each run. `bus`: the real one, in real time.
    """

    folders: Mapping[str, Path]
    out: Path
    bus: str | None = None

    def __call__(self, cell: dict[str, Any]) -> Result:
        """Run the cell's scenario, score it, keep what is wanted; see `run`."""
        scenario = scenario_of(cell, self.folders[cell["entry"]], "experiment")
        with own_folder(self.out / run_name(cell), bool(cell["outputs"])) as folder:
            every = Every(images=cell["image_every"], truth=cell["truth_every"])
            return run(scenario, folder, cell["outputs"], every, cell["ecu"], self.bus)


def run_name(cell: Mapping[str, Any]) -> str:
    """Return the name of a run's folder: scenario, seed, and what tells it from its likes."""
    seed = cell["scenario"]["seed"]
    return f"{Path(cell['entry']).stem}_seed{seed}_{cell_key(cell)[:8]}"


def run(
    scenario: Scenario,
    folder: Path,
    outputs: Sequence[str] = (),
    every: Every = EVERY,
    ecu: str = "none",
    bus: str | None = None,
) -> Result:
    """Run a scenario; returns its figures: "sides", "conditions", "seconds", "ended", of a departure "loop".

    `sides` has those that occur and "all" of them; `seconds` were simulated, `ended` if the road did
    before; `loop` is LOOP_FIGURES and `course` the ticks of the departure. `ecu`: who answers where the
    vehicle listens to a bus and `bus` does not name one. Raises VsensorError subclasses.
    """
    line = build_line(scenario)
    width_m = scenario.config.vehicle.width_m
    memory, conditions = TraceInMemory(scenario.config.vehicle), ConditionSink()
    period_ns = scenario.config.cycle_ms * 1_000_000
    course = _course(scenario, line)
    with contextlib.ExitStack() as stack:
        sinks: list[Sink] = [memory, conditions, *([course] if course else [])]
        for sink in _kept(scenario, line, folder, outputs, every):
            stack.callback(sink.close)
            sinks.append(sink)
        tap = None
        if line.needs_bus or bus is not None:
            tap = Tap(
                bench(ecu, line.profile, period_ns, width_m) if bus is None else _opened(bus, line, stack)
            )
        is_over = course.is_over if course else lambda: False
        summary = _run(scenario, line, sinks, tap, is_over, is_real=bus is not None)
    result = {
        **_scored(memory.trace(), conditions),
        "seconds": summary.ticks * summary.period_ns / 1e9,
        "ended": summary.ended,
    }
    return result if course is None or tap is None else {**result, **_departed(scenario, course, tap)}


@dataclass(slots=True)
class Tap:
    """A bus that keeps what arrived on it, at times from slot 0 on."""

    bus: FrameBus
    start_ns: int = 0
    arrived: list[Frame] = field(default_factory=list)

    def send(self, frame: Frame) -> bool:
        """Send a frame."""
        return self.bus.send(frame)

    def drain(self) -> Sequence[Frame]:
        """Return what has arrived, and keep it."""
        frames = self.bus.drain()
        self.arrived += [structs.replace(frame, due_ns=frame.due_ns - self.start_ns) for frame in frames]
        return frames

    def confirmed(self) -> Sequence[tuple[int, int]]:
        """Return when own frames were on the bus."""
        return self.bus.confirmed()


def _course(scenario: Scenario, line: Line) -> CourseSink | None:
    if scenario.config.ego.control != "departure" or not isinstance(line.source, LiveDrive):
        return None
    return CourseSink(scenario, line.source.drive.speed_mps(0.0))


def _run(
    scenario: Scenario,
    line: Line,
    sinks: Sequence[Sink],
    tap: Tap | None,
    is_over: Callable[[], bool],
    *,
    is_real: bool,
) -> Summary:
    clock: Clock = MonotonicClock() if is_real else SimulatedClock()
    start_ns = clock.now_ns() + START_UP_NS if is_real else clock.now_ns()
    if tap is not None:
        tap.start_ns = start_ns
    return run_loop(
        line,
        clock,
        period_ns=scenario.config.cycle_ms * 1_000_000,
        ticks=tick_count(scenario, line.source),
        start_ns=start_ns,
        bus=tap,
        sinks=sinks,
        stop=is_over,
        real_time=is_real,
    )


def _opened(bus: str, line: Line, stack: contextlib.ExitStack) -> FrameBus:
    opened = open_bus(bus, fd=line.is_fd)
    stack.callback(opened.close)
    return opened


def _departed(scenario: Scenario, course: CourseSink, tap: Tap) -> Result:
    config, listen = scenario.config, scenario.config.listen
    profiles = profiles_of(listen.profiles or ("vehicle",), listen.dbc, scenario.folder)
    rows = course.course()
    ecu, is_left = told(tap.arrived, profiles), config.departure.is_left
    found = loop_figures(rows, ecu, course.release_s, course.marking_m, is_left)
    return {"loop": found, "course": rows.round(6).tolist()}


def _scored(trace: Trace, conditions: ConditionSink) -> Result:
    score = score_trace(trace)
    return {
        "sides": {side.name: figures(side) for side in (*score.sides, score.pooled)},
        "conditions": binned(trace, conditions.joined(trace)),
    }


def _kept(
    scenario: Scenario, line: Line, folder: Path, outputs: Sequence[str], every: Every
) -> Iterator[Sink]:
    """Open what is to be kept of a run, one after the other."""
    if "trace" in outputs:
        yield open_trace(folder / FILES["trace"], scenario, line)
    if "truth" in outputs:
        yield open_truth(folder / FILES["truth"], scenario, line, every=every.truth)
    if "log" in outputs:
        yield LogSink(folder / FILES["log"])
    if "images" in outputs:
        yield open_images(scenario, line, folder=folder / FILES["images"], every=every.images)

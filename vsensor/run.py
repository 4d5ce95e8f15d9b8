"""`vsensor run`: a scenario, a bus, sinks and a clock put together."""

import contextlib
import ctypes
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import msgspec

from vsensor.bus import FrameBus, open_bus
from vsensor.clock import Clock, MonotonicClock, SimulatedClock, epoch_offset_ns
from vsensor.config import Scenario
from vsensor.errors import BusError, ConfigError
from vsensor.faults import Fault, parse_fault
from vsensor.line import Line, build_line, tick_count
from vsensor.realtime import calm_collector, real_time_priority
from vsensor.runner import Control, Summary, run_loop
from vsensor.runner.outputs import open_images, open_trace, open_truth
from vsensor.sinks import Sink
from vsensor.types import Tick

Say = Callable[[str], None]

START_UP_NS = 100_000_000
"""Time between the end of loading and slot 0: the first tick is computed, the live table starts."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RunOptions:
    """What the command line says beside the scenario."""

    bus: str | None = None
    log: Path | None = None
    trace: Path | None = None
    truth: Path | None = None
    truth_every: int = 1
    picture: Path | None = None
    images: Path | None = None
    image_every: int = 25
    video: Path | None = None
    fast: bool = False
    profile: str | None = None
    dbc: Path | None = None
    table: bool = False
    progress: bool = False
    realtime: bool = False
    faults: tuple[str, ...] = ()
    control: str | None = None


def run_scenario(
    scenario: Scenario, options: RunOptions, say: Say, stopped: Callable[[], bool] = lambda: False
) -> Summary:
    """Run a scenario to its end or until `stopped()`; raises VsensorError subclasses."""
    scenario = with_profile(scenario, options)
    with contextlib.ExitStack() as stack:
        _require_places(scenario, options)
        line = with_faults(build_line(scenario), options)
        period_ns = scenario.config.cycle_ms * 1_000_000
        ticks = tick_count(scenario, line.source)
        require_inputs(scenario, line, options)
        if ticks is None and options.fast:
            raise ConfigError(f"{scenario.name}: the drive never ends; with --fast give --duration S")
        bus = open_run_bus(options, line)
        if bus is not None:
            stack.callback(bus.close)
            bus.tell(say)
        control = _control(options, stack, say)
        keep_memory()
        warm_up(line, period_ns)
        sinks = _sinks(scenario, options, line, stack)
        say_start(bus, line, say)
        too_late = [] if ticks is None else _never_happen(line.timeline, ticks * period_ns)
        for text in (*line.source.notes, *line.source.findings, *line.uneven(period_ns), *too_late):
            say(text)
        summary = play_line(
            line,
            options,
            stack,
            say,
            stopped,
            period_ns=period_ns,
            ticks=ticks,
            bus=bus,
            sinks=sinks,
            control=control,
        )
    if bus is not None:
        summary.notes += bus.report()
    if summary.ended:
        of_all = _never_happen(line.timeline, summary.ticks * period_ns)
        summary.notes += of_all[: len(of_all) - len(too_late)]
    written = (
        *(options.log, options.trace, options.truth),
        *(options.picture, options.images, options.video),
    )
    summary.notes += [f"wrote {path}" for path in written if path]
    return summary


def play_line(
    line: Line,
    options: RunOptions,
    stack: contextlib.ExitStack,
    say: Say,
    stopped: Callable[[], bool] = lambda: False,
    *,
    period_ns: int,
    ticks: int | None,
    bus: FrameBus | None,
    sinks: Sequence[Sink],
    control: Control | None = None,
) -> Summary:
    """Run a line that is warmed up, by the clock, progress bar and priority that the options ask for."""
    clock: Clock = SimulatedClock() if options.fast else MonotonicClock()
    advance = stack.enter_context(_progress(options, ticks, period_ns))
    if options.realtime:
        stack.enter_context(real_time_priority(say))
    look_for_garbage = stack.enter_context(calm_collector())

    def on_tick(ticks_done: int) -> None:
        advance(ticks_done)
        look_for_garbage(ticks_done)

    start_ns = clock.now_ns() + START_UP_NS
    _tell_start(sinks, epoch_offset_ns() + (MonotonicClock().now_ns() if options.fast else start_ns))
    return run_loop(
        line,
        clock,
        period_ns=period_ns,
        ticks=ticks,
        start_ns=start_ns,
        bus=bus,
        sinks=sinks,
        stop=stopped,
        on_tick=on_tick,
        real_time=not options.fast,
        control=control,
    )


def with_profile(scenario: Scenario, options: RunOptions) -> Scenario:
    """Return the scenario with the profile and database that the command line gives instead."""
    if options.profile is None and options.dbc is None:
        return scenario
    output = scenario.config.output
    profile = options.profile or output.profile
    if profile.endswith(".toml") and options.profile:
        profile = str(Path(profile).resolve())
    dbc = str(options.dbc.resolve()) if options.dbc else (None if options.profile else output.dbc)
    changed = msgspec.structs.replace(output, profile=profile, dbc=dbc)
    return msgspec.structs.replace(scenario, config=msgspec.structs.replace(scenario.config, output=changed))


def with_faults(line: Line, options: RunOptions) -> Line:
    """Return the line with the faults that the command line plans beside the scenario's."""
    if not options.faults:
        return line
    more = tuple(parse_fault(text, line.profile) for text in options.faults)
    return replace(line, timeline=(*line.timeline, *more))


def _never_happen(timeline: Sequence[Fault], end_ns: int) -> list[str]:
    """Say which faults are planned for later than the run's end, the latest last."""
    late = sorted(
        (fault for fault in timeline if (fault.from_ns or 0) >= end_ns), key=lambda one: one.from_ns or 0
    )
    return [f"never happens: {fault.text()}, but the run ends after {end_ns / 1e9:g} s" for fault in late]


def _control(options: RunOptions, stack: contextlib.ExitStack, say: Say) -> Control | None:
    """Open the control socket that was asked for; it is closed when the stack unwinds."""
    if options.control is None:
        return None
    from vsensor.control import ControlServer, parse_address

    server = stack.enter_context(ControlServer(parse_address(options.control)))
    say(f"control at {server.name}: one JSON object a line")
    return server


def say_start(bus: FrameBus | None, line: Line, say: Say) -> None:
    """Say what is sent where, and what is odd about the bus."""
    if bus is not None:
        say(f"sending on {bus.name} {_rhythm(line)}, profile {line.profile.name}")
        if bus.remark:
            say(bus.remark)


def _rhythm(line: Line) -> str:
    """Return how often messages leave, as a person says it."""
    cycles = sorted({plan.cycle_ns // 1_000_000 for plan in line.profile.messages if plan.cycle_ns})
    if not cycles:
        return "on events"
    return f"every {cycles[0]} ms" if len(cycles) == 1 else f"every {cycles[0]} to {cycles[-1]} ms"


def _require_places(scenario: Scenario, options: RunOptions) -> None:
    """Refuse files that cannot be written, and those that the run reads, before anything is replaced."""
    files = (options.log, options.trace, options.truth, options.picture, options.video)
    for path in filter(None, files):
        if path.is_dir():
            raise ConfigError(f"{path}: cannot be written: is a folder")
        if not path.parent.is_dir():
            raise ConfigError(f"{path}: cannot be written: there is no folder {path.parent}")
        if path.exists() and any(path.samefile(f) for f in (scenario.source, scenario.path) if f):
            raise ConfigError(f"{path}: this run reads it, so it cannot be written over")
    if options.trace is not None:
        from vsensor.sinks.rows import writer_for

        writer_for(options.trace)
    if options.truth is not None:
        from vsensor.sinks.rows import writer_for
        from vsensor.sinks.truth_points import SUFFIXES

        writer_for(options.truth, SUFFIXES)
    if options.realtime and options.fast:
        raise ConfigError("--realtime and --fast exclude each other: --fast takes no time at all")
    if (options.images or options.video) and not options.fast:
        raise ConfigError("--images and --video need --fast: an image takes longer than a cycle to draw")


def require_inputs(scenario: Scenario, line: Line, options: RunOptions) -> None:
    """Refuse a drive that listens where nothing can arrive."""
    if line.needs_bus and options.fast and options.bus is None:
        control = scenario.config.ego.control
        raise ConfigError(
            f'{scenario.name}: ego.control = "{control}": with --fast and no --bus nothing can arrive'
        )


def open_run_bus(options: RunOptions, line: Line) -> FrameBus | None:
    """Open the bus that the options name; None where nothing is sent."""
    if options.fast and options.bus is None:
        return None
    bus = open_bus("auto" if options.bus is None else options.bus, fd=line.is_fd)
    if options.fast and not bus.is_simulated:
        bus.close()
        raise BusError(f"bus {options.bus}: --fast would flood a real bus; use it with vcan or virtual only")
    return bus


def _sinks(
    scenario: Scenario, options: RunOptions, line: Line, stack: contextlib.ExitStack
) -> Sequence[Sink]:
    """Open the sinks; each is closed when the stack unwinds, the table first.

    What can still refuse its file comes before what replaces one: a slip costs no older log.
    """
    sinks: list[Sink] = []
    if options.picture is not None:
        from vsensor.plots import PictureSink

        wheelbase_m = scenario.config.vehicle.wheelbase_m
        sinks.append(PictureSink(options.picture, line.sensor.camera, front_axle_x_m=wheelbase_m))
        stack.callback(sinks[-1].close)
    if options.images is not None or options.video is not None:
        every = options.image_every
        sinks.append(open_images(scenario, line, folder=options.images, every=every, video=options.video))
        stack.callback(sinks[-1].close)
    if options.log is not None:
        from vsensor.sinks.log import LogSink

        sinks.append(LogSink(options.log))
        stack.callback(sinks[-1].close)
    if options.trace is not None:
        sinks.append(open_trace(options.trace, scenario, line))
        stack.callback(sinks[-1].close)
    if options.truth is not None:
        sinks.append(open_truth(options.truth, scenario, line, every=options.truth_every))
        stack.callback(sinks[-1].close)
    if options.table and not options.fast:
        from vsensor.sinks.table import TableSink

        sinks.append(TableSink())
        stack.callback(sinks[-1].close)
    return sinks


def _tell_start(sinks: Sequence[Sink], epoch_ns: int) -> None:
    """Tell the log when slot 0 is; opening sinks takes up to a second, so it is not known before."""
    from vsensor.sinks.log import LogSink

    for sink in sinks:
        if isinstance(sink, LogSink):
            sink.starts_at(epoch_ns)


def warm_up(line: Line, period_ns: int) -> None:
    """Compute the first tick and throw it away: it imports and allocates what no slot should wait for."""
    line.compute(line.initial_state(), Tick(index=0, t_ns=0, period_ns=period_ns))


def keep_memory() -> None:
    """Let glibc keep freed memory: arrays that go back to the kernel fault in again, tick by tick.

    Measured on the camera stage: 0.40 ms without, 0.18 ms with. mallopt(3) numbers from malloc.h.
    """
    trim_threshold, top_pad, mmap_threshold = -1, -2, -3
    with contextlib.suppress(OSError, AttributeError):  # another C library has no mallopt
        mallopt = ctypes.CDLL(None).mallopt
        for parameter, size in ((trim_threshold, 64 << 20), (mmap_threshold, 32 << 20), (top_pad, 16 << 20)):
            mallopt(parameter, size)
    # Touched once here, so that no tick waits for the kernel to hand out pages: in a user-mode kernel
    # that takes some 10 us a page, and a new stretch of road needs hundreds.
    bytearray(b"\x01") * (24 << 20)


@contextlib.contextmanager
def _progress(options: RunOptions, ticks: int | None, period_ns: int) -> Iterator[Callable[[int], None]]:
    """Show a progress bar in simulated seconds, if wanted."""
    if not options.progress:
        yield lambda index: None
        return
    from tqdm import tqdm

    total_s = None if ticks is None else ticks * period_ns / 1e9
    with tqdm(
        total=total_s, unit="s", unit_scale=False, bar_format="{l_bar}{bar}| {n:.0f}/{total:.0f} s"
    ) as bar:

        def advance(index: int) -> None:
            if index % 25 == 0:
                bar.n = index * period_ns / 1e9
                bar.refresh()

        yield advance

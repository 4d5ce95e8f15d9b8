"""A sensor in the hands of a test: step it, override what it says, break it, read what it sent.

with Session("highway") as sensor:
    sensor.run_for(1.0)
    sensor.inject("frame_lost", message="LDS_Lane", times=3)
    sensor.run_until(lambda output: ..., timeout_s=5.0)
"""

import contextlib
from collections import deque
from collections.abc import Callable, Mapping
from math import ceil
from pathlib import Path
from typing import Any

from vsensor.bus import FrameBus
from vsensor.clock import MonotonicClock, SimulatedClock
from vsensor.config import Scenario, load_scenario
from vsensor.errors import SessionError
from vsensor.faults import fault_of, overriding
from vsensor.line import build_line
from vsensor.run import RunOptions, keep_memory, open_run_bus, require_inputs, warm_up, with_profile
from vsensor.runner import Loop, Summary
from vsensor.types import Frame, Output

MOST_FRAMES = 100_000
"""So many of the latest frames are kept for `take_frames`."""


class Session:
    """A scenario that runs in the caller's thread, tick by tick, with the loop of `vsensor run`.

    By default time is simulated: as quickly as it computes, no bus, the same frames every time. `bus`
    (`"virtual:name"`, `"socketcan:vcan0"`) sends them there; `real_time` on their time, where each call runs
    as long as it takes and between two calls nothing is sent. Raises VsensorError subclasses.
    """

    def __init__(
        self,
        scenario: str | Path | Scenario | None = None,
        *,
        bus: str | None = None,
        real_time: bool = False,
        seed: int | None = None,
        profile: str | None = None,
        dbc: Path | None = None,
        overrides: Mapping[str, Any] | None = None,
    ) -> None:
        """Load a scenario (None: the shipped one); `overrides` are its top-level keys."""
        if not isinstance(scenario, Scenario):
            told = {**(overrides or {}), **({} if seed is None else {"seed": seed})}
            scenario = load_scenario(None if scenario is None else str(scenario), told)
        elif overrides or seed is not None:
            raise SessionError("overrides and seed belong into load_scenario where a Scenario is given")
        options = RunOptions(bus=bus, fast=not real_time, profile=profile, dbc=dbc)
        self.scenario = with_profile(scenario, options)
        line = build_line(self.scenario)
        require_inputs(self.scenario, line, options)
        self._frames: deque[Frame] = deque(maxlen=MOST_FRAMES)
        with contextlib.ExitStack() as stack:
            self._bus: FrameBus | None = None
            if bus is not None:
                self._bus = open_run_bus(options, line)
            if self._bus is not None:
                stack.callback(self._bus.close)
            period_ns = self.scenario.config.cycle_ms * 1_000_000
            if real_time:
                keep_memory()
                warm_up(line, period_ns)
            self.loop = Loop(
                line,
                MonotonicClock() if real_time else SimulatedClock(),
                period_ns=period_ns,
                bus=self._bus,
                sinks=[self],
                real_time=real_time,
            )
            self._stack = stack.pop_all()
        self._is_closed = False

    def __enter__(self) -> "Session":
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Release the bus; closing twice does no harm. What was sent last can still be read."""
        self._is_closed = True
        self._stack.close()

    # ---- time ---------------------------------------------------------------------------------------

    def step(self, ticks: int = 1) -> Output:
        """Do so many ticks; returns what was sent last. Raises SessionError once the drive has ended."""
        if ticks < 1:
            raise SessionError(f"step: {ticks} ticks, at least 1 was expected")
        self.loop.catch_up()
        for _ in range(ticks):
            self._tick()
        return self.read()

    def run_for(self, seconds: float) -> Output:
        """Do the ticks of so many seconds, at least one; returns what was sent last."""
        if not 0.0 < seconds < 1e9:
            raise SessionError(f"run_for: {seconds} s, a time above 0 was expected")
        return self.step(self._ticks(seconds))

    def run_until(self, holds: Callable[[Output], bool], timeout_s: float = 10.0) -> Output:
        """Do ticks until `holds` of what was sent; returns that. Raises TimeoutError, in the run's time."""
        self.loop.catch_up()
        for _ in range(self._ticks(timeout_s)):
            self._tick()
            if self.loop.output is not None and holds(self.loop.output):
                return self.loop.output
        raise TimeoutError(f"not within {timeout_s:g} s, at {self.time_s:g} s of the run")

    @property
    def time_s(self) -> float:
        """The time of the next tick, from the start of the run."""
        return self.loop.index * self.loop.period_ns / 1e9

    # ---- what happens -------------------------------------------------------------------------------

    def inject(self, kind: str, **told: Any) -> int:
        """Let a fault happen from the next tick (or from `at_s`) on; returns its number.

        Kinds and keys are those of `[[fault]]`. Raises ConfigError.
        """
        return self.loop.inject(fault_of({"kind": kind, **told}, self.loop.line.profile, "inject"))

    def override(self, name: str, value: float | None = None, **told: Any) -> int:
        """Send `value` of a quantity (SI), or of a signal (its unit on the bus; or `raw`), until cleared.

        As for inject: `at_s`, `for_s`, `times`; returns its number. Raises ConfigError.
        """
        heads = {quantity.partition(".")[0] for quantity in self.loop.line.profile.quantities()}
        key = "quantity" if name.partition(".")[0] in heads else "signal"
        given = {key: name, **told, **({} if value is None else {"value": value})}
        return self.loop.inject(fault_of(overriding(given), self.loop.line.profile, "override"))

    def clear(self, number: int | None = None) -> None:
        """End a fault by its number, or all that have begun, with the next tick."""
        self.loop.clear(number)

    @property
    def faults(self) -> tuple[str, ...]:
        """The faults that have begun and not ended, as a person says them."""
        t_ns = self.loop.index * self.loop.period_ns
        return tuple(running.fault.text() for running in self.loop.state.faults.active(t_ns))

    # ---- what came of it ----------------------------------------------------------------------------

    def read(self) -> Output:
        """Return everything of the latest tick that was sent: truth, lines, values, frames."""
        if self.loop.output is None:
            raise SessionError("nothing was sent yet: step first")
        return self.loop.output

    def value(self, quantity: str) -> float:
        """Return a quantity as it was sent last, in SI; NaN = not available."""
        values = self.read().values
        if quantity not in values:
            raise SessionError(f"{quantity}: no quantity that is sent; such as left.offset_m")
        return values[quantity]

    def take_frames(self) -> tuple[Frame, ...]:
        """Return the frames sent since the last call (the latest MOST_FRAMES), each with its due time."""
        frames = tuple(self._frames)
        self._frames.clear()
        return frames

    def summary(self) -> Summary:
        """Return what the run did so far."""
        return self.loop.so_far()

    def write(self, output: Output) -> None:
        """Keep the frames of a tick (the loop calls it)."""
        self._frames.extend(output.frames)

    def _ticks(self, seconds: float) -> int:
        return ceil(round(seconds * 1e9) / self.loop.period_ns)

    def _tick(self) -> None:
        if self._is_closed:
            raise SessionError("the session is closed: its bus is released")
        if not self.loop.step():
            raise SessionError(f"the road or the recording has ended after {self.time_s:g} s")

"""`vsensor sweep`: a scenario over a grid of settings and seeds, each cell a run scored against the truth."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsensor.clock import SimulatedClock
from vsensor.config import Scenario, ScenarioConfig
from vsensor.errors import ConfigError
from vsensor.line import build_line, tick_count
from vsensor.runner import run_loop
from vsensor.schema import convert
from vsensor.score import SCORED_RANGES_M, ErrorStats, SideScore, score_trace
from vsensor.signals import VehicleConfig
from vsensor.sinks.trace import rows
from vsensor.sinks.trace_file import COLUMNS, ROW
from vsensor.study.cells import Outcome, run_cells
from vsensor.study.digest import file_digest, program_digest, referenced_files
from vsensor.study.store import Result
from vsensor.study.vary import MOST_CELLS, Settings, grid, parse_vary, scenario_with
from vsensor.types import Output


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What is swept: `cells[i]` is the run with `settings[i]` and `seeds[i]`."""

    name: str
    varied: dict[str, list[Any]]
    settings: tuple[Settings, ...]
    seeds: tuple[int, ...]
    cells: tuple[dict[str, Any], ...]
    folder: Path


@dataclass(frozen=True, slots=True)
class SweepCell:
    """Runs a cell in a worker; relative names in its scenario start from `folder`."""

    folder: Path

    def __call__(self, cell: dict[str, Any]) -> Result:
        """Run the cell's scenario in simulated time and score it.

        Returns {side: figures} of the sides that occur and of "all" of them, see `figures`. Raises
        ConfigError where program or files differ from those that the cell was made with.
        """
        if cell["program"] != program_digest():
            raise ConfigError("the worker's vsensor is not the one that began the sweep")
        for name, digest in cell["files"].items():
            if file_digest(self.folder / Path(name).expanduser()) != digest:
                raise ConfigError(f"{self.folder / name}: not the file that the sweep began with")
        config = convert(cell["scenario"], ScenarioConfig, "cell")
        trace = simulated_trace(Scenario(config=config, folder=self.folder))
        score = score_trace(trace)
        return {side.name: figures(side) for side in (*score.sides, score.pooled)}


def make_sweep(
    name_or_path: str, vary: Sequence[str], *, seeds: int = 1, duration_s: float | None = None
) -> Sweep:
    """Return the cells of every combination of settings with `seeds` seeds, from the scenario's seed on.

    Raises ConfigError for settings that are no scenario, VsensorErrors for what cannot be loaded.
    """
    varied = parse_vary(vary)
    for key, option in (("seed", "--seeds N"), ("duration_s", "--duration S")):
        if key in varied and (key == "seed" or duration_s is not None):
            raise ConfigError(f"--vary {key}: use {option} alone")
    if (count := seeds * int(np.prod([len(values) for values in varied.values()], dtype=float))) > MOST_CELLS:
        raise ConfigError(f"--vary, --seeds: {count} cells; at most {MOST_CELLS}")
    fixed = {} if duration_s is None else {"duration_s": duration_s}
    points = list(grid(varied))
    scenarios = [scenario_with(name_or_path, {**fixed, **point}) for point in points]
    _require_end(scenarios[0])
    return Sweep(
        name=scenarios[0].name,
        varied=varied,
        settings=tuple(point for point in points for _ in range(seeds)),
        seeds=tuple(s.config.seed + k for s in scenarios for k in range(seeds)),
        cells=tuple(cell for scenario in scenarios for cell in _cells(scenario, seeds)),
        folder=scenarios[0].folder.resolve(),
    )


def run_sweep(
    sweep: Sweep, folder: Path, *, scheduler: str | None, workers: int | None, progress: bool = False
) -> Outcome:
    """Run the cells that `folder` has not yet; see `run_cells`."""
    return run_cells(
        SweepCell(sweep.folder),
        sweep.cells,
        folder,
        scheduler=scheduler,
        workers=workers,
        progress=progress,
    )


def simulated_trace(scenario: Scenario) -> dict[str, NDArray[Any]]:
    """Return the trace (`sinks.trace`) of a whole run in simulated time, without bus and files."""
    line = build_line(scenario)
    if line.needs_bus:
        control = scenario.config.ego.control
        raise ConfigError(
            f'{scenario.name}: ego.control = "{control}": a sweep has no bus that it could come from'
        )
    sink = _TraceInMemory(scenario.config.vehicle)
    run_loop(
        line,
        SimulatedClock(),
        period_ns=scenario.config.cycle_ms * 1_000_000,
        ticks=tick_count(scenario, line.source),
        sinks=[sink],
        real_time=False,
    )
    return sink.trace()


def figures(side: SideScore) -> dict[str, float]:
    """Return the columns of the table for one side: errors in m, ranges in m, shares, numbers."""
    found: dict[str, float] = {}
    for x in SCORED_RANGES_M:
        found |= _error_figures(f"error_{x}m", side.error[x])
    return {
        **found,
        **_error_figures("lane_offset_error", side.lane_offset),
        "range_mean_m": side.range_mean_m,
        "range_5_m": side.range_5_m,
        "range_95_m": side.range_95_m,
        "availability": side.availability,
        "true_rows": side.true_rows,
        "false_reports": side.false_reports,
    }


def _error_figures(name: str, error: ErrorStats) -> dict[str, float]:
    return {
        f"{name}_n": error.n,
        f"{name}_mean_m": error.mean_m,
        f"{name}_std_m": error.std_m,
        f"{name}_abs_95_m": error.abs_95_m,
    }


def _cells(scenario: Scenario, seeds: int) -> Iterator[dict[str, Any]]:
    settings = msgspec.to_builtins(scenario.config)
    common = {"program": program_digest(), "files": referenced_files(settings, scenario.folder)}
    first = scenario.config.seed
    for seed in range(first, first + seeds):
        yield {**common, "scenario": {**settings, "seed": seed}}


def _require_end(scenario: Scenario) -> None:
    """Load what the first cell needs: what is wrong with all cells is said once, before any runs."""
    if tick_count(scenario, build_line(scenario).source) is None:
        raise ConfigError(f"{scenario.name}: the drive never ends; give --duration S")


class _TraceInMemory:
    """A sink that keeps the rows of a trace, 0.45 kB each."""

    def __init__(self, vehicle: VehicleConfig) -> None:
        self._vehicle = vehicle
        self._ticks: list[NDArray[Any]] = []

    def write(self, output: Output) -> None:
        """Keep the rows of one tick."""
        table = list(rows(output, self._vehicle.wheelbase_m, self._vehicle))
        self._ticks.append(np.array(table, ROW))

    def close(self) -> None:
        """Nothing to close."""

    def trace(self) -> dict[str, NDArray[Any]]:
        """Return the columns, as `read_trace` of a file does."""
        table = np.concatenate([*self._ticks, np.empty(0, ROW)])
        return {name: np.ascontiguousarray(table[name]) for name in COLUMNS}


def settings_text(settings: Settings, seed: int) -> str:
    """Return settings as a person gave them, for an error's line."""
    words = itertools.chain((f"{key}={value}" for key, value in settings.items()), (f"seed={seed}",))
    return " ".join(words)

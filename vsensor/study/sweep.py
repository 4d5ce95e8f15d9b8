"""`vsensor sweep`: a scenario over a grid of settings and seeds, each cell a run scored against the truth."""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.clock import SimulatedClock
from vsensor.config import Scenario
from vsensor.errors import ConfigError
from vsensor.line import build_line, tick_count
from vsensor.runner import run_loop
from vsensor.score import score_trace
from vsensor.study.cells import Outcome, run_cells
from vsensor.study.scenario_cells import (
    TraceInMemory,
    figures,
    require_end,
    scenario_cell,
    scenario_of,
    with_seed,
)
from vsensor.study.store import Result
from vsensor.study.vary import MOST_CELLS, Settings, grid, parse_vary, scenario_with


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
        trace = simulated_trace(scenario_of(cell, self.folder, "sweep"))
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
    require_end(scenarios[0])
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
    sink = TraceInMemory(scenario.config.vehicle)
    run_loop(
        line,
        SimulatedClock(),
        period_ns=scenario.config.cycle_ms * 1_000_000,
        ticks=tick_count(scenario, line.source),
        sinks=[sink],
        real_time=False,
    )
    return sink.trace()


def _cells(scenario: Scenario, seeds: int) -> Iterator[dict[str, Any]]:
    cell = scenario_cell(scenario)
    first = scenario.config.seed
    yield from (with_seed(cell, seed) for seed in range(first, first + seeds))


def settings_text(settings: Settings, seed: int) -> str:
    """Return settings as a person gave them, for an error's line."""
    words = itertools.chain((f"{key}={value}" for key, value in settings.items()), (f"seed={seed}",))
    return " ".join(words)

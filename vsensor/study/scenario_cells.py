"""Runs of scenarios as cells: what sweep and experiment share, from the cell's content to its trace."""

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from vsensor.config import Scenario, ScenarioConfig
from vsensor.errors import ConfigError
from vsensor.line import build_line, tick_count
from vsensor.schema import convert
from vsensor.score import ERROR_RANGES_M, ErrorStats, SideScore
from vsensor.signals import VehicleConfig
from vsensor.sinks.trace import rows
from vsensor.sinks.trace_file import COLUMNS, ROW
from vsensor.sources import STORY_SUFFIXES
from vsensor.sources.story_files import files_of
from vsensor.study.digest import file_digest, program_digest, referenced_files
from vsensor.types import Output


def scenario_cell(scenario: Scenario) -> dict[str, Any]:
    """Return all that a run depends on: the program, the files that the scenario names, its settings."""
    settings = msgspec.to_builtins(scenario.config)
    files = referenced_files(settings, scenario.folder) | _story_files(scenario)
    return {"program": program_digest(), "files": files, "scenario": settings}


def _story_files(scenario: Scenario) -> dict[str, str]:
    """Return {name seen from the scenario's folder: hash} of a storyboard's map and catalogs."""
    if scenario.source.suffix.lower() not in STORY_SUFFIXES:
        return {}
    files = files_of(scenario.config.storyboard.story(scenario.source))
    return {os.path.relpath(file, scenario.folder): file_digest(file) for file in files}


def with_seed(cell: Mapping[str, Any], seed: int) -> dict[str, Any]:
    """Return the cell with another seed."""
    return {**cell, "scenario": {**cell["scenario"], "seed": seed}}


def scenario_of(cell: Mapping[str, Any], folder: Path, what: str) -> Scenario:
    """Return the scenario of a cell in a worker; relative names in it start from `folder`.

    Raises ConfigError where program or files differ from those that the cell was made with.
    """
    if cell["program"] != program_digest():
        raise ConfigError(f"the worker's vsensor is not the one that began the {what}")
    for name, digest in cell["files"].items():
        if file_digest(folder / Path(name).expanduser()) != digest:
            raise ConfigError(f"{folder / name}: not the file that the {what} began with")
    return Scenario(config=convert(cell["scenario"], ScenarioConfig, "cell"), folder=folder)


def require_end(scenario: Scenario) -> None:
    """Load what the first cell needs: what is wrong with all cells is said once, before any runs."""
    if tick_count(scenario, build_line(scenario).source) is None:
        raise ConfigError(f"{scenario.name}: the drive never ends; give --duration S")


class TraceInMemory:
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


def figures(side: SideScore) -> dict[str, float]:
    """Return the columns of the table for one side: errors in m, ranges in m, shares, numbers."""
    found: dict[str, float] = {}
    for x in ERROR_RANGES_M:
        found |= _error_figures(f"error_{x}m", side.error[x])
    return {
        **found,
        **_error_figures("lane_offset_error", side.lane_offset),
        "range_mean_m": side.range_mean_m,
        "range_5_m": side.range_5_m,
        "range_95_m": side.range_95_m,
        "availability": side.availability,
        "true_rows": side.true_rows,
        "lost_rows": side.true_rows - side.reported_true_rows,
        "false_reports": side.false_reports,
    }


def _error_figures(name: str, error: ErrorStats) -> dict[str, float]:
    return {
        f"{name}_n": error.n,
        f"{name}_mean_m": error.mean_m,
        f"{name}_std_m": error.std_m,
        f"{name}_rms_m": error.rms_m,
        f"{name}_abs_95_m": error.abs_95_m,
        f"{name}_abs_max_m": error.abs_max_m,
    }

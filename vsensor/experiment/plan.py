"""The runs of a matrix as cells, and which of those that are finished count."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsensor.experiment.matrix import Matrix, points_of, seeds_of
from vsensor.experiment.runs import FILES, ExperimentCell, run_name
from vsensor.study.scenario_cells import require_end, scenario_cell, with_seed
from vsensor.study.store import Store, cell_key
from vsensor.study.vary import Settings


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan:
    """`cells[i]` is the run that `told[i]` tells from the others: scenario, seed, varied settings, run."""

    name: str
    cells: tuple[dict[str, Any], ...]
    told: tuple[Settings, ...]
    folders: dict[str, Path]

    def function(self, out: Path, bus: str | None = None) -> ExperimentCell:
        """Return what runs a cell, and keeps what is wanted of it in folders in `out`."""
        return ExperimentCell(self.folders, out, bus)


def make_plan(
    matrix: Matrix, *, outputs: Sequence[str], ecu: str = "none", duration_s: float | None = None
) -> Plan:
    """Return the runs of a matrix, `ecu` on the bus of each; raises ConfigError for what is no scenario.

    The first run of each scenario is loaded whole, so that what is wrong with all is said before any runs.
    """
    cells, told, folders = [], list[Settings](), dict[str, Path]()
    for point in points_of(matrix, duration_s):
        if point.entry not in folders:
            require_end(point.scenario)
            folders[point.entry] = point.scenario.folder.resolve()
        whole = {
            **scenario_cell(point.scenario),
            "entry": point.entry,
            "outputs": [kind for kind in FILES if kind in outputs],
            "image_every": matrix.config.image_every if "images" in outputs else 0,
            "truth_every": matrix.config.truth_every if "truth" in outputs else 0,
            "ecu": ecu,
        }
        for seed in seeds_of(matrix, point.scenario):
            cell = with_seed(whole, seed)
            cells.append(cell)
            told.append({"scenario": point.entry, **point.told, "seed": seed, "run": run_name(cell)})
    return Plan(name=matrix.name, cells=tuple(cells), told=tuple(told), folders=folders)


def forget_incomplete(plan: Plan, store: Store, out: Path) -> None:
    """Forget finished runs of which something that is to be kept has gone: they are done again."""
    for cell in plan.cells:
        folder = out / run_name(cell)
        if not all((folder / FILES[kind]).exists() for kind in cell["outputs"]):
            store.forget(cell_key(cell))

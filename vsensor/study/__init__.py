"""Many runs at once: `run_cells` is the one resumable runner; `sweep_scenario` is `vsensor sweep`."""

from vsensor.study.cells import Failure, Outcome, run_cells
from vsensor.study.report import SweepOptions, SweepReport, sweep_scenario
from vsensor.study.store import Store, cell_key

__all__ = [
    "Failure",
    "Outcome",
    "Store",
    "SweepOptions",
    "SweepReport",
    "cell_key",
    "run_cells",
    "sweep_scenario",
]

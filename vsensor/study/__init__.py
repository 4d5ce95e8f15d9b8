"""Many runs at once: `run_cells` is the one resumable runner; `sweep_scenario` is `vsensor sweep`.

What sweeps is imported when it is asked for: a worker of other cells starts in a tenth of the time.
"""

from typing import TYPE_CHECKING

from vsensor.study.cells import Failure, Outcome, run_cells
from vsensor.study.store import Store, cell_key

if TYPE_CHECKING:
    from vsensor.study.report import SweepOptions, SweepReport, sweep_scenario

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


def __getattr__(name: str) -> object:
    """Import the sweep when it is asked for."""
    if name in ("SweepOptions", "SweepReport", "sweep_scenario"):
        from vsensor.study import report

        return getattr(report, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

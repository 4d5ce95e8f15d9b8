"""`vsensor experiment`: scenarios x seeds x settings, each run kept and scored, a table and a report page."""

from vsensor.experiment.matrix import Matrix, load_matrix, shipped_matrices
from vsensor.experiment.report import ExperimentOptions, ExperimentReport, run_experiment

__all__ = [
    "ExperimentOptions",
    "ExperimentReport",
    "Matrix",
    "load_matrix",
    "run_experiment",
    "shipped_matrices",
]

"""The errors of the real sensor: `file` reads and writes a library of models, `law` and `process` make them.

`model` says what a model is, `rule` which one of a library holds.
"""

from vsensor.error_model.file import DEFAULT_FILE, SCHEMA, load_library, save_library
from vsensor.error_model.law import ErrorLaw, ErrorModelConfig, compile_law, load_law
from vsensor.error_model.model import ErrorLibrary, ErrorModel, library_of, model_of, normal_model
from vsensor.error_model.process import ErrorState, apply, initial_state, reach, report
from vsensor.error_model.report import ReportState
from vsensor.error_model.rule import Conditions, Rule

__all__ = [
    "DEFAULT_FILE",
    "SCHEMA",
    "Conditions",
    "ErrorLaw",
    "ErrorLibrary",
    "ErrorModel",
    "ErrorModelConfig",
    "ErrorState",
    "ReportState",
    "Rule",
    "apply",
    "compile_law",
    "initial_state",
    "library_of",
    "load_law",
    "load_library",
    "model_of",
    "normal_model",
    "reach",
    "report",
    "save_library",
]

"""The errors of the real sensor: `file` reads and writes a model, `law` makes its errors."""

from vsensor.error_model.file import DEFAULT_FILE, SCHEMA, ErrorModel, load_model, save_model
from vsensor.error_model.law import (
    ErrorLaw,
    ErrorModelConfig,
    ErrorState,
    apply,
    compile_law,
    initial_state,
    load_law,
)

__all__ = [
    "DEFAULT_FILE",
    "SCHEMA",
    "ErrorLaw",
    "ErrorModel",
    "ErrorModelConfig",
    "ErrorState",
    "apply",
    "compile_law",
    "initial_state",
    "load_law",
    "load_model",
    "save_model",
]

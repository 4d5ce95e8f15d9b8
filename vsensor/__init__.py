"""A virtual lane-detection sensor: a road scene in, DBC-defined lane frames on CAN out."""

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vsensor.session import Session

__all__ = ["Session"]


def __getattr__(name: str) -> object:
    """Import what the package offers when it is asked for; one stage alone loads nothing else."""
    if name == "Session":
        from vsensor.session import Session

        return Session
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")

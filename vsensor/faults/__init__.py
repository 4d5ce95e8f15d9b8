"""Faults on demand: what a broken sensor, a dirty windscreen or a bad bus would do, as values.

    FaultConfig --fault_of--> Fault --Inject--> FaultState --advance, each tick--> Effects, Spoiler

A fault acts at one place of the line: the sensor's state (blocked, failed, reset), its lines, its image, a
value, bits and counter of a frame before protection, a frame after it, the bus. What follows is made of that
as ever.
"""

from vsensor.faults.config import FaultConfig
from vsensor.faults.fault import Fault, fault_of, faults_of, overriding
from vsensor.faults.kinds import KINDS, Kind
from vsensor.faults.lines import spoiled_lines
from vsensor.faults.spoiled import NOT_SPOILED, Spoiled
from vsensor.faults.spoiler import Spoiler
from vsensor.faults.state import (
    NO_EFFECTS,
    NO_FAULTS,
    Clear,
    Command,
    Effects,
    FaultState,
    Inject,
    Running,
    advance,
    initial_state,
)
from vsensor.faults.told import parse_fault

__all__ = [
    "KINDS",
    "NOT_SPOILED",
    "NO_EFFECTS",
    "NO_FAULTS",
    "Clear",
    "Command",
    "Effects",
    "Fault",
    "FaultConfig",
    "FaultState",
    "Inject",
    "Kind",
    "Running",
    "Spoiled",
    "Spoiler",
    "advance",
    "fault_of",
    "faults_of",
    "initial_state",
    "overriding",
    "parse_fault",
    "spoiled_lines",
]

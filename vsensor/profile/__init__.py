"""Profiles: which model quantity each signal of a bus carries, both ways."""

from vsensor.profile.compiled import (
    Binding,
    Column,
    Guard,
    MessagePlan,
    Profile,
    Validity,
    quantisation_error_m,
)
from vsensor.profile.config import GeometryConfig, ProfileConfig
from vsensor.profile.load import SCHEMA, load_profile, load_profiles, shipped_profiles
from vsensor.profile.quantities import QUANTITIES, UNITS, Indicator, LaneChange, Quantity, Wiper

__all__ = [
    "QUANTITIES",
    "SCHEMA",
    "UNITS",
    "Binding",
    "Column",
    "GeometryConfig",
    "Guard",
    "Indicator",
    "LaneChange",
    "MessagePlan",
    "Profile",
    "ProfileConfig",
    "Quantity",
    "Validity",
    "Wiper",
    "load_profile",
    "load_profiles",
    "quantisation_error_m",
    "shipped_profiles",
]

"""Profiles: which model quantity each signal of a bus carries, both ways."""

from vsensor.profile.binding import Binding, Part, Validity
from vsensor.profile.compiled import Column, MessagePlan, Profile, quantisation_error_m
from vsensor.profile.config import GeometryConfig, ProfileConfig
from vsensor.profile.load import SCHEMA, load_profile, load_profiles, shipped_profiles
from vsensor.profile.quantities import LINES, QUANTITIES, UNITS, Indicator, LaneChange, Quantity, Wiper

__all__ = [
    "LINES",
    "QUANTITIES",
    "SCHEMA",
    "UNITS",
    "Binding",
    "Column",
    "GeometryConfig",
    "Indicator",
    "LaneChange",
    "MessagePlan",
    "Part",
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

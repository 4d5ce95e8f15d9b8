"""Profiles: which model quantity each signal of a bus carries, both ways."""

from vsensor.profile.bind import hint
from vsensor.profile.binding import Binding, Part, Validity
from vsensor.profile.bursts import NOTHING_OPEN, Assembly, Burst, FrameKey, Image, left_over
from vsensor.profile.columns import Column
from vsensor.profile.compiled import Profile
from vsensor.profile.config import GeometryConfig, ProfileConfig
from vsensor.profile.load import SCHEMA, load_profile, load_profiles, load_worded, shipped_profiles
from vsensor.profile.messages import compile_profile
from vsensor.profile.pages import Page
from vsensor.profile.plan import MessagePlan
from vsensor.profile.quantisation import quantisation_error_m
from vsensor.profile.quantities import (
    LINES,
    QUANTITIES,
    RAIN_OF_WIPER,
    UNITS,
    Indicator,
    LaneChange,
    LaneWarning,
    Quantity,
    Wiper,
    wiper_of,
)

__all__ = [
    "LINES",
    "NOTHING_OPEN",
    "QUANTITIES",
    "RAIN_OF_WIPER",
    "SCHEMA",
    "UNITS",
    "Assembly",
    "Binding",
    "Burst",
    "Column",
    "FrameKey",
    "GeometryConfig",
    "Image",
    "Indicator",
    "LaneChange",
    "LaneWarning",
    "MessagePlan",
    "Page",
    "Part",
    "Profile",
    "ProfileConfig",
    "Quantity",
    "Validity",
    "Wiper",
    "compile_profile",
    "hint",
    "left_over",
    "load_profile",
    "load_profiles",
    "load_worded",
    "quantisation_error_m",
    "shipped_profiles",
    "wiper_of",
]

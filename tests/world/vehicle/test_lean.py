"""The body's lean from masses and springs, in closed form, and where `[motion]` takes it."""

from math import degrees

import pytest

from vsensor.errors import ConfigError
from vsensor.world.vehicle import DynamicsConfig, lean_degpmps2


def test_pitch_is_the_moment_of_inertia_forces_over_the_springs():
    config = DynamicsConfig(anti_dive=0.25, front_spring_npm=40e3, rear_spring_npm=60e3)
    pitch, _ = lean_degpmps2(config, 2.8)
    assert pitch == pytest.approx(degrees(1600 * 0.55 * 0.75 / (40e3 * 1.25**2 + 60e3 * 1.55**2)))


def test_roll_counts_the_weight_that_leans_over():
    _, roll = lean_degpmps2(DynamicsConfig(roll_centre_height_m=0.15), 2.8)
    assert roll == pytest.approx(degrees(1600 * 0.4 / (120e3 - 1600 * 9.81 * 0.4)))


def test_the_default_vehicle_leans_as_the_default_body_does():
    """`[motion]` was 0.15 and 0.4 before masses and springs were known: the same car."""
    assert lean_degpmps2(DynamicsConfig(), 2.8) == pytest.approx((0.15, 0.4), rel=0.03)


def test_a_vehicle_that_falls_over_is_refused():
    with pytest.raises(ConfigError, match="else it falls over"):
        lean_degpmps2(DynamicsConfig(roll_stiffness_nmprad=7e3), 2.8)

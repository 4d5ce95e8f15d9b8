"""The magic formula of an axle: slope, peak and the friction circle in closed form."""

from math import sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.world.vehicle.tyres import Tyres

STIFFNESS, LOAD, FRICTION = 120_000.0, 8_700.0, 0.8
TYRES = Tyres.of(STIFFNESS, LOAD, FRICTION, 1.3, -1.0)


def force(slip_rad, load=LOAD, along=0.0):
    return TYRES.force(*TYRES.grip(load, along), slip_rad)


def slope(load, along=0.0):
    return force(1e-6, load, along) / 1e-6


def test_a_small_slip_gives_the_axles_stiffness():
    assert slope(LOAD) == pytest.approx(STIFFNESS, rel=1e-6)


def test_the_largest_force_is_friction_times_load_at_the_peak_slip():
    slope_of_x, peak = TYRES.grip(LOAD, 0.0)
    at_peak = TYRES.peak_x / slope_of_x
    assert force(at_peak) == pytest.approx(FRICTION * LOAD, rel=1e-12) == pytest.approx(peak)
    assert force(0.98 * at_peak) < force(at_peak) > force(1.02 * at_peak)


@given(st.floats(-1.5, 1.5), st.floats(500, 30_000), st.floats(-1, 1))
def test_the_force_never_leaves_the_friction_circle(slip, load, along):
    """The circle leaves sqrt(1 - along^2); at the limit a twentieth of the grip stays."""
    across = force(slip, load, along) / (FRICTION * load)
    assert abs(across) <= sqrt(max(1.0 - along**2, 0.05**2)) * (1.0 + 1e-12)
    assert force(-slip, load, along) == -force(slip, load, along)


def test_a_thousandth_more_load_makes_the_axle_six_ten_thousandths_stiffer():
    """sin(2 atan(x)) about x = 0.5: its elasticity is (1 - x^2) / (1 + x^2) = 0.6."""
    assert slope(1.001 * LOAD) / slope(LOAD) == pytest.approx(1.0006, abs=1e-6)


def test_braking_leaves_the_stiffness_and_takes_the_peak():
    assert slope(LOAD, -0.6) == pytest.approx(slope(LOAD), rel=1e-5)
    assert TYRES.grip(LOAD, -0.6)[1] == pytest.approx(0.8 * TYRES.grip(LOAD, 0.0)[1])

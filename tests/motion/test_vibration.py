"""The law of the noise: algebra of the exact discretisation, and its spectrum over hours."""

import math

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import welch

from vsensor.motion import PRESETS_MRAD, MotionConfig, Vibration
from vsensor.motion.vibration import BROADBAND_HZ, NORMALS, _counted_share, _step

HOURS = 4
SHAKING = [name for name in PRESETS_MRAD if name != "none"]


def states(rate_hz, seconds, seed):
    """Return the noise's states at `rate_hz`, of whatever preset: presets differ in size alone."""
    normals = np.random.default_rng(seed).standard_normal((round(rate_hz * seconds), NORMALS)).tolist()
    vibration = Vibration.of(MotionConfig(vibration="normal"))
    found = [vibration.start(normals[0])]
    for fresh in normals[1:]:
        found.append(vibration.advance(found[-1], round(1e9 / rate_hz), fresh))
    return found


@pytest.fixture(scope="module")
def hours():
    """States of a long drive at 25 Hz."""
    return states(25, HOURS * 3600, 1)


def series(found, **config):
    """Return pitch, roll (mrad) and heave (mm), (N, 3)."""
    vibration = Vibration.of(MotionConfig(**config))
    return 1e3 * np.array([vibration.motion(state) for state in found])


def std_above(values, rate_hz, from_hz=0.3, to_hz=math.inf):
    """Return the standard deviation of what is faster than `from_hz`."""
    frequency, density = welch(values, rate_hz, nperseg=round(400 * rate_hz))
    counted = (frequency >= from_hz) & (frequency < to_hz)
    return math.sqrt(density[counted].sum() * frequency[1])


# Over 4 h the mean square of the roughness, correlated over some 4 s, is known to 3 %: the standard
# deviation to 1.7 %. Tolerances are 3.5 of these.


@pytest.mark.parametrize("preset", SHAKING)
def test_a_preset_has_its_standard_deviation_above_three_tenths_of_a_hertz(hours, preset):
    pitch, roll, heave = series(hours, vibration=preset).T
    expected = PRESETS_MRAD[preset]
    assert 0.3 <= expected <= 3.0
    assert std_above(pitch, 25) == pytest.approx(expected, rel=0.06)
    assert std_above(roll, 25) == pytest.approx(expected, rel=0.06)
    assert std_above(heave, 25) == pytest.approx(4 * expected, rel=0.06)


@pytest.mark.parametrize("preset", SHAKING)
def test_ninety_nine_percent_of_a_preset_lie_within_what_real_cameras_show(hours, preset):
    pitch = series(hours, vibration=preset)[:, 0]
    assert 1.0 < np.quantile(np.abs(pitch), 0.99) < 12.0


def test_the_roughness_changes_so_that_ninety_nine_percent_lie_within_three_and_a_half_deviations(hours):
    pitch = series(hours, vibration="normal")[:, 0]
    # P(|n| exp(0.6 g - 0.36) > q) = 0.01 for normal n, g has q = 3.55
    assert np.quantile(np.abs(pitch), 0.99) / pitch.std() == pytest.approx(3.55, rel=0.05)
    even = series(hours, vibration="normal", vibration_spread=0.0)[:, 0]
    assert np.quantile(np.abs(even), 0.99) / even.std() == pytest.approx(2.576, rel=0.02)


@pytest.mark.parametrize("preset", SHAKING)
def test_the_spectrum_of_a_preset_peaks_between_three_and_seven_tenths_of_a_hertz(hours, preset):
    for values in series(hours, vibration=preset).T:
        frequency, density = welch(values, 25, nperseg=1024)  # bins of 0.024 Hz, 700 of them averaged
        assert 0.3 <= frequency[density.argmax()] <= 0.7
        slow = density[(frequency > 0) & (frequency < 0.1)].mean()
        assert slow < density.max() / 3  # a lean that lasts is mounting


def test_numbers_say_the_size_of_each_axis(hours):
    pitch, roll, heave = series(
        hours, vibration=2.0, vibration_roll_mrad=0.5, vibration_heave_mm=1.5, vibration_spread=0.0
    ).T
    assert std_above(pitch, 25) == pytest.approx(2.0, rel=0.03)
    assert std_above(roll, 25) == pytest.approx(0.5, rel=0.03)
    assert std_above(heave, 25) == pytest.approx(1.5, rel=0.03)


def test_the_axes_shake_for_themselves(hours):
    correlation = np.corrcoef(series(hours, vibration="normal", vibration_spread=0.0).T)
    np.testing.assert_allclose(correlation, np.eye(3), atol=0.04)  # 4 of 1 / sqrt(2 * 0.5 Hz * 4 h)


def test_the_law_does_not_depend_on_the_length_of_a_tick(hours):
    fast = states(100, 3600, 2)
    config = {"vibration": "normal", "vibration_spread": 0.0}
    slow_pitch, fast_pitch = series(hours, **config)[:, 0], series(fast, **config)[:, 0]
    for from_hz, to_hz in ((0.3, 50.0), (0.3, 1.0), (1.0, 5.0)):
        # 1 h has 2 * 0.5 Hz * 3600 s independent values: 1.2 % of the deviation; below 5 Hz of 12.5
        # what 25 Hz folds back is 3 % of what is there
        expected = std_above(slow_pitch, 25, from_hz, to_hz)
        assert std_above(fast_pitch, 100, from_hz, to_hz) == pytest.approx(expected, rel=0.06)


# What is exact


@pytest.mark.parametrize("period_ns", [1_000_000, 40_000_000, 1_000_000_000, 10**12])
def test_a_step_leaves_the_stationary_law_as_it_is(period_ns):
    aa, ab, ba, bb, k0, k1, k2, broad, broad_kick, rough, rough_kick = _step(
        Vibration.of(MotionConfig(vibration="normal")), period_ns
    )
    transition, noise = np.array([[aa, ab], [ba, bb]]), np.array([[k0, 0.0], [k1, k2]])
    np.testing.assert_allclose(transition @ transition.T + noise @ noise.T, np.eye(2), atol=1e-14)
    assert broad**2 + broad_kick**2 == pytest.approx(1.0, abs=1e-15)
    assert rough**2 + rough_kick**2 == pytest.approx(1.0, abs=1e-15)


def test_four_ticks_are_one_of_four_times_the_length():
    vibration = Vibration.of(MotionConfig(vibration="normal"))
    short, long = _step(vibration, 10_000_000), _step(vibration, 40_000_000)
    np.testing.assert_allclose(
        np.linalg.matrix_power(np.reshape(short[:4], (2, 2)), 4), np.reshape(long[:4], (2, 2)), atol=1e-14
    )
    assert short[7] ** 4 == pytest.approx(long[7], abs=1e-14)
    assert short[9] ** 4 == pytest.approx(long[9], abs=1e-14)


@pytest.mark.parametrize("period_ns", [10_000_000, 40_000_000])
def test_every_element_of_the_state_keeps_its_unit_variance(period_ns):
    vibration = Vibration.of(MotionConfig(vibration="normal"))
    nothing = [0.0] * NORMALS
    kept = [vibration.advance(row, period_ns, nothing) for row in np.eye(NORMALS).tolist()]
    fresh = [vibration.advance(nothing, period_ns, row) for row in np.eye(NORMALS).tolist()]
    covariance = np.transpose(kept) @ kept + np.transpose(fresh) @ fresh
    np.testing.assert_allclose(covariance, np.eye(NORMALS), atol=1e-14)


def test_what_is_remembered_does_not_depend_on_the_length_of_a_tick():
    vibration = Vibration.of(MotionConfig(vibration="normal"))
    state = long = tuple(np.random.default_rng(1).standard_normal(NORMALS).tolist())
    for _ in range(4):
        state = vibration.advance(state, 10_000_000, [0.0] * NORMALS)
    np.testing.assert_allclose(state, vibration.advance(long, 40_000_000, [0.0] * NORMALS), atol=1e-14)


@pytest.mark.parametrize("broadband", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(("peak_hz", "damping"), [(0.5, 0.35), (0.3, 0.05), (5.0, 0.9)])
def test_the_share_above_three_tenths_of_a_hertz_is_that_of_the_spectrum(peak_hz, damping, broadband):
    def density(f):
        of_peak = f**2 / ((peak_hz**2 - f**2) ** 2 + (2 * damping * peak_hz * f) ** 2)
        of_peak *= 4 * damping * peak_hz / math.pi
        of_broad = 2 / math.pi * BROADBAND_HZ / (f**2 + BROADBAND_HZ**2)
        return (1 - broadband) * of_peak + broadband * of_broad

    below = quad(density, 0.0, 0.3, epsabs=1e-12)[0]
    assert _counted_share(peak_hz, damping, broadband) == pytest.approx(1.0 - below, abs=1e-9)


def test_nothing_shakes_where_nothing_was_asked_for():
    assert Vibration.of(MotionConfig()) is None
    assert Vibration.of(MotionConfig(vibration=0.0)) is None
    assert Vibration.of(MotionConfig(vibration="none", vibration_roll_mrad=2.0)) is None

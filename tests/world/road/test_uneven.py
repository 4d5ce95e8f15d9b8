"""Bumps and rough stretches of a road: heights, spectrum, and what the body on its springs does."""

import itertools
import math

import numpy as np
import pytest
from scipy.integrate import quad

from tests.world.road.made import STRAIGHT, built, written
from vsensor import motion
from vsensor.cli import main
from vsensor.draws import Draws
from vsensor.motion import BumpConfig, MotionConfig, load_motion
from vsensor.motion.swell import swell_height_m
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.types import Tick
from vsensor.world.corridor import Corridor
from vsensor.world.rough import CLASSES, band_variance_m2, rough_swells, spectrum_m3, waves
from vsensor.world.route import CorridorConfig

PERIOD_NS = 40_000_000
WHEELBASE_M = 2.8
BUMP = "bump = [{ at_m = 30, length_m = 0.6, height_m = 0.05 }]\n"


def body_motion(drive, config, ticks):
    """Return heave of the middle between the axles, and pitch, (ticks,), of a drive."""
    model = load_motion(config, WHEELBASE_M)
    state, rows = motion.initial_state(), []
    for index in range(ticks):
        tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
        _, snapshot = drive.advance(None, tick, ())
        state, ego = motion.advance(model, state, snapshot.ego, Draws(0), tick)
        rows.append((ego.body_heave_m - 0.5 * WHEELBASE_M * math.sin(ego.body_pitch_rad), ego.body_pitch_rad))
    return np.array(rows).T


def road_drive(folder, more, speed_kmh, lane=-1):
    return MapDrive(
        Corridor(built(folder, STRAIGHT + more), CorridorConfig(road="1", lane=lane)),
        EgoConfig(speed_kmh=speed_kmh),
    )


def heave_by_duhamel(speed, t, frequency=1.3, damping=0.35):
    """Return the heave at t by quadrature of the response to an impulse, bump by axle."""
    w = 2 * math.pi * frequency
    damped = w * math.sqrt(1 - damping**2)
    turn = 2 * math.pi / 0.6

    def response(after):
        return math.exp(-damping * w * after) * math.sin(damped * after) / damped

    def force(s):
        return 0.025 * (w**2 * (1 - math.cos(turn * s)) + 2 * damping * w * speed * turn * math.sin(turn * s))

    total = 0.0
    for axle in (0.0, WHEELBASE_M):
        on, off = (30.0 - axle) / speed, (30.6 - axle) / speed
        if t > on:
            part = quad(
                lambda at, on=on: response(t - at) * force(speed * (at - on)),
                on,
                min(off, t),
                epsabs=1e-13,
                epsrel=1e-11,
            )[0]
            total += part / 2
    return total


@pytest.mark.parametrize("speed_kmh", [36.0, 108.0])
def test_the_heave_over_a_bump_is_that_of_the_oscillator_at_every_speed(tmp_path, speed_kmh):
    drive = road_drive(tmp_path, BUMP, speed_kmh)
    speed = speed_kmh / 3.6
    ticks = int(30.0 / speed / 0.04) + 20
    heave, _ = body_motion(drive, MotionConfig(body=True), ticks)
    expected = [heave_by_duhamel(speed, index * 0.04) for index in range(ticks)]
    np.testing.assert_allclose(heave, expected, atol=1e-9)
    assert np.abs(heave).max() > 1e-3


def test_a_bump_of_the_road_moves_the_body_like_one_of_the_scenario(tmp_path):
    with_road = body_motion(road_drive(tmp_path, BUMP, 72.0), MotionConfig(body=True), 60)
    bump = BumpConfig(at_m=30.0, length_m=0.6, height_m=0.05)
    with_list = body_motion(road_drive(tmp_path, "", 72.0), MotionConfig(body=True, bumps=(bump,)), 60)
    np.testing.assert_allclose(with_road, with_list, atol=1e-12)


def test_an_even_road_has_nothing_under_the_wheels(tmp_path):
    assert Corridor(built(tmp_path, STRAIGHT)).uneven(100.0) is None


def test_a_bump_lies_where_an_oncoming_drive_meets_it(tmp_path):
    drive = Corridor(built(tmp_path, STRAIGHT + "left = [{}]\n" + BUMP), CorridorConfig(road="1", lane=1))
    (swell,) = drive.uneven(260.0).swells
    assert (swell.from_m, swell.to_m) == pytest.approx((269.4, 270.0), abs=1e-9)
    assert swell_height_m(swell, 269.7) == pytest.approx(0.05, abs=1e-12)


def test_an_oncoming_drive_meets_the_same_heights_in_the_other_order(tmp_path):
    more = "left = [{}]\nrough = [{ from_m = 20, to_m = 280, grade = 'C' }]\n"
    road_map = built(tmp_path, STRAIGHT + more)
    there, back = (Corridor(road_map, CorridorConfig(road="1", lane=lane)) for lane in (-1, 1))
    for s in (21.0, 50.3, 150.0, 279.0):
        heights = [
            sum(swell_height_m(one, at) for one in drive.uneven(at).swells)
            for drive, at in ((there, s), (back, 300.0 - s))
        ]
        assert heights[0] == pytest.approx(heights[1], abs=1e-9)
        assert heights[0] != 0.0


def test_heights_have_no_step_where_a_rough_stretch_is_cut_into_blocks(tmp_path):
    more = "rough = [{ from_m = 20, to_m = 280, grade = 'C' }]\n"
    drive = Corridor(built(tmp_path, STRAIGHT + more), CorridorConfig(road="1", lane=-1))
    s = np.concatenate([edge + np.array([-1e-7, 1e-7]) for edge in (20.0, 22.0, 200.0, 278.0, 280.0)])
    heights = [sum(swell_height_m(one, at) for one in drive.uneven(at).swells) for at in s]
    np.testing.assert_allclose(heights[::2], heights[1::2], atol=1e-7)
    assert heights[0] == 0.0
    assert abs(heights[4]) > 1e-4


def test_each_class_of_iso_8608_has_four_times_the_spectrum_of_the_one_before():
    at_reference = [float(spectrum_m3(grade, np.array(0.1))) for grade in CLASSES]
    np.testing.assert_allclose(at_reference, 16e-6 * 4.0 ** np.arange(8), rtol=1e-12)


def test_the_waves_have_the_variance_of_the_spectrum_in_every_part_of_the_band():
    wave, amplitude = waves("C", seed=5)
    edges = np.geomspace(0.011, 2.83, len(wave) + 1)
    frequency = wave / (2 * math.pi)
    assert ((frequency >= edges[:-1]) & (frequency <= edges[1:])).all()
    by_quadrature = [
        quad(lambda n: float(spectrum_m3("C", n)), a, b)[0] for a, b in itertools.pairwise(edges)
    ]
    np.testing.assert_allclose(np.abs(amplitude) ** 2 / 2, by_quadrature, rtol=1e-9)


def test_the_measured_spectrum_of_a_rough_road_is_that_of_its_class():
    """The periodogram of 4 km, averaged over octaves: the standard's own way to class a road."""
    (_, middle, _) = rough_swells("D", 0.0, 4100.0, seed=3)
    s = 2.0 + 0.3 * np.arange(13_600)
    heights = np.zeros(len(s))
    for wave, amplitude in zip(middle.wave_radpm, middle.amplitude_m, strict=True):
        heights += (amplitude * np.exp(1j * wave * (s - middle.from_m))).real
    window = np.hanning(len(s))
    power = np.abs(np.fft.rfft(heights * window)) ** 2 * 2 * 0.3 / (window**2).sum()
    frequency = np.fft.rfftfreq(len(s), 0.3)
    for low in 0.0221 * 2.0 ** np.arange(6):
        mine = (frequency >= low) & (frequency < 2 * low)
        measured = power[mine].sum() * (frequency[1] - frequency[0])
        assert measured == pytest.approx(float(band_variance_m2("D", low, 2 * low)), rel=0.25)


def test_a_rough_road_is_the_same_for_the_same_seed_alone():
    first, again, other = (rough_swells("B", 0.0, 50.0, seed)[1].amplitude_m for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert not np.array_equal(first, other)


def test_check_says_that_nobody_feels_the_bumps_of_a_road(tmp_path, capsys):
    path = written(tmp_path, 'schema = "vsensor.scenario/1"\nsource = "road.toml"\n', "drive.toml")
    written(tmp_path, STRAIGHT + BUMP)
    assert main(["check", str(path)]) == 1
    assert "motion.body = false: the road's bumps" in capsys.readouterr().out

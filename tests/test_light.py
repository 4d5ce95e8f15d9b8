"""Light on the road and through the air: closed forms of Koschmieder's law, and what goes with what."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from vsensor import light
from vsensor.types import Beam, Colour, Environment, Light

AHEAD_M = np.linspace(2.0, 300.0, 300)
STRAIGHT = np.zeros_like(AHEAD_M)
LEAST = 0.1
NIGHT = Environment(light=Light.NIGHT)
WEATHERS = [
    Environment(),
    Environment(visibility_m=150.0),
    Environment(rain=0.6),
    NIGHT,
    replace(NIGHT, rain=0.4, visibility_m=300.0),
    Environment(light=Light.DUSK, visibility_m=80.0),
]


def contrast(environment, paint=1.0):
    return light.contrast(environment, AHEAD_M, STRAIGHT, paint)


@pytest.mark.parametrize("visibility_m", [30.0, 100.0, 400.0])
def test_at_the_visibility_a_twentieth_of_a_contrast_against_the_sky_is_left(visibility_m):
    k = light.extinction_per_m(Environment(visibility_m=visibility_m))
    assert math.exp(-k * visibility_m) == pytest.approx(0.05)


@pytest.mark.parametrize("visibility_m", [50.0, 100.0, 250.0])
def test_in_fog_by_day_paint_is_seen_as_far_as_koschmieders_law_says(visibility_m):
    fog = Environment(visibility_m=visibility_m, beam=Beam.OFF)
    paint, road, sky = 0.13, 0.07, 1.0 / math.pi  # luminance per illuminance
    dark = light.CAMERA_CD_PER_M2 / light.AMBIENT_LX[Light.DAY]
    # (paint - road) T = LEAST (road T + sky (1 - T) + dark)
    clear = LEAST * (sky + dark) / (paint - road - LEAST * (road - sky))
    expected = -math.log(clear) / light.extinction_per_m(fog)
    assert light.visible_range_m(fog, LEAST) == pytest.approx(expected, abs=0.1)


def test_half_the_visibility_halves_the_range():
    near, far = (light.visible_range_m(Environment(visibility_m=v, beam=Beam.OFF), LEAST) for v in (100, 200))
    assert far == pytest.approx(2 * near, abs=0.2)


@pytest.mark.parametrize("weather", WEATHERS)
def test_contrast_never_rises_with_distance(weather):
    assert (np.diff(contrast(weather)) <= 1e-12).all()


@pytest.mark.parametrize("weather", WEATHERS)
def test_contrast_is_proportional_to_the_paint_that_is_left(weather):
    np.testing.assert_allclose(contrast(weather, 0.3), 0.3 * contrast(weather), rtol=1e-12)


@pytest.mark.parametrize("weather", WEATHERS)
@pytest.mark.parametrize("worse", [{"rain": 1.0}, {"visibility_m": 40.0}])
def test_more_rain_or_fog_lowers_the_contrast_wherever_there_is_some(weather, worse):
    worse = replace(weather, beam=weather.headlights, **worse)
    assert (contrast(worse) <= contrast(weather) + 1e-12).all()


def test_on_a_clear_day_distance_takes_nothing():
    day = contrast(Environment())
    np.testing.assert_allclose(day, day[0])
    assert light.visible_range_m(Environment(), LEAST) == math.inf


def test_at_night_low_beams_end_the_sight_a_little_behind_their_cut_off():
    cut_off_m = light.LAMP_HEIGHT_M / light.CUT_OFF_SLOPE
    assert cut_off_m < light.visible_range_m(NIGHT, LEAST) < 1.3 * cut_off_m


def test_high_beams_see_farther_than_low_ones_and_without_any_there_is_next_to_nothing():
    ranges = [
        light.visible_range_m(replace(NIGHT, beam=beam), LEAST) for beam in (Beam.OFF, Beam.LOW, Beam.HIGH)
    ]
    assert ranges[0] < 5.0 < ranges[1] < ranges[2] / 2


def test_high_beams_in_fog_see_less_far_than_low_ones():
    """The fog that they light up outshines what they light up of the road."""
    fog = replace(NIGHT, visibility_m=40.0)
    low, high = (light.visible_range_m(replace(fog, beam=beam), LEAST) for beam in (Beam.LOW, Beam.HIGH))
    assert high < low


def test_at_night_wet_paint_is_seen_less_far_than_dry():
    assert light.visible_range_m(replace(NIGHT, rain=0.5), LEAST) < light.visible_range_m(NIGHT, LEAST) - 5.0


def test_headlights_fall_with_the_square_of_the_distance():
    high = light.beam_cd(Beam.HIGH, AHEAD_M, STRAIGHT)
    np.testing.assert_allclose(high, high[0])
    dark = replace(NIGHT, beam=Beam.HIGH)
    ratio = light.contrast(dark, np.array([150.0, 300.0]), np.zeros(2))
    assert ratio[0] / ratio[1] == pytest.approx(
        4.0, rel=0.1
    )  # the camera's own luminance is most of the rest


def test_the_beam_is_half_as_bright_aside_at_its_slope():
    aside = light.BEAM_ASIDE_M + light.BEAM_SLOPE * AHEAD_M
    np.testing.assert_allclose(
        light.beam_cd(Beam.LOW, AHEAD_M, aside), light.beam_cd(Beam.LOW, AHEAD_M, STRAIGHT) / 2
    )


def test_white_paint_stands_out_most_and_every_colour_on_a_clear_day():
    left = light.paint_left(1.0, np.array(list(Colour), np.uint8))
    assert left.max() == left[Colour.WHITE] == 1.0
    assert (contrast(Environment())[0] * left > LEAST).all()


@pytest.mark.parametrize(
    ("environment", "beam"),
    [
        (Environment(), Beam.OFF),
        (Environment(light=Light.DUSK), Beam.LOW),
        (NIGHT, Beam.LOW),
        (Environment(rain=0.1), Beam.LOW),
        (Environment(visibility_m=500.0), Beam.LOW),
        (Environment(visibility_m=5000.0), Beam.OFF),
        (replace(NIGHT, beam=Beam.HIGH), Beam.HIGH),
        (replace(NIGHT, beam=Beam.OFF), Beam.OFF),
    ],
)
def test_headlights_are_on_when_it_is_not_a_clear_day_unless_somebody_says_otherwise(environment, beam):
    assert environment.headlights is beam


README = Path(__file__).parents[1] / "README.md"
TABLE = {
    "dry night": NIGHT,
    "heaviest rain, night": replace(NIGHT, rain=1.0),
    "heaviest rain, day": Environment(rain=1.0),
    "fog of 100 m, day": Environment(visibility_m=100.0),
    "fog of 100 m, night": replace(NIGHT, visibility_m=100.0),
}


@pytest.mark.parametrize("row", TABLE)
def test_the_ranges_in_the_readme_are_those_of_the_model(row):
    ranges = [light.visible_range_m(replace(TABLE[row], beam=beam), LEAST) for beam in (Beam.LOW, Beam.HIGH)]
    assert f"| {row} | {ranges[0]:.0f} m | {ranges[1]:.0f} m |" in README.read_text(encoding="utf-8")

"""Magnitudes, codes for error and init, numbers split over signals, validity: both ways, one and many."""

import math

import pytest

from tests.bus_values import boundary, estimate
from tests.made_profiles import nothing, profile_of, raws, sent, values, written
from tests.test_profile import assert_bulk_equals_single
from vsensor.errors import ConfigError
from vsensor.profile import load_profile
from vsensor.types import SensorMode, Side

MESSAGE = "[messages.M]\ncycle_ms = 40\n[messages.M.signals]\n"
DISTANCES = (
    'BO_ 7 M: 8 CAM\n SG_ L : 3|12@1+ (0.01,0) [0|0] "m" ECU\n SG_ R : 31|12@0+ (0.01,0) [0|0] "m" ECU\n'
    ' SG_ Q : 40|4@1+ (1,0) [0|15] "" ECU\n SG_ Ok : 44|1@1+ (1,0) [0|1] "" ECU\n'
    ' SG_ Ok2 : 45|1@1+ (1,0) [0|1] "" ECU\n SG_ F : 46|1@1+ (1,0) [0|1] "" ECU\n'
)


def profile_with(tmp_path, signals, geometry=""):
    return profile_of(tmp_path, DISTANCES, geometry + MESSAGE + signals)


@pytest.mark.parametrize("positive", ["left", "right"])
def test_a_magnitude_leaves_out_the_sign_that_the_side_tells(tmp_path, positive):
    profile = profile_with(
        tmp_path,
        'L = { quantity = "left.offset_m", magnitude = true }\n'
        'R = { quantity = "right.offset_m", magnitude = true }\n',
        f'[geometry]\npositive = "{positive}"\n',
    )
    frames = sent(profile, values())
    assert raws(profile, frames) == [pytest.approx({"L": 180, "R": 170, "Q": 0, "Ok": 0, "Ok2": 0, "F": 0})]
    assert profile.decode(frames[0]) == {
        "left.offset_m": pytest.approx(1.8),
        "right.offset_m": pytest.approx(-1.7),
    }
    assert_bulk_equals_single(profile, list(frames))


def test_a_magnitude_of_what_has_no_side_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"sign of left\.heading cannot be told"):
        profile_with(tmp_path, 'L = { quantity = "left.heading", magnitude = true }\n')


CODES = 'L = { quantity = "left.offset_m", sna = 4095, error = 4094, init = 4093, magnitude = true }\n'


@pytest.mark.parametrize(
    ("mode", "raw"),
    [
        (SensorMode.INIT, 4093),
        (SensorMode.CALIBRATING, 4093),
        (SensorMode.AVAILABLE, 180),
        (SensorMode.DEGRADED, 180),
        (SensorMode.BLOCKED, 4094),
        (SensorMode.FAILED, 4094),
    ],
)
def test_error_and_init_codes_follow_the_state_of_the_sensor(tmp_path, mode, raw):
    profile = profile_with(tmp_path, CODES)
    frames = sent(profile, values(mode=mode))
    assert raws(profile, frames)[0]["L"] == raw
    told = profile.decode(frames[0])["left.offset_m"]
    assert math.isnan(told) == (raw > 4092)
    assert_bulk_equals_single(profile, list(frames))


def test_without_a_line_sna_is_sent_and_no_error(tmp_path):
    assert raws(profile := profile_with(tmp_path, CODES), sent(profile, nothing()))[0]["L"] == 4095


def test_a_number_stops_before_all_the_codes(tmp_path):
    profile = profile_with(tmp_path, CODES)
    far = values(estimate(boundary(Side.LEFT, [500.0])))
    assert raws(profile, sent(profile, far))[0]["L"] == 4092


@pytest.mark.parametrize(
    ("offset_m", "raw"), [(0.99, 99), (1.0, 103), (1.01, 103), (-1.02, 103), (1.03, 103), (1.04, 104)]
)
def test_no_number_becomes_a_code_even_in_the_middle_of_its_range(tmp_path, offset_m, raw):
    text = 'L = { quantity = "left.offset_m", sna = 100, error = 101, init = 102, magnitude = true }\n'
    profile = profile_with(tmp_path, text)
    frames = sent(profile, values(estimate(boundary(Side.LEFT, [offset_m]))))
    assert raws(profile, frames)[0]["L"] == raw
    assert profile.messages[0].bindings[0].raw(offset_m)[0] == raw


def test_a_code_may_be_named_by_the_databases_value_table(tmp_path):
    dbc = DISTANCES + 'VAL_ 7 Q 15 "Failure" 14 "Nothing" ;\n'
    profile = profile_of(
        tmp_path, dbc, MESSAGE + 'Q = { quantity = "left.quality", error = "Failure", sna = "Nothing" }\n'
    )
    assert raws(profile, sent(profile, values(mode=SensorMode.FAILED)))[0]["Q"] == 15
    assert raws(profile, sent(profile, values()))[0]["Q"] == 4


def test_codes_of_a_table_are_sent_and_read_as_no_value(tmp_path):
    profile = profile_with(
        tmp_path, 'Q = { quantity = "left.kind", table = { solid = 1, dashed = 2, other = 0 }, error = 7 }\n'
    )
    frames = sent(profile, values(mode=SensorMode.BLOCKED))
    assert raws(profile, frames)[0]["Q"] == 7
    assert math.isnan(profile.decode(frames[0])["left.kind"])
    assert_bulk_equals_single(profile, list(frames))


SPLIT = (
    'BO_ 7 M: 8 CAM\n SG_ Low : 5|7@1+ (0.001,-20) [0|0] "m" ECU\n SG_ Mid : 31|6@0+ (1,0) [0|0] "" ECU\n'
    ' SG_ High : 33|4@1{sign} (1,0) [0|0] "" ECU\n'
)
SPLIT_PROFILE = (
    MESSAGE + 'Low = {{ quantity = "{quantity}", bits = [6, 0] {more} }}\n'
    'Mid = {{ quantity = "{quantity}", bits = [12, 7] }}\n'
    'High = {{ quantity = "{quantity}", bits = [16, 13] }}\n'
)


@pytest.mark.parametrize("offset_m", [-50.0, -19.2, -1.7, 0.0, 1.834, 40.0])
@pytest.mark.parametrize("sign", ["+", "-"])
def test_a_number_split_over_signals_of_either_byte_order_is_put_together_again(tmp_path, offset_m, sign):
    dbc = SPLIT.replace("{sign}", sign)
    profile = profile_of(tmp_path, dbc, SPLIT_PROFILE.format(quantity="left.offset_m", more=""))
    frames = sent(profile, values(estimate(boundary(Side.LEFT, [offset_m]))))
    raw = raws(profile, frames)[0]
    whole = (raw["Low"] & 0x7F) | (raw["Mid"] & 0x3F) << 7 | (raw["High"] & 0xF) << 13
    low, high = (-(1 << 16), (1 << 16) - 1) if sign == "-" else (0, (1 << 17) - 1)
    raw = min(max(round((offset_m + 20) * 1000), low), high)
    assert whole == raw & 0x1FFFF
    assert profile.decode(frames[0])["left.offset_m"] == pytest.approx(raw / 1000 - 20, abs=1e-9)
    assert_bulk_equals_single(profile, list(frames))


def test_a_frame_index_split_over_signals_wraps_at_all_its_bits(tmp_path):
    dbc = SPLIT.replace("{sign}", "+").replace("0.001,-20", "1,0")
    text = SPLIT_PROFILE.format(quantity="image.index", more=", wrap = true")
    profile = profile_of(tmp_path, dbc, text)
    frames = sent(profile, {**values(), "image.index": float((1 << 17) + 70_000)})
    assert profile.decode(frames[0]) == {"image.index": 70_000.0}


@pytest.mark.parametrize(
    ("bits", "said"),
    [
        ("[7, 0]", r"bits = \[7, 0\]: Low has 7 bits"),
        ("[7, 1]", "Low starts at bit 1 of left.offset_m, not 0"),
    ],
)
def test_split_bits_that_do_not_fit_are_refused(tmp_path, bits, said):
    text = SPLIT_PROFILE.format(quantity="left.offset_m", more="").replace("[6, 0]", bits)
    path = written(tmp_path, SPLIT.replace("{sign}", "+"), text)
    with pytest.raises(ConfigError, match=said):
        load_profile(path)


def test_one_validity_bit_stands_for_a_whole_line_and_another_for_two_quantities(tmp_path):
    profile = profile_with(
        tmp_path,
        'L = "left.offset_m"\nR = "left.x_max_m"\nQ = "right.quality"\n'
        'Ok = { valid_of = "left", valid_raw = 0, invalid_raw = 1 }\n'
        'Ok2 = { valid_of = ["left.offset_m", "right.offset_m"] }\n',
    )
    only_left = values(estimate(boundary(Side.LEFT, [1.8])))
    for found, expected in ((values(), (0, 1)), (only_left, (0, 0)), (nothing(), (1, 0))):
        frames = sent(profile, found)
        raw = raws(profile, frames)[0]
        assert (raw["Ok"], raw["Ok2"]) == expected
        told = profile.decode(frames[0])
        assert math.isnan(told["left.offset_m"]) == (expected != (0, 1))
        assert math.isnan(told["left.x_max_m"]) == (expected[0] == 1)
        assert not math.isnan(told["right.quality"])
        assert_bulk_equals_single(profile, list(frames))

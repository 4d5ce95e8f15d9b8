"""Times, speeds and buses as people write them."""

from fractions import Fraction

import pytest

from vsensor.errors import ConfigError
from vsensor.replay.options import epoch_ns, log_time_ns, mapping, speed_of

START = 1_533_224_087_000_000_000  # 2018-08-02 15:34:47 UTC


@pytest.mark.parametrize(
    ("text", "ns"),
    [
        ("0", START),
        ("12.5", START + 12_500_000_000),
        (".000000001", START + 1),
        ("-1", START - 10**9),
        ("1533224088.123456789", 1_533_224_088_123_456_789),
        ("2018-08-02T15:34:48", START + 10**9),
        ("2018-08-02 15:34:47.25", START + 250_000_000),
        ("2018-08-02T17:34:47.000001+02:00", START + 1000),
        ("2018-08-02T15:34:47Z", START),
    ],
)
def test_a_time_of_a_log_is_from_its_start_or_absolute(text, ns):
    assert log_time_ns("--start", text, START) == ns


@pytest.mark.parametrize("text", ["", "soon", "1e5", "1:30", "2018-13-01", "nan", "inf", "9" * 40])
def test_a_text_that_is_no_time_is_refused_with_what_one_looks_like(text):
    with pytest.raises(ConfigError, match=f"--stop {text}: s, or a time such as"):
        log_time_ns("--stop", text, START)


def test_a_wall_clock_time_is_never_one_from_the_start():
    assert epoch_ns("--start-at", "1533224087") == START
    with pytest.raises(ConfigError, match="--start-at 12"):
        epoch_ns("--start-at", "12")


@pytest.mark.parametrize(
    ("text", "speed"), [("1", 1), ("0.1", Fraction(1, 10)), ("100", 100), ("1/3", Fraction(1, 3))]
)
def test_a_speed_is_exact(text, speed):
    assert speed_of(text) == speed


@pytest.mark.parametrize("text", ["0.09", "100.1", "-1", "fast", "nan", "1/0", ""])
def test_a_speed_that_is_none_is_refused(text):
    with pytest.raises(ConfigError, match=r"from 0\.1 to 100"):
        speed_of(text)


def test_channels_are_mapped_to_buses_with_their_options():
    assert mapping(("can0=socketcan:vcan0", "2=pcan:PCAN_USBBUS1,bitrate=500000")) == {
        "can0": "socketcan:vcan0",
        "2": "pcan:PCAN_USBBUS1,bitrate=500000",
    }


@pytest.mark.parametrize("texts", [("can0",), ("can0=",), ("=virtual:a",), ("a=virtual:x", "a=virtual:y")])
def test_a_mapping_that_says_too_little_or_too_much_is_refused(texts):
    with pytest.raises(ConfigError, match="--map"):
        mapping(texts)

"""The time that frames take on the bus, against frames laid out bit by bit."""

import pytest

from tests.test_cli import vsensor
from vsensor.check import BusSpeed
from vsensor.check.busload import frame_s

HIGH = {"start": 1, "id": 11, "rtr": 1, "ide": 1, "r0": 1, "length": 4}
EXTENDED = {"start": 1, "id": 11, "srr": 1, "ide": 1, "id low": 18, "rtr": 1, "r": 2, "length": 4}
TAIL = {"crc delimiter": 1, "acknowledgement": 1, "its delimiter": 1, "end": 7, "gap": 3}
FD_HEAD = {"start": 1, "id": 11, "rrs": 1, "ide": 1, "fdf": 1, "res": 1, "brs": 1}
FD_EXTENDED = {"start": 1, "id": 11, "srr": 1, "ide": 1, "id low": 18, "rrs": 1, "fdf": 1, "res": 1, "brs": 1}
SPEED = BusSpeed(nominal_bps=1.0, data_bps=1.0)


def bits(length, **options):
    """Bits of a frame: seconds at 1 bit/s."""
    given = {"is_fd": False, "switches": False, "is_extended": False, "stuffed": False} | options
    return frame_s(length, SPEED, **given)


def stuff_bits(count):
    """Stuff bits that a sender puts into the worst `count` bits: a level that runs on to five each time."""
    stuffed, level, run, put = 0, 0, 0, 0
    while put < count:
        run += 1
        put += 1
        if run == 5 and put <= count:
            stuffed += 1
            level, run = 1 - level, 1  # the stuff bit begins the next run
    return stuffed


@pytest.mark.parametrize("length", range(9))
@pytest.mark.parametrize(("head", "is_extended"), [(HIGH, False), (EXTENDED, True)])
def test_a_classic_frame_has_these_bits(length, head, is_extended):
    stuffable = sum(head.values()) + 8 * length + 15
    plain = stuffable + sum(TAIL.values())
    assert bits(length, is_extended=is_extended) == plain
    assert bits(length, is_extended=is_extended, stuffed=True) == plain + stuff_bits(stuffable)


def test_the_published_worst_cases_of_classic_frames():
    assert (bits(8, stuffed=True), bits(8, is_extended=True, stuffed=True)) == (135, 160)
    assert (bits(0, stuffed=True), bits(1, stuffed=True)) == (55, 65)


@pytest.mark.parametrize(("length", "crc", "fixed"), [(8, 17, 6), (16, 17, 6), (20, 21, 7), (64, 21, 7)])
@pytest.mark.parametrize(("head", "is_extended"), [(FD_HEAD, False), (FD_EXTENDED, True)])
def test_a_can_fd_frame_has_these_bits(length, crc, fixed, head, is_extended):
    stuffable = sum(head.values()) + 1 + 4 + 8 * length
    plain = stuffable + 4 + crc + fixed + sum(TAIL.values())
    assert bits(length, is_fd=True, is_extended=is_extended) == plain
    most = bits(length, is_fd=True, is_extended=is_extended, stuffed=True)
    assert most == plain + stuff_bits(stuffable)


def test_only_the_data_phase_goes_at_the_data_bit_rate():
    fast = BusSpeed(nominal_bps=1.0, data_bps=1e12)
    given = {"is_fd": True, "is_extended": False, "stuffed": False}
    nominal_only = frame_s(64, fast, switches=True, **given)
    assert nominal_only == pytest.approx(sum(FD_HEAD.values()) + sum(TAIL.values()))
    assert frame_s(64, fast, switches=False, **given) == bits(64, is_fd=True)


def test_check_tells_the_load_at_the_bit_rates_it_is_given(capsys):
    out = vsensor(capsys, "check", "native")[1]
    assert f"325 frames/s, {325 * 111 / 5e3:.1f} to {325 * 135 / 5e3:.1f} % of a bus of 500 kbit/s" in out
    out = vsensor(capsys, "check", "native", "--bitrate", "125k")[1]
    assert f"{325 * 111 / 1.25e3:.1f} to {325 * 135 / 1.25e3:.1f} % of a bus of 125 kbit/s" in out
    slow = vsensor(capsys, "check", "native_fd", "--data-bitrate", "1M")[1]
    fast = vsensor(capsys, "check", "native_fd", "--data-bitrate", "5M")[1]
    assert "500 kbit/s (1 Mbit/s data)" in slow
    assert share(slow) > share(fast)


def share(out):
    return float(out.split(" frames/s, ")[1].split(" to ")[0])


def test_frames_that_do_not_fit_are_a_finding(capsys):
    status, out, _ = vsensor(capsys, "check", "native", "--bitrate", "33.333k")
    assert status == 1
    assert "the frames do not fit" in out
    assert vsensor(capsys, "check", "native", "--bitrate", "50k")[0] == 0


@pytest.mark.parametrize("rate", ["fast", "0", "-1k", "1", "1G", "nan"])
def test_a_bit_rate_that_is_none_is_refused(capsys, rate):
    status, _, err = vsensor(capsys, "check", "native", f"--bitrate={rate}")
    assert status == 2
    assert "expected bits per second" in err

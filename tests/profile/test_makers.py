"""The shipped profiles of production lane interfaces: sent, read by cantools, decoded back, checked."""

import math

import pytest

from tests.bus_values import boundary, estimate
from tests.made_profiles import Sender, nothing, raws, reference, sent, values
from tests.shared import SHARED_DATA, needs_shared
from tests.test_profile import assert_bulk_equals_single
from vsensor.profile import load_profile
from vsensor.types import Frame, MarkingKind, SensorMode, Side

CAMERA_X_M = 1.9
LEFT, RIGHT = (1.83, 0.01, 1e-3, 1e-6), (-1.71, 0.012, 9e-4, 2e-6)
LINES = estimate(
    boundary(Side.LEFT, LEFT, kind=MarkingKind.SOLID, x_max_m=70.0),
    boundary(Side.RIGHT, RIGHT, kind=MarkingKind.DASHED, quality=3, x_max_m=55.0),
    index=37,
)


def honda():
    return maker("honda", "honda_bosch_lane_lines_extract")


def hyundai():
    return maker("hyundai", "hyundai_canfd_fr_cmr_03_extract")


def tesla():
    return maker("tesla", "tesla_das_lanes_extract")


def maker(name, database):
    return load_profile(name, SHARED_DATA / "dbc" / f"{database}.dbc")


def frames_of(profile, found=None):
    return sent(profile, values(LINES) if found is None else found, CAMERA_X_M)


def told(profile, frames):
    return [reference(profile).decode_message(f.arbitration_id, f.data) for f in frames]


def at_camera(line):
    """c0..c3 with x = 0 at the camera (Taylor)."""
    c0, c1, c2, c3 = line
    x = CAMERA_X_M
    return (
        c0 + c1 * x + c2 * x**2 + c3 * x**3,
        c1 + 2 * c2 * x + 3 * c3 * x**2,
        c2 + 3 * c3 * x,
        c3,
    )


@needs_shared
def test_honda_a_line_in_two_frames_is_unsigned_with_an_offset_and_positive_to_the_right():
    profile = honda()
    frames = told(profile, frames_of(profile))
    for first, line in ((0, LEFT), (2, RIGHT)):
        y, slope, c2, _ = at_camera(line)
        assert frames[first]["LINE_OFFSET"] == pytest.approx(-y, abs=0.002)
        assert frames[first]["LINE_ANGLE"] == pytest.approx(-math.atan(slope), abs=0.00025)
        assert frames[first + 1]["LINE_CURVATURE"] == pytest.approx(-2 * c2, abs=5e-6)
    assert frames[0]["LINE_OFFSET"] < 0 < frames[2]["LINE_OFFSET"]
    assert (frames[0]["LINE_DISTANCE_VISIBLE"], frames[2]["LINE_DISTANCE_VISIBLE"]) == (68, 53)
    assert (frames[0]["LINE_PROBABILITY"], frames[2]["LINE_PROBABILITY"]) == (60 / 64, 45 / 64)


@needs_shared
def test_honda_the_frame_index_reads_the_same_in_either_byte_order():
    frames = frames_of(honda())
    assert [frame["FRAME_INDEX"] for frame in told(honda(), frames)] == [37 % 16] * 8
    # Low nibble of byte 1 in the first frame of a line, high nibble of byte 0 in the second.
    assert (frames[0].data[1] & 0xF, frames[1].data[0] >> 4) == (5, 5)


@needs_shared
def test_honda_placeholder_ranges_do_not_clip_and_kinds_are_two_bits():
    profile = honda()
    frames = told(profile, frames_of(profile))
    assert abs(frames[0]["LINE_OFFSET"]) > 1  # declared [0|1]
    assert [frames[1][name] for name in ("LINE_SOLID", "LINE_DASHED")] == [1, 0]
    assert [frames[3][name] for name in ("LINE_SOLID", "LINE_DASHED")] == [0, 1]
    assert_bulk_equals_single(profile, list(frames_of(profile)), check=True)


@needs_shared
def test_honda_a_line_that_is_not_seen_stands_at_the_end_of_the_range_without_probability():
    profile = honda()
    frames = frames_of(profile, nothing())
    unseen = told(profile, frames)[0]
    assert (unseen["LINE_OFFSET"], unseen["LINE_PROBABILITY"]) == (-8.192, 0)
    assert math.isnan(profile.decode(frames[0])["left.offset_m"])


@needs_shared
def test_honda_two_bit_counters_and_nibble_checksums_hold_over_many_slots():
    profile, counters = honda(), []
    sender = Sender(profile, camera_x_m=CAMERA_X_M)
    for _ in range(9):
        frames = sender(values(LINES))
        assert all(profile.decode(frame, check=True) for frame in frames)
        counters.append(raws(profile, frames)[2]["COUNTER"])
    assert counters == [k % 4 for k in range(9)]


@needs_shared
def test_hyundai_has_both_lines_in_32_bytes_of_can_fd_positive_to_the_right():
    profile = hyundai()
    (frame,) = frames_of(profile)
    assert (len(frame.data), frame.is_fd, frame.arbitration_id) == (32, True, 0x1B5)
    read = told(profile, [frame])[0]
    for word, line in (("Lft", LEFT), ("Rt", RIGHT)):
        y, slope, c2, c3 = at_camera(line)
        assert read[f"Info_{word}LnPosVal"] == pytest.approx(-y, abs=0.002)
        assert read[f"Info_{word}LnHdingAnglVal"] == pytest.approx(-math.atan(slope), abs=0.0005)
        assert read[f"Info_{word}LnCvtrVal"] == pytest.approx(-2 * c2, abs=5.1e-7)
        assert read[f"Info_{word}LnCrvtrDrvtvVal"] == pytest.approx(-6 * c3, abs=2.1e-9)
    # Open programs that draw lines from this frame: left about -1.7 m, right about 1.7 m.
    assert read["Info_LftLnPosVal"] < 0 < read["Info_RtLnPosVal"]
    assert (str(read["Info_LftLnQualSta"]), str(read["Info_RtLnQualSta"])) == (
        "Very High Quality",
        "High Quality",
    )


@needs_shared
def test_hyundai_a_changed_bit_fails_its_crc():
    profile = hyundai()
    (frame,) = frames_of(profile)
    assert profile.decode(frame, check=True)["left.quality"] == 4
    for bit in (70, 130, 200):
        spoilt = bytearray(frame.data)
        spoilt[bit // 8] ^= 1 << bit % 8
        changed = Frame(due_ns=0, arbitration_id=0x1B5, data=bytes(spoilt), is_fd=True)
        assert profile.decode(changed, check=True) is None


@needs_shared
def test_hyundai_without_lines_has_the_values_that_cars_show_then():
    profile = hyundai()
    read = raws(profile, frames_of(profile, nothing()))[0]
    assert (read["Info_LftLnPosVal"], read["Info_RtLnPosVal"]) == (-511, 511)
    assert (read["Info_LftLnQualSta"], read["ID_CIPV"]) == (0, 0)
    assert math.isnan(profile.decode(frames_of(profile, nothing())[0])["left.offset_m"])


@needs_shared
def test_hyundai_a_blocked_sensor_says_so_in_its_qualities():
    profile = hyundai()
    read = told(profile, frames_of(profile, nothing(SensorMode.BLOCKED)))[0]
    assert str(read["Info_LftLnQualSta"]) == str(read["Info_RtLnQualSta"]) == "Error indicator"


@needs_shared
def test_tesla_has_one_virtual_line_positive_to_the_right_in_coefficients_of_8_bits():
    profile = tesla()
    read = told(profile, frames_of(profile))[0]
    middle = [(a + b) / 2 for a, b in zip(at_camera(LEFT), at_camera(RIGHT), strict=True)]
    for name, value, step in zip(
        ("C0", "C1", "C2", "C3"), middle, (0.035, 0.0016, 2e-5, 2.4e-7), strict=True
    ):
        assert read[f"DAS_virtualLane{name}"] == pytest.approx(-value, abs=step * 0.501)
    assert read["DAS_virtualLaneViewRange"] == 53
    assert read["DAS_virtualLaneWidth"] == pytest.approx(3.54 - 0.15, abs=0.3125 / 2 + 0.005)
    assert str(read["DAS_leftLineUsage"]) == str(read["DAS_rightLineUsage"]) == "FUSED"


@needs_shared
def test_tesla_a_lane_to_the_left_has_a_negative_offset():
    profile = tesla()
    far_left = estimate(boundary(Side.LEFT, [2.6, 0, 0, 0]), boundary(Side.RIGHT, [-1.0, 0, 0, 0]))
    assert told(profile, frames_of(profile, values(far_left)))[0]["DAS_virtualLaneC0"] == pytest.approx(
        -0.8, abs=0.0176
    )


@needs_shared
def test_tesla_without_lines_stands_at_the_ends_of_the_ranges():
    profile = tesla()
    frames = frames_of(profile, nothing())
    read = raws(profile, frames)[0]
    assert [read[f"DAS_virtualLane{name}"] for name in ("C0", "C1", "C2", "C3")] == [0] * 4
    assert (read["DAS_leftLaneExists"], read["DAS_leftLineUsage"], read["DAS_rightFork"]) == (0, 0, 0)
    decoded = profile.decode(frames[0])
    assert math.isnan(decoded["centre.offset_m"])
    assert decoded["left.available"] == 0

"""Sensor, vehicle and ECU in one loop, in simulated time: the same every time, on any machine."""

import numpy as np
import pytest
from msgspec.structs import replace

from tests.ecu.building import found
from tests.ecu.lockstep import closed_loop
from tests.ecu.streams import IDS
from tools.ecu.closed_loop import SCENARIO
from vsensor.types import Side

TICKS = 1500  # a minute
HALF_WIDTH_M = 1.85 / 2
LEFT_LINE = IDS["LDS_LeftLine"]


def margin_m(drive):
    """Return the least distance of a side of the vehicle to its line, where it has one."""
    return min(np.nanmin(drive.offsets_m[Side.LEFT]), np.nanmin(-drive.offsets_m[Side.RIGHT])) - HALF_WIDTH_M


@pytest.fixture(scope="module")
def minute():
    return closed_loop(SCENARIO, TICKS)


def test_the_ecu_finds_no_error_in_what_vsensor_sends(minute):
    assert found(minute.report) == {"sensor_not_ready": 1}  # its start
    assert minute.report["frames"] == TICKS * 13
    assert minute.report["bursts"] == TICKS - 1  # the first frame of a message has nothing before it


def test_the_vehicle_keeps_well_within_its_lane_round_both_bends(minute):
    lateral_mps2 = minute.yaw_rate_radps * minute.speed_mps
    assert lateral_mps2.max() > 1.2  # a bend of 600 m to the left at 110 km/h ...
    assert lateral_mps2.min() < -0.5  # ... and one of 1200 m to the right
    assert margin_m(minute) > 0.4


def test_it_is_the_ecu_that_keeps_it_there():
    """With a wheelbase of a centimetre the law turns the wheels by next to nothing."""
    drive = closed_loop(SCENARIO, TICKS // 3, options=["--wheelbase-m", "0.01"])
    assert margin_m(drive) < 0


def test_the_loop_is_bit_identical_when_it_runs_again(minute):
    again = closed_loop(SCENARIO, 200)
    for side in (Side.LEFT, Side.RIGHT):
        np.testing.assert_array_equal(again.offsets_m[side], minute.offsets_m[side][:200])


def test_it_keeps_its_lane_although_every_tenth_frame_of_a_line_is_lost():
    def spoiled(frames, index):
        return [frame for frame in frames if index % 10 or frame.arbitration_id != LEFT_LINE]

    drive = closed_loop(SCENARIO, TICKS, frames_of=spoiled)
    assert margin_m(drive) > 0.4
    assert drive.report["errors"]["counter_lost"] == TICKS // 10 - 1  # the very first one is not missed
    assert drive.report["errors"]["timeout"] == 0


def test_frames_with_a_wrong_crc_are_not_steered_by():
    """Bits flipped in every left line from second 5 on: counted, and the ECU ramps out."""

    def spoiled(frames, index):
        if index < 125:
            return frames
        return [_flipped(frame) if frame.arbitration_id == LEFT_LINE else frame for frame in frames]

    drive = closed_loop(SCENARIO, 250, frames_of=spoiled)
    assert drive.report["errors"]["crc"] == 125
    assert drive.report["images_steered_by"] == 124
    assert drive.report["requests_without_angle"] > 150


def _flipped(frame):
    return replace(frame, data=frame.data[:2] + bytes([frame.data[2] ^ 0x40]) + frame.data[3:])

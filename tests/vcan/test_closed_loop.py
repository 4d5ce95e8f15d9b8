"""The closed loop in real time on a real vcan: vsensor drives, an ECU that is not ours steers, for a minute.

What the law does with the lane is tested without a clock in tests/ecu. Here the claim is about the bus: the
frames that leave in real time hold what they promise. A machine that had no time for a slot is no error of
the frames; from where it had none for a quarter of a second nobody steered, and nothing is claimed.
"""

import pytest

from tests.ecu.building import built_ecu
from tests.vcan.programs import ran
from tools.ecu.closed_loop import MESSAGES, SCENARIO, drive, kept, unexcused

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(600)]

SECONDS = 60
HALF_WIDTH_M = 1.85 / 2


def vsensor(*words):
    done = ran("vsensor.cli", *words)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


@pytest.fixture(scope="module")
def minute(tmp_path_factory):
    folder = tmp_path_factory.mktemp("loop")
    report = drive(built_ecu() / "ecu", SECONDS, SCENARIO, folder, vsensor)
    return report, kept(folder / "loop.npz", SECONDS, HALF_WIDTH_M)


def test_the_ecu_finds_no_error_in_a_minute_of_frames(minute):
    report, way = minute
    assert unexcused(report, way) == {}, report["log"]
    assert report["frames_overrun"] == 0


def test_it_hears_every_frame_that_vsensor_sends(minute):
    report, way = minute
    sent, apart = MESSAGES * (SECONDS * 25 - way["slots_dropped"]), MESSAGES * (2 + way["pauses"])
    assert report["frames"] == pytest.approx(sent, abs=apart), report["vsensor"]


def test_the_vehicle_stays_in_its_lane(minute):
    _, way = minute
    assert way["margin_m"] > 0
    assert way["judged_s"] > SECONDS - 1 or way["pauses"] > 0


def test_the_ecu_steers_all_the_time(minute):
    report, way = minute
    if way["pauses"] == 0:  # before vsensor starts, there is nothing to steer by
        assert report["requests"] - report["requests_without_angle"] > SECONDS * 48
    assert report["largest_request_rad"] > 0.005

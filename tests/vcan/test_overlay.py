"""A drive that never had a lane camera, on a real vcan: the ECU in C steers by it as if there had been one.

A machine that stands still is no error of the frames: a timeout is then right. A process apart watches.
"""

import time

import numpy as np
import pytest

from tests.ecu.building import found
from tests.shared import SHARED_DATA, needs_shared
from tests.vcan.stalls import watched
from tests.vcan.test_ecu import ecu, ended
from vsensor.logs import read_log
from vsensor.profile import load_profile
from vsensor.replay import ReplayOptions, replay_log

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(600)]

LOG = SHARED_DATA / "can/rav4_drive.log"
DBC = SHARED_DATA / "dbc/toyota_rav4_2017_pt_generated.dbc"
SCENARIO = f"""schema = "vsensor.scenario/1"
source = "{LOG}"
[drive]
profile = ["toyota_rav4"]
dbc = "{DBC}"
"""
SAID = {"sensor_not_ready", "left_not_available", "right_not_available"}
"""At its start, and where the scene is another one; no errors of frames."""
PRESSED_S = (0.5, 1.2)
STOOD_STILL_NS = 80_000_000
"""The ECU waits 140 ms for a message that comes every 40 ms."""


def keys():
    """Return what types the right arrow at PRESSED_S after it was asked first: two seeks of 5 s ahead."""
    began, done = [], []

    def typed():
        now = time.monotonic()
        began.append(now)
        if len(done) < len(PRESSED_S) and now - began[0] > PRESSED_S[len(done)]:
            done.append(now)
            return ["right"]
        return []

    return typed


@needs_shared
@pytest.mark.parametrize(("speed", "stop"), [("1", "16"), ("10", "24")])
def test_an_ecu_accepts_a_drive_that_had_no_camera_over_a_seam_and_seeks(tmp_path, speed, stop):
    (tmp_path / "rav4.toml").write_text(SCENARIO)
    options = ReplayOptions(
        path=LOG,
        bus="socketcan:vcan1",
        overlay=str(tmp_path / "rav4.toml"),
        repair=(f"toyota_rav4={DBC}", "native"),
        speed=speed,
        start="10",
        stop=stop,
        loops=2,
    )
    said = []
    with ecu() as process, watched() as stalls:
        report = replay_log(options, said.append, keys=keys())
        judged = ended(process)
    assert sum(text.startswith("playing at") for text in said) == len(PRESSED_S), said
    assert (report.refused, report.reordered) == (0, 0)
    assert judged["frames"] > 13 * 30
    assert judged["frames_of_others"] > 1000
    assert judged["images_steered_by"] >= judged["frames"] // 13 - 8
    assert report.seeks == len(PRESSED_S)
    assert report.silence_ns < 100_000_000 + stalls[0], stalls
    assert no_errors(judged, stalls), judged["log"]


def no_errors(judged, stalls):
    """Whether the ECU found nothing wrong with the frames, or nothing but that they did not come."""
    errors = {name for name in found(judged) if name not in SAID}
    return not errors or (stalls[0] > STOOD_STILL_NS and errors == {"timeout"})


@pytest.fixture(scope="module")
def taken_over(tmp_path_factory):
    """6 s of the drive, the ECU in C steers from the third on: what was sent, what the ECU says."""
    folder = tmp_path_factory.mktemp("over")
    (folder / "rav4.toml").write_text(SCENARIO)
    options = ReplayOptions(
        path=LOG,
        bus="socketcan:vcan1",
        overlay=str(folder / "rav4.toml"),
        take_over="12",
        start="10",
        stop="16",
        log=folder / "out.blf",
    )
    with ecu() as process, watched() as stalls:
        replay_log(options, lambda text: None)
        judged = ended(process)
    return read_log(folder / "out.blf"), judged, stalls


def decoded(profile, table, quantity):
    """Return times (s from the first frame) and values of a quantity."""
    columns = profile.decode_arrays(table.arbitration_id, table.data, table.length, check=True)
    column = columns[quantity]
    return (table.t_ns[column.rows] - table.t_ns[0]) / 1e9, column.values


@needs_shared
def test_the_ecu_that_takes_over_keeps_the_vehicle_in_its_lane_and_finds_no_fault(taken_over):
    table, judged, stalls = taken_over
    left_s, left = decoded(load_profile("native"), table, "left.lane_offset_m")
    _, right = decoded(load_profile("native"), table, "right.lane_offset_m")
    seen = left_s > 0.5
    assert np.isfinite(left[seen]).all()
    assert np.abs(left[seen]).min() > 0.925  # half the vehicle's width
    assert np.abs(right[seen]).min() > 0.925
    assert no_errors(judged, stalls), judged["log"]
    assert judged["requests"] > 200


@needs_shared
def test_the_cars_yaw_rate_is_the_simulated_one_and_goes_on_without_a_step(taken_over):
    table, _, _ = taken_over
    profile = load_profile("toyota_rav4", DBC)
    recorded = read_log(LOG)
    log_s, was = decoded(profile, recorded, "ego.yaw_rate_radps")
    out_s, now = decoded(profile, table, "ego.yaw_rate_radps")
    before = out_s < 1.9
    first = np.searchsorted(log_s, 10.0)
    np.testing.assert_array_equal(now[before], was[first:][: np.count_nonzero(before)])
    assert np.count_nonzero(now != was[first:][: len(now)]) > 20
    step_rad = np.radians(0.244)
    assert np.abs(np.diff(now)).max() <= 3 * step_rad

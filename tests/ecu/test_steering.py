"""The steering law of the ECU, as its requests show it: frames of dbc/vehicle.dbc every 20 ms."""

import math
import re
import subprocess

import cantools
import numpy as np
import pytest

from tests.ecu.building import ROOT, built_ecu
from tests.ecu.streams import IDS, changed, lane, lost, stream, write
from tools.independent_reader import e2e_profile_01
from vsensor.types import SensorMode, Side

REQUEST = cantools.database.load_file(ROOT / "dbc" / "vehicle.dbc").get_message_by_name("ECU_Steering")
WHEELBASE_M, STEP_S, LARGEST_RATE_RADPS = 2.8, 0.02, 0.5
LINE = re.compile(r"\((\d+\.\d+)\) vcan0 200#([0-9A-F]{16})")


def requests(frames, folder):
    """Return times in s from the first frame, and the data, of what the ECU asks for."""
    log, answers = folder / "heard.log", folder / "requests.log"
    write(frames, log)
    command = [built_ecu() / "ecu", "--log", log, "--requests", answers]
    subprocess.run(command, capture_output=True, check=True)
    rows = [LINE.fullmatch(line).groups() for line in answers.read_text().splitlines()]
    return np.array([float(t_s) - 1000.0 for t_s, _ in rows]), [bytes.fromhex(data) for _, data in rows]


def angles(frames, folder):
    """Return times in s and requested angles in rad, NaN where nothing is asked for."""
    t_s, data = requests(frames, folder)
    read = [REQUEST.decode(one)["RequestedWheelAngle"] for one in data]
    return t_s, np.array([math.nan if str(value) == "SNA" else float(value) for value in read])


def steady(folder, images=75, **options):
    """Return the mean angle of the last half second of a lane that stays as it is."""
    return float(np.mean(angles(stream(images, lambda index: lane(index, **options)), folder)[1][-25:]))


def test_requests_leave_every_20_ms_with_counters_and_crcs_as_the_dbc_promises(tmp_path):
    t_s, data = requests(stream(60), tmp_path)
    np.testing.assert_allclose(np.diff(t_s), 0.02, atol=1e-6)
    assert len(data) == 119  # up to the first frame of the last image
    assert [one[1] & 15 for one in data] == [number % 15 for number in range(len(data))]
    data_id = REQUEST.dbc.attributes["E2EDataId"].value
    assert [one[0] for one in data] == [e2e_profile_01(one, data_id, 0) for one in data]


def test_the_law_asks_for_nothing_until_the_sensor_sees_a_lane(tmp_path):
    def starting(index):
        return lane(index, mode=SensorMode.INIT if index < 20 else SensorMode.AVAILABLE)

    t_s, angle = angles(stream(60, starting), tmp_path)
    assert np.isnan(angle[t_s < 20 * 0.04]).all()
    assert not np.isnan(angle[t_s > 21 * 0.04]).any()


def test_it_steers_to_the_side_on_which_the_lane_lies(tmp_path):
    left, right = (steady(tmp_path, centre_m=centre) for centre in (0.5, -0.5))
    assert left > 0.005
    assert right == pytest.approx(-left, abs=0.002)


def test_in_the_middle_of_a_bend_it_asks_for_the_bends_own_angle(tmp_path):
    """Ackermann: tan(angle) = wheelbase * curvature."""
    bend_per_m = 1 / 300
    assert math.tan(steady(tmp_path, bend_per_m=bend_per_m)) == pytest.approx(
        WHEELBASE_M * bend_per_m, rel=0.05
    )


@pytest.mark.parametrize("side", [Side.LEFT, Side.RIGHT])
def test_one_line_is_enough_once_the_width_is_known(side, tmp_path):
    both = steady(tmp_path, bend_per_m=1 / 300)
    one = steady(tmp_path, bend_per_m=1 / 300, sides=(side,))
    assert one == pytest.approx(both, rel=0.1)


def test_without_lines_it_holds_then_ramps_out_without_a_step_and_asks_for_nothing(tmp_path):
    def gone(index):
        return lane(index, bend_per_m=1 / 300, sides=(Side.LEFT, Side.RIGHT) if index < 50 else ())

    t_s, angle = angles(stream(100, gone), tmp_path)
    gone_s = 49 * 0.04
    held = angle[(t_s > gone_s) & (t_s < gone_s + 0.25)]
    assert held.min() > 0.8 * WHEELBASE_M / 300
    assert np.isnan(angle[t_s > gone_s + 0.25 + 1.0 + 0.05]).all()
    assert np.isnan(angle[t_s > gone_s + 0.25]).argmax() > 45  # not at once: over a second
    assert np.nanmax(np.abs(np.diff(angle))) <= LARGEST_RATE_RADPS * STEP_S + 4e-5  # two steps of the signal


def test_it_goes_on_through_one_torn_burst(tmp_path):
    torn = changed(stream(75), "LDS_LeftLine", {40}, lost)
    assert IDS["LDS_LeftLine"] == 0x323
    _, angle = angles(torn, tmp_path)
    assert not np.isnan(angle[40:]).any()

"""`vsensor experiment --bus` on a real vcan: a standard lane test in real time, the ECU in C on the bus."""

import csv
import json
import signal
import subprocess

import pytest

from tests.ecu.building import built_ecu
from tests.vcan.programs import ran
from vsensor.experiment.matrix import SHIPPED

pytestmark = [pytest.mark.vcan, pytest.mark.timeout(300)]

MATRIX = f"""schema = "vsensor.experiment/1"
name = "bench"
scenarios = ["{SHIPPED / "lanes" / "dashed.toml"}"]
outputs = ["trace", "log"]
[loop]
[settings]
departure.start_s = 1.0
departure.radius_m = 600
departure.lateral_mps = 0.6
departure.distance_m = 0.6
departure.side = "right"
[[limit]]
column = "dtle_min_m"
at_least = -0.3
"""


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """The folder of a finished experiment on vcan0, what the command said, what the ECU said."""
    folder = tmp_path_factory.mktemp("bench")
    (folder / "bench.toml").write_text(MATRIX)
    pipe = subprocess.PIPE
    with subprocess.Popen(
        [built_ecu() / "ecu", "--bus", "vcan0"], stdout=pipe, stderr=pipe, text=True
    ) as ecu:
        try:
            assert ecu.stderr.readline() == "ecu: listening on vcan0\n"
            words = ("--bus", "socketcan:vcan0", "--quiet", "--out", folder / "out")
            done = ran("vsensor.cli", "experiment", folder / "bench.toml", *words)
            ecu.send_signal(signal.SIGTERM)
            report = json.loads(ecu.communicate(timeout=20)[0])
        finally:
            ecu.kill()
    return folder / "out", done, report


def test_the_ecu_on_the_bus_keeps_the_vehicle_in_its_lane(bench):
    folder, done, _ = bench
    assert done.returncode == 0, done.stdout + done.stderr
    with (folder / "table.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert row["beyond"] == "-"
    assert float(row["departure_mps"]) == pytest.approx(0.6, abs=0.01)
    assert 0.0 <= float(row["intervention_s"]) < 0.2
    assert float(row["lateral_acceleration_max_mps2"]) > 0.3


def test_the_ecu_heard_the_sensor_in_real_time(bench):
    folder, _, report = bench
    with (folder / "table.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert report["errors"]["crc"] == report["errors"]["counter_repeated"] == 0
    assert report["frames"] > 0.8 * 13 * 25 * float(row["seconds"])
    assert report["seconds"] >= float(row["seconds"]) - 0.5


def test_its_page_and_its_log_are_kept(bench):
    folder, *_ = bench
    assert (folder / "report.html").stat().st_size > 1000
    (log,) = (folder / "runs").glob("*/bus.blf")
    assert log.stat().st_size > 1000

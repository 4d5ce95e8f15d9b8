"""A layout that nobody has seen, from the command line alone: pages, a burst, magnitudes, codes, odd bits."""

import pytest

from tests.made_profiles import written
from tests.test_cli import vsensor

DBC = (
    'BO_ 700 Head: 7 CAM\n SG_ Burst : 5|6@1+ (1,0) [0|63] "" ECU\n SG_ Roll : 11|3@1+ (1,0) [0|7] "" ECU\n'
    ' SG_ Dist : 31|13@0+ (0.005,0) [0|40.955] "m" ECU\n SG_ NotOk : 49|1@1+ (1,0) [0|1] "" ECU\n'
    'BO_ 701 Line: 8 CAM\n SG_ Which M : 0|2@1+ (1,0) [0|3] "" ECU\n SG_ Burst : 2|6@1+ (1,0) [0|63] "" ECU\n'
    ' SG_ Slope m1 : 9|17@1- (2E-05,0) [0|1] "" ECU\n SG_ Bend m2 : 9|20@1- (4E-07,0) [0|1] "1/m" ECU\n'
    'BO_ 702 Tail: 8 CAM\n SG_ Burst : 7|6@0+ (1,0) [0|63] "" ECU\n'
    ' SG_ Width : 12|9@1+ (1,0) [0|1] "cm" ECU\n'
    ' SG_ Sum : 40|16@1+ (1,0) [0|65535] "" ECU\n'
)
TEXT = """
[messages.Head]
cycle_ms = 40
e2e = { counter = "Roll" }
[messages.Head.signals]
Dist = { quantity = "right.offset_m", magnitude = true, sna = 8191, error = 8190, init = 8189 }
NotOk = { valid_of = "right", valid_raw = 0, invalid_raw = 1 }
[messages.Line]
cycle_ms = 40
[messages.Line.signals]
Slope = "right.heading"
Bend = "right.curvature_per_m"
[messages.Tail]
cycle_ms = 40
[messages.Tail.signals]
Width = { quantity = "lane.width_m", sna = 511 }
[bursts.image]
messages = ["Head", "Line", "Tail"]
id = "Burst"
checksum = { message = "Tail", signal = "Sum", algorithm = "crc16_ccitt", data_id = 7 }
"""


@pytest.fixture
def recorded(capsys, tmp_path):
    """Send a second of it; return the log and the profile."""
    path, log = written(tmp_path, DBC, TEXT), tmp_path / "out.log"
    status, _, err = vsensor(capsys, "run", "--fast", "--duration", 1, "--profile", path, "--log", log)
    assert status == 0, err
    return log, path


def table(capsys, log, path):
    status, out, err = vsensor(capsys, "decode", log, "--profile", path, "--csv")
    assert status == 0, err
    lines = [line.split(",") for line in out.splitlines() if line and not line.startswith("#")]
    return [dict(zip(lines[0], line, strict=True)) for line in lines[1:]], out + err


def test_what_was_sent_comes_back_a_row_for_each_image(capsys, recorded):
    rows, _ = table(capsys, *recorded)
    assert len(rows) == 25
    assert [float(row["image.index"]) for row in rows] == [*range(25)]
    # The sensor starts for 200 ms; then its right line lies to the right.
    seen = [row for row in rows[8:] if row["right.offset_m"]]
    assert len(seen) > 10
    for row in seen:
        assert -3 < float(row["right.offset_m"]) < -0.5
        assert abs(float(row["right.heading"])) < 0.1
        assert abs(float(row["right.curvature_per_m"])) < 0.05
    assert not rows[0]["right.offset_m"]


def test_of_a_damaged_image_nothing_is_told(capsys, recorded):
    log, path = recorded
    lines = log.read_text().splitlines()
    before, data = lines[41].split("#")  # the second frame of the image 10
    lines[41] = f"{before}#{data[:5]}{'0' if data[5] != '0' else '1'}{data[6:]}"
    log.write_text("\n".join(lines) + "\n")
    rows, said = table(capsys, log, path)
    assert [float(row["image.index"]) for row in rows] == [k for k in range(25) if k != 10]
    assert "4 of 100 frames" in said

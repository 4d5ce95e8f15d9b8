"""What `vsensor check` says of a profile before anything is sent."""

import pytest

from tests.made_profiles import written
from tests.shared import SHARED_DATA, needs_shared
from tests.test_cli import vsensor

DBC = (
    'BO_ 700 Line: 8 CAM\n SG_ Pos : 0|16@1- (0.001,0) [-32.768|32.767] "m" ECU\n'
    ' SG_ Wide : 16|8@1+ (1,0) [0|1000] "m" ECU\n SG_ Empty : 24|8@1+ (0.01,-1) [0|1] "" ECU\n'
    ' SG_ Which M : 32|2@1+ (1,0) [0|3] "" ECU\n SG_ Slope m1 : 40|16@1- (1E-04,0) [-3.2768|3.2767] "" ECU\n'
)
HEAD = "[messages.Line]\ncycle_ms = 40\n[messages.Line.signals]\nPos = 'left.offset_m'\n"


def check(capsys, path, *words):
    return vsensor(capsys, "check", path, *words)


def test_signals_that_are_not_mapped_are_named_with_what_goes_out_there(capsys, tmp_path):
    status, out, _ = check(capsys, written(tmp_path, DBC, HEAD))
    assert status == 0
    assert "3 signals are not mapped, sent as their start value: Line.Wide (0 m), Line.Empty (-1), " in out
    mapped = HEAD + "Wide = { constant = 7 }\nEmpty = { constant = 0 }\nSlope = 'left.heading'\n"
    assert "not mapped" not in check(capsys, written(tmp_path, DBC, mapped))[1]


def test_a_quantity_on_a_multiplexer_is_told_before_a_run_refuses_it(capsys, tmp_path):
    status, out, _ = check(capsys, written(tmp_path, DBC, HEAD + "Which = 'left.quality'\n"))
    assert status == 1
    assert "finding: cannot be sent: " in out
    assert "Line.Which: the multiplexer says" in out


def test_a_range_that_the_bits_miss_is_told_before_a_run_refuses_it(capsys, tmp_path):
    text = HEAD + "Wide = 'left.x_max_m'\n"
    status, out, _ = check(capsys, written(tmp_path, DBC, text))
    assert status == 1
    assert "cannot be sent: " in out
    assert "[0|1000] exceeds what 8 bits hold" in out
    status, out, _ = check(capsys, written(tmp_path, DBC, "wide_ranges = 'saturate'\n" + text))
    assert status == 0
    assert "Line.Wide: range [0|1000] exceeds what 8 bits hold, [0|255]; it saturates at the bits" in out


def test_placeholder_ranges_are_said_once_and_are_no_findings(capsys, tmp_path):
    status, out, _ = check(capsys, written(tmp_path, DBC, HEAD))
    assert status == 0
    assert "1 ranges are placeholders, which do not clip: Line.Empty" in out


def test_findings_are_those_of_the_profiles_messages_alone(capsys, tmp_path):
    other = 'BO_ 701 Other: 1 CAM\n SG_ A : 0|4@1+ (1,0) [0|15] "" ECU\n SG_ B : 3|4@1+ (1,0) [0|15] "" ECU\n'
    path = written(tmp_path, DBC + other, HEAD)
    assert check(capsys, path)[0] == 0
    status, out, _ = check(capsys, tmp_path / "mine.dbc")
    assert status == 1
    assert "Other: signals A and B overlap" in out
    status, out, _ = check(capsys, written(tmp_path, DBC + other, HEAD + "[messages.Other]\ncycle_ms = 40\n"))
    assert status == 1
    assert "Other: signals A and B overlap" in out


def test_another_message_of_the_database_with_the_id_of_one_that_is_sent_is_told(capsys, tmp_path):
    twin = 'BO_ 700 Twin: 8 OTHER\n SG_ A : 0|8@1+ (1,0) [0|255] "" ECU\n'
    status, out, _ = check(capsys, written(tmp_path, DBC + twin, HEAD))
    assert status == 1
    assert "finding: Line and Twin have the same id: a receiver cannot tell them apart" in out
    apart = DBC + twin.replace("700", "702") + twin.replace("700", "702").replace("Twin", "Triplet")
    status, out, _ = check(capsys, written(tmp_path, apart, HEAD))
    assert status == 0  # two others: not this profile's


def test_open_marks_are_findings_with_their_line(capsys, tmp_path):
    text = HEAD + "Empty = 'left.quality'  #? confidence by its name\n#? Wide = '...'\n"
    status, out, _ = check(capsys, written(tmp_path, DBC, text))
    assert status == 1
    assert "mine.toml line 7: open, see `#?`: Empty = 'left.quality' - confidence by its name" in out
    assert "2 findings" in out


def test_the_cycle_of_the_database_is_named_where_the_profile_says_another(capsys, tmp_path):
    cycle = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 1000;\nBA_DEF_DEF_ "GenMsgCycleTime" 20;\n'
    assert "every 40 ms (database: 20 ms)" in check(capsys, written(tmp_path, DBC + cycle, HEAD))[1]


def test_lines_without_a_cubic_coefficient_are_named(capsys, tmp_path):
    assert "bends that tighten are lost far away: left" in check(capsys, written(tmp_path, DBC, HEAD))[1]
    assert "bends that tighten" not in check(capsys, "native")[1]


def test_lane_offsets_without_a_polynomial_are_told_by_their_step(capsys):
    out = check(capsys, "p2")[1]
    assert "lane offsets are rounded by at most 1.0 mm" in out
    assert "quantisation" not in out


@needs_shared
@pytest.mark.parametrize(
    ("name", "database", "worst_mm"),
    [
        # Half a step of each coefficient times x^n / n! at 100 m.
        ("honda", "honda_bosch_lane_lines_extract", 2 + 25 + 25),
        ("hyundai", "hyundai_canfd_fr_cmr_03_extract", 1.98 + 48.83 + 2.5 + 0.33),
        ("tesla", "tesla_das_lanes_extract", 17.5 + 80 + 100 + 120),
    ],
)
def test_the_shipped_profiles_of_makers_have_no_findings(capsys, name, database, worst_mm):
    status, out, _ = check(capsys, name, "--dbc", SHARED_DATA / "dbc" / f"{database}.dbc")
    assert status == 0, out
    assert "no findings" in out
    assert "not mapped" not in out
    assert float(out.split(" mm at 100 m")[0].rsplit(" ", 1)[1]) == pytest.approx(worst_mm, abs=0.06)

"""Faults that cannot be: one line that names the key and what was expected."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.faults.runs import line
from vsensor.cli import main
from vsensor.config import load_scenario
from vsensor.errors import ConfigError, VsensorError
from vsensor.faults import KINDS, fault_of, overriding, parse_fault
from vsensor.faults.config import FaultConfig
from vsensor.line import build_line

WRONG = {
    "kind = 'frame_lst': not known; did you mean frame_lost?": {"kind": "frame_lst"},
    "kind = 'x': not known; known: frame_lost,": {"kind": "x"},
    "message = 'LDS_Lan': not in profile native; did you mean LDS_Lane?": {
        "kind": "frame_lost",
        "message": "LDS_Lan",
    },
    "signal = 'LaneWith': not in profile native; did you mean LaneWidth?": {
        "kind": "signal_sna",
        "signal": "LaneWith",
    },
    "signal = 'LDS_Lane.LeftOffset'": {
        "kind": "signal_sna",
        "signal": "LDS_Lane.LeftOffset",
        "message": "LDS_Image",
    },
    "signal = LDS_Lane.LaneCrc: protects the frame": {"kind": "signal_stuck", "signal": "LaneCrc"},
    "signal = LDS_Lane.LaneCounter: protects the frame": {"kind": "signal_stuck", "signal": "LaneCounter"},
    "signal = LDS_Lane.LaneBurst: has no value for 'not available'": {
        "kind": "signal_sna",
        "signal": "LaneBurst",
    },
    "quantity = 'left.ofset_m': not in profile native; did you mean left.offset_m?": {
        "kind": "override",
        "quantity": "left.ofset_m",
        "value": 1.0,
    },
    "raw = 16: LDS_Lane.LaneBurst holds 0 to 15": {"kind": "signal_raw", "signal": "LaneBurst", "raw": 16},
    "raw = -1: LDS_Lane.LaneBurst holds 0 to 15": {"kind": "signal_raw", "signal": "LaneBurst", "raw": -1},
    "raw: signal_raw needs it": {"kind": "signal_raw", "signal": "LaneWidth"},
    "raw: frame_lost does not take it; it takes message, at_s, for_s, times": {
        "kind": "frame_lost",
        "raw": 1,
    },
    "times: reset does not take it": {"kind": "reset", "times": 2},
    "for_s: sensor_failed does not take it": {"kind": "sensor_failed", "for_s": 2.0},
    "for_s and times: one of them ends a fault": {"kind": "frame_lost", "for_s": 2.0, "times": 2},
    "times = 0: expected `int` >= 1": {"kind": "frame_lost", "times": 0},
    "at_s = -1.0: expected `float` >= 0.0": {"kind": "frame_lost", "at_s": -1.0},
    "value = nan: a finite number": {"kind": "override", "quantity": "left.offset_m", "value": float("nan")},
    "line = 'middle': left, next_left, next_right, right were expected": {
        "kind": "line_lost",
        "line": "middle",
    },
    "tims: unknown key; did you mean times?": {"kind": "frame_lost", "tims": 1},
    "message = 'LDS_Lane': counter_jumped needs an alive counter that 15 steps change": {
        "kind": "counter_jumped",
        "message": "LDS_Lane",
        "by": 15,
    },
    "message = 'LDS_Lane': frame_truncated needs more than 8 bytes": {
        "kind": "frame_truncated",
        "message": "LDS_Lane",
        "length": 8,
    },
    "profile native: frame_truncated needs more than 9 bytes": {"kind": "frame_truncated", "length": 9},
}


@pytest.mark.parametrize("said", WRONG)
def test_a_fault_that_cannot_be_is_refused_in_one_line(said):
    with pytest.raises(ConfigError) as caught:
        fault_of(WRONG[said], line().profile)
    assert said in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_scenario_names_its_file_and_the_table(tmp_path):
    path = tmp_path / "s.toml"
    source = load_scenario("highway").source
    fault = '[[fault]]\nkind = "frame_lost"\n[[fault]]\nkind = "frame_lst"\n'
    path.write_text(f'schema = "vsensor.scenario/1"\nsource = "{source}"\n{fault}')
    with pytest.raises(ConfigError, match=r"s\.toml: fault\[1\]: kind = 'frame_lst'"):
        build_line(load_scenario(str(path)))


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("kind=frame_lost,message=LDS_Lane,at_s=3,for_s=1", (3.0, 1.0, None)),
        ('kind = "frame_lost" , message = LDS_Lane, times = 4', (None, None, 4)),
    ],
)
def test_a_fault_of_the_command_line_is_read(text, told):
    config = parse_fault(text, line().profile).config
    assert (config.kind, config.message) == ("frame_lost", "LDS_Lane")
    assert (config.at_s, config.for_s, config.times) == told


@pytest.mark.parametrize(
    "text", ["frame_lost", "", "kind=frame_lost,kind=bus_off", "kind=frame_lost,times=x", "=1"]
)
def test_a_fault_of_the_command_line_that_is_none_is_refused_with_its_text(text):
    with pytest.raises(ConfigError) as caught:
        parse_fault(text, line().profile)
    assert str(caught.value).startswith(f"--fault {text}: ")


def test_an_override_is_of_a_quantity_or_a_signal_by_value_or_raw():
    assert overriding({"quantity": "left.offset_m", "value": 1})["kind"] == "override"
    assert overriding({"signal": "LaneWidth", "value": 1})["kind"] == "signal_value"
    assert overriding({"signal": "LaneWidth", "raw": 1})["kind"] == "signal_raw"


@pytest.mark.parametrize(
    ("told", "text"),
    [
        (
            {"kind": "frame_lost", "message": "LDS_Lane", "at_s": 3, "times": 2},
            "frame_lost LDS_Lane from 3 s 2 times",
        ),
        (
            {"kind": "ghost_line", "line": "left", "offset_m": 1.5, "for_s": 2},
            "ghost_line left offset_m 1.5 for 2 s",
        ),
        ({"kind": "image_frozen"}, "image_frozen until it is cleared"),
        ({"kind": "reset"}, "reset"),
        ({"kind": "counter_jumped", "by": 3}, "counter_jumped by 3"),
    ],
)
def test_a_fault_says_what_it_is(told, text):
    assert fault_of(told, line().profile).text() == text


def test_check_lists_the_faults_and_says_which_come_too_late(tmp_path, capsys):
    path = tmp_path / "s.toml"
    path.write_text(
        f'schema = "vsensor.scenario/1"\nsource = "{load_scenario("highway").source}"\nduration_s = 9\n'
        '[[fault]]\nkind = "bus_off"\nat_s = 3\nfor_s = 1\n[[fault]]\nkind = "reset"\nat_s = 9\n'
    )
    assert main(["check", str(path)]) == 1
    said = capsys.readouterr().out
    assert "fault planned: bus_off from 3 s for 1 s\n" in said
    assert "finding: fault[1].at_s = 9: without effect, as duration_s is 9\n" in said


def test_run_takes_faults_from_the_command_line(capsys):
    words = ["run", "--fast", "--duration", "1", "--fault", "kind=frame_lost,times=2", "--fault"]
    assert main([*words, "kind=bus_off,at_s=0.2,for_s=0.2"]) == 0
    assert f"frames sent {13 * (25 - 2 - 5)}," in capsys.readouterr().out


KEYS = st.fixed_dictionaries(
    {"kind": st.sampled_from([*KINDS, "", "frame"])},
    optional={
        **{
            key: st.one_of(st.integers(), st.floats(), st.text(max_size=5))
            for key in FaultConfig.__struct_fields__[1:]
        },
        "message": st.sampled_from(["LDS_Lane", "LDS_Image", "x", ""]),
        "signal": st.sampled_from(["LaneWidth", "LDS_Lane.LaneWidth", ".", "x.", ""]),
        "quantity": st.sampled_from(["left.offset_m", "image.index", "sensor.state", "", "."]),
    },
)


@given(KEYS)
def test_whatever_is_told_is_a_fault_or_one_line(told):
    said = ""
    try:
        assert fault_of(told, line().profile).text()
    except VsensorError as error:
        said = str(error)
    assert "\n" not in said

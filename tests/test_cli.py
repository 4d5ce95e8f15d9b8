"""The command line as a user meets it: what it says, what it leaves behind, its exit status."""

import contextlib
import os
import re
import shutil
import signal
import subprocess
import sys
import time
from pathlib import Path

import can
import numpy as np
import pytest

from tests.full_disk import no_file_longer_than
from tests.shared import SHARED_DATA, needs_shared
from tests.vehicle_frames import Gateway
from vsensor.cli import main
from vsensor.config import SHIPPED

REPOSITORY = Path(__file__).parents[1]
XODR = SHARED_DATA / "xodr"
RAV4_DBC = SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc"


def vsensor(capsys, *words):
    """Run one command in this process; returns (status, stdout, stderr)."""
    try:
        status = main([str(word) for word in words])
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def scenario_file(folder, text, name="scenario.toml"):
    path = folder / name
    path.write_text(f'schema = "vsensor.scenario/1"\n{text}', encoding="utf-8")
    return path


def own_map(folder):
    return shutil.copy(SHIPPED / "highway.xodr", folder / "highway.xodr")


def assert_one_line(err, *words):
    assert err.count("\n") == 1, err
    assert err.startswith("vsensor: ")
    for word in words:
        assert word in err


# --- run ----------------------------------------------------------------------------------------------


def test_fast_without_arguments_runs_the_shipped_scenario(capsys):
    status, out, err = vsensor(capsys, "run", "--fast", "--duration", 2)
    assert status == 0
    assert "50 ticks of 40 ms = 2.00 s" in out
    assert "frames sent 650, refused by the bus 0, slots dropped 0" in out
    assert err == "vsensor: drive from road 1, lane -3\n"


def test_real_time_on_the_virtual_bus_hears_and_decodes_every_frame(capsys):
    status, out, err = vsensor(capsys, "run", "--bus", "virtual:cli", "--duration", 1)
    assert status == 0
    sent = int(re.search(r"frames sent (\d+)", out)[1])
    assert f"frames heard {sent}, decoded and checked {sent}" in out
    assert sent > 0
    assert "lateness of the first frame: p50" in out
    assert "virtual" in err


@pytest.mark.parametrize("suffix", [".log", ".asc", ".blf", ".mf4"])
def test_a_log_holds_just_what_was_sent(capsys, tmp_path, suffix):
    log = tmp_path / f"out{suffix}"
    status, out, _ = vsensor(capsys, "run", "--fast", "--duration", 2, "--log", log)
    assert status == 0
    assert f"wrote {log}" in out
    from vsensor.logs import read_log

    table = read_log(log)
    assert len(table.t_ns) == 650
    reference = tmp_path / "reference.log"
    vsensor(capsys, "run", "--fast", "--duration", 2, "--log", reference)
    expected = read_log(reference)
    np.testing.assert_array_equal(table.arbitration_id, expected.arbitration_id)
    np.testing.assert_array_equal(table.data[:, :8], expected.data[:, :8])


@pytest.mark.timing
def test_fast_and_real_time_send_the_same_frames_bit_for_bit(capsys, tmp_path):
    files = tmp_path / "fast.log", tmp_path / "real.log"
    vsensor(capsys, "run", "--fast", "--duration", 2, "--log", files[0])
    for _ in range(5):  # a busy machine may drop a slot; then the comparison says nothing
        _, out, _ = vsensor(capsys, "run", "--bus", "virtual:same", "--duration", 2, "--log", files[1])
        if "slots dropped 0" in out:
            break
    else:
        pytest.fail("every run dropped slots")
    fast, real = ([line.split()[2] for line in file.read_text().splitlines()] for file in files)
    assert len(fast) == 650
    assert fast == real


@pytest.mark.parametrize("suffix", [".npz", ".csv", ".parquet"])
def test_a_trace_can_be_scored(capsys, tmp_path, suffix):
    trace = tmp_path / f"trace{suffix}"
    vsensor(capsys, "run", "--fast", "--duration", 4, "--trace", trace)
    status, out, _ = vsensor(capsys, "score", trace)
    assert status == 0
    assert re.search(r"\bleft\b", out)
    assert re.search(r"\b20\b.*m", out)
    assert re.search(
        r"left +seen, but not sent yet +3\b", out
    )  # starts in 0.2 s, a line takes two more images


def test_a_picture_is_drawn(capsys, tmp_path):
    picture = tmp_path / "run.png"
    status, _, _ = vsensor(capsys, "run", "--fast", "--duration", 3, "--picture", picture)
    assert status == 0
    assert picture.read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


@needs_shared
def test_a_bare_map_is_a_scenario(capsys):
    status, out, _ = vsensor(capsys, "run", XODR / "e6mini.xodr", "--fast", "--duration", 3)
    assert status == 0
    assert "75 ticks" in out


@needs_shared
def test_a_real_map_is_one_line_of_the_scenario(capsys, tmp_path):
    text = (SHIPPED / "highway.toml").read_text()
    text = re.sub(r"^source = .*$", f'source = "{XODR / "soderleden.xodr"}"', text, flags=re.MULTILINE)
    path = tmp_path / "mine.toml"
    path.write_text(text)
    status, out, _ = vsensor(capsys, "run", path, "--fast", "--duration", 3)
    assert status == 0
    assert "75 ticks" in out


@needs_shared
def test_the_recorded_drive_is_a_scenario(capsys, tmp_path):
    path = scenario_file(
        tmp_path,
        f'source = "{SHARED_DATA / "can" / "rav4_drive.log"}"\n'
        f'[drive]\nprofile = ["toyota_rav4"]\ndbc = "{RAV4_DBC}"\n',
    )
    trace = tmp_path / "trace.npz"
    status, out, err = vsensor(capsys, "run", path, "--fast", "--trace", trace)
    assert status == 0
    assert "yaw-rate offset" in err
    assert int(re.search(r"^(\d+) ticks", out)[1]) > 1450
    status, out, _ = vsensor(capsys, "score", trace)
    assert status == 0


def test_the_end_of_the_road_ends_the_run(capsys, tmp_path):
    own_map(tmp_path)
    path = scenario_file(
        tmp_path, 'source = "highway.xodr"\nduration_s = 3\n[ego]\nspeed_kmh = [[0, 50], [1, 0]]\n'
    )
    assert vsensor(capsys, "run", path, "--fast")[0] == 0


@needs_shared
def test_a_run_whose_road_ends_says_so(capsys):
    status, out, _ = vsensor(capsys, "run", XODR / "straight_500m.xodr", "--fast", "--duration", 60)
    assert status == 0
    assert re.search(r"^the road or the recording ended after 1\d\.\d\d s$", out, re.MULTILINE)


def test_a_run_that_lasts_its_duration_does_not_speak_of_an_end(capsys):
    _, out, _ = vsensor(capsys, "run", "--fast", "--duration", 1)
    assert "ended" not in out


@pytest.mark.parametrize(("message_ms", "is_uneven"), [(40, False), (100, False), (33.3, True)])
def test_slots_that_messages_do_not_fit_in_are_told(capsys, tmp_path, message_ms, is_uneven):
    own_map(tmp_path)
    dbc = REPOSITORY / "dbc"
    native = (dbc / "native.toml").read_text().replace("lds.dbc", str(dbc / "lds.dbc"))
    own = native.replace("[messages.LDS_Lane]\n", f"[messages.LDS_Lane]\ncycle_ms = {message_ms}\n")
    (tmp_path / "own.toml").write_text(own)
    path = scenario_file(tmp_path, 'source = "highway.xodr"\noutput.profile = "own.toml"\n')
    _, _, err = vsensor(capsys, "run", path, "--bus", "virtual:slots", "--duration", 0.2)
    assert ("cycle_ms = 40: 1 messages (LDS_Lane every 33.3 ms, ...)" in err) == is_uneven
    status, out, _ = vsensor(capsys, "check", path)
    assert status == int(is_uneven)
    assert ("finding: cycle_ms = 40: 1 messages" in out) == is_uneven


@pytest.mark.timing
def test_sinks_that_open_slowly_cost_no_slot_and_the_log_knows_when_slot_0_was(capsys, tmp_path, monkeypatch):
    from vsensor import run as run_module

    open_sinks = run_module._sinks

    def slowly(*arguments):
        time.sleep(0.6)
        return open_sinks(*arguments)

    monkeypatch.setattr(run_module, "_sinks", slowly)
    log, before_s = tmp_path / "out.log", time.time()
    _, out, _ = vsensor(capsys, "run", "--bus", "virtual:slow", "--duration", 1, "--log", log)
    assert "slots dropped 0" in out
    first_s = float(log.read_text()[1:18])
    assert before_s + 0.6 < first_s < time.time() - 0.9


# --- decode, score, check -----------------------------------------------------------------------------


def test_decode_prints_the_lanes_as_a_table_and_as_csv(capsys, tmp_path):
    log = tmp_path / "out.log"
    vsensor(capsys, "run", "--fast", "--duration", 2, "--log", log)
    status, out, _ = vsensor(capsys, "decode", log)
    assert status == 0
    assert "offset_m" in "".join(out.splitlines()[:2])
    status, csv, _ = vsensor(capsys, "decode", log, "--csv")
    header, *rows = csv.splitlines()
    assert len(rows) == 50
    column = header.split(",").index("left.offset_m")
    last = float(rows[-1].split(",")[column])
    assert 1.0 < last < 3.0


def test_check_lists_models_costs_and_messages_and_sends_nothing(capsys):
    status, out, _ = vsensor(capsys, "check", "highway")
    assert status == 0
    for word in ("world", "camera", "region+error", "fit+track", "signals+codec", "total", "LDS_Image"):
        assert word in out
    assert "quantisation adds at most" in out
    assert "no findings" in out


@needs_shared
@pytest.mark.parametrize(
    ("file", "status", "words"),
    [
        (XODR / "e6mini.xodr", 0, "roads"),
        (SHARED_DATA / "can" / "rav4_drive.log", 0, "53800 frames"),
        (SHARED_DATA / "dbc" / "honda_bosch_lane_lines_extract.dbc", 1, "placeholder"),
        ("native", 0, "LDS_Image"),
    ],
)
def test_check_knows_files_by_suffix_and_content(capsys, file, status, words):
    found, out, _ = vsensor(capsys, "check", file)
    assert words in out
    assert found == status


@needs_shared
def test_decode_gives_the_database_to_the_profile_that_names_none(capsys, tmp_path):
    own, drive = tmp_path / "own.log", SHARED_DATA / "can" / "rav4_drive.log"
    vsensor(capsys, "run", "--fast", "--duration", 2, "--log", own)
    both = tmp_path / "both.log"
    both.write_text(own.read_text() + "".join(drive.read_text().splitlines(keepends=True)[:5000]))
    words = ["--profile", "native", "--profile", "toyota_rav4", "--dbc", RAV4_DBC, "--csv"]
    status, out, err = vsensor(capsys, "decode", both, *words)
    assert status == 0, err
    header = out.split("\n", 1)[0].split(",")
    assert {"left.offset_m", "ego.speed_mps", "ego.yaw_rate_radps"} <= set(header)


@needs_shared
def test_a_makers_database_sends_frames_through_a_profile_file_in_another_folder(capsys, tmp_path):
    profile = tmp_path / "bus" / "maker.toml"
    profile.parent.mkdir()
    shutil.copy(SHARED_DATA / "dbc" / "honda_bosch_lane_lines_extract.dbc", profile.parent / "maker.dbc")
    profile.write_text(
        'schema = "vsensor.profile/1"\ndatabase = "maker.dbc"\n[geometry]\npositive = "right"\n'
        "[messages.LEFT_LANE_LINE_1]\ncycle_ms = 40\n[messages.LEFT_LANE_LINE_1.signals]\n"
        'LINE_OFFSET = "left.offset_m"\n'
        'LINE_PROBABILITY = { quantity = "left.quality", table = { 4 = 63, other = 0 } }\n'
        "[messages.LEFT_LANE_LINE_2]\ncycle_ms = 40\n[messages.LEFT_LANE_LINE_2.signals]\n"
        'LINE_CURVATURE = "left.curvature_per_m"\n'
    )
    own_map(tmp_path)
    path = scenario_file(tmp_path, 'source = "highway.xodr"\n[output]\nprofile = "bus/maker.toml"\n')
    log = tmp_path / "out.log"
    status, out, err = vsensor(capsys, "run", path, "--fast", "--duration", 2, "--log", log)
    assert status == 0, err
    assert "frames sent 100" in out
    status, out, _ = vsensor(capsys, "decode", log, "--profile", profile, "--csv")
    last = dict(zip(*(line.split(",") for line in (out.splitlines()[0], out.splitlines()[-1])), strict=True))
    assert 1.0 < float(last["left.offset_m"]) < 3.0  # left positive again
    assert abs(float(last["left.curvature_per_m"])) < 0.01


def test_check_sends_a_trace_to_score(capsys, tmp_path):
    trace = tmp_path / "trace.npz"
    vsensor(capsys, "run", "--fast", "--duration", 1, "--trace", trace)
    status, _, err = vsensor(capsys, "check", trace)
    assert status == 2
    assert_one_line(err, "trace.npz", "vsensor score")


def test_check_finds_garbage_in_a_log(capsys, tmp_path):
    log = tmp_path / "out.log"
    vsensor(capsys, "run", "--fast", "--duration", 1, "--log", log)
    status, out, _ = vsensor(capsys, "check", log)
    assert status == 0
    assert out.splitlines()[-1] == "no findings"
    log.write_text(log.read_text() + "(17953839\n")
    status, out, _ = vsensor(capsys, "check", log)
    assert status == 1
    assert "finding: 1 lines are no CAN frames, first line 326" in out


@needs_shared
def test_check_says_what_a_maker_reads_where_there_is_no_line(capsys, tmp_path):
    profile = tmp_path / "maker.toml"
    text = (
        'schema = "vsensor.profile/1"\n[messages.LEFT_LANE_LINE_1]\ncycle_ms = 40\n'
        "[messages.LEFT_LANE_LINE_1.signals]\n"
        'LINE_PROBABILITY = { quantity = "left.quality", table = { 4 = 63, other = 0 } }\n'
    )
    dbc = SHARED_DATA / "dbc" / "honda_bosch_lane_lines_extract.dbc"
    profile.write_text(text + 'LINE_OFFSET = "left.offset_m"\n')
    _, out, _ = vsensor(capsys, "check", profile, "--dbc", dbc)
    assert "no SNA value, so sent as their start value while there is no line: " in out
    assert "LEFT_LANE_LINE_1.LINE_OFFSET (-8.192)" in out
    profile.write_text(text + 'LINE_OFFSET = { quantity = "left.offset_m", sna = 4095 }\n')
    assert "no SNA value" not in vsensor(capsys, "check", profile, "--dbc", dbc)[1]


# --- bad input ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[camera]\nheigth_px = 800\n", ["camera.heigth_px", "did you mean height_px?"]),
        ("[camera]\nhfov_rad = 0.9\n", ["camera.hfov_rad", "hfov_deg"]),
        ("[camera]\nposition_m = [1.9, 0.0, 1350.0]\n", ["camera.position_m", "1350"]),
        ('[camera]\nwidth_px = "wide"\n', ["camera.width_px", "wide"]),
        ("cycle_ms = 0.04\n", ["cycle_ms", "0.04"]),
        ("[ego]\nspeed_kmh = nan\n", ["ego.speed_kmh", "finite"]),
        ("[ego]\nspeed_kmh = inf\n", ["ego.speed_kmh", "finite"]),
        ("[ego]\nspeed_kmh = [[5, 100], [1, 50]]\n", ["ego.speed_kmh", "times must rise"]),
        ("[ego]\nspeed_kmh = 3000\n", ["ego.speed_kmh", "540 km/h"]),
        ("[ego]\nroad = '99'\n", ["99"]),
        ("[ego]\nlane = 77\nroad = '1'\n", ["77"]),
        ("[ego]\nlane = -2\n", ["scenario.toml", "ego.lane = -2", "ego.road"]),
        ("[ego]\ns_m = 1e9\n", ["scenario.toml", "ego.s_m", "ego.road"]),
        ("[ego]\ns_m = 1e9\nroad = '1'\n", ["road 1", "1e+09"]),
        ("[[traffic]]\nkind = 'tank'\n", ["traffic", "tank"]),
        ("[[traffic]]\nrecycle_m = 300\n", ["traffic[0].recycle_m"]),
        ("[error_model]\nfile = 'none.npz'\n", ["none.npz", "no such file"]),
        ("[output]\nprofile = 'natve'\n", ["natve", "native"]),
        ("[region]\nspeed_kmh = [0, 50]\nrange_m = [10]\n", ["region", "range_m"]),
        ("seed = -1\n", ["seed", "-1"]),
        ("ego = 5\n", ["ego"]),
        ("a = [\n", ["TOML"]),
    ],
)
def test_a_mistake_in_a_scenario_is_one_line_that_names_file_and_key(capsys, tmp_path, text, words):
    own_map(tmp_path)
    path = scenario_file(tmp_path, f'source = "highway.xodr"\n{text}')
    status, out, err = vsensor(capsys, "run", path, "--fast", "--duration", 1)
    assert status == 2
    assert_one_line(err, *words)
    assert out == ""


@pytest.mark.parametrize(
    ("text", "key"),
    [
        ("[ego]\nspeed_kmh = -30\n", "ego.speed_kmh"),
        ("[ego]\noffset_m = 50\n", "ego.offset_m"),
        ("[[traffic]]\nsize_m = [0, 2, 2]\n", "traffic[0].size_m"),
        ("[error_model]\nlevel = 7\nmode = 'extreme'\n", "error_model.level"),
    ],
)
def test_a_mistake_that_shows_only_when_the_run_is_built_names_the_file_once(capsys, tmp_path, text, key):
    own_map(tmp_path)
    path = scenario_file(tmp_path, f'source = "highway.xodr"\n{text}')
    status, _, err = vsensor(capsys, "run", path, "--fast", "--duration", 1)
    assert status == 2
    assert_one_line(err, str(path), key)
    assert err.count(str(path)) == 1


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["run", "absent.toml"], ["absent.toml", "no such file"]),
        (["run", "motorway"], ["motorway", "highway"]),
        (["run", ""], ["empty name"]),
        (["run", "~nobody-has-this-name/a.toml"], ["~nobody-has-this-name/a.toml", "no such file"]),
        (["run", "absent.xodr"], ["absent.xodr", "no such file"]),
        (["run", "--bus", "socketcan:can77"], ["can77"]),
        (["run", "--bus", "nonsense"], ["nonsense", "INTERFACE:CHANNEL"]),
        (["run", "--bus", ""], ["bus ''", "INTERFACE:CHANNEL"]),
        (["run", "--bus", "udp_multicast:239.0.0.1"], ["udp_multicast"]),
        (["run", "--fast", "--log", "out.txt"], ["out.txt", ".blf"]),
        (["run", "--fast", "--log", "/nowhere/out.log"], ["/nowhere/out.log"]),
        (["run", "--fast", "--log", "."], [".: cannot be written", "folder"]),
        (["run", "--fast", "--trace", "/nowhere/out.csv"], ["/nowhere/out.csv", "no folder /nowhere"]),
        (["run", "--fast", "--trace", "out.xyz"], ["out.xyz", ".npz"]),
        (["run", "--fast", "--duration", "-3"], ["-3"]),
        (["run", "--fast", "--duration", "long"], ["long"]),
        (["run", "--fast", "--profile", "absent.toml"], ["absent.toml"]),
        (["check", "absent.dbc"], ["absent.dbc"]),
        (["decode", "absent.log"], ["absent.log"]),
        (["score", "absent.npz"], ["absent.npz"]),
        (["fly"], ["fly"]),
        (["run", "--fsat"], ["--fsat"]),
    ],
)
def test_a_mistake_on_the_command_line_is_one_line(capsys, words, expected):
    status, _, err = vsensor(capsys, *words)
    assert status == 2
    assert_one_line(err, *expected)


@needs_shared
def test_fast_is_refused_on_a_hardware_bus(capsys, monkeypatch):
    from vsensor import run as run_module

    class Hardware:
        name, is_simulated = "socketcan:can0", False

        def close(self):
            pass

    monkeypatch.setattr(run_module, "open_bus", lambda specification, fd=False: Hardware())
    status, _, err = vsensor(capsys, "run", "--fast", "--bus", "socketcan:can0", "--duration", 1)
    assert status == 2
    assert_one_line(err, "can0", "--fast")


@pytest.mark.parametrize("suffix", ["xodr", "log"])
def test_a_folder_in_place_of_a_map_or_log_is_called_a_folder(capsys, tmp_path, suffix):
    folder = tmp_path / f"road.{suffix}"
    folder.mkdir()
    scenario = scenario_file(tmp_path, f'source = "road.{suffix}"\n')
    for file in (folder, scenario):
        status, _, err = vsensor(capsys, "run", file, "--fast", "--duration", 1)
        assert status == 2
        assert_one_line(err, f"road.{suffix}", "is a folder")
        assert "no such file" not in err


def test_a_map_with_a_suffix_in_capitals_is_a_map(capsys, tmp_path):
    own_map(tmp_path).rename(tmp_path / "HIGHWAY.XODR")
    assert vsensor(capsys, "run", tmp_path / "HIGHWAY.XODR", "--fast", "--duration", 1)[0] == 0


def test_a_recording_is_not_written_over_by_the_run_that_reads_it(capsys, tmp_path, monkeypatch):
    log = tmp_path / "drive.log"
    vsensor(capsys, "run", "--fast", "--duration", 1, "--log", log)
    before = log.read_bytes()
    monkeypatch.chdir(tmp_path)
    status, _, err = vsensor(capsys, "run", log, "--fast", "--log", "drive.log")
    assert status == 2
    assert_one_line(err, "drive.log", "reads it")
    assert log.read_bytes() == before


@pytest.mark.parametrize("wrong", [("--picture", "out.gif"), ("--trace", "out.xyz"), ("--log", "out.txt")])
def test_a_slip_in_one_output_leaves_older_files_alone(capsys, tmp_path, wrong):
    log, trace, picture = (tmp_path / name for name in ("out.log", "out.npz", "out.png"))
    outputs = {"--log": log, "--trace": trace, "--picture": picture}
    for file in outputs.values():
        file.write_bytes(b"older")
    words = [*(outputs | {wrong[0]: tmp_path / wrong[1]}).items()]
    status, _, err = vsensor(
        capsys, "run", "--fast", "--duration", 1, *(word for pair in words for word in pair)
    )
    assert status == 2
    assert wrong[1] in err.splitlines()[-1]
    assert {file.read_bytes() for file in outputs.values()} == {b"older"}
    assert sorted(file.name for file in tmp_path.iterdir()) == ["out.log", "out.npz", "out.png"]


@pytest.mark.parametrize(
    ("name", "left"),
    [
        *((f"out.{suffix}", True) for suffix in ("log", "asc", "blf", "mf4")),
        *((f"out.{suffix}", False) for suffix in ("npz", "csv", "parquet")),
    ],
)
def test_a_full_disk_is_one_line_and_leaves_what_can_be_read(capsys, tmp_path, name, left):
    option = "--trace" if name.endswith(("npz", "csv", "parquet")) else "--log"
    with no_file_longer_than(30_000):
        status, _, err = vsensor(capsys, "run", "--fast", "--duration", 20, option, tmp_path / name)
    assert status == 2
    assert_one_line(err.splitlines(keepends=True)[-1], name, "cannot be written", "too large")
    assert [file.name for file in tmp_path.iterdir()] == [name] * left
    if left:
        from vsensor.logs import read_log

        assert len(read_log(tmp_path / name).t_ns) > 100


def test_a_map_cut_off_anywhere_is_one_line(capsys, tmp_path):
    whole = (SHIPPED / "highway.xodr").read_bytes()
    for share in (0.0, 0.1, 0.5, 0.9, 0.999):
        path = tmp_path / "cut.xodr"
        path.write_bytes(whole[: int(share * len(whole))])
        status, _, err = vsensor(capsys, "run", path, "--fast", "--duration", 1)
        assert status == 2
        assert_one_line(err, "cut.xodr")


def test_a_dbc_whose_ranges_exceed_its_bits_is_found_with_message_and_signal(capsys, tmp_path):
    text = (REPOSITORY / "dbc" / "lds.dbc").read_text()
    broken = re.sub(r"(SG_ LaneWidth .*)\[0\|20\.475\]", r"\1[0|100]", text)
    assert broken != text
    path = tmp_path / "broken.dbc"
    path.write_text(broken)
    status, out, _ = vsensor(capsys, "check", path)
    assert status == 1
    assert re.search(r"finding: LDS_Lane\.LaneWidth: range \[0\|100\] exceeds what 12 bits hold", out)
    status, _, err = vsensor(capsys, "run", "--fast", "--duration", 1, "--dbc", path)
    assert status == 2
    assert_one_line(err, "broken.dbc", "LDS_Lane.LaneWidth", "12 bits")


def test_garbage_lines_in_a_log_are_counted_and_the_good_ones_used(capsys, tmp_path):
    log = tmp_path / "out.log"
    vsensor(capsys, "run", "--fast", "--duration", 2, "--log", log)
    lines = log.read_text().splitlines()
    lines[100:100] = ["garbage", "(12.0) can0 XYZ#00"]
    log.write_text("\n".join(lines) + "\n")
    status, out, err = vsensor(capsys, "decode", log, "--csv")
    assert status == 0
    assert len(out.splitlines()) == 51
    assert "2" in err
    assert "101" in err


@needs_shared
@pytest.mark.parametrize("value", [float("nan"), float("inf"), 400.0])
def test_an_impossible_speed_in_a_log_names_time_and_signal(capsys, tmp_path, value, monkeypatch):
    from vsensor.sources import drive

    original = drive.Profile.decode_arrays

    def spoiled(self, *args, **kwargs):
        columns = original(self, *args, **kwargs)
        if drive.SPEED in columns:
            columns[drive.SPEED].values[50] = value
        return columns

    monkeypatch.setattr(drive.Profile, "decode_arrays", spoiled)
    path = scenario_file(
        tmp_path,
        f'source = "{SHARED_DATA / "can" / "rav4_drive.log"}"\n'
        f'[drive]\nprofile = ["toyota_rav4"]\ndbc = "{RAV4_DBC}"\n',
    )
    status, _, err = vsensor(capsys, "run", path, "--fast")
    assert status == 2
    assert_one_line(err, "rav4_drive.log", "ego.speed_mps", " s:")


# --- a process of its own -----------------------------------------------------------------------------


def started(*words, **options):
    return subprocess.Popen(
        [sys.executable, "-m", "vsensor.cli", *map(str, words)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        **options,
    )


def test_python_m_vsensor_is_the_same_program(tmp_path):
    words = [sys.executable, "-m", "vsensor", "check", "absent.toml"]
    done = subprocess.run(words, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2
    assert_one_line(done.stderr, "absent.toml", "no such file")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_ctrl_c_ends_a_run_with_its_summary_and_a_readable_log(tmp_path, number):
    log, trace = tmp_path / "out.blf", tmp_path / "trace.npz"
    process = started("run", "--bus", "virtual:ctrl", "--duration", 60, "--log", log, "--trace", trace)
    assert "sending on" in process.stderr.readline()
    time.sleep(1.5)
    process.send_signal(number)
    out, err = process.communicate(timeout=20)
    assert process.returncode == 130, err
    ticks = int(re.search(r"^(\d+) ticks", out)[1])
    dropped = int(re.search(r"slots dropped (\d+)", out)[1])  # of a machine that is busy just then
    assert 0 <= dropped < ticks < 1500
    with can.LogReader(str(log)) as reader:
        assert sum(1 for _ in reader) == 13 * (ticks - dropped)
    from vsensor.sinks.trace import read_trace

    assert len(set(read_trace(trace)["tick"].tolist())) == ticks - dropped


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_that_a_library_swallowed_while_loading_still_ends_the_run(capsys, monkeypatch, number):
    from vsensor import run as run_module

    whole = run_module.build_line

    def swallowing(scenario):
        with contextlib.suppress(KeyboardInterrupt):
            os.kill(os.getpid(), number)
        return whole(scenario)

    monkeypatch.setattr(run_module, "build_line", swallowing)
    status, out, _ = vsensor(capsys, "run", "--bus", "virtual:loading", "--duration", 5)
    assert status == 130
    assert out.startswith("0 ticks")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_while_loading_ends_at_once(capsys, monkeypatch, number):
    from vsensor import run as run_module

    before = signal.getsignal(number)
    monkeypatch.setattr(run_module, "build_line", lambda scenario: os.kill(os.getpid(), number))
    status, out, _ = vsensor(capsys, "run", "--fast", "--duration", 5)
    assert (status, out) == (130, "")
    assert signal.getsignal(number) == before


def test_a_scenario_without_obstacles_never_imports_embreex(tmp_path):
    own_map(tmp_path)
    path = scenario_file(tmp_path, 'source = "highway.xodr"\n')
    code = (
        "import sys; from vsensor.cli import main\n"
        f"status = main(['run', {str(path)!r}, '--fast', '--duration', '2'])\n"
        "assert status == 0 and 'embreex' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True)


def test_a_scenario_with_the_camera_bypassed_never_projects(capsys, tmp_path, monkeypatch):
    from vsensor.camera import look

    def refuse(*_):
        raise AssertionError("projected")

    monkeypatch.setattr(look, "project", refuse)
    monkeypatch.setattr(look, "back_to_road", refuse)
    own_map(tmp_path)
    bypassed = scenario_file(tmp_path, 'source = "highway.xodr"\n[camera]\nmodel = "none"\n')
    assert vsensor(capsys, "run", bypassed, "--fast", "--duration", 1)[0] == 0
    with pytest.raises(AssertionError, match="projected"):
        main(["run", str(scenario_file(tmp_path, 'source = "highway.xodr"\n')), "--fast", "--duration", "1"])


OPTICS = """source = "highway.xodr"
[camera]
max_range_m = 80
min_width_px = 2.5
inverse = "ground_plane"
distortion.k1 = -0.3
"""


def test_check_names_the_camera_models_that_are_on(capsys, tmp_path):
    own_map(tmp_path)
    plain, full = (
        vsensor(capsys, "check", scenario_file(tmp_path, text))[1]
        for text in ('source = "highway.xodr"\n', OPTICS)
    )
    for words in ("lens k1 -0.3 to 47 deg off axis", "sight 80 m", "paint from 2.5 px", "ground plane"):
        assert words in full
        assert words[:5] not in plain.partition("camera ")[2].partition("\n")[0]


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    """A log of 1000 images: more than a pipe holds."""
    log = tmp_path_factory.mktemp("long") / "out.log"
    own_map(log.parent)
    path = scenario_file(log.parent, 'source = "highway.xodr"\n[camera]\nmodel = "none"\n')
    assert main(["run", str(path), "--fast", "--duration", "40", "--log", str(log), "--quiet"]) == 0
    return log


def test_output_into_a_closed_pipe_ends_quietly(long_log):
    log = long_log
    command = f"{sys.executable} -m vsensor.cli decode {log} | head -1"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, env=os.environ, check=True)
    assert "left" in done.stdout
    assert done.stderr == ""


@pytest.mark.parametrize("words", [["decode", "out.log", "--csv"], ["check", "native"]])
def test_output_onto_a_full_disk_is_one_line(long_log, words):
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "vsensor", *words],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            cwd=long_log.parent,
        )
    assert done.returncode == 2
    assert_one_line(done.stderr, "standard output", "No space left")


COMMANDS = "run check decode convert log score accept sweep experiment replay gateway scan table"
LEARNING = "density influence tune validate"


@pytest.mark.parametrize("command", ["", *COMMANDS.split(), *LEARNING.split(), "profile new"])
def test_help_teaches_every_command(capsys, command):
    status, out, _ = vsensor(capsys, *command.split(), "--help")
    assert status == 0
    assert "vsensor" in out
    assert len(out.splitlines()) > 8


def test_the_list_of_commands_has_a_whole_sentence_for_each(capsys):
    _, out, _ = vsensor(capsys, "--help")
    listed = out.partition("COMMAND\n")[2].partition("\n\n")[0]
    said = re.split(r"\n    (?=\w)", "\n" + listed)[1:]
    assert len(said) > 15
    assert [one for one in said if not one.strip().endswith((".", "?"))] == []


def test_a_second_database_is_refused_and_not_lost(capsys, tmp_path):
    words = ["--dbc", "one.dbc", "--dbc", "two.dbc"]
    for command in (["run"], ["check", "honda"], ["decode", "a.log"], ["convert", "a.log", "a.parquet"]):
        status, _, err = vsensor(capsys, *command, *words)
        assert status == 2
        assert_one_line(err, "--dbc two.dbc: there is one already, one.dbc")


@needs_shared
def test_each_of_several_profiles_may_be_told_with_its_database(capsys, tmp_path):
    dbc = SHARED_DATA / "dbc"
    log = tmp_path / "out.log"
    profile = ["--profile", "honda", "--dbc", dbc / "honda_bosch_lane_lines_extract.dbc"]
    assert vsensor(capsys, "run", "--fast", "--duration", 2, "--log", log, *profile)[0] == 0
    words = [f"honda={profile[-1]}", f"tesla={dbc / 'tesla_das_lanes_extract.dbc'}"]
    _, out, _ = vsensor(capsys, "decode", log, "--csv", "--profile", words[0], "--profile", words[1])
    assert "left.offset_m" in out.splitlines()[0]
    assert len(out.splitlines()) > 20


def test_a_fault_later_than_the_end_of_the_run_is_told_before_it_begins(capsys):
    early, late = (f"kind=frame_lost,message=LDS_Lane,at_s={at},times=1" for at in ("0.4", "0.8"))
    _, out, err = vsensor(capsys, "run", "--fast", "--duration", 0.8, "--fault", early, "--fault", late)
    said = "never happens: frame_lost LDS_Lane from 0.8 s 1 time, but the run ends after 0.8 s"
    assert said in err
    assert "from 0.4 s" not in err
    assert "never happens" not in out


def test_a_fault_later_than_the_end_of_the_road_is_told_at_the_end(capsys, tmp_path):
    log, gateway = tmp_path / "drive.log", Gateway()
    frames = [(k, gateway.motion(0, 20.0, 0.0)) for k in range(60)]
    log.write_text(
        "".join(f"({1000 + 0.02 * k:.6f}) can0 {f.arbitration_id:03X}#{f.data.hex()}\n" for k, f in frames)
    )
    words = ["run", log, "--fast", "--duration", 60, "--fault", "kind=reset,at_s=50"]
    status, out, err = vsensor(capsys, *words)
    assert status == 0
    assert "the road or the recording ended" in out
    assert "never happens: reset from 50 s, but the run ends after" in out
    assert "never happens" not in err

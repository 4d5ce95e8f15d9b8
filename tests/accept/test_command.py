"""`vsensor accept` as a user meets it."""

import json

import pytest

from tests.accept.streams import spoiled
from tests.ecu.streams import crc_wrong, lost, stream, write
from vsensor.cli import main


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "own.log"
    write(stream(60), path)
    return path


@pytest.fixture
def spoiled_log(tmp_path):
    path = tmp_path / "spoiled.log"
    frames = spoiled(crc_wrong, images=(10,))
    place = next(k for k, f in enumerate(frames) if f.arbitration_id == 0x322 and k > 500)
    write(frames[:place] + frames[place + 1 :], path)
    return path


def accept(capsys, *words):
    """Return status, standard output and standard error of `vsensor accept`."""
    try:
        status = main(["accept", *(str(word) for word in words)])
    except SystemExit as exit_:
        status = exit_.code
    captured = capsys.readouterr()
    return status, captured.out, captured.err


def test_a_good_stream_is_accepted_with_exit_status_0(capsys, log):
    status, out, err = accept(capsys, log)
    assert (status, err) == (0, "")
    assert out.splitlines()[0] == "profile native: 780 frames in 2.36 s"
    assert out.splitlines()[-1] == "accepted"


def test_a_bad_stream_is_a_list_the_worst_first_and_exit_status_1(capsys, spoiled_log):
    status, out, _ = accept(capsys, spoiled_log)
    assert status == 1
    lines = out.splitlines()
    assert lines[1].split()[:2] == ["kind", "message"]
    assert [line.split()[:3] for line in lines[2:5]] == [
        ["wrong_crc", "LDS_LeftLine", "1"],
        ["missing", "LDS_Lane", "1"],
        ["burst_incomplete", "LDS_Lane", "1"],
    ]
    assert "0.401" in lines[2]  # seconds from the first frame
    assert "drops the frame" in lines[2]
    assert lines[-1] == "not accepted: 3 findings"


def test_the_verdict_for_programs_has_the_same(capsys, spoiled_log, tmp_path):
    path = tmp_path / "verdict.json"
    assert accept(capsys, spoiled_log, "--json", path)[0] == 1
    report = json.loads(path.read_text())
    assert report["schema"] == "vsensor.accept_report/1"
    assert report["accepted"] is False
    (judged,) = report["verdicts"]
    assert [f["kind"] for f in judged["findings"]] == ["wrong_crc", "missing", "burst_incomplete"]
    crc = judged["findings"][0]
    assert (crc["message"], crc["count"], crc["first_s"]) == ("LDS_LeftLine", 1, pytest.approx(0.40075))
    lane = next(row for row in judged["intervals"] if row["message"] == "LDS_Lane")
    assert (lane["frames"], lane["cycle_ms"], lane["max_ms"]) == (59, 40.0, 80.0)


def test_limits_come_from_a_file(capsys, spoiled_log, tmp_path):
    limits = tmp_path / "limits.toml"
    allowed = "wrong_crc = 1\nmissing = 1\nburst_incomplete = 1\n"
    limits.write_text(f'schema = "vsensor.accept/1"\n[allow]\n{allowed}')
    status, out, _ = accept(capsys, spoiled_log, "--limits", limits)
    assert status == 0
    assert "remark: allowed: 1 wrong_crc in LDS_LeftLine" in out


def test_every_profile_that_is_given_judges(capsys, log):
    status, out, _ = accept(capsys, log, "--profile", "native", "--profile", "vehicle")
    assert status == 1
    assert "profile native: 780 frames" in out
    assert "never_heard  VEH_Motion" in out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "either a LOG or --bus"),
        (["own.log", "--bus", "virtual:x"], "either a LOG or --bus"),
        (["own.log", "--duration", "5"], "--duration is for --bus"),
        (["missing.log"], "missing.log: no such file"),
        (["own.log", "--limits", "missing.toml"], "missing.toml: no such file"),
        (["own.log", "--profile", "natve"], "natve"),
        (["own.log", "--json", "no/such/folder.json"], "cannot be written"),
        (["--bus", "nonsense"], "INTERFACE:CHANNEL"),
        (["own.log", "--duration", "-1"], "--duration"),
    ],
)
def test_bad_input_is_one_line_and_exit_status_2(capsys, log, monkeypatch, words, said):
    monkeypatch.chdir(log.parent)
    status, _, err = accept(capsys, *words)
    assert status == 2
    assert err.startswith("vsensor: ")
    assert err.count("\n") == 1
    assert said in err


def test_a_bus_without_a_frame_is_not_accepted(capsys):
    status, out, _ = accept(capsys, "--bus", "virtual:nobody", "--duration", "0.1")
    assert status == 1
    assert out.count("never_heard") == 13


def test_the_channel_with_the_profiles_frames_is_judged_and_the_other_said(capsys, log):
    other = [line.replace("vcan0", "can7") for line in log.read_text().splitlines()[:20]]
    log.write_text("\n".join([*other, *log.read_text().splitlines()]) + "\n")
    status, out, _ = accept(capsys, log)
    assert status == 0
    assert "judged on channel vcan0; the ids are on can7, too" in out


def test_lost_frames_at_both_ends_of_a_recording_are_none(capsys, tmp_path):
    write(spoiled(lost, images=(0, 59)), tmp_path / "cut.log")
    assert accept(capsys, tmp_path / "cut.log")[0] == 0


def test_help_says_what_is_looked_for_and_how_to_begin(capsys):
    status, out, _ = accept(capsys, "--help")
    assert status == 0
    for word in ("vsensor accept drive.log", "--limits", "vsensor.accept/1", "Exit 0 accepted"):
        assert word in out

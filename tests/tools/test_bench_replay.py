"""The bench of replay: its queue is the ideal one, its rows judge as they should, its schedule runs."""

import copy

import numpy as np
import pytest

from tools.bench import report, report_replay, schedule
from tools.bench.queue import Arrived, ideal_ns, judged
from tools.bench.replay import _beginning, _timed, _write
from vsensor.logs import read_log
from vsensor.replay import open_outputs

MACHINE = {"processor": "", "cores": 1, "python": "", "numpy": "", "load_average": 0.0}
DUE = np.array([0, 10, 10, 10, 11, 30])
SENT = [bytes([k]) * 16 for k in range(6)]


def test_of_equal_times_one_frame_leaves_after_the_other():
    np.testing.assert_array_equal(ideal_ns(DUE, 2), [0, 10, 12, 14, 16, 30])
    np.testing.assert_array_equal(ideal_ns(DUE, 0), DUE)


def test_who_is_as_fast_as_the_queue_has_no_error_beyond_it():
    found = judged(Arrived(1000 + ideal_ns(DUE, 2 * 10**6), SENT), DUE, SENT, 2 * 10**6)
    assert found["beyond_queue"]["max"] == 0
    assert found["raw"] == found["queue"]
    assert found["raw"]["max"] == pytest.approx(10 - 21e-6)  # the last of five waits for four others


def test_errors_count_from_a_players_own_best_frame():
    late = np.array([5, 0, 0, 0, 7, 3]) * 10**6
    found = judged(Arrived(10**9 + DUE + late, SENT), DUE, SENT, 0)
    assert (found["raw"]["max"], found["raw"]["p50"]) == (7.0, 1.5)
    assert found["duration_error_ms"] == pytest.approx(-2.0)


def test_frames_that_are_missing_or_elsewhere_are_counted():
    swapped = [SENT[k] for k in (0, 2, 1, 3, 4, 5)]
    assert judged(Arrived(DUE, swapped), DUE, SENT, 0)["unlike"] == 2
    short = judged(Arrived(DUE[:4], SENT[:4], missed=2), DUE, SENT, 0)
    assert (short["lost"], short["missed"], "raw" in short) == (2, 2, False)


def test_the_schedule_of_both_is_played_whole(tmp_path, monkeypatch):
    monkeypatch.setattr(open_outputs, "open_bus", open_outputs.open_bus)  # put back afterwards
    _write(tmp_path / "a.log", 30, 1000)
    for who in schedule.WHO:
        found = schedule.schedule(who, tmp_path / "a.log")
        assert (found["frames"], found["lost"], found["unlike"]) == (30, 0, 0)


def test_made_logs_have_their_rate_and_a_beginning_is_cut_by_time(tmp_path):
    _write(tmp_path / "a.log", 3000, 1000)
    (tmp_path / "b.log").write_text("".join(_beginning(tmp_path / "a.log", 0.5)))
    table = read_log(tmp_path / "b.log")
    assert len(table) == 501
    assert set(np.diff(table.t_ns)) == {10**6}
    np.testing.assert_array_equal(table.data[7], [0, 0, 0, 0, 0, 0, 0, 7])


def test_the_meter_tells_time_and_memory_of_what_it_started():
    found = _timed("--version")
    assert 0.01 < found["seconds"] < 60
    assert 5 < found["memory_mb"] < 400


def one(raw=0.2, beyond=0.1, lost=0, off_ms=0.1):
    figures = ({"p50": at, "p99": at, "p99.9": at, "max": at} for at in (raw, beyond))
    kinds = dict(zip(("raw", "beyond_queue"), figures, strict=True))
    return {"lost": lost, "unlike": 0, "duration_error_ms": off_ms, **kinds}


GOOD = {
    "seconds": 60.0,
    "million": 1000,
    "vcan": {
        "drive": {"canplayer": one(0.9), "python-can": one(0.9), "ours": one(), "realtime": one()},
        "steady": {"ours": one(), "realtime": one(), "unthrottled": one()},
        "without_waiting": {
            who: {"frames_per_s": rate, "lost": 0, "unlike": 0}
            for who, rate in (("canplayer", 20_000), ("python-can", 3000), ("ours", 10_000))
        },
    },
    "schedule": {log: {"ours": one(), "bare": one()} for log in ("drive", "full")},
    "convert": [{"seconds": 1.0, "memory_mb": 120.0}, {"seconds": 4.0, "memory_mb": 121.0}],
    "first_frame_s": {"short.log": 0.9, "long.log": 1.0, "long.blf": 1.0, "long.mf4": 1.0},
    "memory_mb": [140.0, 141.0],
    "overlay": {
        "10": {"lateness": {"p50": 0.25, "p99": 0.75}, "duration_error_ms": 0.5, "frames_per_s": 12000.0}
    },
    "gateway": {"latency": {"p50": 0.125, "p99": 0.5}, "refused": 0, "images": 370, "images_lost": 5},
}
CASES = {
    ("vcan", "drive", "ours"): (one(0.8, 0.31), 1),
    ("vcan", "drive", "canplayer"): (one(0.1), 2),
    ("vcan", "drive", "python-can"): (one(0.2), 2),
    ("vcan", "steady", "ours"): (one(1.0), 1),
    ("vcan", "without_waiting", "ours"): ({"frames_per_s": 8999, "lost": 1, "unlike": 0}, 2),
    ("schedule", "drive", "ours"): (one(9.0, 0.31), 1),
    ("schedule", "full", "ours"): (one(1.1, lost=1), 2),
    ("convert",): ([{"seconds": 1.0, "memory_mb": 120.0}, {"seconds": 16.0, "memory_mb": 150.0}], 2),
    ("first_frame_s", "long.mf4"): (2.1, 1),
    ("memory_mb",): ([140.0, 170.0], 1),
}


def page(found):
    return report.markdown({"machine": MACHINE, "replay": found})


def test_where_every_target_is_kept_none_is_called_missed():
    assert "0 of 25 targets missed" in page(GOOD)


@pytest.mark.parametrize("keys", CASES, ids="/".join)
def test_what_is_too_late_too_slow_or_lost_is_called_missed(keys):
    bad = copy.deepcopy(GOOD)
    place = bad
    for key in keys[:-1]:
        place = place[key]
    value, missed = CASES[keys]
    place[keys[-1]] = value
    assert f"{missed} of 25 targets missed" in page(bad)


def test_a_real_time_player_is_judged_with_and_without_the_kernels_limit():
    limited, free = copy.deepcopy(GOOD), copy.deepcopy(GOOD)
    limited["vcan"]["steady"] |= {"realtime": one(38.0), "unthrottled": one()}
    free["vcan"]["steady"] |= {"realtime": one(38.0), "unthrottled": one(38.0)}
    assert "1 of 25 targets missed" in page(limited)
    assert "2 of 25 targets missed" in page(free)


def test_what_a_sensor_that_is_laid_over_costs_is_said():
    text = page(GOOD)
    for shown in ("0.250, 0.750 ms", "+0.5 ms, 12000 frames/s", "0.125, 0.500 ms", "0, 5 of 375"):
        assert shown in text


def test_a_player_that_lost_frames_keeps_no_target_of_time():
    bad = copy.deepcopy(GOOD)
    bad["vcan"]["drive"]["ours"] = {"lost": 3, "unlike": 0}
    assert "8 of 25 targets missed" in page(bad)


def test_everybody_is_named_and_what_could_not_be_measured_is_said():
    assert all(name in page(GOOD) for name in report_replay.NAMES.values())
    without = {key: value for key, value in GOOD.items() if key != "vcan"} | {"not_on_vcan": ["no kernel"]}
    assert "Not measured on vcan: no kernel" in page(without)
    assert "replay" not in page({"error": "the drive is not there"}).lower()

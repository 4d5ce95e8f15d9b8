"""A log piece by piece: parts, loops, faults, frames that no bus takes."""

import numpy as np
import pytest

from tests.replay.playing import MS, reel_of, write_log
from vsensor.errors import LogError
from vsensor.logs import open_log_writer
from vsensor.replay.choice import choice
from vsensor.replay.reading import Cut
from vsensor.types import Frame


def all_of(reel):
    """Every (due in ms, id, loop) that a reel gives."""
    found = []
    while not reel.ended:
        if (piece := reel.pull()) is not None:
            found += [(frame.due_ns / MS, frame.arbitration_id, piece.loop) for frame in piece.frames]
    return found


def dues(reel):
    return [due_ms for due_ms, _, _ in all_of(reel)]


@pytest.fixture
def log(tmp_path):
    """Ten frames, one every 10 ms, from 5000 ms on."""
    return write_log(tmp_path / "a.log", [5000 + 10 * k for k in range(10)])


@pytest.mark.parametrize("piece", [1, 3, 128])
def test_a_log_is_played_from_its_first_frame_at_time_0_whatever_the_pieces(log, piece):
    assert all_of(reel_of(log, piece=piece)) == [(10.0 * k, k, 0) for k in range(10)]


def test_a_part_is_played_from_its_start_up_to_its_stop(log):
    cut = Cut(start_ns=5015 * MS, stop_ns=5050 * MS)
    assert [(due, number) for due, number, _ in all_of(reel_of(log, cut=cut))] == [(5, 2), (15, 3), (25, 4)]


def test_a_loop_goes_on_one_median_interval_after_the_last_frame(log):
    found = all_of(reel_of(log, cut=Cut(loops=3), piece=4))
    assert [due for due, _, _ in found] == [10.0 * k for k in range(30)]
    assert [loop for _, _, loop in found] == [0] * 10 + [1] * 10 + [2] * 10


def test_a_choice_does_not_change_how_long_a_loop_is(log):
    chosen = choice(("0x003",), (), (), None)
    assert dues(reel_of(log, choice=chosen, cut=Cut(loops=3))) == [30, 130, 230]


def test_a_part_is_looped_as_a_part(log):
    cut = Cut(start_ns=5020 * MS, stop_ns=5040 * MS, loops=2)
    assert all_of(reel_of(log, cut=cut)) == [(0, 2, 0), (10, 3, 0), (20, 2, 1), (30, 3, 1)]


def test_after_a_seek_frames_go_on_in_the_replays_own_time(log):
    reel = reel_of(log, piece=2)
    reel.pull()
    reel.seek(5055 * MS, 1000 * MS, loop=0)
    assert [(due, number) for due, number, _ in all_of(reel)] == [(1005 + 10 * k, 6 + k) for k in range(4)]


def test_a_reel_that_ended_goes_on_after_a_seek_back(log):
    reel = reel_of(log)
    all_of(reel)
    reel.seek(5080 * MS, 0)
    assert [number for _, number, _ in all_of(reel)] == [8, 9]


def test_frames_at_a_rate_have_its_times_whatever_the_log_says(log):
    assert dues(reel_of(log, cut=Cut(rate_hz=250), piece=3)) == [4 * k for k in range(10)]


def test_a_log_without_times_is_played_at_its_rate(tmp_path):
    path = tmp_path / "bare.log"
    path.write_text("can0 001#11\n  can0  002   [1]  11\n" * 3)
    assert dues(reel_of(path, cut=Cut(rate_hz=100, loops=2))) == [10 * k for k in range(12)]


def test_smoothing_spreads_a_batch(tmp_path):
    path = write_log(tmp_path / "a.log", [20 * (k // 2 + 1) for k in range(200)], ids=[1] * 200)
    steps = np.diff(dues(reel_of(path, cut=Cut(cycles={1: 10 * MS}))))[100:]
    assert steps.min() > 5


def test_what_cannot_be_sent_is_left_out(log):
    assert [
        number
        for _, number, _ in all_of(reel_of(log, sendable=lambda columns: columns.arbitration_id % 2 == 0))
    ] == [0, 2, 4, 6, 8]


@pytest.mark.parametrize("wish", [{"choice": choice(("0x700",), (), (), None)}, {"cut": Cut(start_ns=9**18)}])
def test_a_log_of_which_nothing_is_played_is_refused(log, wish):
    with pytest.raises(LogError, match=r"a\.log: none of its frames is chosen"):
        all_of(reel_of(log, **wish))


def test_the_frames_before_a_fault_are_played_in_every_loop_and_the_fault_is_kept(tmp_path):
    path = tmp_path / "cut.blf"
    with open_log_writer(path) as writer:
        for k in range(2000):
            writer.write(Frame(due_ns=10**18 + k * MS, arbitration_id=k % 0x700, data=bytes(8)))
    path.write_bytes(path.read_bytes()[:-1000])
    once = all_of(reel_of(path))
    reel = reel_of(path, cut=Cut(loops=2))
    assert len(all_of(reel)) == 2 * len(once) > 1000
    assert "cut.blf: reading ended early: the file is cut off" in reel.fault


def test_findings_are_those_of_one_pass(tmp_path):
    path = write_log(tmp_path / "a.log", [0, 0, 10, 5, 20])
    path.write_text(path.read_text() + "oops\n")
    reel = reel_of(path, cut=Cut(loops=3), piece=2)
    all_of(reel)
    assert [line.split(":")[0] for line in reel.findings()] == [
        "1 of 4 intervals are 0 (25.0%)",
        "1 timestamps run backwards",
        "1 lines are no CAN frames, first line 6",
    ]


@pytest.mark.parametrize("times_ms", [[5000], [5000, 5000]])
def test_a_log_in_which_no_time_passes_is_looped_only_at_a_rate(tmp_path, times_ms):
    still = write_log(tmp_path / "still.log", times_ms)
    with pytest.raises(LogError, match="no pace to loop at; --rate HZ"):
        reel_of(still, cut=Cut(loops=3))
    count = len(times_ms) * 3
    assert dues(reel_of(still, cut=Cut(loops=3, rate_hz=100.0))) == [10.0 * k for k in range(count)]

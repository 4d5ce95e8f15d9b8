"""When frames leave, on a simulated clock: deadlines, holding, steps, seeks, stages, recording."""

from itertools import pairwise

import pytest
from msgspec.structs import replace

from tests.replay.playing import MS, play, player_of, write_log
from vsensor.replay.player import BREATH_NS, BREATHLESS, REST_NS
from vsensor.replay.reading import Cut
from vsensor.replay.reel import AHEAD
from vsensor.replay.stages import Stage
from vsensor.types import Frame


@pytest.fixture
def log(tmp_path):
    """A hundred frames, one every 10 ms; the seek tests count on it."""
    return write_log(tmp_path / "a.log", [5000 + 10 * k for k in range(100)])


def test_every_frame_leaves_at_its_time_to_the_nanosecond(tmp_path):
    times = [0, 0.5, 0.5, 3, 3.001, 70, 70, 1000.123]
    player, bus = player_of(write_log(tmp_path / "a.log", times))
    report = play(player)
    assert [t_ms for t_ms, _ in bus.sent] == times
    assert bus.ids == list(range(8))
    assert (report.frames_sent, report.reordered, report.timing.lateness.max_ns) == (8, 0, 0)


def test_what_a_slow_bus_delays_does_not_add_up(log):
    player, bus = player_of(log, cost_ns=4 * MS)
    report = play(player)
    assert bus.sent == [(10.0 * k, k) for k in range(100)]
    assert report.duration_error_ns == 0


def test_frames_that_are_late_leave_at_once_and_in_order(tmp_path):
    player, bus = player_of(write_log(tmp_path / "a.log", [0, 1, 2, 50]), cost_ns=20 * MS)
    report = play(player)
    assert bus.sent == [(0, 0), (20, 1), (40, 2), (60, 3)]
    assert report.timing.lateness.max_ns == 38 * MS
    assert report.duration_error_ns == 10 * MS


def test_catching_up_gives_the_processor_away_after_every_128_late_frames(tmp_path):
    player, bus = player_of(write_log(tmp_path / "a.log", [0.1 * k for k in range(1000)]), cost_ns=MS // 5)
    play(player)
    left_ms = [t_ms for t_ms, _ in bus.sent]
    rests_ms = [after - before - 0.2 for before, after in pairwise(left_ms) if after - before > 0.21]
    assert rests_ms == pytest.approx([BREATH_NS / MS] * (1000 // BREATHLESS))
    assert bus.ids == list(range(1000))


def test_who_keeps_up_never_pauses(tmp_path):
    player, bus = player_of(write_log(tmp_path / "a.log", [k for k in range(1000)]), cost_ns=MS // 5)
    play(player)
    assert [t_ms for t_ms, _ in bus.sent] == list(range(1000))


def test_a_pause_holds_the_next_frame_for_as_long_as_it_lasts(log):
    player, bus = player_of(log)
    play(player, until_ms=25)
    before = len(bus.sent)
    player.pause()
    for _ in range(5):
        assert player.advance()
    assert (len(bus.sent), player.paused) == (before, True)
    player.resume()
    held_ms = 5 * REST_NS / MS
    play(player)
    assert bus.sent == [(10.0 * k + (held_ms if k >= before else 0), k) for k in range(100)]
    assert player.report.duration_error_ns == 0


def test_steps_send_single_frames_and_then_the_log_goes_on_from_there(log):
    player, bus = player_of(log)
    play(player, until_ms=20)
    assert player.step(2) == 2
    assert bus.ids == [0, 1, 2, 3, 4]
    player.advance()
    at_ms = player._clock.now_ns() / MS
    player.resume()
    play(player, until_ms=at_ms + 10)
    assert bus.sent[5] == (at_ms + 10, 5)


def test_no_more_steps_are_made_than_there_are_frames(log):
    player, bus = player_of(log)
    assert player.step(1000) == 100
    assert bus.ids == list(range(100))
    player.resume()
    assert not player.advance()


@pytest.mark.parametrize(("log_s", "first"), [(0.5, 50), (0.0, 0), (-3.0, 0), (0.101, 11), (0.99, 99)])
def test_a_seek_goes_on_with_the_first_frame_there(log, log_s, first):
    player, bus = player_of(log)
    play(player, until_ms=25)
    before = len(bus.sent)
    player.seek(log_s)
    play(player)
    assert bus.ids[before:] == list(range(first, 100))
    wait_ms = 10 * first - 1000 * max(0.0, log_s)
    assert bus.sent[before][0] == pytest.approx(25 + wait_ms if wait_ms else 30, abs=6)


def test_a_seek_behind_the_end_ends_the_replay(log):
    player, bus = player_of(log)
    play(player, until_ms=20)
    player.seek(99.0)
    play(player)
    assert bus.ids == [0, 1, 2]


def test_a_seek_while_it_is_held_keeps_it_held(log):
    player, bus = player_of(log)
    play(player, until_ms=20)
    player.pause()
    player.seek(0.7)
    player.advance()
    assert (player.paused, bus.ids, player.position_s) == (True, [0, 1, 2], 0.7)
    player.step()
    assert bus.ids[-1] == 70


def test_due_times_never_fall_over_seeks_and_loops(log):
    player, bus = player_of(log, cut=Cut(loops=3))
    for until_ms, log_s in ((300, 0.1), (600, 0.9), (1700, 0.0)):
        play(player, until_ms=until_ms)
        player.seek(log_s)
    play(player)
    dues = [frame.due_ns for frame in bus.frames]
    assert dues == sorted(dues)
    assert player.report.reordered == 0


def count(state, frame):
    """A stage with a counter: its state in the data."""
    return state + 1, replace(frame, data=bytes([state % 256]))


def test_a_stage_changes_every_frame_and_its_state_goes_on_over_seeks(log):
    player, bus = player_of(log, stages=[Stage(count, 0)])
    for log_s in (0.3, 0.9, 0.1):
        play(player, until_ms=player._clock.now_ns() / MS + 35)
        player.seek(log_s)
    play(player)
    assert [frame.data[0] for frame in bus.frames] == list(range(len(bus.frames)))
    assert player.states == [len(bus.frames)]


def test_a_frame_that_the_bus_refuses_leaves_the_stages_as_they_were(log):
    player, bus = player_of(log, stages=[Stage(count, 0)], refuses={3, 4})
    report = play(player)
    assert [frame.data[0] for frame in bus.frames] == list(range(98))
    assert (report.frames_sent, report.refused) == (98, 2)


def test_a_stage_may_make_several_frames_of_one_or_none(log):
    def doubled(state, frame):
        return state, (frame, frame) if frame.arbitration_id % 2 else ()

    player, bus = player_of(log, stages=[Stage(doubled), Stage(count, 0)])
    play(player)
    assert bus.ids == [number for number in range(1, 100, 2) for _ in range(2)]
    assert [frame.data[0] for frame in bus.frames] == list(range(100))


def test_everything_that_was_sent_is_recorded_in_order_with_the_time_it_was_due(log):
    recorded = []
    player, bus = player_of(log, record=lambda *what: recorded.append(what), refuses={7})
    play(player, until_ms=25)
    player.pause()
    player.advance()
    player.resume()
    play(player)
    assert [frame for frame, _ in recorded] == bus.frames
    assert [(frame.due_ns + origin_ns) / MS for frame, origin_ns in recorded] == [t for t, _ in bus.sent]


def test_a_replay_that_is_stopped_has_recorded_what_it_sent(log):
    recorded = []
    player, bus = player_of(log, record=lambda *what: recorded.append(what))
    play(player, until_ms=200)
    assert len(recorded) == len(bus.sent) == 21


def test_reading_ahead_has_an_end(tmp_path):
    path = write_log(tmp_path / "a.log", range(0, 200_000, 10), ids=[1] * 20_000)
    player, _ = player_of(path)
    play(player, until_ms=1000)
    assert AHEAD <= player._supply.ahead.count < AHEAD + 200


def test_a_log_without_any_pause_is_listened_in_all_the_same(tmp_path):
    path = write_log(tmp_path / "a.log", [0] * 3500)
    player, bus = player_of(path)
    play(player)
    assert bus.drained == 3 + 1  # and at the end


def metronome(every_ms, until_ms, name=0x7FE):
    """A stage with a frame of its own every so often, after the first of the log."""

    def due(state):
        return state * MS if 0 < state <= until_ms else None

    def wake(state, due_ns):
        return state + every_ms, (Frame(due_ns=due_ns, arbitration_id=name, data=b""),)

    def function(state, frame):
        return state or every_ms, frame

    return Stage(function, 0, due=due, wake=wake)


def test_the_frames_of_a_stage_leave_at_their_own_times_before_between_and_after_the_logs(log):
    player, bus = player_of(log, stages=[metronome(15, 1100)])
    play(player)
    assert [ms for ms, name in bus.sent if name == 0x7FE] == [15.0 * k for k in range(1, 74)]
    assert [ms for ms, name in bus.sent if name != 0x7FE] == [10.0 * k for k in range(100)]
    assert player.report.reordered == 0


def test_a_stages_own_frames_pass_the_stages_behind_it_and_not_those_before(log):
    def marked(mark):
        return Stage(lambda state, frame: (state + [mark] * (frame.arbitration_id == 0x7FE), frame), [])

    player, _ = player_of(log, stages=[marked("before"), metronome(500, 900), marked("behind")])
    play(player)
    assert player.states[0] == []
    assert player.states[2] == ["behind"]


def test_a_stages_frame_that_a_bus_refuses_does_not_hold_the_replay_up(log):
    player, bus = player_of(log, stages=[metronome(100, 900)], refuses=[0x7FE])
    report = play(player)
    assert (len(bus.sent), report.refused) == (100, 9)

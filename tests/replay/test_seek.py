"""A seek while a replay runs: the bus is not silent meanwhile, and no image of a sensor is missing."""

from itertools import pairwise

import pytest

from tests.replay.laying import Told, laid_player
from tests.replay.playing import EVERYTHING, MS, Bus, play, player_of, write_log
from tests.replay.test_overlaid import images, of_camera, whole_images
from vsensor.clock import SimulatedClock
from vsensor.replay.player import SEARCH_NS, Player
from vsensor.replay.reading import survey
from vsensor.replay.reel import Reel


class Far(Reel):
    """A reel on which the way to a place takes `cost_ns` for every 20 frames."""

    def __init__(self, path, clock, cost_ns):
        super().__init__(path, survey(path), choice=EVERYTHING)
        self.clock, self.cost_ns, self.steps = clock, cost_ns, 0

    def reading(self, log_ns):
        reading = super().reading(log_ns)
        skip = reading.skip

        def slowly(log_ns):
            self.steps += 1
            self.clock.sleep_until_ns(self.clock.now_ns() + self.cost_ns)
            return skip(log_ns, 20)

        reading.skip = slowly
        return reading


def far_player(path, cost_ms, **wishes):
    clock = SimulatedClock()
    bus, reel = Bus(clock), Far(path, clock, round(cost_ms * MS))
    return Player(reel, bus, clock, **wishes), bus, reel


@pytest.fixture
def log(tmp_path):
    """A thousand frames, one every 10 ms from 5 s on."""
    return write_log(tmp_path / "a.log", [5000 + 10 * k for k in range(1000)])


def test_the_old_place_is_played_on_its_times_while_the_new_one_is_looked_for(log):
    player, bus, reel = far_player(log, 3)
    play(player, until_ms=205)
    player.seek(8.0)
    report = play(player)
    last = bus.ids.index(800) - 1
    assert reel.steps > 30
    assert bus.sent[: last + 1] == [(10.0 * k, k) for k in range(last + 1)]
    assert bus.ids[last + 1 :] == list(range(800, 1000))
    searched_ms = 3 * reel.steps
    assert 205 + searched_ms <= bus.sent[last + 1][0] <= 205 + 2 * searched_ms
    assert max(after - before for (before, _), (after, _) in pairwise(bus.sent)) <= 10.001
    assert (report.timing.lateness.max_ns, report.seeks, report.silence_ns) == (0, 1, 10 * MS)


def test_a_bus_without_any_pause_is_never_silent_for_longer_than_one_look_takes(tmp_path):
    log = write_log(tmp_path / "a.log", range(3000), ids=[k % 0x700 for k in range(3000)])
    player, bus, reel = far_player(log, 4)
    play(player, until_ms=100)
    player.seek(2.0)
    play(player)
    assert reel.steps > 90
    assert max(after - before for (before, _), (after, _) in pairwise(bus.sent)) <= 4
    arrived_ms = next(after for (_, one), (after, other) in pairwise(bus.sent) if other not in (one + 1, 0))
    assert arrived_ms <= 100 + (reel.steps + 1) * SEARCH_NS / MS


def test_seeks_that_follow_each_other_add_up(log):
    player, bus, _ = far_player(log, 3)
    play(player, until_ms=205)
    for _ in range(2):
        player.seek(player.position_s + 3.0)
        player.advance()
    assert player.position_s == pytest.approx(6.21)
    play(player)
    assert [after for before, after in pairwise(bus.ids) if after != before + 1] == [621]


def test_a_pause_ends_a_seek_at_once(log):
    player, bus, _ = far_player(log, 3)
    play(player, until_ms=205)
    player.seek(8.0)
    player.advance()
    player.pause()
    sent = len(bus.sent)
    player.step()
    assert bus.ids[sent:] == [800]


def test_a_log_that_ends_while_a_place_is_looked_for_goes_on_there(log):
    player, bus, _ = far_player(log, 50)
    play(player, until_ms=9900)
    player.seek(5.0)
    report = play(player)
    assert bus.ids == [*range(1000), *range(500, 1000)]
    assert report.reordered == 0


def test_without_waiting_the_new_place_follows_at_once(log):
    player, bus, _ = far_player(log, 3, real_time=False)
    player.advance()
    sent = len(bus.sent)
    player.seek(8.0)
    play(player)
    assert bus.ids[sent:] == list(range(800, 1000))


def test_the_summary_tells_how_long_no_frame_was_sent(log):
    player, _, _ = far_player(log, 3)
    play(player, until_ms=205)
    player.seek(8.0)
    assert "seeks 1, longest silence at one 10.000 ms" in play(player).text()
    quiet, _ = player_of(log)
    assert "silence" not in play(quiet).text()


class Slow(Told):
    """A desk on a clock: each image takes `takes_ns` after the one before, also one that is taken back."""

    def __init__(self, takes_ns, **more):
        super().__init__(**more)
        self.takes_ns, self.clock, self.free_ns, self.ready_ns = takes_ns, None, 0, {}

    def ask(self, wish):
        super().ask(wish)
        self.free_ns = max(self.free_ns, self.clock.now_ns()) + self.takes_ns
        self.ready_ns[wish.number] = self.free_ns

    @property
    def is_ready(self):
        return bool(self._made) and self.clock.now_ns() >= self.ready_ns[self._made[0].number]

    def answer(self):
        self.clock.sleep_until_ns(self.ready_ns[self._made[0].number])
        return super().answer()


@pytest.mark.parametrize("from_ms", [301, 319, 340])
@pytest.mark.parametrize("takes_ms", [1, 8])
def test_over_a_seek_the_sensors_images_leave_on_time_and_none_is_missing(tmp_path, from_ms, takes_ms):
    log = write_log(tmp_path / "car.log", range(0, 10_000, 10), ids=[1] * 1000)
    desk = Slow(takes_ms * MS, after_ns=15 * MS)
    clock = desk.clock = SimulatedClock()
    player, bus, _ = laid_player(log, desk=desk, clock=clock)
    play(player, until_ms=from_ms)
    player.seek(6.0)
    report = play(player)
    found = images(bus)
    assert [k for _, k in found] == list(range(len(found)))
    assert [ms for ms, _ in found][1:] == [40.0 * k for k in range(1, len(found))]
    assert sorted(of_camera(bus), key=lambda one: (one[1], one[0])) == whole_images(len(found))
    assert report.timing.lateness.max_ns <= takes_ms * MS
    cut = next(wish for wish in desk.wishes.values() if wish.is_cut)
    assert cut.number * 40 <= from_ms + 180

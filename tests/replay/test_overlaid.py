"""Where the images of a sensor that is laid over a log come: a told sensor, a simulated clock."""

from fractions import Fraction

import pytest

from tests.replay.laying import CAMERA, Told, laid_player
from tests.replay.playing import MS, play, write_log
from vsensor.replay.overlaid import SEEK_LEAD_NS
from vsensor.replay.reading import Cut
from vsensor.replay.timeline import Pace


@pytest.fixture
def log(tmp_path):
    """A hundred frames of ids 0 to 99, one every 10 ms from 5 s on."""
    return write_log(tmp_path / "a.log", [5000 + 10 * k for k in range(100)])


def images(bus):
    """Return (time in ms, image number) of the first frame of each image sent."""
    both = zip(bus.sent, bus.frames, strict=True)
    return [(ms, int.from_bytes(f.data, "big")) for (ms, number), f in both if number == CAMERA[0]]


def of_camera(bus):
    """Return (id, image number) of all the sensor's frames in their order."""
    return [
        (f.arbitration_id, int.from_bytes(f.data, "big")) for f in bus.frames if f.arbitration_id in CAMERA
    ]


def whole_images(count):
    return [(number, k) for k in range(count) for number in CAMERA]


def log_ms(wish):
    return wish.log_ns / MS - 5000


def test_an_image_comes_every_40_ms_of_the_replay_from_its_first_frame_on(log):
    player, bus, _ = laid_player(log)
    play(player)
    assert images(bus) == [(40.0 * k, k) for k in range(25)]


def test_the_frames_of_the_car_are_all_there_and_everything_is_in_the_order_of_time(log):
    player, bus, _ = laid_player(log)
    report = play(player)
    assert [number for number in bus.ids if number not in CAMERA] == list(range(100))
    assert [frame.due_ns for frame in bus.frames] == sorted(frame.due_ns for frame in bus.frames)
    assert report.reordered == 0


def test_frames_that_leave_later_than_their_image_stand_between_those_of_the_car(log):
    player, bus, _ = laid_player(log, desk=Told(after_ns=15 * MS))
    report = play(player)
    assert report.reordered == 0
    assert [ms for ms, number in bus.sent if number == CAMERA[1]] == [40.0 * k + 15 for k in range(25)]


def test_at_twice_the_speed_images_come_twice_as_often_at_the_same_places(log):
    player, bus, desk = laid_player(log, speed=2, pace=Pace(speed=Fraction(2)))
    play(player)
    assert images(bus) == [(20.0 * k, k) for k in range(25)]
    assert [log_ms(desk.wishes[k]) for k in range(25)] == [40.0 * k for k in range(25)]


def test_without_waiting_the_same_frames_are_sent_in_the_same_order(log):
    player, bus, _ = laid_player(log)
    play(player)
    quick, other, _ = laid_player(log, real_time=False)
    play(quick)
    assert other.frames == bus.frames


def test_over_a_seam_the_sensor_goes_on_and_the_scene_is_back_at_the_start(log):
    player, bus, desk = laid_player(log, cut=Cut(loops=2))
    play(player)
    assert images(bus) == [(40.0 * k, k) for k in range(50)]
    cuts = {k: wish for k, wish in desk.wishes.items() if wish.is_cut}
    assert list(cuts) == [25]  # the second pass begins after 1000 ms: 100 frames and a seam of 10 ms
    assert log_ms(cuts[25]) == 0.0
    assert cuts[25].is_start


def test_after_a_seek_the_sensor_goes_on_and_the_scene_is_there(log):
    player, bus, desk = laid_player(log)
    play(player, until_ms=205)
    player.seek(0.7)
    play(player)
    assert of_camera(bus) == whole_images(len(images(bus)))
    cut = next(wish for wish in desk.wishes.values() if wish.is_cut)
    assert not cut.is_start
    assert (cut.number, log_ms(cut)) == (8, pytest.approx(700 + 320 - (210 + SEEK_LEAD_NS / MS), abs=10))
    later = desk.wishes[cut.number + 1]
    assert log_ms(later) - log_ms(cut) == 40.0


@pytest.mark.parametrize("steps", range(1, 15))
def test_a_seek_in_the_middle_of_anything_tears_no_image(log, steps):
    player, bus, _ = laid_player(log, desk=Told(after_ns=15 * MS))
    player.step(steps)
    player.seek(0.33)
    player.step(3)
    player.seek(0.05)
    player.resume()
    play(player)
    found = of_camera(bus)
    assert sorted(found, key=lambda one: (one[1], one[0])) == whole_images(len(found) // 2)
    for number in CAMERA:
        assert [k for i, k in found if i == number] == list(range(len(found) // 2))


def test_a_gap_that_is_cut_is_a_cut_of_the_scene(tmp_path):
    times = [*range(0, 200, 10), *range(5000, 5200, 10)]
    path = write_log(tmp_path / "gap.log", times)
    player, _, desk = laid_player(path, pace=Pace(max_gap_ns=50 * MS))
    play(player)
    assert [number for number, wish in desk.wishes.items() if wish.is_cut] == [6]
    assert desk.wishes[6].log_ns == 5000 * MS  # 190 ms, 50 ms of gap: the frame of 5000 ms is due at 240


def test_a_log_that_is_silent_for_long_asks_for_few_images_ahead(tmp_path):
    path = write_log(tmp_path / "gap.log", [0, 60_000])
    player, bus, desk = laid_player(path)
    assert len(desk.wishes) <= 8
    play(player)
    assert [k for _, k in images(bus)] == list(
        range(1500)
    )  # what is due with the last frame has no time left


def test_what_moves_the_vehicle_is_told_with_the_image_after_it_on_the_sensors_clock(log):
    heard = frozenset({(3, False), (4, False), (5, False), (50, False)})
    player, _, desk = laid_player(log, speed=2, pace=Pace(speed=Fraction(2)), heard=heard)
    play(player)
    told = {
        k: [(f.arbitration_id, f.due_ns / MS) for f in w.heard] for k, w in desk.wishes.items() if w.heard
    }
    assert told == {1: [(3, 30.0), (4, 40.0)], 2: [(5, 50.0)], 13: [(50, 500.0)]}

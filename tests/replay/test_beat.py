"""Seams and seeks in the rhythm of the images: a strict receiver accepts what a player sends."""

from fractions import Fraction

import numpy as np
import pytest
from msgspec.structs import replace

from tests.accept.streams import found
from tests.ecu.building import found as ecu_found
from tests.ecu.building import report_on
from tests.ecu.streams import IDS, stream, write
from tests.replay.playing import play, player_of
from tests.replay.repairing import NATIVE, later, repair_of
from vsensor.replay.beat import beat_of
from vsensor.replay.choice import choice, keys_of
from vsensor.replay.reading import Cut, survey
from vsensor.replay.timeline import Pace

MS = 1_000_000
START_NS = stream(1)[0].due_ns


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    path = tmp_path_factory.mktemp("beat") / "a.log"
    write(stream(28), path)
    return path


def beat(log, rename=()):
    head = survey(log)
    return beat_of([NATIVE], keys_of(head.columns), head.m_ns, dict(rename))


def player(log, **cut):
    return player_of(log, stages=[repair_of()], cut=Cut(beat=beat(log), **cut))


def sent(bus):
    return [replace(f, due_ns=round(ms * MS)) for f, (ms, _) in zip(bus.frames, bus.sent, strict=True)]


def test_the_rhythm_is_that_of_the_messages_that_leave_together(log):
    assert beat(log) == (IDS["LDS_Image"], frozenset(IDS.values()), 13, 40 * MS)


def test_the_first_frame_of_an_image_is_the_one_after_the_pause_whatever_the_profile_says(tmp_path):
    frames = stream(20)
    order = [frames[13 * k + (place + 4) % 13] for k in range(20) for place in range(13)]
    write([replace(f, due_ns=g.due_ns) for f, g in zip(order, frames, strict=True)], tmp_path / "b.log")
    assert beat(tmp_path / "b.log").key == frames[4].arbitration_id


@pytest.mark.parametrize("start_ms", [0, 1, 38])
@pytest.mark.parametrize("stop_ms", [1200, 920.4, 921.6, 959])
def test_a_part_cut_anywhere_is_accepted_as_a_loop(log, start_ms, stop_ms):
    cut = {"start_ns": START_NS + start_ms * MS, "stop_ns": START_NS + round(stop_ms * MS), "loops": 3}
    one, bus = player(log, **cut)
    play(one)
    assert found(sent(bus)) == {}
    firsts = [ms for ms, name in bus.sent if name == IDS["LDS_Image"]]
    assert set(np.round(np.diff(firsts), 6)) == {40.0}


@pytest.mark.parametrize("from_ms", [400, 401.1, 402.9, 430])
@pytest.mark.parametrize("to_s", [0.0, 0.2015, 0.33, 0.801])
def test_a_seek_from_and_to_anywhere_is_accepted(log, from_ms, to_s):
    one, bus = player(log)
    play(one, until_ms=from_ms)
    one.seek(to_s)
    play(one)
    assert found(sent(bus)) == {}


def test_a_log_that_is_not_one_whole_image_is_looped_as_it_is(tmp_path):
    write(stream(6)[:70], tmp_path / "b.log")
    rhythm = beat(tmp_path / "b.log")
    write(stream(1)[:5], tmp_path / "c.log")
    one, bus = player_of(tmp_path / "c.log", stages=[repair_of()], cut=Cut(beat=rhythm, loops=4))
    play(one)
    assert len(bus.sent) == 20


def test_where_the_images_end_the_rest_of_the_log_is_played_after_a_seek(tmp_path):
    frames = stream(20)
    other = [replace(frames[0], arbitration_id=0x7A1, due_ns=START_NS + k * 10 * MS) for k in range(80, 120)]
    write(frames + other, tmp_path / "b.log")
    one, bus = player(tmp_path / "b.log")
    play(one, until_ms=100)
    one.seek(0.85)
    play(one)
    left = [ms for ms, name in bus.sent if name == 0x7A1]
    assert len(left) >= 35 - 13
    assert set(np.round(np.diff(left), 6)) == {10.0}


def test_a_message_that_is_sent_under_another_id_has_its_rhythm(tmp_path):
    image = IDS["LDS_Image"]
    frames = [replace(f, arbitration_id=0x7A0) if f.arbitration_id == image else f for f in stream(20)]
    write(frames, tmp_path / "b.log")
    assert beat(tmp_path / "b.log").key != 0x7A0
    assert beat(tmp_path / "b.log", {0x7A0: image}) == (0x7A0, {0x7A0, *IDS.values()} - {image}, 13, 40 * MS)
    renaming = choice((), (), (f"0x7A0=0x{image:X}",), None)
    cut = Cut(beat=beat(tmp_path / "b.log", renaming.rename))
    one, bus = player_of(tmp_path / "b.log", stages=[repair_of()], cut=cut, choice=renaming)
    play(one, until_ms=201.1)
    one.seek(0.5)
    play(one)
    assert found(sent(bus)) == {}


@pytest.mark.parametrize("speed", [1, 10])
def test_the_reference_ecu_finds_nothing_over_seams_and_a_seek(log, tmp_path, speed):
    pace = Pace(speed=Fraction(speed))
    cut = Cut(beat=beat(log), loops=3, start_ns=START_NS + 7 * MS, stop_ns=START_NS + 950 * MS)
    one, bus = player_of(log, stages=[repair_of(speed=float(speed))], cut=cut, pace=pace)
    play(one, until_ms=501.5 / speed)
    one.seek(0.313)
    play(one)
    assert ecu_found(report_on(later(sent(bus), START_NS / MS), tmp_path)) == {}


def test_the_reference_ecu_finds_the_same_log_looped_without_repair_wrong(log, tmp_path):
    one, bus = player_of(log, cut=Cut(loops=3))
    play(one)
    assert ecu_found(report_on(later(sent(bus), START_NS / MS), tmp_path)) != {}

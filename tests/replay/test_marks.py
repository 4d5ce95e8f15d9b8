"""Places at which reading goes on: the same frames as from the first one, and nothing read twice for them."""

import numpy as np
import pytest

from tests.replay.playing import MS, reel_of, write_log
from tests.replay.test_reel import all_of
from vsensor.replay import marks
from vsensor.replay.reading import Cut


@pytest.fixture
def log(tmp_path, monkeypatch):
    """Two thousand frames of two ids in batches, some back in time, a clock set back, a foreign line."""
    monkeypatch.setattr(marks, "EVERY", 100)
    times = np.arange(2000) * 5 // 20 * 20 + 5000
    times[::37] -= 3
    times[1500:] -= 4000
    path = write_log(tmp_path / "a.log", times.tolist(), ids=[k % 2 for k in range(2000)])
    text = path.read_text().splitlines(keepends=True)
    path.write_text("".join([*text[:150], "oops\n", *text[150:]]))
    return path


CUTS = [{}, {"cycles": {0: 10 * MS, 1: 10 * MS}}, {"rate_hz": 200.0}]


@pytest.mark.parametrize("cut", CUTS)
@pytest.mark.parametrize("to_ms", [0, 2, 900, 5003, 7480, 9100])
def test_a_seek_in_what_was_read_gives_what_reading_from_the_first_frame_gives(log, cut, to_ms):
    reel, fresh = (reel_of(log, piece=64, cut=Cut(**cut)) for _ in range(2))
    all_of(reel)
    target_ns = reel.start_ns + to_ms * MS
    can_go_on = to_ms >= 900 and "rate_hz" not in cut  # without times lines are read as they come
    assert (reel.reading(target_ns).count > 0) == can_go_on
    assert fresh.reading(target_ns).count == 0
    reel.seek(target_ns, 0)
    fresh.seek(target_ns, 0)
    found = all_of(reel)
    assert found == all_of(fresh)
    assert len(found) == pytest.approx(2000 - to_ms / 5, abs=10)
    assert reel.findings() == fresh.findings()
    assert any("oops" in line for line in reel.findings())


def test_little_is_read_again(log):
    reel = reel_of(log, piece=64)
    all_of(reel)
    for at in range(300, 1400, 50):
        reading = reel.reading(reel.start_ns + at * 5 * MS)
        assert at - 2 * 100 - 64 <= reading.count <= at


def test_a_pass_from_the_middle_of_a_log_begins_near_it(log, monkeypatch):
    monkeypatch.setattr("vsensor.replay.reel.SURVEY", 128)
    start_ns = 5000 * MS + 4000 * MS
    reel = reel_of(log, piece=64, cut=Cut(start_ns=start_ns, loops=2))
    once = reel_of(log, piece=64, cut=Cut(start_ns=start_ns))
    assert len(all_of(reel)) == 2 * len(all_of(once))
    assert reel.reading(start_ns).count >= 500


def test_of_a_long_log_as_many_marks_are_kept_as_of_one_twice_as_long(monkeypatch):
    monkeypatch.setattr(marks, "EVERY", 10)
    monkeypatch.setattr(marks, "MOST", 16)
    kept = marks.Marks()
    for count in range(1000):
        if kept.wants(count):
            kept.add(marks.Mark(count, count, (count,), None, None, None))
    assert 8 <= len(kept._marks) <= 17
    assert kept.before(0) is None
    for at in range(200, 1000, 7):
        assert at - 2 * kept._every <= kept.before(at).frames < at

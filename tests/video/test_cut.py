"""Events cut out of a long drive: what is cut is what the drive had there."""

import numpy as np
import pytest

from tests.video.event_made import straight_event
from vsensor.cli import main
from vsensor.errors import LogError
from vsensor.profile import load_profiles
from vsensor.video.camera_file import read_camera
from vsensor.video.can_signals import read_can
from vsensor.video.cut import CutOptions, cut_events
from vsensor.video.event_folder import read_event
from vsensor.video.events import Event
from vsensor.video.frames import open_pictures

pytest.importorskip("cv2")

PROFILES = load_profiles(("p2",), None)


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A drive of 3 s beside the left marking, as one folder."""
    return straight_event(tmp_path_factory.mktemp("drive") / "whole", seconds=3.0, offset_m=0.4)


def event(begins_s, ends_s):
    return Event(begins_s=begins_s, ends_s=ends_s, core_begins_s=begins_s, core_ends_s=ends_s)


def cut(drive, out, *events, **more):
    can = read_can(drive / "can.blf", PROFILES)
    options = CutOptions(out=out, video=str(drive / "video.avi"), **more)
    return cut_events(can, events, read_camera(drive / "camera.toml"), options)


def pictures(path):
    with open_pictures(path) as reader:
        return np.array([picture.grey for picture in reader])


def test_a_cut_event_has_the_pictures_and_messages_of_its_time(drive, tmp_path):
    cut(drive, tmp_path, event(0.5, 1.2), event(1.7, 2.3))
    whole, again = pictures(drive / "video.avi"), read_event(tmp_path / "event_0001")
    np.testing.assert_array_equal(pictures(again.video), whole[17:23])
    assert again.config.frames == 6
    can, part = read_can(drive / "can.blf", PROFILES), read_can(again.log, PROFILES)
    assert part.seconds == pytest.approx(0.6, abs=0.05)
    at = again.config.video_starts_at_log_s + np.arange(6) * 0.1
    np.testing.assert_allclose(
        part.linear("left.lane_offset_m", at),
        can.linear("left.lane_offset_m", 1.7 + np.arange(6) * 0.1),
        atol=1e-6,
    )


def test_the_camera_goes_with_a_cut_event(drive, tmp_path):
    cut(drive, tmp_path, event(0.5, 1.2))
    again, before = read_event(tmp_path / "event_0000").config, read_camera(drive / "camera.toml")
    assert (again.camera, again.vehicle) == (before.config, before.vehicle)


def test_a_video_that_begins_later_is_cut_by_the_logs_time(drive, tmp_path):
    cut(drive, tmp_path, event(0.5, 1.2), event(1.7, 2.3), starts_at_log_s=1.0)
    assert not (tmp_path / "event_0000").exists()  # it began before the video
    np.testing.assert_array_equal(
        pictures(tmp_path / "event_0001" / "video.avi"), pictures(drive / "video.avi")[7:13]
    )


def test_an_event_that_the_video_does_not_have_to_its_end_is_told_and_not_left_in_part(drive, tmp_path):
    notes = cut(drive, tmp_path, event(0.5, 1.2), event(2.5, 3.5))
    assert [path.name for path in tmp_path.iterdir()] == ["event_0000"]
    assert notes[-1] == "1 events are not wholly in the video"


def test_a_video_of_another_time_is_refused(drive, tmp_path):
    with pytest.raises(LogError, match="does not overlap the video"):
        cut(drive, tmp_path, event(0.5, 1.2), starts_at_log_s=100.0)


def test_the_command_finds_cuts_and_names_criteria(drive, tmp_path, capsys):
    mine = tmp_path / "mine.toml"
    mine.write_text('schema = "vsensor.events/1"\nbefore_s = 0.5\nafter_s = 0.5\nleast_s = 0.5\n')
    words = ["video", "events", str(drive / "can.blf"), "--criteria", str(mine), "--quiet"]
    out = tmp_path / "events"
    more = ["--video", str(drive / "video.avi"), "--camera", str(drive / "camera.toml"), "--out", str(out)]
    assert main([*words, *more]) == 0
    said = capsys.readouterr()
    assert "1 events in" in said.out
    assert "tells no indicator" in said.err
    assert read_event(out / "event_0000").config.frames == 15
    mine.write_text('schema = "vsensor.events/1"\nnear = 0.5\n')
    assert main(words) == 2
    assert "near: unknown key; did you mean near_m?" in capsys.readouterr().err

"""Pictures of videos, folders, patterns and single images, with their times; what cannot be used is said."""

import cv2
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import ConfigError, VideoError
from vsensor.image import import_opencv
from vsensor.video.frames import open_pictures

SIZE = 96, 64
import_opencv("tests")  # before a writer is opened: it makes FFmpeg quiet, once and for all


def noise(number, colour=False):
    """A picture that no other is like, (64, 96) or (64, 96, 3)."""
    shape = (SIZE[1], SIZE[0], 3) if colour else (SIZE[1], SIZE[0])
    return np.random.default_rng(number).integers(0, 256, shape, dtype=np.uint8)


def write_video(path, pictures, rate_hz=10.0, codec="FFV1"):
    colour = pictures[0].ndim == 3
    writer = cv2.VideoWriter(str(path), cv2.CAP_FFMPEG, cv2.VideoWriter_fourcc(*codec), rate_hz, SIZE, colour)
    for picture in pictures:
        writer.write(picture)
    writer.release()
    return path


def read(path, rate_hz=None):
    with open_pictures(path, rate_hz) as reader:
        return list(reader), reader


def test_a_video_without_loss_gives_back_every_grey_level(tmp_path):
    written = [noise(n) for n in range(5)]
    pictures, reader = read(write_video(tmp_path / "v.avi", written))
    assert [p.index for p in pictures] == [0, 1, 2, 3, 4]
    for picture, grey in zip(pictures, written, strict=True):
        np.testing.assert_array_equal(picture.grey, grey)
        assert picture.bgr is None
    assert (reader.size, reader.rate_hz, reader.count, reader.notes) == (SIZE, 10.0, 5, [])


def test_a_video_in_colour_keeps_it(tmp_path):
    written = [noise(n, colour=True) for n in range(3)]
    pictures, _ = read(write_video(tmp_path / "v.avi", written))
    np.testing.assert_array_equal(pictures[1].bgr, written[1])
    np.testing.assert_array_equal(pictures[1].grey, cv2.cvtColor(written[1], cv2.COLOR_BGR2GRAY))


@pytest.mark.parametrize(("suffix", "codec"), [(".avi", "FFV1"), (".avi", "MJPG"), (".mp4", "mp4v")])
def test_times_are_those_of_the_video(tmp_path, suffix, codec):
    pictures, _ = read(write_video(tmp_path / f"v{suffix}", [noise(n) for n in range(7)], 4.0, codec))
    np.testing.assert_allclose([p.t_ns for p in pictures], np.arange(7) * 250e6, atol=1e3)


def test_a_stated_rate_takes_the_place_of_the_video_s_and_is_told_where_it_differs(tmp_path):
    video = write_video(tmp_path / "v.avi", [noise(n) for n in range(4)], 25.0)
    pictures, reader = read(video, 10.0)
    assert [p.t_ns for p in pictures] == [0, 100_000_000, 200_000_000, 300_000_000]
    assert "has 25 pictures/s by itself" in reader.notes[0]
    assert read(video, 25.0)[1].notes == []


def test_images_of_a_folder_come_in_the_order_of_their_numbers(tmp_path):
    for number in (10, 9, 1, 100):
        cv2.imwrite(str(tmp_path / f"frame{number}.png"), noise(number))
    (tmp_path / "notes.txt").write_text("no image")
    pictures, reader = read(tmp_path, 4.0)
    assert [p.t_ns for p in pictures] == [0, 250_000_000, 500_000_000, 750_000_000]
    for picture, number in zip(pictures, (1, 9, 10, 100), strict=True):
        np.testing.assert_array_equal(picture.grey, noise(number))
    assert (reader.count, reader.notes) == (4, [])


def test_a_pattern_takes_the_files_that_fit_it(tmp_path):
    for number in (1, 2, 11):
        cv2.imwrite(str(tmp_path / f"frame{number}.png"), noise(number))
    pictures, reader = read(str(tmp_path / "frame1*.png"))
    assert len(pictures) == 2
    assert "images carry no time" in reader.notes[0]


def test_one_image_is_a_video_of_one_picture(tmp_path):
    cv2.imwrite(str(tmp_path / "one.png"), noise(3, colour=True))
    pictures, reader = read(tmp_path / "one.png")
    np.testing.assert_array_equal(pictures[0].bgr, noise(3, colour=True))
    assert (len(pictures), reader.notes) == (1, [])


@needs_shared
def test_the_real_drive_has_221_pictures_at_25_hz():
    with open_pictures(SHARED_DATA / "camera" / "carnd_lanelines" / "solidWhiteRight.mp4") as reader:
        times = [picture.t_ns for picture in reader]
    assert (reader.size, reader.rate_hz, len(times), reader.notes) == ((960, 540), 25.0, 221, [])
    np.testing.assert_allclose(np.diff(times), 40e6, atol=1e3)


def unreadable(tmp_path):
    """Return {name: (what is there, words of the sentence)}."""
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "empty.png").touch()
    (tmp_path / "text.mp4").write_text("no video\n" * 100)
    (tmp_path / "text.png").write_text("no image\n" * 100)
    (tmp_path / "none").mkdir()
    whole = write_video(tmp_path / "whole.mp4", [noise(n) for n in range(9)], codec="mp4v").read_bytes()
    (tmp_path / "head.mp4").write_bytes(whole[:200])
    return {
        "absent.mp4": "no such file",
        "empty.mp4": "is empty",
        "empty.png": "is empty",
        "text.mp4": "not a video that can be read",
        "text.png": "not an image that can be read",
        "none": "a folder without images",
        "a*.png": "no file fits",
        "head.mp4": "not a video that can be read",
    }


def test_what_is_no_video_is_said_in_one_line_and_nothing_else_is_printed(tmp_path, capfd):
    for name, words in unreadable(tmp_path).items():
        capfd.readouterr()
        with pytest.raises(VideoError, match=words) as told:
            read(tmp_path / name)
        assert name in str(told.value)
        assert "\n" not in str(told.value)
        assert capfd.readouterr() == ("", "")


def test_a_video_that_was_cut_off_ends_early_and_says_so(tmp_path):
    whole = write_video(tmp_path / "v.avi", [noise(n) for n in range(20)]).read_bytes()
    cut = tmp_path / "cut.avi"
    cut.write_bytes(whole[: len(whole) * 6 // 10])
    pictures, reader = read(cut)
    assert 5 < len(pictures) < 15
    assert f"ends after {len(pictures)} of the 20" in reader.notes[0]


def test_images_of_two_sizes_are_refused_by_name(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), noise(1))
    cv2.imwrite(str(tmp_path / "b.png"), noise(1)[1:])
    with pytest.raises(VideoError, match=r"b\.png is 96 x 63, the first one 96 x 64"):
        read(tmp_path)


def test_times_that_do_not_go_on_are_refused_and_a_rate_mends_it(tmp_path, monkeypatch):
    video = write_video(tmp_path / "v.avi", [noise(n) for n in range(4)])
    monkeypatch.setattr("vsensor.video.frames._Video.read", stuck(iter([5.0, 5.1, 5.1])))
    with pytest.raises(VideoError, match=r"picture 2 is of 0\.100 s, the one before of 0\.100 s.*--rate"):
        read(video)
    monkeypatch.setattr("vsensor.video.frames._Video.read", stuck(iter([5.0, 5.1, 5.1])))
    assert [p.t_ns for p in read(video, 10.0)[0]] == [0, 100_000_000, 200_000_000]


def stuck(times):
    """Return a reader of pictures at these times."""

    def one(self):
        time_s = next(times, None)
        return None if time_s is None else (time_s, noise(1, colour=True))

    return one


def test_a_video_that_states_no_rate_asks_for_one(tmp_path, monkeypatch):
    video = write_video(tmp_path / "v.avi", [noise(n) for n in range(3)])
    monkeypatch.setattr("vsensor.video.frames._Video._rate_hz", staticmethod(lambda said: 0.0))
    with pytest.raises(VideoError, match="--rate HZ was expected"):
        read(video)
    assert len(read(video, 10.0)[0]) == 3


@pytest.mark.parametrize("rate_hz", [0.0, -1.0, 1e6, float("nan")])
def test_a_rate_that_no_video_has_is_refused(tmp_path, rate_hz):
    cv2.imwrite(str(tmp_path / "one.png"), noise(3))
    with pytest.raises(ConfigError, match="pictures per second were expected"):
        read(tmp_path / "one.png", rate_hz)

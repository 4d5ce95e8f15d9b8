"""Images as files: other readers see the same pixels, a video holds every tick, nothing half is left."""

import numpy as np
import pytest
from matplotlib.image import imread

from tests.lines import tick
from tests.outputs import four_lines, output_of
from vsensor.camera import Camera, CameraConfig
from vsensor.draws import Draws
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.image import ImageConfig, render
from vsensor.sinks.image import ImageSink, write_png

GREY = ImageConfig()
CAMERA = Camera.from_config(CameraConfig(width_px=96, height_px=64))


def sink(camera=CAMERA, config=GREY, seed=1, **options):
    return ImageSink(camera, config, Draws(seed), **options)


def outputs(count):
    return [output_of(four_lines(), tick=index) for index in range(count)]


def rendered(outputs, camera=CAMERA, config=GREY, seed=1):
    draws = Draws(seed)
    return [render(camera, config, output.snapshot, draws, output.tick) for output in outputs]


def frames_of(path):
    """Return the frames of a video as OpenCV's own reader sees them (N, H, W, 3), and its frame rate."""
    import cv2

    video = cv2.VideoCapture(str(path))
    frames = []
    while (read := video.read())[0]:
        frames.append(read[1])
    return np.array(frames), video.get(cv2.CAP_PROP_FPS)


@pytest.mark.parametrize("channels", ["grey", "rgb"])
def test_another_reader_sees_the_same_pixels(tmp_path, channels):
    config = ImageConfig(channels=channels)
    (image,) = rendered(outputs(1), config=config)
    write_png(tmp_path / "one.png", image)
    assert np.array_equal(np.rint(imread(tmp_path / "one.png") * 255.0), image)


def test_every_nth_tick_is_a_png_named_by_its_tick(tmp_path):
    writer = sink(folder=tmp_path / "images", every=3)
    for output in outputs(7):
        writer.write(output)
    writer.close()
    found = sorted(path.name for path in (tmp_path / "images").iterdir())
    assert found == ["000000.png", "000003.png", "000006.png"]


@pytest.mark.parametrize("channels", ["grey", "rgb"])
def test_a_video_without_loss_holds_every_tick_as_it_was(tmp_path, channels):
    config = ImageConfig(channels=channels)
    writer = sink(config=config, video=tmp_path / "run.avi", period_ns=100_000_000)
    made = outputs(5)
    for output in made:
        writer.write(output)
    writer.close()
    frames, rate = frames_of(tmp_path / "run.avi")
    assert rate == pytest.approx(10.0)
    images = np.array(rendered(made, config=config))
    assert np.array_equal(frames[..., ::-1] if channels == "rgb" else frames[..., 0], images)


def test_a_small_video_holds_every_tick(tmp_path):
    writer = sink(video=tmp_path / "run.mp4")
    for output in outputs(6):
        writer.write(output)
    writer.close()
    frames, rate = frames_of(tmp_path / "run.mp4")
    assert frames.shape == (6, 64, 96, 3)
    assert rate == pytest.approx(25.0)


def test_an_odd_size_gets_one_more_row_and_column(tmp_path):
    camera = Camera.from_config(CameraConfig(width_px=95, height_px=63))
    writer = sink(camera, video=tmp_path / "run.avi")
    made = outputs(2)
    for output in made:
        writer.write(output)
    writer.close()
    frames, _ = frames_of(tmp_path / "run.avi")
    assert frames.shape == (2, 64, 96, 3)
    assert np.array_equal(frames[:, :63, :95, 0], rendered(made, camera))


def test_until_it_is_whole_a_video_has_not_its_name_and_afterwards_nothing_else_is_left(tmp_path):
    path = tmp_path / "run.avi"
    path.write_bytes(b"of an earlier run")
    writer = sink(video=path)
    for output in outputs(2):
        writer.write(output)
    assert path.read_bytes() == b"of an earlier run"
    writer.close()
    writer.close()
    assert [found.name for found in tmp_path.iterdir()] == ["run.avi"]
    assert len(frames_of(path)[0]) == 2


def test_a_run_without_a_tick_leaves_no_video(tmp_path):
    sink(video=tmp_path / "run.avi").close()
    assert not list(tmp_path.iterdir())


def test_a_video_of_another_kind_is_refused(tmp_path):
    with pytest.raises(ConfigError, match=r"\.mp4, \.avi"):
        sink(video=tmp_path / "run.webm")


def test_images_that_cannot_be_written_are_refused_at_once(tmp_path):
    with pytest.raises(ConfigError, match="cannot be made"):
        sink(folder=tmp_path / "no" / "such")
    (tmp_path / "file").write_text("")
    with pytest.raises(ConfigError, match="cannot be made"):
        sink(folder=tmp_path / "file")
    with pytest.raises(ConfigError, match="model"):
        sink(Camera.from_config(CameraConfig(model="none")), folder=tmp_path / "images")


def test_without_opencv_one_sentence_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "cv2", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'vsensor\[video\]'"):
        sink(folder=tmp_path / "images")
    with pytest.raises(MissingExtraError, match="video"):
        render(CAMERA, ImageConfig(), outputs(1)[0].snapshot, Draws(0), tick(0))

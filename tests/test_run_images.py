"""`vsensor run --images, --video`: what is written, when it is refused, what Ctrl-C leaves."""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from matplotlib.image import imread

from vsensor.cli import main

SMALL = """
schema = "vsensor.scenario/1"
source = "{map}"
seed = 3
[camera]
width_px = 160
height_px = 100
[image]
channels = "rgb"
"""


@pytest.fixture
def scenario(tmp_path):
    from vsensor.config import SHIPPED

    path = tmp_path / "small.toml"
    path.write_text(SMALL.format(map=SHIPPED / "highway.xodr"))
    return path


def run(*words):
    return main(["run", *map(str, words), "--quiet"])


def test_a_run_writes_one_image_a_second(scenario, tmp_path, capsys):
    assert run(scenario, "--fast", "--duration", "2.2", "--images", tmp_path / "images") == 0
    found = sorted(path.name for path in (tmp_path / "images").iterdir())
    assert found == ["000000.png", "000025.png", "000050.png"]
    assert imread(tmp_path / "images" / "000000.png").shape == (100, 160, 3)
    assert f"wrote {tmp_path / 'images'}" in capsys.readouterr().out


def test_image_every_says_how_many_ticks_lie_between(scenario, tmp_path):
    options = ("--images", tmp_path / "images", "--image-every", 4)
    assert run(scenario, "--fast", "--duration", "0.4", *options) == 0
    found = sorted(path.name for path in (tmp_path / "images").iterdir())
    assert found == ["000000.png", "000004.png", "000008.png"]


def test_a_video_has_the_cycle_as_its_rate_and_a_frame_for_every_tick(scenario, tmp_path):
    import cv2

    assert run(scenario, "--fast", "--duration", "0.4", "--video", tmp_path / "run.mp4") == 0
    video = cv2.VideoCapture(str(tmp_path / "run.mp4"))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 10
    assert video.get(cv2.CAP_PROP_FPS) == pytest.approx(25.0)


def test_the_same_scenario_gives_the_same_images(scenario, tmp_path):
    for folder in ("a", "b"):
        assert run(scenario, "--fast", "--duration", "0.1", "--images", tmp_path / folder) == 0
    assert (tmp_path / "a" / "000000.png").read_bytes() == (tmp_path / "b" / "000000.png").read_bytes()


def test_images_change_nothing_that_is_sent(scenario, tmp_path):
    assert run(scenario, "--fast", "--duration", "0.4", "--trace", tmp_path / "without.npz") == 0
    options = ("--images", tmp_path / "images", "--image-every", 1)
    assert run(scenario, "--fast", "--duration", "0.4", "--trace", tmp_path / "with.npz", *options) == 0
    with np.load(tmp_path / "without.npz") as a, np.load(tmp_path / "with.npz") as b:
        assert all(np.array_equal(a[name], b[name], equal_nan=a[name].dtype.kind == "f") for name in a.files)


@pytest.mark.parametrize("option", [("--images", "images"), ("--video", "run.mp4")])
def test_in_real_time_images_are_refused_in_one_line(scenario, tmp_path, capsys, option):
    assert run(scenario, "--bus", "virtual:x", "--duration", 1, option[0], tmp_path / option[1]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "--fast" in said
    assert not (tmp_path / option[1]).exists()


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--video", "run.webm"), ".mp4, .avi"),
        (("--images", "no/such/folder"), "cannot be made"),
        (("--video", "no/such.mp4"), "no folder"),
    ],
)
def test_what_cannot_be_written_is_refused_before_a_log_is_replaced(
    scenario, tmp_path, capsys, monkeypatch, options, said
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.log").write_text("of an earlier run")
    assert run(scenario, "--fast", "--duration", 1, "--log", "old.log", *options) == 2
    message = capsys.readouterr().err
    assert message.count("\n") == 1
    assert said in message
    assert (tmp_path / "old.log").read_text() == "of an earlier run"


@pytest.mark.parametrize("wrong", ["0", "-1", "two"])
def test_image_every_is_a_number_of_ticks(scenario, capsys, wrong):
    with pytest.raises(SystemExit) as ended:
        run(scenario, "--fast", "--image-every", wrong)
    assert ended.value.code == 2
    assert "at least 1" in capsys.readouterr().err


def test_ctrl_c_leaves_a_whole_video(scenario, tmp_path):
    import cv2

    path = tmp_path / "run.avi"
    command = [
        sys.executable,
        "-m",
        "vsensor.cli",
        "run",
        scenario,
        "--fast",
        "--duration",
        "3000",
        "--video",
        path,
    ]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    ends = time.monotonic() + 60
    while not any(part.stat().st_size > 100_000 for part in tmp_path.glob(".run.*.part.avi")):
        assert process.poll() is None
        assert time.monotonic() < ends
        time.sleep(0.02)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=60)
    assert process.returncode == 130
    ticks = int(out.split()[0])
    video = cv2.VideoCapture(str(path))
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == ticks
    assert not list(tmp_path.glob(".*"))

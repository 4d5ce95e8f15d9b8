"""A lens is found from pictures of a chessboard; what cannot be used is named."""

import shutil

import cv2
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.video.boards import board_picture, write_boards
from vsensor.camera import Camera, CameraConfig, project
from vsensor.cli import main
from vsensor.distortion import DistortionConfig
from vsensor.errors import ConfigError, VideoError
from vsensor.video.camera_file import read_camera
from vsensor.video.chessboard import calibrate

TRUTH = CameraConfig(
    width_px=400,
    height_px=300,
    fx_px=330.0,
    fy_px=334.0,
    cx_px=195.0,
    cy_px=155.0,
    distortion=DistortionConfig(k1=-0.25, k2=0.06, p1=0.001, p2=-0.0015),
)


@pytest.fixture(scope="module")
def boards(tmp_path_factory):
    return write_boards(tmp_path_factory.mktemp("boards"), TRUTH, count=8)


@pytest.fixture(scope="module")
def found(boards):
    return calibrate(sorted(boards.iterdir()), 9, 6)


def test_the_lens_that_made_the_pictures_is_found(found):
    camera = found.camera
    assert found.rms_px < 0.1
    assert len(found.used) == 8
    assert (camera.fx_px, camera.fy_px) == pytest.approx((330.0, 334.0), rel=2e-3)
    assert (camera.cx_px, camera.cy_px) == pytest.approx((195.0, 155.0), abs=0.7)
    assert camera.distortion.k3 == 0.0  # there is none, and it is not made up


def test_the_found_lens_shows_what_the_true_one_shows(found):
    """Directions keep to 0.3 px against each other: where the axis points, no board tells."""
    points = np.array([(x, y, 1.0) for x in np.linspace(-0.4, 0.4, 11) for y in np.linspace(-0.3, 0.3, 9)])
    true, seen = (project(Camera.from_config(config), points) for config in (TRUTH, found.camera))
    apart = true - seen
    assert np.abs(apart - apart.mean(axis=0)).max() < 0.3


def test_part_of_a_board_is_used_as_far_as_it_shows(boards, tmp_path):
    shutil.copytree(boards, tmp_path, dirs_exist_ok=True)
    near_edge = board_picture(TRUTH, (0.55, 0.05, 1.3), (5, -10, 3))
    cv2.imwrite(str(tmp_path / "part.png"), near_edge)
    part = calibrate(sorted(tmp_path.iterdir()), 9, 6).boards[-1]
    assert part.path.name == "part.png"
    assert not part.problem
    assert (part.rows, part.columns) in ((6, 8), (6, 7), (6, 6), (6, 5))
    assert part.error_px < 0.15


def test_what_is_not_used_is_named_with_the_reason(boards, tmp_path):
    shutil.copytree(boards, tmp_path, dirs_exist_ok=True)
    cv2.imwrite(str(tmp_path / "y_empty.png"), np.full((300, 400), 90, np.uint8))
    wider = np.pad(cv2.imread(str(boards / "board4.png"), 0), ((0, 1), (0, 1)), mode="edge")
    cv2.imwrite(str(tmp_path / "y_wider.png"), wider)
    bent = cv2.imread(str(boards / "board4.png"), 0)
    v, u = np.mgrid[:300, :400].astype(np.float32)
    bent = cv2.remap(bent, u + 6.0 * np.sin(v / 25.0, dtype=np.float32), v, cv2.INTER_LINEAR)
    cv2.imwrite(str(tmp_path / "z_bent.png"), bent)
    result = calibrate(sorted(tmp_path.iterdir()), 9, 6)
    problems = {board.path.name: board.problem for board in result.boards if board.problem}
    assert set(problems) == {"y_empty.png", "y_wider.png", "z_bent.png"}
    assert "no board of 9 x 6" in problems["y_empty.png"]
    assert "is 401 x 301, most are 400 x 300: left out; the lens fits it to 0." in problems["y_wider.png"]
    assert "contradicts the others" in problems["z_bent.png"]
    assert result.rms_px < 0.1


def test_too_few_boards_or_a_wrong_count_of_corners_is_an_error(boards):
    files = sorted(boards.iterdir())
    with pytest.raises(VideoError, match="boards in 3 pictures of 400 x 300: at least 4 were expected"):
        calibrate(files[:3], 9, 6)
    with pytest.raises(VideoError, match="no board of 12 x 11 inner corners in any of 1 pictures"):
        calibrate(files[:1], 12, 11)
    with pytest.raises(ConfigError, match="3 to 60 inner corners"):
        calibrate(files, 2, 6)


def test_the_command_writes_a_camera_file_and_says_how_good_it_is(boards, tmp_path, capsys):
    out = tmp_path / "camera.toml"
    words = ["video", "calibrate", str(boards), "--board", "9x6", "--out", str(out), "--quiet"]
    assert main([*words, "--pictures", str(tmp_path / "drawn")]) == 0
    said = capsys.readouterr()
    assert "8 of 8 pictures used, reprojection error 0.0" in said.out
    assert "no corner was seen beyond" in said.err  # the boards keep off the rim
    assert read_camera(out).config.fx_px == pytest.approx(330.0, rel=2e-3)
    assert "reprojection error 0.0" in out.read_text()
    assert len(list((tmp_path / "drawn").iterdir())) == 8
    assert cv2.imread(str(tmp_path / "drawn" / "board0.png")).shape == (300, 800, 3)


@pytest.mark.parametrize("board", ["9", "9x", "9x6x2", "axb"])
def test_a_board_is_two_numbers(board, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["video", "calibrate", "x.png", "--board", board, "--out", "c.toml"])
    assert ended.value.code == 2
    assert "expected inner corners such as 9x6" in capsys.readouterr().err


@needs_shared
def test_real_boards_that_lack_corners_are_used_in_part_and_others_are_named():
    folder = SHARED_DATA / "camera" / "carnd_advanced" / "camera_cal"
    numbers = (1, 3, 5, 6, 7, 8, 12)
    result = calibrate([folder / f"calibration{number}.jpg" for number in numbers], 9, 6)
    seen = {board.path.stem.removeprefix("calibration"): board for board in result.boards}
    assert [(seen[n].columns, seen[n].rows) for n in "15"] == [(9, 5), (9, 5)]
    assert {n for n in seen if seen[n].problem} == {"7"}
    assert "is 1281 x 721, most are 1280 x 720" in seen["7"].problem
    assert result.rms_px < 1.0
    assert result.camera.fx_px == pytest.approx(1160, rel=0.015)

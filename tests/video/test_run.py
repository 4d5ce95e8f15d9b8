"""`vsensor video run` from its words to its files."""

from dataclasses import replace

import msgspec
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.video.drawn import EOR, VEHICLE, road_picture
from vsensor.cli import main
from vsensor.logs.decode import decode_log
from vsensor.profile import load_profile
from vsensor.sinks.video_file import VideoFile
from vsensor.video.camera_file import VideoCamera, write_camera
from vsensor.video.rows import read_rows
from vsensor.video.run import VideoRun, run_video

FRAMES, RATE_HZ = 12, 10
EVEN = msgspec.structs.replace(EOR, width_px=356)
"""A video has even sizes."""
DRIVE = SHARED_DATA / "camera" / "carnd_lanelines" / "solidWhiteRight.mp4"


def write_video(path, pictures, rate_hz=RATE_HZ):
    """Write pictures without loss."""
    with VideoFile(path, pictures[0].grey.shape[::-1], rate_hz, colour=False) as video:
        for picture in pictures:
            video.write(picture.grey)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A short video whose right line is gone in the second half, and its camera."""
    folder = tmp_path_factory.mktemp("video")
    pictures = [road_picture(EVEN, index=k, right_m=-1.6 if k < FRAMES // 2 else None) for k in range(FRAMES)]
    write_video(folder / "drive.avi", pictures)
    write_camera(folder / "camera.toml", VideoCamera(EVEN, VEHICLE))
    return folder


def run(folder, *words, video="drive.avi", method="published"):
    camera = ["--camera", str(folder / "camera.toml")]
    return main(
        ["video", "run", str(folder / video), "--method", method, *camera, "--quiet", *map(str, words)]
    )


@pytest.mark.parametrize("method", ["published", "ours"])
def test_there_is_a_row_for_every_picture_and_nothing_where_no_line_is(folder, tmp_path, capsys, method):
    assert run(folder, "--out", tmp_path / "rows.parquet", method=method) == 0
    rows = read_rows(tmp_path / "rows.parquet")
    np.testing.assert_allclose(rows.t_s, np.arange(FRAMES) / RATE_HZ, atol=1e-6)
    half = FRAMES // 2
    assert np.isfinite(rows.right_offset_m[2:half]).all()
    if method == "published":  # the other one may predict for a moment
        assert np.isnan(rows.right_offset_m[half:]).all()
        assert (rows.right_confidence[half:] == 0).all()
    np.testing.assert_allclose(rows.left_offset_m[2:half], 1.7 - 0.075, atol=0.14)
    assert f"{FRAMES} pictures of 356 x 288, 10 a second" in capsys.readouterr().out


def test_filled_gaps_keep_confidence_0(folder, tmp_path):
    assert run(folder, "--out", tmp_path / "rows.csv", "--fill") == 0
    rows = read_rows(tmp_path / "rows.csv")
    assert np.isfinite(rows.right_offset_m).all()
    assert (rows.right_confidence[FRAMES // 2 :] == 0).all()


def test_the_log_holds_the_offsets_of_the_rows(folder, tmp_path, capsys):
    words = ("--out", tmp_path / "rows.csv", "--log", tmp_path / "lanes.blf", "--profile", "p2")
    assert run(folder, *words) == 0
    rows, table = read_rows(tmp_path / "rows.csv"), decode_log(tmp_path / "lanes.blf", [load_profile("p2")])
    for side in ("left", "right"):
        sent, written = table.columns[f"{side}.lane_offset_m"], getattr(rows, f"{side}_offset_m")
        np.testing.assert_allclose(sent, written, atol=0.006)  # half a step of p2.dbc, and NaN alike
        np.testing.assert_array_equal(
            table.columns[f"{side}.quality"], getattr(rows, f"{side}_confidence").astype(float)
        )
    assert f"wrote {tmp_path / 'lanes.blf'}" in capsys.readouterr().out


def test_the_motion_of_a_log_goes_into_the_frames(folder, tmp_path):
    """The frames of a first run carry no speed; those of a second one that of the log it is given."""
    first, second = tmp_path / "first.log", tmp_path / "second.log"
    motion = tmp_path / "motion.log"
    write_motion(motion)
    assert run(folder, "--log", first, "--profile", "p2") == 0
    words = ("--motion", motion, "--motion-profile", "vehicle")
    assert run(folder, "--log", second, "--profile", "p2", *words) == 0
    profile = load_profile("p2")
    assert np.isnan(decode_log(first, [profile]).columns["ego.speed_mps"]).all()
    np.testing.assert_allclose(decode_log(second, [profile]).columns["ego.speed_mps"], 20.0, atol=0.1)


def write_motion(path):
    from tests.vehicle_frames import Gateway
    from vsensor.logs import open_log_writer

    gateway, writer = Gateway(), open_log_writer(path)
    for index in range(100):
        writer.write(msgspec.structs.replace(gateway.motion(0, 20.0, 0.0), due_ns=index * 20_000_000), 10**18)
    writer.close()


def test_a_log_of_another_time_is_refused_in_one_line(folder, tmp_path, capsys):
    write_motion(tmp_path / "motion.log")
    words = ("--motion", tmp_path / "motion.log", "--motion-begins", 60)
    assert run(folder, *words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert "does not overlap the video" in said


def test_the_report_shows_figures_and_pictures_and_loads_nothing(folder, tmp_path):
    assert run(folder, "--report", tmp_path / "page.html", "--limit", 6) == 0
    page = (tmp_path / "page.html").read_text()
    assert page.count("<figure>") >= 1 + 6
    assert "http" not in page
    assert "lane width" in page


def test_steps_are_kept_of_every_nth_picture(folder, tmp_path):
    assert run(folder, "--steps", tmp_path / "steps", "--every", 5, "--limit", 6) == 0
    found = {path.name.split("_")[0] for path in (tmp_path / "steps").iterdir()}
    assert found == {"000000", "000005"}


def test_settings_change_the_method(folder, tmp_path):
    (tmp_path / "set.toml").write_text(
        'schema = "vsensor.video/1"\n[published]\nwhite_above = 250\nleast_edge = 250\n'
    )
    assert run(folder, "--out", tmp_path / "rows.csv", "--settings", tmp_path / "set.toml") == 0
    assert np.isnan(read_rows(tmp_path / "rows.csv").left_offset_m).all()


@pytest.mark.parametrize("method", ["published", "ours"])
def test_of_black_pictures_nothing_is_made_up(folder, tmp_path, capsys, method):
    dark = [
        replace(one, grey=np.zeros_like(one.grey)) for one in [road_picture(EVEN, index=k) for k in range(25)]
    ]
    write_video(folder / "black.avi", dark)
    assert run(folder, "--out", tmp_path / "rows.csv", "--fill", video="black.avi", method=method) == 0
    rows = read_rows(tmp_path / "rows.csv")
    assert np.isnan([rows.left_offset_m, rows.right_offset_m, rows.lane_width_m, rows.heading_rad]).all()
    assert not rows.left_confidence.any()
    assert "lane width unknown" in capsys.readouterr().out


@pytest.mark.parametrize("method", ["published", "ours"])
def test_a_camera_upside_down_gives_no_offset(folder, tmp_path, method):
    turned = [
        replace(one, grey=one.grey[::-1, ::-1]) for one in [road_picture(EVEN, index=k) for k in range(5)]
    ]
    write_video(folder / "turned.avi", turned)
    assert run(folder, "--out", tmp_path / "rows.csv", video="turned.avi", method=method) == 0
    rows = read_rows(tmp_path / "rows.csv")
    assert np.isnan([rows.left_offset_m, rows.right_offset_m]).all()


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--method", "hugh"), "--method hugh: ours, published were expected"),
        (("--out", "rows.xlsx"), ".parquet, .csv, .mf4 were expected"),
        (("--report", "no/page.html"), "no folder"),
        (("--log", "lanes.blf", "--profile", "nobody"), "nobody"),
        (("--profile", "p2"), "neither of which is given"),
        (("--bus", "nonsense:0"), "nonsense"),
        (("--steps", "steps", "--method", "ours"), "--method published was expected"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line_before_anything_is_looked_at(
    folder, tmp_path, capsys, monkeypatch, words, said
):
    monkeypatch.chdir(tmp_path)
    assert run(folder, *words) == 2
    captured = capsys.readouterr()
    assert captured.err.count("\n") == 1
    assert said in captured.err
    assert not captured.out


def test_a_video_of_another_size_than_its_camera_is_refused(folder, tmp_path, capsys):
    small = msgspec.structs.replace(EOR, width_px=320, cx_px=160.0)
    write_camera(tmp_path / "camera.toml", VideoCamera(small, VEHICLE))
    assert main(["video", "run", str(folder / "drive.avi"), "--camera", str(tmp_path / "camera.toml")]) == 2
    assert "356 x 288" in capsys.readouterr().err


def test_stopped_it_writes_what_it_has_seen_and_sends_nothing(folder, tmp_path):
    asked = iter([False] * 5 + [True] * 100)
    options = VideoRun(
        video=str(folder / "drive.avi"),
        camera=str(folder / "camera.toml"),
        method="published",
        out=tmp_path / "rows.csv",
        log=tmp_path / "lanes.log",
    )
    run_video(options, lambda text: None, lambda: next(asked))
    assert len(read_rows(tmp_path / "rows.csv")) == 5
    assert not (tmp_path / "lanes.log").exists()


def test_an_image_is_a_video_of_one_picture(folder, tmp_path):
    import cv2

    cv2.imwrite(str(tmp_path / "one.png"), road_picture(EVEN).grey)
    camera = ("--camera", str(folder / "camera.toml"))
    words = (*camera, "--out", str(tmp_path / "rows.csv"), "--log", str(tmp_path / "lanes.log"))
    assert main(["video", "run", str(tmp_path / "one.png"), "--method", "published", *words]) == 0
    assert np.isfinite(read_rows(tmp_path / "rows.csv").left_offset_m).all()
    assert len(decode_log(tmp_path / "lanes.log", [load_profile("native")])) == 1


@needs_shared
def test_of_a_real_drive_without_a_camera_the_assumption_is_said(tmp_path, capsys):
    assert main(["video", "run", str(DRIVE), "--limit", "2", "--out", str(tmp_path / "rows.csv")]) == 0
    assert "is assumed" in capsys.readouterr().err
    assert len(read_rows(tmp_path / "rows.csv")) == 2

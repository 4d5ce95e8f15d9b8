"""`vsensor video view` and `sensitivity` as commands."""

import csv
import re

import numpy as np
import pytest

from tests.video.event_made import straight_event
from vsensor.cli import main
from vsensor.profile import load_profiles
from vsensor.video.can_signals import read_can
from vsensor.video.frames import open_pictures, read_image
from vsensor.video.rows import rows_from, write_rows
from vsensor.video.view_command import signals_at
from vsensor.video.views import GREEN, MAGENTA

pytest.importorskip("cv2")


@pytest.fixture(scope="module")
def event(tmp_path_factory):
    """An event of half a second, and a file of rows of it: the truth, 0.1 m too far to the left."""
    folder = straight_event(tmp_path_factory.mktemp("event") / "one", seconds=0.5)
    t_s = np.arange(5) * 0.1
    rows = rows_from([(t, 1.55, -1.75, 3.3, 0.0, 4, 4) for t in t_s])
    write_rows(folder / "rows.csv", rows)
    return folder


def view(event, out, *more):
    words = ["video", "view", str(event / "video.avi"), "--camera", str(event / "camera.toml")]
    return main([*words, "--out", str(out), "--quiet", *map(str, more)])


def test_a_video_of_views_has_a_picture_for_each_of_the_videos(event, tmp_path):
    out = tmp_path / "view.avi"
    assert view(event, out, "--rows", event / "rows.csv", "--can", event / "can.blf") == 0
    with open_pictures(out) as reader:
        assert reader.rate_hz == pytest.approx(10.0)
        seen = list(reader)
    assert len(seen) == 5
    magenta = np.abs(seen[3].bgr.astype(int) - MAGENTA).max(axis=2) < 60
    green = np.abs(seen[3].bgr.astype(int) - GREEN).max(axis=2) < 60
    assert magenta.sum() > 200
    assert green.sum() > 200


def test_one_picture_is_a_png(event, tmp_path, capsys):
    assert view(event, tmp_path / "one.png", "--frame", 2, "--view", "front") == 0
    assert read_image(tmp_path / "one.png").shape == (576, 712, 3)
    assert view(event, tmp_path / "none.png", "--frame", 9) == 2
    assert "has no picture 9" in capsys.readouterr().err
    assert view(event, tmp_path / "one.avi", "--frame", 2) == 2
    assert "a .png is one picture" in capsys.readouterr().err


def test_signals_are_those_of_the_time_and_none_where_there_are_none(event):
    can = read_can(event / "can.blf", load_profiles(("p2",), None))
    rows = rows_from([(0.0, 1.0, -2.0, 3.0, 0.0, 4, 4), (0.1, 1.1, np.nan, 3.0, 0.01, 4, 0)])
    told, video = signals_at(0.1, [(event / "rows.csv", rows)], can, 0.2)
    assert (video.left_m, video.heading_rad) == (1.1, 0.01)
    assert np.isnan(video.right_m)
    assert told.left_m == pytest.approx(1.45, abs=0.2)
    (late,) = signals_at(0.3, [(event / "rows.csv", rows)], None, 0.0)
    assert np.isnan(late.left_m)


def test_a_log_of_another_time_is_refused(event, tmp_path, capsys):
    assert view(event, tmp_path / "v.avi", "--can", event / "can.blf", "--can-at", 90) == 2
    assert "does not overlap the video" in capsys.readouterr().err


def test_sensitivity_writes_courses_shares_and_a_page(event, tmp_path, capsys):
    words = ["video", "sensitivity", str(event / "rows.csv"), "--camera", str(event / "camera.toml")]
    assert main([*words, "--out", str(tmp_path), "--within", "roll=2,height=0.1"]) == 0
    said = capsys.readouterr().out
    assert "1 files of rows, 5 left and 5 right lines" in said
    with (tmp_path / "one_by_one.csv").open() as file:
        rows = [
            row for row in csv.DictReader(file) if row["parameter"] == "lateral" and row["side"] == "left"
        ]
    for row in rows:  # the camera farther to the left by so much: the marking is farther by it
        assert float(row["mean_m"]) == pytest.approx(-float(row["change"]), abs=1e-9)
    with (tmp_path / "together.csv").open() as file:
        shares = {(row["index"], row["parameters"]): float(row["share"]) for row in csv.DictReader(file)}
    assert sum(share for (index, _), share in shares.items() if index != "total") == pytest.approx(
        1.0, abs=0.02
    )
    page = (tmp_path / "report.html").read_text()
    assert re.findall(r"""(?:src|href)=["'](?!data:)""", page) == []


def test_a_wrong_tolerance_is_named(event, tmp_path, capsys):
    words = ["video", "sensitivity", str(event / "rows.csv"), "--camera", str(event / "camera.toml")]
    with pytest.raises(SystemExit):
        main([*words, "--out", str(tmp_path), "--within", "hight=0.1"])
    assert "hight=0.1: expected such as height=0.1" in capsys.readouterr().err

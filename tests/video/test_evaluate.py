"""Methods over events, compared with the CAN log and with the truth, and what is written about it."""

import csv
import re
import shutil
from dataclasses import replace

import numpy as np
import polars
import pytest

from tests.video.event_made import straight_event
from vsensor.cli import main
from vsensor.errors import ConfigError, TableError, VideoError
from vsensor.types import Boundary, Colour, LaneEstimate, MarkingKind, Side, frozen
from vsensor.video.evaluate.judged import CAN, TRUTH, judged, read_truth
from vsensor.video.evaluate.report import EvaluateOptions, evaluate
from vsensor.video.evaluate.rules import Rules
from vsensor.video.evaluate.runs import RunOptions, run_event, thinned
from vsensor.video.evaluate.truth import Truth, presence
from vsensor.video.event_folder import FILE, find_events, read_event
from vsensor.video.methods import METHODS, MethodKind
from vsensor.video.settings import VideoConfig
from vsensor.video.types import Picture

pytest.importorskip("cv2")

TRUE_M = (1.45, -1.85)  # of the made event: lane 3.5 m, markings 0.2 m, vehicle 0.2 m to the left
FAR_M = 0.04
"""So much too far out the method of these tests is, on both sides."""


class Known:
    """A method that knows the road: FAR_M too far out; in every fifth picture it sees nothing."""

    def begin(self):
        return 0

    def look(self, state, picture, motion):
        assert motion.speed_mps == pytest.approx(20.0, abs=0.1) or picture.index == 0
        lines = () if picture.index % 5 == 4 else (line(Side.LEFT, 1.55), line(Side.RIGHT, -1.95))
        return state + 1, LaneEstimate(exposed_at_ns=picture.t_ns, image_index=state, boundaries=lines)


def line(side, y_m):
    outward = FAR_M if side is Side.LEFT else -FAR_M
    return Boundary(
        side=side,
        coefficients=frozen([y_m + outward]),
        covariance=frozen([[0.0]]),
        x_min_m=3.0,
        x_max_m=40.0,
        quality=4,
        kind=MarkingKind.SOLID,
        colour=Colour.WHITE,
        width_m=0.2,
        measured=True,
        marking=-1,
        points=0,
    )


@pytest.fixture(scope="module", autouse=True)
def known():
    """The method `known` beside the program's own."""
    with pytest.MonkeyPatch.context() as patch:
        kind = MethodKind(maker=lambda setup: Known(), has_lov=False, has_steps=False, about="of these tests")
        patch.setitem(METHODS, "known", kind)
        yield


@pytest.fixture(scope="module")
def events(tmp_path_factory):
    """Two events, day and night."""
    folder = tmp_path_factory.mktemp("events")
    straight_event(folder / "a_day", seconds=1.0)
    straight_event(folder / "b_night", seconds=1.0, light="night")
    return folder


def options(out, **more):
    run = RunOptions(workers=0, **more.pop("run", {}))
    return EvaluateOptions(
        out=out, methods=("known",), run=run, **{"which": "all", "pictures": False, **more}
    )


@pytest.fixture(scope="module")
def found(events, tmp_path_factory):
    out = tmp_path_factory.mktemp("results")
    return out, evaluate(events, options(out, pictures=True), lambda text: None)


def test_a_known_error_is_what_the_tables_say(found):
    figures = found[1].figures["known", TRUTH]
    assert figures["general"].cases == 2
    assert figures["general"].count == 2 * 2 * 8  # events, sides, pictures in which lines are seen
    assert figures["general"].mean_m == pytest.approx(FAR_M, abs=1e-6)
    assert figures["general"].within_m == pytest.approx(0.0, abs=1e-6)
    assert figures["general"].rms_m == pytest.approx(FAR_M, abs=1e-6)
    assert (figures["daytime"].cases, figures["nighttime"].cases) == (1, 1)


def test_against_can_the_virtual_sensors_own_error_is_in_it(found):
    figures = found[1].figures["known", CAN]["general"]
    assert figures.mean_m == pytest.approx(FAR_M, abs=0.1)
    assert figures.rms_m > FAR_M


def test_what_is_not_reported_is_told_and_nothing_is_reported_that_is_absent(found):
    one = found[1].presence["known"]
    assert one.availability == pytest.approx(0.8)
    assert (one.absent, one.gross_share) == (0, 0.0)


def test_a_drive_that_goes_straight_on_says_nothing_of_time(found):
    assert not [line for line in found[1].lines if "against the CAN log's" in line]


def test_files_hold_the_same_as_the_figures(found):
    out, evaluation = found
    with (out / "table.csv").open() as file:
        table = {(row["against"], row["type_of_case"]): row for row in csv.DictReader(file)}
    general = table[TRUTH, "general"]
    assert float(general["rms_m"]) == evaluation.figures["known", TRUTH]["general"].rms_m
    assert table[TRUTH, "curvy"]["mean_m"] == ""
    with (out / "events.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["event"], row["light"], row["truth_count"]) for row in rows] == [
        ("a_day", "day", "16"),
        ("b_night", "night", "16"),
    ]
    told = polars.read_csv(out / "rows" / "known" / "a_day.csv")
    assert told["left_offset_m"].drop_nulls().to_list() == pytest.approx([TRUE_M[0] + FAR_M] * 8)


def test_the_page_loads_nothing_and_shows_tables_distributions_and_events(found):
    page = (found[0] / "report.html").read_text()
    assert re.findall(r"""(?:src|href)=["'](?!data:)""", page) == []
    for words in (
        "Errors against truth",
        "Errors against CAN",
        "<th>standard deviation</th>",
        "b_night, 0.50 s",
    ):
        assert words in page
    assert "known: errors and normal distributions" in page


def test_what_is_finished_is_not_run_again(found, events, monkeypatch):
    out, before = found
    monkeypatch.setattr(Known, "look", None)
    again = evaluate(events, options(out), lambda text: None)
    assert again.lines == before.lines
    assert again.failures == ()


def test_an_event_that_fails_or_whose_log_is_of_another_time_is_a_line_and_the_others_go_on(events, tmp_path):
    folder = tmp_path / "events"
    for name in ("a_broken", "b_whole", "c_other_time"):
        shutil.copytree(events / "a_day", folder / name)
    (folder / "a_broken" / "video.avi").write_bytes(b"nothing")
    said = (folder / "c_other_time" / FILE).read_text()
    later = said.replace("video_starts_at_log_s = 0.0", "video_starts_at_log_s = 500.0")
    (folder / "c_other_time" / FILE).write_text(later)
    found = evaluate(folder, options(tmp_path / "out"), lambda text: None)
    assert found.figures["known", TRUTH]["general"].cases == 1
    broken, other = found.failures
    assert broken.startswith("a_broken, known: ")
    assert "video.avi: not a video" in broken
    assert other.startswith("c_other_time, known: ")
    assert "can.blf: does not overlap the video" in other


def test_no_reliable_event_is_one_sentence(events, tmp_path):
    with pytest.raises(ConfigError, match="none of 2 events is unreliable: 0 % of the CAN offsets"):
        evaluate(events, options(tmp_path, which="unreliable", rules=Rules(share=0.0)), lambda text: None)


def test_a_folder_without_events_and_a_file_that_is_missing_are_named(events, tmp_path):
    with pytest.raises(ConfigError, match="holds no event"):
        find_events(tmp_path)
    with pytest.raises(ConfigError, match="no such folder"):
        find_events(tmp_path / "absent")
    broken = tmp_path / "broken"
    shutil.copytree(events / "a_day", broken)
    (broken / "can.blf").unlink()
    with pytest.raises(ConfigError, match=r"event\.toml: names can\.blf, which is not there"):
        read_event(broken)


def test_a_video_of_another_size_than_its_camera_is_refused(events):
    event = read_event(events / "a_day")
    camera = replace_struct(event.config.camera, height_px=300)
    other = replace(event, config=replace_struct(event.config, camera=camera))
    with pytest.raises(VideoError, match=r"is 356 x 288, the camera of event\.toml has 356 x 300"):
        run_event(other, "known", VideoConfig())


def replace_struct(struct, **changes):
    import msgspec

    return msgspec.structs.replace(struct, **changes)


def test_a_truth_of_other_times_is_refused(events):
    event = read_event(events / "a_day")
    with pytest.raises(TableError, match=r"truth\.parquet: has no row at 0\.050 s of the video"):
        read_truth(event.truth, np.array([0.0, 0.05]))


def test_fewer_pictures_a_second_are_the_same_drive(events):
    event = read_event(events / "a_day")
    rows = run_event(event, "known", VideoConfig(), rate_hz=4.0)
    np.testing.assert_allclose(rows.t_s, [0.0, 0.3, 0.5, 0.8], atol=1e-6)
    one = judged(event, {"known": rows}, Rules())
    np.testing.assert_allclose(one.truth.offset_m[:, 0], TRUE_M[0], atol=1e-6)


def test_thinning_keeps_the_rate_whatever_the_videos_own():
    pictures = [
        Picture(index=k, t_ns=round(k * 1e9 / 30), grey=np.zeros((2, 2), np.uint8)) for k in range(60)
    ]
    assert [one.index for one in thinned(pictures, 4.0)] == [0, 8, 15, 23, 30, 38, 45, 53]
    assert [one.index for one in thinned(pictures, None, 3)] == [0, 1, 2]
    assert len(list(thinned(pictures, 100.0))) == 60


def test_presence_counts_what_is_near_absent_and_gross():
    nan = np.nan
    truth = Truth(
        offset_m=np.array([[1.5, -1.5], [1.5, nan], [nan, nan], [1.5, -1.5]]),
        is_near=np.array([[True, True], [False, False], [False, False], [True, True]]),
    )
    video = np.array([[1.52, nan], [1.5, -1.4], [nan, -3.0], [3.0, -1.5]])
    one = presence([(truth, video)], 0.5)
    assert (one.near, one.near_reported) == (4, 3)
    assert (one.absent, one.absent_reported) == (3, 2)
    assert one.gross_share == pytest.approx(3 / 6)  # 2 absent ones, and one that is 1.5 m off


def test_a_wrong_method_is_one_line(events, tmp_path, capsys):
    words = ["video", "evaluate", str(events), "--out", str(tmp_path), "--quiet"]
    assert main([*words, "--method", "published,nothing"]) == 2
    error = capsys.readouterr().err.splitlines()[-1]
    assert error.startswith("vsensor: --method nothing: ")

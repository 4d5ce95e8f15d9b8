import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from vsensor.config import SHIPPED, load_scenario
from vsensor.errors import ConfigError
from vsensor.profile import load_profile
from vsensor.schema import read_toml
from vsensor.video.can_signals import read_can
from vsensor.video.made import MakeOptions, make_events
from vsensor.video.made.drives import LIGHTS, PLACES, Plan, planned
from vsensor.video.made.event import write_event, write_toml
from vsensor.video.made.kinds import VEHICLE
from vsensor.video.made.truth import COLUMNS
from vsensor.world.opendrive import load_map

cv2 = pytest.importorskip("cv2")

LEFT, RIGHT = 1, -1


def plan(seconds=1.0, offset_m=0.2, **road):
    """Return an event on a straight road of one lane of 3.5 m, clear and quiet, both edges solid of 0.2 m."""
    edge = {"kind": "solid", "width_m": 0.2}
    scenario = {
        **planned("eor", 1, 0).scenario,
        "duration_s": seconds,
        "ego": {"road": "1", "speed_kmh": 72.0, "offset_m": offset_m},
        "traffic": [],
        "environment": {"light": "day"},
        "motion": {},
        "image": {"noise_std": 0.0, "texture": 0.0, "wear": 0.0, "blur_px": 0.5},
    }
    straight = {"line": [{"kind": "straight", "length_m": 500.0}], "centre": edge}
    lanes = {"right": [{"width_m": 3.5, "paint": edge}]}
    return planned("eor", 1, 0)._replace(scenario=scenario, road={**straight, **lanes, **road})


def pictures(folder: Path):
    """Return the frames (N, H, W, 3) of an event's video."""
    video, frames = cv2.VideoCapture(str(folder / "video.avi")), []
    while (read := video.read())[0]:
        frames.append(read[1])
    return np.array(frames)


def truth(folder: Path):
    return pl.read_parquet(folder / "truth.parquet")


def made(folder: Path, what: Plan, kind="eor") -> Path:
    folder.mkdir()
    write_event(folder, kind, what)
    return folder


@pytest.fixture(scope="module")
def quiet(tmp_path_factory):
    return made(tmp_path_factory.mktemp("made") / "quiet", plan())


@pytest.fixture(scope="module")
def drawn(tmp_path_factory):
    return made(tmp_path_factory.mktemp("made") / "drawn", planned("eor", 7, 0, duration_s=1.0))


def test_an_event_has_as_many_frames_as_its_truth_has_rows_and_as_it_says(drawn):
    frames, rows, said = pictures(drawn), truth(drawn), read_toml(drawn / "event.toml")
    assert len(frames) == len(rows) == said["frames"] == 10
    assert tuple(rows.columns) == COLUMNS
    assert rows["t_s"].to_list() == pytest.approx([0.1 * k for k in range(10)])


def test_frames_have_the_size_of_the_events_camera(drawn):
    camera = read_toml(drawn / "event.toml")["camera"]
    assert pictures(drawn).shape[1:3] == (camera["height_px"], camera["width_px"])


def edge_px(row, side):
    """Return where the inner edge of a bright stripe crosses half its level on a row of levels, seen from
    the middle of the lane outwards."""
    middle, step = 170, -side
    levels = row.astype(float)[middle:] if step > 0 else row.astype(float)[middle::-1]
    half = 0.5 * (levels[0] + levels.max())
    k = int(np.argmax(levels > half))
    part = (half - levels[k - 1]) / (levels[k] - levels[k - 1])
    return middle + step * (k - 1 + part)


@pytest.mark.parametrize(("side", "column"), [(LEFT, "left_offset_m"), (RIGHT, "right_offset_m")])
def test_inner_edges_in_the_pictures_lie_where_the_truth_says(quiet, side, column):
    camera = read_toml(quiet / "event.toml")["camera"]
    _, left_m, height_m = camera["position_m"]
    frame, rows = pictures(quiet)[4][..., 0], range(185, 230, 5)
    depth_m = [height_m * camera["fy_px"] / (v - camera["cy_px"]) for v in rows]
    across = [
        left_m - (edge_px(frame[v], side) - camera["cx_px"]) / camera["fx_px"] * depth
        for v, depth in zip(rows, depth_m, strict=True)
    ]
    # straight road, parallel vehicle: y is the same at every depth; half a level on a row slants by < 0.02 m
    assert np.mean(across) == pytest.approx(truth(quiet)[column][4], abs=0.015)


def test_offsets_and_width_are_those_of_lane_and_vehicle_in_closed_form(quiet):
    # lane of 3.5 m, markings of 0.2 m on its borders, the vehicle 0.2 m to the left of its middle
    for row in truth(quiet).iter_rows(named=True):
        assert row["left_offset_m"] == pytest.approx(1.75 - 0.1 - 0.2, abs=1e-6)
        assert row["right_offset_m"] == pytest.approx(-(1.75 - 0.1 + 0.2), abs=1e-6)
        assert row["lane_width_m"] == pytest.approx(3.3, abs=1e-6)
        assert row["heading_rad"] == pytest.approx(0.0, abs=1e-9)
        assert (row["left_confidence"], row["right_confidence"]) == (4, 4)


def test_can_tells_the_same_drive(quiet):
    can = read_can(quiet / "can.blf", [load_profile("p2")])
    t, left_m = can.series["left.lane_offset_m"]
    known = left_m[np.isfinite(left_m)]
    assert len(known) > 5
    assert np.abs(known - 1.45).max() < 0.2  # the virtual sensor's own error
    assert can.series["ego.speed_mps"][1][-1] == pytest.approx(20.0, abs=0.01)
    assert t[0] == pytest.approx(0.0, abs=0.1)


def test_a_border_without_paint_has_no_offset(tmp_path):
    bare = [{"width_m": 3.5, "paint": {"kind": "none"}}]
    rows = truth(made(tmp_path / "event", plan(seconds=0.2, right=bare)))
    assert rows["right_confidence"].to_list() == [0, 0]
    assert all(map(math.isnan, rows["right_offset_m"]))
    assert all(map(math.isnan, rows["lane_width_m"]))
    assert rows["left_confidence"].to_list() == [4, 4]


@pytest.mark.parametrize(("end_m", "confidence"), [(20.0, 4), (45.0, 1), (90.0, 0)])
def test_confidence_of_the_truth_says_how_far_the_next_paint_is(tmp_path, end_m, confidence):
    gap = [{"borders": [-1], "at_m": 0.0, "length_m": end_m}]
    row = truth(made(tmp_path / "event", plan(seconds=0.1, gap=gap))).row(0, named=True)
    assert row["right_confidence"] == confidence
    assert math.isnan(row["right_offset_m"]) == (confidence == 0)


def test_the_same_seed_and_number_give_the_same_event_bit_for_bit(drawn, tmp_path):
    again = made(tmp_path / "event", planned("eor", 7, 0, duration_s=1.0))
    for name in ("event.toml", "road.toml", "drive.toml", "truth.parquet"):
        assert (again / name).read_bytes() == (drawn / name).read_bytes(), name
    assert np.array_equal(pictures(again), pictures(drawn))


def test_another_seed_gives_another_drive():
    assert planned("eor", 1, 0).scenario["ego"] != planned("eor", 2, 0).scenario["ego"]


def test_the_drive_of_an_event_runs_as_a_scenario(drawn):
    assert load_scenario(str(drawn / "drive.toml")).config.output.profile == "p2"


def test_lytx_events_are_in_colour_at_4_hz_with_a_mount_of_their_own(tmp_path):
    folder = made(tmp_path / "event", planned("lytx", 1, 0, duration_s=0.5), "lytx")
    said = read_toml(folder / "event.toml")
    assert pictures(folder).shape == (2, 352, 620, 3)
    assert truth(folder)["t_s"].to_list() == [0.0, 0.25]
    assert said["camera"] != planned("lytx", 1, 1).camera


def test_35_events_have_each_place_in_each_light():
    told = [planned("eor", 1, number).conditions for number in range(len(LIGHTS) * len(PLACES))]
    pairs = {(one["light"], one["place"]) for one in told}
    assert len(pairs) == len(set(LIGHTS)) * len(set(PLACES))


@pytest.mark.parametrize("number", range(0, 35, 3))
def test_drawn_events_keep_to_the_criteria_of_the_study(number):
    made_of = planned("eor", 3, number)
    ego = made_of.scenario["ego"]
    fastest_mps = max(speed for _, speed in ego["speed_kmh"]) / 3.6
    radii = [piece["radius_m"] for piece in (made_of.road or {}).get("line", []) if piece["kind"] == "bend"]
    assert all(np.degrees(fastest_mps / radius) <= 10.0 for radius in radii)
    assert max(abs(offset) for _, offset in ego["offset_m"]) + VEHICLE.width_m / 2 < 3.75 / 2


def test_every_drawn_road_can_be_built_and_every_drive_begins_on_its_road(tmp_path):
    for number in range(84):
        made_of = planned("eor", 1, number)
        place = SHIPPED / (made_of.shipped or "")
        if made_of.road is not None:
            place = tmp_path / "road.toml"
            write_toml(place, {"schema": "vsensor.road/1", "road": [made_of.road]})
        assert made_of.scenario["ego"]["s_m"] < load_map(place).road("1").length_m, number


def test_a_sixth_of_the_drawn_roads_and_more_have_bends_that_the_study_calls_curvy():
    curvy = 0
    for number in range(35):
        made_of = planned("eor", 3, number)
        mean_mps = np.mean([speed for _, speed in made_of.scenario["ego"]["speed_kmh"]]) / 3.6
        line = (made_of.road or {}).get("line", [])
        curvy += any(np.degrees(mean_mps / piece.get("radius_m", np.inf)) > 5.0 for piece in line)
    assert curvy > 6


def test_finished_events_are_kept_and_missing_ones_made_again(tmp_path):
    options = MakeOptions(out=tmp_path, events=2, seed=1, duration_s=0.1, workers=0)
    assert make_events(options).lines[0].endswith("2 of 2 events, 2 frames")
    kept = tmp_path / "eor_seed1_0000" / "video.avi"
    before = kept.stat().st_mtime_ns
    (tmp_path / "eor_seed1_0001" / "event.toml").unlink()
    assert "1 of them were there" in make_events(replace(options, events=2)).lines[0]
    assert kept.stat().st_mtime_ns == before
    assert (tmp_path / "eor_seed1_0001" / "event.toml").is_file()


def test_an_unknown_kind_is_refused_in_one_line(tmp_path):
    with pytest.raises(ConfigError, match=r"--kind dashcam: eor or lytx was expected"):
        make_events(MakeOptions(out=tmp_path, kind="dashcam"))

"""What the examiner's page draws and hands out, without a browser; and whom its server answers."""

import json
import struct
import urllib.error
import urllib.request
from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from tests.apps.examined import HIT_S, ROUNDING_M, loaded
from tests.field.made_logs import Drive as Made
from vsensor.apps.examine.analysis import lane_error_m
from vsensor.apps.examine.figures import analysis_figure, quality_figure
from vsensor.apps.examine.packed import columns_of, packed
from vsensor.apps.examine.page import make_app
from vsensor.apps.examine.server import PORT, PageServer
from vsensor.apps.examine.views import View, csv_of
from vsensor.cli import main
from vsensor.errors import ConfigError
from vsensor.types import Side, Unseen


@pytest.fixture(scope="module")
def served(drive):
    with PageServer(make_app(drive), 0) as server:
        yield server


def asked(url, **headers):
    """Return status, headers and body of a request."""
    try:
        with urllib.request.urlopen(urllib.request.Request(url, headers=headers), timeout=60) as answer:
            return answer.status, answer.headers, answer.read()
    except urllib.error.HTTPError as error:
        with closing(error):
            return error.code, error.headers, error.read()


@pytest.mark.parametrize("function", ["error", "range", "width", "over_range"])
def test_every_function_has_axes_with_units_and_values(drive, function):
    figure = analysis_figure(drive, View(function=function, number=50))
    titles = [figure["layout"][axis]["title"]["text"] for axis in ("xaxis", "yaxis")]
    assert all("(m)" in title or "(s)" in title for title in titles), titles
    assert all(any(y is not None for y in curve["y"]) for curve in figure["data"])


def test_sorted_by_yaw_rate_the_same_errors_stand_over_it(drive):
    by_time = analysis_figure(drive, View())["data"][0]
    by_rate = analysis_figure(drive, View(sort="yaw_rate"))["data"][0]
    images = dict(zip(by_time["customdata"], by_time["y"], strict=True))
    assert all(images[image] == y for image, y in zip(by_rate["customdata"], by_rate["y"], strict=True))
    assert by_rate["x"] == sorted(by_rate["x"])


def test_a_point_of_a_curve_carries_the_image_that_a_click_selects(drive):
    curve = analysis_figure(drive, View(range_m=50.0))["data"][0]
    worst = int(np.nanargmax(np.array(curve["y"], dtype=float)))
    assert curve["customdata"][worst] == drive.number_at(HIT_S)


def test_a_part_is_drawn_with_its_own_points_alone(drive):
    figure = analysis_figure(drive, View(), 2.0, 3.0)
    assert figure["layout"]["xaxis"]["range"] == [2.0, 3.0]
    assert (min(figure["data"][0]["x"]), max(figure["data"][0]["x"])) == (2.0, 3.0)


def test_where_nothing_can_be_shown_the_plot_says_so(drive):
    figure = analysis_figure(drive, View(range_m=95.0))
    assert "nothing to show" in figure["layout"]["annotations"][0]["text"]


def test_the_timeline_shows_the_least_quality_and_names_the_causes(drive):
    causes = {side: np.zeros(len(drive)) for side in drive.sides}
    causes[Side.LEFT][100:120] = float(Unseen.OCCLUDED)
    figure = quality_figure(replace(drive, causes=causes))
    strips = next(one for one in figure["data"] if one["type"] == "heatmap")
    assert set(np.ravel(strips["z"])) == {4.0}
    (cause,) = [one for one in figure["data"] if one.get("name") == "occluded"]
    assert cause["x"][:2] == [drive.t_s[100], drive.t_s[119]]
    assert figure["layout"]["yaxis"]["ticktext"][-1] == "left cause"


def test_the_csv_has_every_image_not_only_those_drawn(drive):
    text = csv_of(drive, View(range_m=50.0, sides=(Side.LEFT,)))
    head, *rows = text.splitlines()[1:]
    assert head == "curve,image,time_s,yaw_rate_degps,x,y"
    errors = [row.split(",")[-1] for row in rows]
    exact = lane_error_m(drive, Side.LEFT, 50.0)
    assert len(errors) == len(drive)
    known = np.isfinite(exact)
    assert [bool(error) for error in errors] == known.tolist()
    np.testing.assert_allclose([float(e) for e in errors if e], exact[known], rtol=1e-8)


def test_what_the_browser_gets_is_head_and_columns_as_they_are(drive):
    data = packed(drive)
    (length,) = struct.unpack_from("<I", data)
    head = json.loads(data[4 : 4 + length])
    place = 4 + length
    for name, values in columns_of(drive).items():
        count = head["columns"][name]
        np.testing.assert_array_equal(np.frombuffer(data, "<f4", count, place), np.float32(values))
        place += 4 * count
    assert place == len(data)


def test_the_reference_beside_the_vehicle_is_where_the_line_is_reported(drive):
    columns = columns_of(drive)
    for word in ("left", "right"):
        place = columns[f"{word}.place"]
        whole = np.arange(len(columns[f"{word}.ref_y"]))
        known = np.isfinite(place)
        beside = np.interp(place[known], whole, columns[f"{word}.ref_y"]) - columns["y"][known]
        ahead = np.interp(place[known], whole, columns[f"{word}.ref_x"]) - columns["x"][known]
        np.testing.assert_allclose(ahead[20:-20], 0.0, atol=0.05)
        np.testing.assert_allclose(beside[20:-20], columns[f"{word}.c0"][known][20:-20], atol=ROUNDING_M)


@pytest.mark.parametrize("function", ["error", "range", "width", "over_range"])
def test_another_drive_is_laid_over_with_its_name_and_a_look_of_its_own(drive, function):
    both = replace(drive, other=drive)
    view = View(function=function, number=50)
    curves = analysis_figure(both, view)["data"]
    own, other = curves[: len(curves) // 2], curves[len(curves) // 2 :]
    assert own == analysis_figure(drive, view)["data"]
    for one, laid in zip(own, other, strict=True):
        assert (laid["x"], laid["y"], laid["name"]) == (one["x"], one["y"], f"{one['name']}, drive.blf")
        assert laid["line"] != one["line"]


def test_a_click_on_the_other_drive_selects_the_image_of_the_same_time(drive, tmp_path):
    other = loaded(tmp_path, Made(seconds=6))
    later = analysis_figure(replace(drive, other=other), View())["data"][-1]
    np.testing.assert_allclose(drive.t_s[later["customdata"]], later["x"], atol=1e-6)
    assert max(later["x"]) < 6.0 < drive.t_s[-1]


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"function": "nothing"}, "function nothing: one of error"),
        ({"range_m": "-1"}, "range -1: a number from 0"),
        ({"range_m": None}, "range None: a number"),
        ({"sort": "size"}, "sort size: one of time"),
        ({"sides": ["above"]}, "side above: one of left"),
        ({"function": "signal", "signal": "No.Such"}, "signal No.Such"),
        ({"number": 10**9}, "image 1000000000: a number"),
    ],
)
def test_what_a_page_cannot_ask_for_is_refused_by_name(drive, wrong, said):
    words = {
        "function": "error",
        "range_m": 50,
        "sort": "time",
        "sides": ["left"],
        "signal": None,
        "number": 0,
    }
    with pytest.raises(ConfigError, match=said):
        View.of(drive, **{**words, **wrong})


def test_the_server_hands_out_drive_and_csv(served, drive):
    status, _, body = asked(served.url + "drive.bin")
    assert (status, body) == (200, packed(drive))
    status, headers, body = asked(served.url + "view.csv?function=width")
    assert (status, body.decode()) == (200, csv_of(drive, View(function="width")))
    assert 'filename="drive_width.csv"' in headers["Content-Disposition"]


def test_a_wrong_question_is_answered_with_what_was_expected(served):
    status, _, body = asked(served.url + "view.csv?function=nothing")
    assert (status, body[:17]) == (400, b"function nothing:")


@pytest.mark.parametrize(
    "headers",
    [
        {"Host": "evil.example"},
        {"Host": "evil.example:8765"},
        {"Origin": "http://evil.example"},
        {"Origin": "null"},
    ],
)
@pytest.mark.parametrize("path", ["", "drive.bin", "view.csv", "_dash-layout", "assets/examine.js"])
def test_pages_of_other_hosts_get_nothing(served, path, headers):
    assert asked(served.url + path, **headers)[0] == 403


@pytest.mark.parametrize(
    "path",
    [
        *("assets/../page.py", "assets/..%2fpage.py", "assets/%2e%2e/page.py", "../../../etc/passwd"),
        *("_dash-component-suites/dash/../../../../etc/passwd", "assets//etc/passwd", "drive.blf"),
    ],
)
def test_no_path_leads_out_of_what_is_served(served, path):
    status, _, body = asked(served.url + path)
    assert b"root:" not in body
    assert b"import" not in body
    assert status in (400, 404) or b'id="react-entry-point"' in body  # Dash's page for an unknown address


def test_the_page_forbids_the_browser_to_load_from_elsewhere(served):
    _, headers, body = asked(served.url)
    assert "default-src 'self'" in headers["Content-Security-Policy"]
    assert b"https://" not in body


def test_a_port_in_use_is_one_line_and_without_a_word_the_next_is_taken(served, drive):
    with pytest.raises(ConfigError, match=f"port {served.port} of 127.0.0.1 is in use"):
        PageServer(make_app(drive), served.port)
    with PageServer(make_app(drive)) as first, PageServer(make_app(drive)) as second:
        assert PORT <= first.port < second.port


def test_the_command_says_where_the_page_is_and_ends_after_its_duration(drive, capsys):
    words = ["examine", str(drive.log), "--port", "0", "--no-browser", "--duration", "0.05"]
    assert main(words) == 0
    assert capsys.readouterr().out.startswith("drive.blf is at http://127.0.0.1:")


def test_the_command_refuses_a_log_that_is_none_in_one_line(tmp_path, capsys):
    assert main(["examine", str(tmp_path / "none.blf")]) == 2
    assert capsys.readouterr().err.count("\n") == 1

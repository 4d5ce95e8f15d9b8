"""The examiner in a real browser without a network: what a person does, and what the page then shows."""

import re
from urllib.parse import urlsplit

import pytest

from tests.apps.examined import HIT_S, bent_drive
from tests.apps.pages import chromium, keep_screenshot, opened
from vsensor.apps.examine.page import make_app
from vsensor.apps.examine.server import PageServer
from vsensor.apps.examine.views import View, csv_of
from vsensor.types import Side

pytestmark = pytest.mark.timeout(600)  # a browser on a busy machine


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    return bent_drive(tmp_path_factory.mktemp("drive"))


@pytest.fixture(scope="module")
def served(drive):
    with PageServer(make_app(drive), 0) as server:
        yield server


@pytest.fixture(scope="module")
def browser():
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="module")
def window(browser, served):
    """The page of all tests: to load it takes longer than most of them."""
    with opened(browser, served.url) as page:
        yield page


@pytest.fixture
def page(window, served):
    """The page as it is at first; nothing on it may go wrong, nor be asked of another host."""
    shows_any(window)
    for name, value in {"function": "error", "range": 50, "sort": "time", "sides": ["left", "right"]}.items():
        window.evaluate("([name, value]) => dash_clientside.set_props(name, {value})", [name, value])
    window.evaluate("window.vsensorExamine.go(0)")
    shows(window, 0)
    wait_for_axis(window, "lane error at 50 m")
    yield window
    assert window.faults == []
    asked = {urlsplit(url).netloc for url in window.asked if not url.startswith(("data:", "blob:"))}
    assert asked == {f"127.0.0.1:{served.port}"}


def shows_any(page):
    """Wait until the page shows an image."""
    page.wait_for_function("window.vsensorExamine && window.vsensorExamine.shown >= 0")


def shows(page, number):
    """Wait until the page shows an image."""
    page.wait_for_function("n => window.vsensorExamine && window.vsensorExamine.shown === n", arg=number)


def curves(page, plot="analysis"):
    """Return names and numbers of points of what a plot of the server shows."""
    found = page.evaluate(
        "id => document.querySelector(`#${id} .js-plotly-plot`).data.map(c => [c.name, (c.y || []).length])",
        plot,
    )
    return {name: count for name, count in found if name}


def wait_for_axis(page, text):
    page.wait_for_function(
        """text => { const g = document.querySelector('#analysis .js-plotly-plot');
        return g && g.layout.yaxis.title.text.includes(text); }""",
        arg=text,
    )


def choose(page, name):
    page.evaluate("name => dash_clientside.set_props('function', {value: name})", name)


def test_the_drive_is_there_with_its_lines_its_totals_and_its_errors(page):
    wait_for_axis(page, "lane error at 50 m")
    assert set(curves(page)) == {"left", "right"}
    names = page.evaluate("document.getElementById('above').data.map(c => c.name)")
    assert {"trajectory", "reference", "left reported", "right reported", "vehicle"} <= set(names)
    assert "0.20 km" in page.inner_text("#totals")
    assert "quality 4" in page.inner_text("#now")
    keep_screenshot(page, "examine_first_view")


def test_the_reported_line_stands_where_it_was_reported(page):
    left = page.evaluate("document.getElementById('above').data.find(c => c.name === 'left reported')")
    assert (left["x"][0], left["x"][-1]) == (0, pytest.approx(80, abs=0.1))
    assert left["y"][0] == pytest.approx(1.75, abs=0.02)
    assert left["y"][-1] == pytest.approx(1.75 + 1e-4 * 80**2, abs=0.02)


@pytest.mark.parametrize(
    ("function", "axis"),
    [("range", "reported range (m)"), ("width", "road width (m)"), ("over_range", "lane error (m)")],
)
def test_each_function_is_drawn(page, function, axis):
    choose(page, function)
    wait_for_axis(page, axis)
    assert min(curves(page).values()) >= 50


def test_a_raw_signal_is_drawn_once_it_is_chosen(page):
    choose(page, "signal")
    page.wait_for_selector(".choice.signal", state="visible")
    page.evaluate("dash_clientside.set_props('signal', {value: 'VEH_Motion.VehicleSpeed'})")
    wait_for_axis(page, "VEH_Motion.VehicleSpeed (km/h)")


def test_what_cannot_be_shown_is_said_on_the_page(page):
    page.evaluate("dash_clientside.set_props('range', {value: -5})")
    page.wait_for_function("document.getElementById('said').textContent.includes('a number from 0 to 250')")
    page.evaluate("dash_clientside.set_props('range', {value: 20})")
    wait_for_axis(page, "lane error at 20 m")
    assert page.inner_text("#said") == ""


def test_the_largest_error_is_found_with_one_click(page, drive):
    page.click("#largest")
    shows(page, drive.number_at(HIT_S))
    keep_screenshot(page, "examine_largest_error")


def test_a_click_on_a_point_jumps_to_its_image(page, drive):
    wait_for_axis(page, "lane error")
    place = page.evaluate(
        """() => { const g = document.querySelector('#analysis .js-plotly-plot'), a = g._fullLayout.xaxis,
        u = g._fullLayout.yaxis, box = g.getBoundingClientRect(), c = g.data[0], k = 100;
        return [box.x + a._offset + a.l2p(c.x[k]), box.y + u._offset + u.l2p(c.y[k]), c.customdata[k]]; }"""
    )
    page.mouse.move(place[0] - 3, place[1])
    page.mouse.move(place[0], place[1])
    page.wait_for_selector("#analysis .hoverlayer .hovertext", state="attached")
    page.mouse.click(place[0], place[1])
    page.wait_for_function("n => Math.abs(window.vsensorExamine.shown - n) <= 1", arg=place[2])


def test_sorted_by_yaw_rate_the_axis_says_so(page):
    page.click("#sort label:nth-of-type(2)")
    page.wait_for_function(
        "document.querySelector('#analysis .js-plotly-plot').layout.xaxis.title.text.includes('yaw rate')"
    )


def test_keys_step_jump_and_play_also_after_a_click_elsewhere(page, drive):
    page.click("#sides label:nth-of-type(2)")
    page.keyboard.press("ArrowRight")
    shows(page, 1)
    page.keyboard.press("Shift+ArrowRight")
    shows(page, 26)
    page.keyboard.press("ArrowLeft")
    shows(page, 25)
    page.keyboard.press("End")
    shows(page, len(drive) - 1)
    page.keyboard.press("Home")
    shows(page, 0)
    page.keyboard.press("Space")
    page.wait_for_function("window.vsensorExamine.shown > 5")
    page.keyboard.press("Space")
    assert page.inner_text("#play") == "play"


def test_playing_ends_with_the_last_image(page, drive):
    page.select_option("#player select", "64")
    page.click("#play")
    shows(page, len(drive) - 1)
    page.wait_for_function("document.getElementById('play').textContent === 'play'")


def test_the_slider_moves_the_picture(page):
    page.evaluate(
        """() => { const s = document.getElementById('slider');
        s.value = 77; s.dispatchEvent(new Event('input')); }"""
    )
    shows(page, 77)
    assert "3.08" in page.inner_text("#clock")


def test_the_address_restores_the_view_in_another_window(page, browser):
    choose(page, "over_range")
    wait_for_axis(page, "lane error (m)")
    page.evaluate("window.vsensorExamine.go(123)")
    page.wait_for_function("location.hash.includes('image=123') && location.hash.includes('over_range')")
    with opened(browser, page.url) as other:
        shows(other, 123)
        wait_for_axis(other, "lane error (m)")
        assert "image 123" in other.evaluate(
            "document.querySelector('#analysis .js-plotly-plot').layout.title.text"
        )


def test_two_windows_do_not_disturb_each_other(page, browser, served):
    with opened(browser, served.url) as other:
        shows(other, 0)
        page.evaluate("window.vsensorExamine.go(50)")
        shows(page, 50)
        choose(other, "width")
        wait_for_axis(other, "road width")
        assert other.evaluate("window.vsensorExamine.shown") == 0
        wait_for_axis(page, "lane error at 50 m")


@pytest.mark.parametrize("view", ["analysis", "above"])
def test_a_view_is_exported_as_a_drawing_with_its_axes(page, view, tmp_path):
    wait_for_axis(page, "lane error")
    page.select_option("#export-view", view)
    with page.expect_download() as download:
        page.click("#svg")
    download.value.save_as(tmp_path / "view.svg")
    drawing = (tmp_path / "view.svg").read_text()
    assert {"analysis": "lane error at 50 m", "above": "ahead (m)"}[view] in re.sub(r"<[^>]*>", "", drawing)


def test_the_analysis_is_exported_as_csv(page, drive, tmp_path):
    with page.expect_download() as download:
        page.click("#csv")
    download.value.save_as(tmp_path / "view.csv")
    assert (tmp_path / "view.csv").read_text() == csv_of(drive, View(sides=(Side.LEFT, Side.RIGHT)))


BOXES = (
    "#examine > header",
    "#above-tools",
    "#above",
    "#overview",
    ".controls",
    "#analysis",
    "#quality",
    "#panel",
    "#player",
)


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1920, 1080)])
def test_nothing_overlaps_or_leaves_the_window(browser, served, width, height):
    with opened(browser, served.url, width=width, height=height) as page:
        shows(page, 0)
        wait_for_axis(page, "lane error")
        boxes = {name: page.locator(name).bounding_box() for name in BOXES}
        tools = page.locator(".controls .choice:visible, header button, header select").all()
        inner = [one.bounding_box() for one in tools]
        keep_screenshot(page, f"examine_{width}x{height}")
    for name, box in boxes.items():
        assert box["x"] >= 0, name
        assert box["x"] + box["width"] <= width, name
        assert box["y"] + box["height"] <= height, name
    for group in (list(boxes.values()), inner):
        for k, one in enumerate(group):
            for other in group[k + 1 :]:
                apart = (
                    one["x"] + one["width"] <= other["x"] + 1
                    or other["x"] + other["width"] <= one["x"] + 1
                    or one["y"] + one["height"] <= other["y"] + 1
                    or other["y"] + other["height"] <= one["y"] + 1
                )
                assert apart, (one, other)

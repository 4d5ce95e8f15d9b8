"""The examiner in a real browser without a network: what a person does, and what the page then shows."""

import re
from itertools import count
from urllib.parse import urlencode, urlsplit

import pytest

from tests.apps.examined import HIT_S
from tests.apps.pages import chromium, keep_screenshot, misplaced, opened, opened_beside
from tools.bench.looking import slider_ms
from vsensor.apps.examine.page import make_app
from vsensor.apps.examine.server import PageServer
from vsensor.apps.examine.views import View, csv_of
from vsensor.types import Side

pytestmark = [pytest.mark.browser, pytest.mark.timeout(900)]  # on a busy machine a load alone takes minutes

SETTINGS = {
    "function": "error",
    "range": "50",
    "sort": "time",
    "sides": "left,right",
    "image": "0",
    "frame": "vehicle",
    "zoom": "auto",
}
"""The page as it is at first."""
LINKS = count()
"""Makes each link another one: a browser does nothing about a link that it has followed already."""


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
        wait_for_first_view(page)
        yield page


@pytest.fixture
def page(window, served):
    """The page as it is at first; nothing on it may go wrong, nor be asked of another host."""
    window.faults.clear()
    follow(window)
    wait_for_first_view(window)
    yield window
    assert window.faults == []
    asked = {urlsplit(url).netloc for url in window.asked if not url.startswith(("data:", "blob:"))}
    assert asked == {f"127.0.0.1:{served.port}"}


def follow(page, **settings):
    """Follow a link to a view within the loaded page."""
    page.evaluate("hash => { location.hash = hash; }", urlencode(SETTINGS | {"go": next(LINKS)} | settings))


def shows(page, number):
    """Wait until the page shows an image."""
    page.wait_for_function("n => window.vsensorExamine && window.vsensorExamine.shown === n", arg=number)


def wait_for_plot(page, y_title, x_title="", sides=None):
    """Wait until the analysis shows these axes, and where they are given curves of these sides alone."""
    page.wait_for_function(
        """([yTitle, xTitle, sides]) => { const g = document.querySelector('#analysis .js-plotly-plot');
        return g && g._fullLayout && g.layout.yaxis.title.text.includes(yTitle)
        && g.layout.xaxis.title.text.includes(xTitle)
        && (!sides || sides === g.data.map((d) => d.name).filter(Boolean).join()); }""",
        arg=[y_title, x_title, sides],
    )


def wait_for_first_view(page):
    """Wait until the page is as it is at first."""
    shows(page, 0)
    wait_for_plot(page, "lane error at 50 m", "time (s)", "left,right")


def curves(page):
    """Return names and numbers of points of what the analysis shows."""
    found = page.evaluate(
        "document.querySelector('#analysis .js-plotly-plot').data.map(c => [c.name, (c.y || []).length])"
    )
    return {name: points for name, points in found if name}


def choose(page, name):
    page.evaluate("name => dash_clientside.set_props('function', {value: name})", name)


def test_the_drive_is_there_with_its_lines_its_totals_and_its_errors(page):
    wait_for_plot(page, "lane error at 50 m")
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
    wait_for_plot(page, axis)
    assert min(curves(page).values()) >= 50


def test_a_raw_signal_is_drawn_once_it_is_chosen(page):
    choose(page, "signal")
    page.wait_for_selector(".choice.signal", state="visible")
    page.evaluate("dash_clientside.set_props('signal', {value: 'VEH_Motion.VehicleSpeed'})")
    wait_for_plot(page, "VEH_Motion.VehicleSpeed (km/h)")


def test_what_cannot_be_shown_is_said_on_the_page(page):
    page.evaluate("dash_clientside.set_props('range', {value: -5})")
    page.wait_for_function("document.getElementById('said').textContent.includes('a number from 0 to 250')")
    page.evaluate("dash_clientside.set_props('range', {value: 20})")
    wait_for_plot(page, "lane error at 20 m")
    assert page.inner_text("#said") == ""


def test_the_largest_error_is_found_with_one_click(page, drive):
    page.click("#largest")
    shows(page, drive.number_at(HIT_S))
    keep_screenshot(page, "examine_largest_error")


def test_a_click_on_a_point_jumps_to_its_image(page, drive):
    wait_for_plot(page, "lane error")
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
    wait_for_plot(page, "lane error", "yaw rate")


def test_keys_step_jump_and_play_also_after_a_click_elsewhere(page, drive):
    page.click("#sides label:nth-of-type(2)")
    wait_for_plot(page, "lane error", sides="left")
    page.select_option("#player select", "1")
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


def test_the_bench_moves_the_slider_and_waits_for_each_picture(page):
    took_ms = slider_ms(page, 3)
    assert len(took_ms) == 3
    assert min(took_ms) > 0
    assert page.evaluate("window.vsensorExamine.shown") == int(page.input_value("#slider")) > 0


def test_a_link_followed_in_the_open_page_restores_its_view(page):
    follow(page, function="over_range", range=30, image=123, frame="world", zoom=200)
    shows(page, 123)
    wait_for_plot(page, "lane error (m)")
    assert page.input_value("#range") == "30"
    assert [box.input_value() for box in page.locator("#above-tools select").all()] == ["world", "200"]


def test_a_link_is_followed_though_the_page_writes_its_own_view_over_it_meanwhile(page):
    page.evaluate("location.hash = 'image=77'; history.replaceState(null, '', '#image=5')")
    shows(page, 77)


def test_the_address_restores_the_view_in_another_window_that_goes_its_own_way(page):
    choose(page, "over_range")
    wait_for_plot(page, "lane error (m)")
    page.evaluate("window.vsensorExamine.go(123)")
    page.wait_for_function("location.hash.includes('image=123') && location.hash.includes('over_range')")
    with opened_beside(page) as other:
        shows(other, 123)
        wait_for_plot(other, "lane error (m)")
        other.wait_for_function(
            "document.querySelector('#analysis .js-plotly-plot').layout.title.text.includes('image 123')"
        )
        page.evaluate("window.vsensorExamine.go(50)")
        shows(page, 50)
        choose(other, "width")
        wait_for_plot(other, "road width")
        assert other.evaluate("window.vsensorExamine.shown") == 123
        wait_for_plot(page, "lane error (m)")
        assert other.faults == []


@pytest.mark.parametrize("view", ["analysis", "above"])
def test_a_view_is_exported_as_a_drawing_with_its_axes(page, view, tmp_path):
    wait_for_plot(page, "lane error")
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


BOXES = [
    "#examine > header",
    "#above-tools",
    "#above",
    "#overview",
    ".controls",
    "#analysis",
    "#quality",
    "#panel",
    "#player",
]
TOOLS = ".controls .choice, header button, header select"


@pytest.mark.parametrize(("width", "height"), [(1920, 1080), (1280, 800)])
def test_nothing_overlaps_or_leaves_the_window(page, width, height):
    page.set_viewport_size({"width": width, "height": height})
    wrong = misplaced(page, BOXES, TOOLS, width, height)
    keep_screenshot(page, f"examine_{width}x{height}")
    assert wrong == []

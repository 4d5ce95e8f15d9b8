"""Debian's chromium for tests of pages: without a network, and every request is noted."""

import os
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest

CHROMIUM = Path("/usr/bin/chromium")
FLAGS = [
    *("--headless=new", "--no-sandbox", "--disable-background-networking", "--disable-gpu"),
    "--disable-dev-shm-usage",  # a container's is too small
    "--host-resolver-rules=MAP * ~NOTFOUND , EXCLUDE 127.0.0.1",
]
PATIENCE_MS = 120_000
"""Far longer than anything takes on a machine that has time for it: a longer wait would be in vain."""


@contextmanager
def chromium():
    """Give a browser; a machine without one fails the test, as CI must not pass over it."""
    from playwright.sync_api import sync_playwright

    if not CHROMIUM.exists():
        pytest.fail(f"{CHROMIUM} is missing: make test installs it (apt-get install chromium)")
    with sync_playwright() as play:
        browser = play.chromium.launch(executable_path=str(CHROMIUM), args=FLAGS, timeout=PATIENCE_MS)
        try:
            yield browser
        finally:
            browser.close()


@contextmanager
def opened(browser, url, *, width=1280, height=800):
    """Give a page whose errors are collected in `page.faults`, its requests in `page.asked`."""
    context = browser.new_context(viewport={"width": width, "height": height}, accept_downloads=True)
    context.set_default_timeout(PATIENCE_MS)
    try:
        yield _open(context, url)
    finally:
        context.close()


@contextmanager
def opened_beside(page):
    """Give another window of the same person with the address of a page."""
    other = _open(page.context, page.url)
    try:
        yield other
    finally:
        other.close()


def _open(context, url):
    page = context.new_page()
    page.faults, page.asked = [], []
    page.on("pageerror", lambda error: page.faults.append(str(error)))
    page.on("console", lambda said: page.faults.append(said.text) if said.type == "error" else None)
    page.on("request", lambda request: page.asked.append(request.url))
    page.goto(url)
    return page


_MISPLACED = """([names, tools, width, height]) => {
  const boxOf = (one) => one.getBoundingClientRect(), shown = (one) => one.getClientRects().length > 0;
  const all = (what) => [...document.querySelectorAll(what)].filter(shown);
  const called = (one) => one.id || one.className || one.textContent;
  const found = names.map((name) => document.querySelector(name)), wrong = [];
  if (innerWidth !== width || innerHeight !== height) wrong.push("the window is not resized");
  for (const one of found) {
    const box = boxOf(one);
    if (box.left < 0 || box.top < 0 || box.right > width || box.bottom > height)
      wrong.push(`${called(one)} leaves the window`);
  }
  for (const plot of all(".js-plotly-plot"))
    if (boxOf(plot.querySelector(".main-svg")).width > boxOf(plot).width + 1)
      wrong.push(`the plot in ${called(plot.parentNode)} is too wide`);
  for (const group of [found, all(tools)])
    group.forEach((one, k) => group.slice(k + 1).forEach((other) => {
      const a = boxOf(one), b = boxOf(other);
      const beside = a.right <= b.left + 1 || b.right <= a.left + 1;
      const stacked = a.bottom <= b.top + 1 || b.bottom <= a.top + 1;
      if (!beside && !stacked) wrong.push(`${called(one)} overlaps ${called(other)}`);
    }));
  return wrong;
}"""
RESIZED_MS = 30_000


def misplaced(page, boxes, tools, width, height):
    """Say which of the boxes, and which of the tools, overlap or leave the window once it is resized."""
    from playwright.sync_api import TimeoutError as StillWrong

    where = [boxes, tools, width, height]
    with suppress(StillWrong):
        page.wait_for_function(f"where => ({_MISPLACED})(where).length === 0", arg=where, timeout=RESIZED_MS)
    return page.evaluate(_MISPLACED, where)


def keep_screenshot(page, name):
    """Keep a picture for people where the environment names a folder (VSENSOR_SCREENSHOTS)."""
    folder = os.environ.get("VSENSOR_SCREENSHOTS")
    if folder:
        Path(folder).mkdir(parents=True, exist_ok=True)
        page.screenshot(path=str(Path(folder) / f"{name}.png"))

import importlib.util
import json
from itertools import product
from pathlib import Path

import pytest

from tests.apps import pages

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def tool():
    spec = importlib.util.spec_from_file_location("vsensor_tools_test", ROOT / "tools" / "test.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.fixture
def part(tmp_path):
    def write(**counts):
        reports = {"passed": 0, "failed": 0, "skipped": 0} | counts
        file = tmp_path / "vcan.json"
        file.write_text(json.dumps({name: [{}] * count for name, count in reports.items()}))
        return file

    return write


def test_vcan_tests_that_ran_are_no_problem(tool, part, monkeypatch):
    monkeypatch.setenv("CI", "true")
    assert tool.not_run(part(passed=3)) == ""


def test_no_vcan_test_that_ran_is_a_problem_everywhere(tool, part, monkeypatch):
    monkeypatch.delenv("CI", raising=False)
    assert tool.not_run(part(skipped=3)) == "no test ran on vcan"
    assert tool.not_run(part()) == "no test ran on vcan"


def test_a_vcan_test_that_was_skipped_is_a_problem_in_ci(tool, part, monkeypatch):
    monkeypatch.setenv("CI", "true")
    assert tool.not_run(part(passed=3, skipped=1)) == "1 tests on vcan were skipped"


def test_a_vcan_part_that_broke_off_is_a_problem(tool, tmp_path):
    assert tool.not_run(tmp_path / "absent.json") == "the part on vcan did not come to its end"


class Part:
    """A part that has run."""

    def __init__(self, status):
        self.status = status

    def wait(self):
        return self.status


@pytest.fixture
def ends_with(tool, monkeypatch):
    """Let the parts end with these statuses, in the order they are started."""

    def let(*statuses):
        left = iter(statuses)
        monkeypatch.setattr(tool, "start", lambda *_: Part(next(left)))
        monkeypatch.setattr(tool, "build_ecu", lambda: None)
        monkeypatch.setattr(tool.sys, "argv", ["test.py"])
        return tool

    return let


@pytest.mark.parametrize(
    ("statuses", "expected"),
    [([0, 0, 0], 0), ([1, 0, 0], 1), ([0, 1, 0], 1), ([0, 0, 1], 1), ([3, 0, 0], 3), ([5, 0, 0], 5)],
    ids=str,
)
def test_every_part_that_fails_fails_the_whole(ends_with, monkeypatch, statuses, expected):
    tool = ends_with(*statuses)
    monkeypatch.setattr(tool, "not_run", lambda part: "")
    assert tool.main() == expected


def test_vcan_tests_that_did_not_run_fail_the_whole_though_pytest_is_content(ends_with):
    assert ends_with(0, 0, 0).main() == 1


def test_what_was_said_on_vcan_is_shown_though_it_ran_beside_the_rest(ends_with, monkeypatch, capsys):
    tool = ends_with(0, 0, 0)
    quiet = tool.start

    def start(before, arguments, output=None):
        if output:
            output.write("3 failed there")
        return quiet()

    monkeypatch.setattr(tool, "start", start)
    tool.main()
    assert "3 failed there" in capsys.readouterr().out


@pytest.mark.parametrize("marks", [*product((False, True), repeat=3)], ids=str)
def test_each_test_is_in_exactly_one_part(ends_with, monkeypatch, marks):
    tool = ends_with(0, 0, 0)
    quiet, selections = tool.start, []

    def start(before, arguments, output=None):
        selections.append(arguments[arguments.index("-m") + 1])
        return quiet()

    monkeypatch.setattr(tool, "start", start)
    tool.main()
    names = dict(zip(("vcan", "timing", "browser"), marks, strict=True))
    assert [eval(one, {}, names) for one in selections].count(True) == 1


def test_a_test_in_a_browser_fails_where_there_is_none(monkeypatch, tmp_path):
    monkeypatch.setattr(pages, "CHROMIUM", tmp_path / "absent")
    with pytest.raises(pytest.fail.Exception, match="absent is missing"), pages.chromium():
        pass

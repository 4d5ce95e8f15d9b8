"""A pytest plugin: parts of one test run, run apart, end as one summary and one closing line.

`--part-out FILE` keeps the reports of this part; `--part-in FILE` adds those of an earlier one, so that
pytest itself counts, lists and judges them: a failure there fails this run too.
"""

import json
from pathlib import Path

import pytest

COUNTED = ("passed", "failed", "skipped", "error", "xfailed", "xpassed")


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--part-out", type=Path, help="file to keep the reports of this part in")
    parser.addoption("--part-in", type=Path, action="append", default=[], help="an earlier part's file")


class Parts:
    """Keeps and adds reports; only in the controlling process, not in the workers of pytest-xdist."""

    def __init__(self, config: pytest.Config) -> None:
        self.config = config

    @pytest.hookimpl(wrapper=True)
    def pytest_sessionfinish(self, session: pytest.Session):
        """Write this part, read the earlier ones, before pytest's terminal reporter sums up."""
        stats = self.config.pluginmanager.getplugin("terminalreporter").stats
        out = self.config.getoption("--part-out")
        if out:
            out.write_text(json.dumps({name: self._plain(stats.get(name, [])) for name in COUNTED}))
        for file in self.config.getoption("--part-in"):
            for name, reports in json.loads(file.read_text()).items():
                stats.setdefault(name, []).extend(map(self._report, reports))
        if session.exitstatus == pytest.ExitCode.OK and (stats.get("failed") or stats.get("error")):
            session.exitstatus = pytest.ExitCode.TESTS_FAILED
        return (yield)

    def _plain(self, reports):
        to_plain = self.config.hook.pytest_report_to_serializable
        plain = [to_plain(config=self.config, report=report) for report in reports]
        for report in plain:
            report.pop("node", None)  # pytest-xdist's, of the worker's connection
        return plain

    def _report(self, data):
        return self.config.hook.pytest_report_from_serializable(config=self.config, data=data)


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        config.pluginmanager.register(Parts(config), "vsensor-parts")

"""The ECU in C on a standard lane test, in simulated time."""

import contextlib
import os
import subprocess

import pytest

from tests.ecu.building import built_ecu
from tests.ecu.lockstep import PERIOD_NS, asked, tell
from tests.experiment.test_lane_tests import point
from vsensor.experiment import runs
from vsensor.experiment.matrix import load_matrix
from vsensor.experiment.tables import keeps


class EcuBus:
    """A bus of a simulated run with the ECU's program on it."""

    def __init__(self, stdin, requests):
        self._stdin, self._requests = stdin, requests
        self._sent, self._index = [], 0

    def send(self, frame):
        self._sent.append(frame)
        return True

    def drain(self):
        t_ns = self._index * PERIOD_NS
        tell(self._stdin, self._sent, t_ns)
        heard = asked(self._requests, t_ns) if self._index else ()
        self._sent, self._index = [], self._index + 1
        return heard

    def confirmed(self):
        return ()


@contextlib.contextmanager
def running_ecu(*options):
    answers, gives = os.pipe()
    command = [built_ecu() / "ecu", "--log", "/dev/stdin", "--requests", f"/dev/fd/{gives}", *options]
    pipe = subprocess.PIPE
    with (
        subprocess.Popen(command, stdin=pipe, stdout=pipe, text=True, pass_fds=[gives]) as ecu,
        os.fdopen(answers) as requests,
    ):
        os.close(gives)
        yield EcuBus(ecu.stdin, requests)
        ecu.stdin.close()
        ecu.stdout.read()


def departure(monkeypatch, tmp_path, *options):
    """Return the figures of a drift of 0.6 m/s over a dashed line."""
    scenario = point("euro_ncap_lss", "lanes/dashed.toml", drift="0.6 m/s")
    with running_ecu(*options) as bus:
        monkeypatch.setattr(runs, "bench", lambda *arguments: bus)
        return runs.run(scenario, tmp_path)["loop"]


@pytest.mark.parametrize(("options", "kept"), [((), True), (("--wheelbase-m", "0.01"), False)])
def test_the_ecu_in_c_keeps_euro_ncaps_limit_unless_it_hardly_steers(monkeypatch, tmp_path, options, kept):
    figures = departure(monkeypatch, tmp_path, *options)
    limit = load_matrix("euro_ncap_lss").config.limit[0]
    assert limit.column == "dtle_min_m"
    assert keeps(limit, figures["dtle_min_m"]) is kept
    assert figures["departure_mps"] == pytest.approx(0.6, abs=0.002)

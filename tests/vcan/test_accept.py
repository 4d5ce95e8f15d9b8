"""`vsensor accept` beside `vsensor run` on a real vcan."""

import json
import re
import signal
import subprocess
from pathlib import Path

import pytest

from tests.vcan.listening import receivers, wait_for
from tests.vcan.programs import Program, ran

pytestmark = pytest.mark.vcan

SECONDS = 3
# The kernel in user mode has one processor for both programs, and stops them for tens of ms, on a loaded
# machine for longer: then slots are dropped and frames are late. That is its doing and passes, up to 3 s.
# What is sent must be right all the same: CRCs, counters, whole bursts in order, lines that neither jump nor
# contradict themselves.
LOADED = """
schema = "vsensor.accept/1"
jitter_ms = 3000.0
burst_ms = 200.0
frozen_ms = 3000.0

[allow]
wrong_cycle = 1000
"""


@pytest.fixture
def sender():
    """A run on vcan0 that has begun to send."""
    words = ["run", "--bus", "socketcan:vcan0", "--duration", 60, "--quiet"]
    with Program("vsensor.cli", *words) as program:
        _wait_for_a_frame()
        yield program


def _wait_for_a_frame():
    subprocess.run(["candump", "-n", "1", "-T", "30000", "vcan0"], check=True, stdout=subprocess.DEVNULL)


def test_the_stream_of_a_run_is_accepted_while_it_is_sent(sender, tmp_path):
    limits, report = tmp_path / "limits.toml", tmp_path / "verdict.json"
    limits.write_text(LOADED)
    options = ["--duration", SECONDS, "--limits", limits, "--json", report]
    done = ran("vsensor.cli", "accept", "--bus", "socketcan:vcan0", *options)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    frames = int(re.search(r"(\d+) frames in", done.stdout)[1])
    assert frames > 13 * 25 * SECONDS / 4
    (verdict,) = json.loads(report.read_text())["verdicts"]
    assert len(verdict["intervals"]) == 13


def test_ctrl_c_ends_the_listening_and_judges(tmp_path):
    report = Path(tmp_path / "verdict.json")
    words = ["accept", "--bus", "socketcan:vcan0", "--profile", "vehicle", "--json", report]
    before = receivers("vcan0")
    with Program("vsensor.cli", *words) as program:
        wait_for(lambda: receivers("vcan0") > before)
        program.send_signal(signal.SIGINT)
        done = program.ended()
    assert done.returncode == 1  # what the vehicle sends is not there
    findings = json.loads(report.read_text())["verdicts"][0]["findings"]
    assert done.stdout.count("never_heard") == len(findings) > 0

"""`vsensor accept` beside `vsensor run` on a real vcan."""

import json
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.vcan.listening import has_socket

pytestmark = pytest.mark.vcan

SECONDS = 5
# The kernel in user mode has one processor for both programs, and stops them for tens of ms, on a loaded
# machine for longer: then slots are dropped and frames are late. That is its doing and passes, up to 3 s.
# What is sent must be right all the same: CRCs, counters, whole bursts in order, lines that neither jump nor
# contradict themselves.
LOADED = """
schema = "vsensor.accept/1"
jitter_ms = 3000.0
burst_ms = 200.0
frozen_ms = 3000.0
"""


def vsensor(*words):
    return [sys.executable, "-m", "vsensor.cli", *(str(word) for word in words)]


@pytest.fixture
def sender():
    """A run on vcan0 that has begun to send."""
    words = vsensor("run", "--bus", "socketcan:vcan0", "--duration", 60, "--quiet")
    with subprocess.Popen(words, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True) as process:
        _wait_for_a_frame()
        yield process
        process.send_signal(signal.SIGINT)


def _wait_for_a_frame():
    subprocess.run(["candump", "-n", "1", "-T", "30000", "vcan0"], check=True, stdout=subprocess.DEVNULL)


def test_the_stream_of_a_run_is_accepted_while_it_is_sent(sender, tmp_path):
    limits, report = tmp_path / "limits.toml", tmp_path / "verdict.json"
    limits.write_text(LOADED)
    options = ["--duration", SECONDS, "--limits", limits, "--json", report]
    words = vsensor("accept", "--bus", "socketcan:vcan0", *options)
    done = subprocess.run(words, capture_output=True, text=True, timeout=60, check=False)
    assert (done.returncode, done.stderr) == (0, ""), done.stdout
    frames = int(re.search(r"(\d+) frames in", done.stdout)[1])
    assert frames > 13 * 25 * SECONDS / 4
    (verdict,) = json.loads(report.read_text())["verdicts"]
    assert len(verdict["intervals"]) == 13


def test_ctrl_c_ends_the_listening_and_judges(tmp_path):
    report = Path(tmp_path / "verdict.json")
    words = vsensor("accept", "--bus", "socketcan:vcan0", "--profile", "vehicle", "--json", report)
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        _wait_for_a_socket(process)
        process.send_signal(signal.SIGINT)
        out, _ = process.communicate(timeout=30)
    assert process.returncode == 1  # what the vehicle sends is not there
    assert out.count("never_heard") == len(json.loads(report.read_text())["verdicts"][0]["findings"])


def _wait_for_a_socket(process):
    deadline = time.monotonic() + 30
    while not has_socket(process.pid):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.1)  # one processor for all

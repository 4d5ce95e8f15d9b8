"""The lane keeping ECU of tools/ecu, built once, and its report on a log."""

import atexit
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.ecu.streams import write

ROOT = Path(__file__).parents[2]


@cache
def built_ecu() -> Path:
    """Build the ECU once per test process and return its folder; it goes when the process ends."""
    if not (shutil.which("gcc") or shutil.which("cc")):
        reason = "needs a C compiler: apt-get install gcc libc6-dev"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    folder = Path(mkdtemp(prefix="vsensor-ecu-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    environment = dict(os.environ, ECU_PYTHON=sys.executable)
    done = subprocess.run(
        [ROOT / "tools" / "ecu" / "build", folder],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return folder


def report_on(frames, folder, *options):
    """Run the ECU over frames, in the time that they bear, and return its report."""
    log = folder / "heard.log"
    write(frames, log)
    done = subprocess.run(
        [built_ecu() / "ecu", "--log", log, *options], capture_output=True, text=True, check=True
    )
    assert done.stderr == ""
    return json.loads(done.stdout)


def found(report):
    """Return the error classes of a report that are not 0."""
    return {name: count for name, count in report["errors"].items() if count}

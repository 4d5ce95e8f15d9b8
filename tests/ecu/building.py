"""The lane keeping ECU of tools/ecu, built once, and its report on a log."""

import hashlib
import json
import os
import shutil
import subprocess
import sys
from functools import cache
from importlib.metadata import version
from pathlib import Path
from tempfile import mkdtemp

import pytest

from tests.ecu.streams import write

ROOT = Path(__file__).parents[2]


@cache
def built_ecu() -> Path:
    """Return the ECU's folder; it is built once for what it is made of, whichever process asks first."""
    if not (shutil.which("gcc") or shutil.which("cc")):
        reason = "needs a C compiler: apt-get install gcc libc6-dev"
        if os.environ.get("CI"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)
    folder = ROOT / "build" / f"ecu-for-tests-{_fingerprint()}"
    if not folder.exists():
        folder.parent.mkdir(exist_ok=True)
        made = Path(mkdtemp(prefix="ecu-", dir=folder.parent))
        _build(made)
        try:
            made.rename(folder)
        except OSError:  # another process was first
            shutil.rmtree(made)
    return folder


def _build(folder: Path) -> None:
    done = subprocess.run(
        [ROOT / "tools" / "ecu" / "build", folder],
        env=dict(os.environ, ECU_PYTHON=sys.executable),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""


def _fingerprint() -> str:
    """Return a name for all that goes into the program."""
    found = hashlib.sha256(version("cantools").encode() + str(shutil.which("gcc")).encode())
    for file in sorted([*(ROOT / "tools" / "ecu").iterdir(), *(ROOT / "dbc").glob("*.dbc")]):
        if file.is_file():
            found.update(file.name.encode() + file.read_bytes())
    return found.hexdigest()[:16]


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


if __name__ == "__main__":  # before user-mode Linux, where it takes ten times as long
    built_ecu()

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def run_pytest(folder, *arguments):
    return subprocess.run(
        [
            sys.executable,
            "-m",
            "pytest",
            "-p",
            "tools.parts_plugin",
            "-p",
            "no:dash",
            f"--rootdir={folder}",
            "-c/dev/null",
            *arguments,
        ],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )


@pytest.fixture
def parts(tmp_path):
    """Two files of tests, and where the first part's reports go."""
    (tmp_path / "early.py").write_text(
        "import pytest\n"
        "def test_good(): pass\n"
        "def test_bad(): assert 1 == 2, 'early failure'\n"
        "@pytest.fixture\n"
        "def broken(): raise ValueError\n"
        "def test_error(broken): pass\n"
        "@pytest.mark.skip(reason='early reason')\n"
        "def test_skipped(): pass\n"
    )
    (tmp_path / "fine.py").write_text("def test_fine(): pass\ndef test_finer(): pass\n")
    return tmp_path


WORKERS = [(), ("-n", "2")]


@pytest.mark.parametrize(
    ("early", "late"), [WORKERS, WORKERS[::-1]], ids=["with late workers", "with early ones"]
)
def test_failures_of_an_earlier_part_are_counted_listed_and_fail_the_last(parts, early, late):
    first = run_pytest(parts, parts / "early.py", f"--part-out={parts / 'early.json'}", *early)
    last = run_pytest(parts, parts / "fine.py", f"--part-in={parts / 'early.json'}", *late)
    assert first.returncode == 1
    assert last.returncode == 1
    assert "1 failed, 3 passed, 1 skipped, 1 error in" in last.stdout.splitlines()[-1]
    assert "FAILED" in last.stdout
    assert "early failure" in last.stdout


def test_parts_that_pass_sum_up_to_a_pass(parts):
    run_pytest(parts, parts / "fine.py", f"--part-out={parts / 'fine.json'}")
    last = run_pytest(parts, parts / "fine.py", f"--part-in={parts / 'fine.json'}")
    assert last.returncode == 0
    assert "4 passed in" in last.stdout.splitlines()[-1]

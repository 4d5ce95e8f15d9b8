"""Where the real input data lies, and what tests do where it is absent."""

import os
from pathlib import Path

import pytest

SHARED_DATA = Path(os.environ.get("VSENSOR_SHARED_DATA", Path(__file__).parents[2] / "shared" / "data"))


def needs_shared(test):
    """Skip a test with a reason where the real data is absent; in CI it runs, and so fails there."""
    absent = not SHARED_DATA.is_dir() and not os.environ.get("CI")
    return pytest.mark.skipif(absent, reason=f"real input data not found at {SHARED_DATA}")(test)

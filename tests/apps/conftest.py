"""The drive at which all tests of the examiner look; it cannot be changed."""

import pytest

from tests.apps.examined import bent_drive


@pytest.fixture(scope="session")
def drive(tmp_path_factory):
    """A straight of 10 s at 20 m/s, the left line reported bent."""
    return bent_drive(tmp_path_factory.mktemp("drive"))

"""No test of a hard case may write anything to the terminal, from Python or from a library in C."""

import pytest


@pytest.fixture(autouse=True)
def quiet_terminal(capfd, caplog):
    """Fail where something was printed or logged; warnings are errors in all tests."""
    yield
    written = capfd.readouterr()
    assert (written.out, written.err, caplog.records) == ("", "", [])

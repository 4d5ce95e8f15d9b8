"""What all tests share: a test of the real vcan runs there, or says why not."""

import os

import pytest
from hypothesis import settings

from vsensor.bus import NETWORK_INTERFACES

# At a desk hypothesis looks for new counterexamples; in CI the same ones are tried every time, and a slow
# machine is no failure.
settings.register_profile("ci", derandomize=True, deadline=None)
settings.register_profile("desk", deadline=None)
settings.load_profile("ci" if os.environ.get("CI") else "desk")


def pytest_runtest_setup(item):
    """Skip a vcan test where there is no vcan; in CI, and when tools/test.py asks, fail instead."""
    if item.get_closest_marker("vcan") and not (NETWORK_INTERFACES / "vcan1").exists():
        reason = "needs vcan0 and vcan1: tools/vcan .venv/bin/python -m pytest -m vcan"
        if os.environ.get("CI") or os.environ.get("VSENSOR_NEEDS_VCAN"):
            pytest.fail(reason, pytrace=False)
        pytest.skip(reason)


@pytest.fixture(scope="session")
def scheduler(tmp_path_factory):
    """The address of a scheduler on the loopback interface with two workers."""
    folder = tmp_path_factory.mktemp("dask")
    before = os.environ.get("DASK_CONFIG")
    os.environ["DASK_CONFIG"] = str(folder)  # Dask writes its settings there, not into the home
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=2,
        threads_per_worker=1,
        processes=True,
        dashboard_address="127.0.0.1:0",  # None means port 8787, which two test processes cannot share
        host="127.0.0.1",
        local_directory=str(folder),
    ) as cluster:
        yield cluster.scheduler_address
    if before is None:
        del os.environ["DASK_CONFIG"]

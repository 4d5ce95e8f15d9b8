"""What `vsensor run` writes through each shipped profile of a sensor is accepted."""

import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.cli import main
from vsensor.profile import shipped_profiles
from vsensor.profile.load import SHIPPED
from vsensor.schema import read_toml

SECONDS = 8
MAKERS = {
    "honda": "honda_bosch_lane_lines_extract",
    "hyundai": "hyundai_canfd_fr_cmr_03_extract",
    "tesla": "tesla_das_lanes_extract",
}


def sensors(*, shipped):
    """Return the profiles of sensors that come with a database, or those of makers, without one."""
    files = {name: read_toml(SHIPPED / f"{name}.toml") for name in shipped_profiles()}
    return [
        name
        for name, file in files.items()
        if file.get("role", "sensor") == "sensor" and ("database" in file) == shipped
    ]


def run_and_accept(folder, name, *words):
    log = folder / "out.log"
    options = ["--profile", name, *words]
    assert main(["run", "--fast", "--duration", str(SECONDS), "--log", str(log), *options]) == 0
    return main(["accept", str(log), *options])


def test_every_maker_has_its_database_here():
    assert set(sensors(shipped=False)) == set(MAKERS)


@pytest.mark.parametrize("name", sensors(shipped=True))
def test_a_run_through_a_shipped_profile_is_accepted(tmp_path, name, capsys):
    assert run_and_accept(tmp_path, name) == 0, capsys.readouterr().out


@needs_shared
@pytest.mark.parametrize("name", sorted(MAKERS))
def test_a_run_through_a_makers_profile_is_accepted(tmp_path, name, capsys):
    dbc = SHARED_DATA / "dbc" / f"{MAKERS[name]}.dbc"
    assert run_and_accept(tmp_path, name, "--dbc", str(dbc)) == 0, capsys.readouterr().out

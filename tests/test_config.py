"""Scenario files: shipped names, bare maps, relative paths, what the command line sets."""

from pathlib import Path

import msgspec
import pytest

from tests.maps import document, road
from vsensor.config import DEFAULT_SCENARIO, ScenarioConfig, load_scenario, shipped_scenarios
from vsensor.errors import ConfigError

HEAD = 'schema = "vsensor.scenario/1"\n'


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "maps").mkdir()
    (tmp_path / "maps" / "here.xodr").write_text(document(road()))
    return tmp_path


def written(folder, text, name="drive.toml"):
    path = folder / name
    path.write_text(HEAD + text)
    return path


@pytest.mark.parametrize("name", shipped_scenarios())
def test_every_shipped_scenario_loads_by_its_name_and_finds_its_map(name):
    scenario = load_scenario(name)
    assert scenario.path.stem == name
    assert scenario.source.is_file()


def test_without_a_name_the_shipped_motorway_is_loaded():
    assert load_scenario().path == load_scenario(DEFAULT_SCENARIO).path


def test_a_file_in_the_folder_goes_before_a_shipped_name(folder, monkeypatch):
    monkeypatch.chdir(folder)
    Path("highway").write_text(HEAD + 'source = "maps/here.xodr"')
    assert load_scenario("highway").path == Path("highway")


def test_a_bare_map_has_all_defaults_and_the_name_of_the_file(folder, monkeypatch):
    monkeypatch.chdir(folder)
    scenario = load_scenario("maps/here.xodr")
    monkeypatch.chdir("/")
    assert scenario.source == folder / "maps" / "here.xodr"
    assert scenario.name == "here"
    assert scenario.config == ScenarioConfig(source=scenario.config.source)


def test_paths_in_a_scenario_start_from_its_own_folder(folder, monkeypatch):
    path = written(folder, 'source = "maps/here.xodr"')
    monkeypatch.chdir("/")
    scenario = load_scenario(str(path))
    assert scenario.source == folder / "maps" / "here.xodr"
    assert scenario.file("errors.npz") == folder / "errors.npz"
    assert scenario.file("/elsewhere/errors.npz") == Path("/elsewhere/errors.npz")


def test_a_name_in_the_file_goes_before_that_of_the_file(folder):
    assert load_scenario(str(written(folder, 'source = "maps/here.xodr"'))).name == "drive"
    assert load_scenario(str(written(folder, 'source = "maps/here.xodr"\nname = "mine"'))).name == "mine"


def test_the_command_line_goes_before_the_file(folder):
    path = written(folder, 'source = "maps/here.xodr"\nseed = 3\nduration_s = 5')
    scenario = load_scenario(str(path), {"seed": 8})
    assert (scenario.config.seed, scenario.config.duration_s) == (8, 5.0)
    with pytest.raises(ConfigError, match="seed"):
        load_scenario(str(path), {"seed": -1})


def test_the_sensor_gets_every_section_that_it_has(folder):
    path = written(
        folder,
        'source = "maps/here.xodr"\n[camera]\nhfov_deg = 40\n[scene]\nrange_m = 60\n'
        '[region]\nenabled = false\n[error_model]\nmode = "none"\n[fit]\norder = 2\n'
        "[tracker]\ngate_m = 0.7\n[quality]\nnight = 2",
    )
    config = load_scenario(str(path)).config
    sensor = config.sensor()
    for section in msgspec.structs.fields(sensor):
        if hasattr(config, section.name):
            assert getattr(sensor, section.name) is getattr(config, section.name)
    assert (sensor.camera.hfov_deg, sensor.fit.order, sensor.quality.night) == (40.0, 2, 2)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ('source = "maps/there.xodr"', "no such file"),
        ('source = "maps"', "expected a map, storyboard or log"),
        ("seed = 1", "source"),
        ('source = "maps/here.xodr"\n[ego]\nspeed_kmh = nan', "ego.speed_kmh = nan"),
        ('source = "maps/here.xodr"\n[ego]\noffset_m = [[0, 0], [1, inf]]', r"ego.offset_m\[1\]\[1\] = inf"),
        ('source = "maps/here.xodr"\n[ego]\nspeed_mps = 20', "did you mean speed_kmh"),
        ('source = "maps/here.xodr"\n[region]\nspeed_kmh = [50, 20]\nrange_m = [40, 60]', "rising values"),
        ('source = "maps/here.xodr"\n[[traffic]]\nrecycle_m = 20', "traffic"),
    ],
)
def test_a_mistake_names_the_file_and_the_key(folder, text, says):
    path = written(folder, text)
    with pytest.raises(ConfigError, match=says) as caught:
        load_scenario(str(path))
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_an_unknown_name_is_told_which_there_are():
    with pytest.raises(ConfigError, match="highway"):
        load_scenario("motorway")


@pytest.mark.parametrize("text", ["", 'schema = "vsensor.profile/1"', 'schema = "vsensor.scenario/99"'])
def test_a_file_of_another_kind_or_a_newer_version_is_refused(folder, text):
    path = folder / "other.toml"
    path.write_text(text)
    with pytest.raises(ConfigError, match="schema"):
        load_scenario(str(path))

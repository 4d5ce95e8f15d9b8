import pytest

from vsensor.config import load_scenario
from vsensor.errors import ConfigError
from vsensor.experiment.matrix import load_matrix, points_of, seeds_of, shipped_matrices

HEAD = 'schema = "vsensor.experiment/1"\n'


def matrix(tmp_path, text):
    path = tmp_path / "mine.toml"
    path.write_text(HEAD + text)
    return load_matrix(str(path))


def test_every_scenario_runs_with_every_variant_and_every_combination_of_settings(tmp_path):
    found = matrix(
        tmp_path,
        """
        scenarios = ["highway", "live_bench"]
        [settings]
        camera.width_px = [640, 1280]
        "environment.light" = ["day", "night", "dusk"]
        fit.order = 2
        [[variant]]
        name = "slow"
        settings = { ego.speed_kmh = 60 }
        [[variant]]
        name = "fast"
        """,
    )
    points = list(points_of(found))
    assert found.columns == ("variant", "camera.width_px", "environment.light")
    assert len(points) == 2 * 2 * 2 * 3
    assert [point.told for point in points[:4]] == [
        {"variant": "slow", "camera.width_px": 640, "environment.light": "day"},
        {"variant": "slow", "camera.width_px": 640, "environment.light": "night"},
        {"variant": "slow", "camera.width_px": 640, "environment.light": "dusk"},
        {"variant": "slow", "camera.width_px": 1280, "environment.light": "day"},
    ]
    assert {point.scenario.config.fit.order for point in points} == {2}
    slow, fast = points[0].scenario.config.ego, points[6].scenario.config.ego
    assert slow.speed_kmh == 60
    assert fast.speed_kmh == load_scenario("highway").config.ego.speed_kmh


def test_seeds_are_a_list_or_count_from_the_scenarios_own(tmp_path):
    highway = load_scenario("highway", {"seed": 7})
    counted = matrix(tmp_path, 'scenarios = ["highway"]\nseeds = 3')
    assert seeds_of(counted, highway) == (7, 8, 9)
    assert seeds_of(matrix(tmp_path, 'scenarios = ["highway"]\nseeds = [5, 2]'), highway) == (5, 2)


def test_a_scenario_beside_the_matrix_is_found_from_anywhere(tmp_path, monkeypatch):
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub" / "own.toml").write_text('schema = "vsensor.scenario/1"\nsource = "a.xodr"\nseed = 4\n')
    (tmp_path / "sub" / "a.xodr").write_text("never read here")
    monkeypatch.chdir("/")
    (point,) = points_of(matrix(tmp_path, 'scenarios = ["sub/own.toml"]'))
    assert point.scenario.config.seed == 4
    assert point.scenario.source == tmp_path / "sub" / "a.xodr"


def test_a_duration_told_outside_stands_in_place_of_the_matrixs(tmp_path):
    found = matrix(tmp_path, 'scenarios = ["highway"]\nduration_s = 5')
    assert [point.scenario.config.duration_s for point in points_of(found)] == [5]
    assert [point.scenario.config.duration_s for point in points_of(found, 0.5)] == [0.5]


@pytest.mark.parametrize("name", shipped_matrices())
def test_a_shipped_experiment_loads_with_all_its_scenarios(name):
    found = load_matrix(name)
    assert len(list(points_of(found))) > 1
    assert found.config.about


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["scenarios"]),
        ("scenarios = []", ["scenarios", "length >= 1"]),
        ('scenarios = ["highwy"]', ["highwy", "nor a shipped scenario"]),
        ('scenarios = ["absent.toml"]', ["absent.toml", "no such file"]),
        ('scenarios = ["highway", "highway"]', ["scenarios: highway is there twice"]),
        ('scenarios = ["highway"]\nseeds = 0', ["seeds"]),
        ('scenarios = ["highway"]\nseeds = []', ["seeds", "at least one"]),
        ('scenarios = ["highway"]\nseeds = [1, 1]', ["seeds: 1 is there twice"]),
        ('scenarios = ["highway"]\nsedes = 3', ["sedes: unknown key; did you mean seeds?"]),
        ('scenarios = ["highway"]\noutputs = ["tarce"]', ["outputs"]),
        ('scenarios = ["highway"]\n[settings]\ncamera.widht_px = [1]', ["camera.widht_px", "width_px"]),
        ('scenarios = ["highway"]\n[settings]\nfit.order = []', ["settings.fit.order", "empty"]),
        ('scenarios = ["highway"]\n[settings]\nfit.order = [1, 1]', ["settings.fit.order", "twice"]),
        ('scenarios = ["highway"]\n[settings]\nseed = [1, 2]', ["settings.seed", "use seeds"]),
        ('scenarios = ["highway"]\n[settings]\ntraffic.99.kind = ["van"]', ["settings traffic.99.kind"]),
        ('scenarios = ["highway"]\n[[variant]]\nsettings = {}', ["variant[0]", "name"]),
        ('scenarios = ["highway"]\n[[limit]]\ncolumn = "ticks"', ["limit[0]", "at_least or at_most"]),
        (
            'scenarios = ["highway"]\n[[limit]]\ncolumn = "seconds"\nat_least = 1\nscenarios = ["b"]',
            ["limit[0].scenarios", "b is none of the scenarios"],
        ),
        ('scenarios = ["highway"]\nseeds = 100000\n[settings]\nfit.order = [1, 2]', ["200000 runs"]),
    ],
)
def test_a_mistake_names_the_file_and_the_key(tmp_path, text, words):
    with pytest.raises(ConfigError) as error:
        list(points_of(matrix(tmp_path, text)))
    assert all(word in str(error.value) for word in [*words, str(tmp_path)]), str(error.value)


def test_an_unknown_name_lists_the_shipped_experiments():
    with pytest.raises(ConfigError, match=r"nowhere: neither a file nor a shipped experiment \(.*p3.*\)"):
        load_matrix("nowhere")


def test_a_scenario_is_no_matrix(tmp_path):
    (tmp_path / "mine.toml").write_text('schema = "vsensor.scenario/1"\nsource = "a.xodr"')
    with pytest.raises(ConfigError, match=r"vsensor\.experiment/1"):
        load_matrix(str(tmp_path / "mine.toml"))

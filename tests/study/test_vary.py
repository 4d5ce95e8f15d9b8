import pytest

from vsensor.config import SHIPPED, load_scenario
from vsensor.errors import ConfigError
from vsensor.study.vary import grid, parse_vary, scenario_with


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ("320,640,1280", [320, 640, 1280]),
        ("-2:2:0.5", [-2.0, -1.5, -1.0, -0.5, 0.0, 0.5, 1.0, 1.5, 2.0]),
        ("0:0.3:0.1", [0.0, 0.1, 0.2, 0.3]),
        ("0:1:0.4", [0.0, 0.4, 0.8]),
        ("3:-3:-3", [3, 0, -3]),
        ("1:1:5", [1]),
        ("1:3:1,10", [1, 2, 3, 10]),
        ("none,auto", ["none", "auto"]),
        ("'a b','c,d'", ["a b", "c,d"]),
        ("true,false", [True, False]),
        ("1,true,1.0", [1, True, 1.0]),
        ("[1.9, 0, 1.3],[2.0, 0, 1.2]", [[1.9, 0, 1.3], [2.0, 0, 1.2]]),
        ("[[0, 100], [5, 50]]", [[[0, 100], [5, 50]]]),
        ("maps/a.xodr, b-2.xodr", ["maps/a.xodr", "b-2.xodr"]),
        ("1e-3", [0.001]),
        ("2020-01-01", ["2020-01-01"]),
    ],
)
def test_values_are_read_as_in_toml_or_as_words_or_as_ranges(values, expected):
    found = parse_vary([f"camera.key={values}"])["camera.key"]
    assert found == expected
    assert [type(value) for value in found] == [type(value) for value in expected]


@pytest.mark.parametrize(
    ("texts", "words"),
    [
        (["camera.width_px"], ["camera.width_px", "KEY=VALUES"]),
        (["=3"], ["KEY=VALUES"]),
        (["camera..width_px=3"], ["KEY=VALUES"]),
        (["a="], ["a value is missing"]),
        (["a=1,,2"], ["a value is missing"]),
        (["a=1,1"], ["1 is there twice"]),
        (["a=0:1:0"], ["0:1:0", "step not 0"]),
        (["a=0:1:-1"], ["0:1:-1", "leads away from 1"]),
        (["a=0:x:1"], ["0:x:1", "start:stop:step"]),
        (["a=0:inf:1"], ["0:inf:1", "start:stop:step"]),
        (["a=0:nan:1"], ["0:nan:1", "start:stop:step"]),
        (["a=0:1:1e-9"], ["at most 10000"]),
        (["a=[1, 2"], ["no value"]),
        (["a=1", "a=2"], ["a: given twice"]),
    ],
)
def test_a_mistake_names_its_text(texts, words):
    with pytest.raises(ConfigError) as error:
        parse_vary(texts)
    assert all(word in str(error.value) for word in ["--vary", *words]), str(error.value)


def test_the_grid_has_every_combination_once():
    found = list(grid({"a": [1, 2], "b": ["x", "y", "z"]}))
    assert found[:3] == [{"a": 1, "b": "x"}, {"a": 1, "b": "y"}, {"a": 1, "b": "z"}]
    assert len(found) == 6


def test_settings_reach_every_depth_of_a_scenario_and_leave_the_rest():
    plain = load_scenario("highway").config
    settings = {
        "camera.width_px": 640,
        "duration_s": 3,
        "traffic.1.kind": "van",
        "fit.order": 2,
        "ego.speed_kmh": 90,
    }
    config = scenario_with("highway", settings).config
    assert (config.camera.width_px, config.duration_s, config.fit.order, config.ego.speed_kmh) == (
        640,
        3,
        2,
        90,
    )
    assert [vehicle.kind for vehicle in config.traffic][:3] == ["car", "van", "car"]
    assert config.camera.height_px == plain.camera.height_px
    assert (config.ego.road, config.scene, config.source) == (plain.ego.road, plain.scene, plain.source)
    assert config.traffic[1].ahead_m == plain.traffic[1].ahead_m


def test_a_bare_map_can_be_varied():
    config = scenario_with(str(SHIPPED / "highway.xodr"), {"camera.width_px": 640}).config
    assert config.camera.width_px == 640


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"camera.widht_px": 3}, ["camera.widht_px", "did you mean width_px?"]),
        ({"camra.width_px": 3}, ["camra", "did you mean camera?"]),
        ({"camera.width_px": "wide"}, ["camera.width_px", "wide"]),
        ({"seed.x": 3}, ["seed.x", "seed is no section"]),
        ({"ego.road.x.y": 3}, ["ego.road.x.y", "ego.road is no section"]),
        ({"traffic.99.kind": "van"}, ["traffic.99.kind", "traffic has 10 entries"]),
        ({"traffic.kind": "van"}, ["traffic.kind", "traffic has 10 entries"]),
        ({"traffic.99": "van"}, ["traffic.99", "traffic has 10 entries"]),
        ({"camera.pitch_deg": float("nan")}, ["camera.pitch_deg", "finite"]),
    ],
)
def test_a_setting_that_cannot_be_is_named(settings, words):
    with pytest.raises(ConfigError) as error:
        scenario_with("highway", settings)
    assert all(word in str(error.value) for word in words), str(error.value)

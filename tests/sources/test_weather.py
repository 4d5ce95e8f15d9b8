"""Light and rain over the time of a run."""

import pytest

from vsensor.config import ScenarioConfig, load_scenario
from vsensor.errors import ConfigError
from vsensor.line import build_line
from vsensor.schema import convert
from vsensor.sources.weather import EnvironmentConfig, Weather
from vsensor.types import Beam, Environment, Light, Tick

EVENING = {"light": [[1.0, "day"], [2.0, "dusk"], [3.0, "night"]], "rain": [[1.0, 0.0], [3.0, 0.8]]}


def weather(table):
    return convert(table, EnvironmentConfig, "test").weather()


@pytest.mark.parametrize(
    ("t_s", "light", "rain"),
    [
        (0.0, Light.DAY, 0.0),
        (1.9, Light.DAY, 0.36),
        (2.0, Light.DUSK, 0.4),
        (2.9, Light.DUSK, 0.76),
        (3.0, Light.NIGHT, 0.8),
        (99.0, Light.NIGHT, 0.8),
    ],
)
def test_light_changes_at_its_times_and_rain_between_them(t_s, light, rain):
    seen = weather(EVENING).at(t_s)
    assert seen.light is light
    assert seen.rain == pytest.approx(rain)


def test_one_value_holds_all_the_time():
    assert weather({"light": "night", "rain": 0.3}).at(1e6) == Environment(light=Light.NIGHT, rain=0.3)
    assert Weather.of(None).at(5.0) == Environment()
    assert Weather.of(Environment(light=Light.DUSK, rain=0.2)).at(5.0) == Environment(
        light=Light.DUSK, rain=0.2
    )


def test_fog_comes_down_and_headlights_are_switched_over_time():
    fog = weather(
        {"visibility_m": [[0, 500], [10, 100]], "headlights": [[0, "low"], [5, "high"], [8, "auto"]]}
    )
    assert fog.at(5.0) == Environment(visibility_m=pytest.approx(300.0), beam=Beam.HIGH)
    assert fog.at(20.0) == Environment(visibility_m=100.0)
    assert Weather.of(Environment(visibility_m=80.0, beam=Beam.OFF)).at(3.0) == Environment(
        visibility_m=80.0, beam=Beam.OFF
    )


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"light": "fog"}, "environment.light"),
        ({"light": []}, "environment: light: an empty list"),
        ({"light": [[0, "fog"]]}, "environment.light"),
        ({"light": [[1, "day"], [1, "night"]]}, "environment: light: times must rise"),
        ({"rain": 1.1}, "environment: rain: values from 0 to 1"),
        ({"rain": [[0, 0.0], [1, -0.1]]}, "environment: rain: values from 0 to 1"),
        ({"rain": [[1, 0.0], [0, 0.1]]}, "environment: rain: times must rise"),
        ({"rain": []}, "environment: rain: an empty list"),
        ({"visibility_m": 4.0}, "environment: visibility_m: values from 5 m"),
        ({"headlights": "dim"}, "environment.headlights"),
        ({"headlights": [[1, "low"], [0, "high"]]}, "environment: headlights: times must rise"),
    ],
)
def test_weather_that_cannot_be_is_refused_where_the_file_is_read(table, expected):
    with pytest.raises(ConfigError, match=f"scenario.toml: {expected}"):
        convert({"source": "x", "environment": table}, ScenarioConfig, "scenario.toml")


def test_a_run_into_the_night_is_seen_by_the_sensor_and_told_on_the_bus():
    state = {"degraded_light": ["night"]}
    line = build_line(load_scenario("highway", {"environment": EVENING, "state": state, "traffic": []}))
    after, told = line.initial_state(), []
    for index in range(0, 101, 25):
        tick = Tick(index=index, t_ns=index * 40_000_000, period_ns=40_000_000)
        computed = line.compute(after, tick)
        after = computed.state_if_sent
        values = computed.output.values
        told.append((values["sensor.light"], values["sensor.rain"], values["sensor.state"]))
    assert [light for light, *_ in told] == [0.0, 0.0, 1.0, 2.0, 2.0]
    assert [rain for _, rain, _ in told] == pytest.approx([0.0, 0.0, 0.4, 0.8, 0.8])
    assert [state for *_, state in told] == [0.0, 2.0, 2.0, 3.0, 3.0]

"""From the weather of a scenario to wipers and lamps on a bus: a profile that has them sends them."""

import pytest

from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.profile import Wiper, load_profile
from vsensor.types import Light, Tick

BODY = """
schema = "vsensor.profile/1"
role = "sensor"
database = "vehicle.dbc"

[messages.VEH_Body]
e2e = { crc = "BodyCrc", counter = "BodyCounter" }

[messages.VEH_Body.signals]
Wiper = "ego.wiper"
LowBeam = "ego.low_beam"
HighBeam = "ego.high_beam"
AmbientLightSensor = "ego.light"
"""


def heard(tmp_path, environment, ticks=8):
    """Return the vehicle's quantities, tick by tick, as a listener decodes them from the frames."""
    profile = tmp_path / "body.toml"
    profile.write_text(BODY)
    (tmp_path / "vehicle.dbc").write_bytes(load_profile("vehicle").database.read_bytes())
    output = {"profile": str(profile)}
    line = build_line(load_scenario("highway", {"environment": environment, "output": output}))
    state, listener, found = line.initial_state(), load_profile("vehicle"), []
    for index in range(ticks):
        computed = line.compute(state, Tick(index=index, t_ns=index * 40_000_000, period_ns=40_000_000))
        state = computed.state_if_sent
        found += [listener.decode(frame, check=True) for frame in computed.output.frames]
    return found


@pytest.mark.parametrize(
    ("environment", "wiper", "low", "high", "light"),
    [
        ({}, Wiper.OFF, 0, 0, Light.DAY),
        ({"rain": 0.9}, Wiper.FAST, 1, 0, Light.DAY),
        ({"light": "night", "headlights": "high"}, Wiper.OFF, 1, 1, Light.NIGHT),
        ({"visibility_m": 100}, Wiper.OFF, 1, 0, Light.DAY),
    ],
)
def test_wiper_and_lamps_are_sent_as_the_weather_asks_for(tmp_path, environment, wiper, low, high, light):
    last = heard(tmp_path, environment)[-1]
    names = ("wiper", "low_beam", "high_beam", "light")
    assert [last[f"ego.{name}"] for name in names] == [wiper, low, high, light]


def test_the_wiper_speeds_up_as_the_rain_sets_in(tmp_path):
    seen = [values["ego.wiper"] for values in heard(tmp_path, {"rain": [[0, 0.0], [0.8, 1.0]]}, ticks=21)]
    assert seen[0] == Wiper.OFF
    assert seen == sorted(seen)
    assert seen[-1] == Wiper.FAST

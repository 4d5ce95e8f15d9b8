"""A model with everything fitted in a whole run: restarted, dropped slots, what is on the bus, night."""

import dataclasses
import pickle

import numpy as np
import pytest

from tests.error_model.models import STD_M, flat_model
from tests.vehicle_frames import Gateway
from vsensor.config import load_scenario
from vsensor.error_model import ErrorLibrary, Rule, library_of, save_library
from vsensor.line import build_line
from vsensor.types import SIDE_NAMES, Light, Side, Tick

LEVELS = np.linspace(0.0, 1.0, 11)
PERIOD_NS = 40_000_000


def lossy_model(**changes):
    share = np.array([0.0, 0.1, 0.2, 0.3, 0.4])
    fitted = {
        "dwell_levels": LEVELS,
        "seen_dwell_s": 0.2 + 0.8 * LEVELS,
        "lost_dwell_s": 0.1 + 0.4 * LEVELS,
        "range_share_levels": LEVELS,
        "range_share": 0.5 + 0.5 * LEVELS,
        "quality_step": 0.8 * np.eye(5) + 0.2 * share,
        "region_speed_mps": np.array([0.0, 40.0]),
        "region_range_m": np.array([30.0, 90.0]),
    }
    return flat_model(**fitted | changes)


def line_of(folder, library, **sections):
    save_library(library, folder / "model.npz")
    given = {"error_model": {"file": str(folder / "model.npz")}, "camera": {"model": "none"}, "traffic": []}
    return build_line(load_scenario("highway", given | sections))


def run(line, ticks, state=None, first=0, drop=(), heard=None):
    """Return the last state and the outputs; the frames of the ticks in `drop` are not sent.

    `heard`: tick -> frames that come from the bus before it.
    """
    state, found = state or line.initial_state(), []
    for index in range(first, first + ticks):
        tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
        computed = line.compute(state, tick, (heard or {}).get(index, ()))
        found.append(computed.output)
        state = computed.state_if_dropped if index in drop else computed.state_if_sent
    return state, found


def reports(outputs):
    return [
        [(line.side, line.quality, line.x_max_m, *line.coefficients) for line in o.estimate.boundaries]
        for o in outputs
    ]


@pytest.mark.parametrize("mode", ["volume", "levels"])
def test_a_run_goes_on_bit_identically_from_any_tick_and_over_dropped_slots(tmp_path, mode):
    section = {"error_model": {"file": str(tmp_path / "model.npz"), "mode": mode}}
    line = line_of(tmp_path, library_of(lossy_model(), "test"), **section)
    whole = run(line, 60)[1]
    state = pickle.loads(pickle.dumps(run(line, 31)[0]))
    assert reports(run(line, 29, state, first=31)[1]) == reports(whole[31:])
    assert reports(run(line, 60, drop=(10, 11, 12, 40))[1]) == reports(whole)


def test_what_is_sent_of_lost_lines_says_so_on_every_signal(tmp_path):
    line = line_of(tmp_path, library_of(lossy_model(), "test"))
    outputs = run(line, 150)[1][10:]
    lost = 0
    for output in outputs:
        there = {boundary.side for boundary in output.estimate.boundaries}
        decoded = {}
        for frame in output.frames:
            decoded |= line.profile.decode(frame, check=True)
        for side, word in SIDE_NAMES.items():
            is_there = side in there
            assert decoded[f"{word}.available"] == is_there
            assert (decoded[f"{word}.quality"] > 0) == is_there
            assert np.isnan(decoded[f"{word}.offset_m"]) != is_there
            lost += not is_there
        both = {0, 1} <= {int(side) for side in there}
        assert np.isnan(decoded["lane.width_m"]) != both
    share = lost / (4 * len(outputs))
    assert 0.15 < share < 0.55  # 0.3 s lost after 0.6 s seen: a third


def test_with_losses_off_lines_are_as_the_camera_sees_them(tmp_path):
    section = {"error_model": {"file": str(tmp_path / "model.npz"), "losses": False}}
    outputs = run(line_of(tmp_path, library_of(lossy_model(), "test"), **section), 40)[1][5:]
    assert all(len(output.estimate.boundaries) == 4 for output in outputs)


def test_the_view_range_follows_the_models_region(tmp_path):
    outputs = run(line_of(tmp_path, library_of(lossy_model(), "test")), 40)[1]
    for output in outputs:
        end_m = np.interp(output.snapshot.ego.speed_mps, [0.0, 40.0], [30.0, 90.0])
        assert output.detections.operating_range_m == pytest.approx(end_m)
        assert all(line.x_max_m <= end_m for line in output.estimate.boundaries)


def test_the_rule_is_asked_for_the_light_of_the_scene(tmp_path):
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    night = lossy_model(region_range_m=np.array([10.0, 50.0]))
    library = ErrorLibrary(source="", rule=rule, models={"day": lossy_model(), "night": night})

    def range_m(light):
        line = line_of(tmp_path, library, environment={"light": light})
        return run(line, 1)[1][0].detections.operating_range_m

    speed_mps = 110 / 3.6
    expected = [
        np.interp(speed_mps, [0.0, 40.0], ends) for ends in ([30.0, 90.0], [30.0, 90.0], [10.0, 50.0])
    ]
    assert [range_m(light) for light in ("day", "dusk", "night")] == pytest.approx(expected)


def test_when_night_falls_during_a_run_the_law_changes_and_nothing_jumps(tmp_path):
    """The lamps go on at tick 20, heard on the bus; night is here only more forgetful, and loses lines."""
    rule = (Rule(model="night", when={"night": True}), Rule(model="day", when={}))
    day = flat_model(std_m=0.2 * STD_M)
    night = lossy_model(std_m=0.2 * STD_M, correlation_time_s=0.2)
    night = dataclasses.replace(night, region_range_m=np.zeros(0), region_speed_mps=np.zeros(0))
    library = ErrorLibrary(source="", rule=rule, models={"day": day, "night": night})
    line = line_of(tmp_path, library, listen={"profile": "vehicle"})
    dark = Gateway().frame("VEH_Body", 19 * PERIOD_NS, low_beam=1.0)
    lit = run(line, 60)[1]
    dusk = run(line, 60, heard={20: (dark,)})[1]
    nights = [output.snapshot.scene.environment.light is Light.NIGHT for output in dusk]
    assert nights == [index >= 20 for index in range(60)]
    assert reports(dusk[:20]) == reports(lit[:20])
    assert not any(output.estimate.lost for output in lit)
    assert not dusk[20].estimate.lost
    assert any(output.estimate.lost for output in dusk[21:])
    left = [output.estimate.on(Side.LEFT) for output in dusk]
    y = np.array([np.nan if one is None else np.polyval(one.coefficients[::-1], 30.0) for one in left])
    # 0.2 * 0.01 * (30 + 30) = 0.12 m of std; in one image AR(1) of 0.2 s moves by 0.6 of it: four times that
    assert np.nanmax(np.abs(np.diff(y[15:26]))) < 4 * 0.6 * 0.12

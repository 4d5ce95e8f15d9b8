"""How the closed loop's tool judges a run: by the truth, and with care where the machine had no time."""

from dataclasses import replace

import pytest

from tests.outputs import Drawn, output_of, straight
from tools.bench.loop import TARGET_ERRORS, targets
from tools.ecu.closed_loop import kept, problems
from vsensor.sinks.trace import TraceSink
from vsensor.types import Side, Tick

HALF_WIDTH_M = 0.9
WAY = {"pauses": 0, "blind": 0, "margin_m": 0.5}


def trace(folder, ticks, left_m=1.8):
    """Write the trace of a straight drive with lines of 0.15 m; `left_m` by tick or for all."""
    path = folder / "loop.npz"
    sink = TraceSink(path, front_axle_x_m=2.8)
    for index in ticks:
        y_m = left_m(index) if callable(left_m) else left_m
        lines = [
            Drawn(y=straight(y_m), reported=Side.LEFT),
            Drawn(y=straight(-1.8), reported=Side.RIGHT),
        ]
        output = output_of(lines, tick=index)
        t_ns = index * 40_000_000
        sink.write(replace(output, tick=Tick(index=index, t_ns=t_ns, period_ns=40_000_000)))
    sink.close()
    return path


def report(**errors):
    names = (*TARGET_ERRORS, "sensor_not_ready", "left_not_available", "burst_incomplete")
    return {"errors": {**dict.fromkeys(names, 0), **errors}, "frames_overrun": 0}


def test_the_margin_is_from_the_side_of_the_vehicle_to_the_inner_edge_of_the_nearer_line(tmp_path):
    way = kept(trace(tmp_path, range(50), left_m=1.5), 2.0, HALF_WIDTH_M)
    assert way["margin_m"] == pytest.approx(1.5 - 0.15 / 2 - HALF_WIDTH_M, abs=1e-9)
    assert (way["slots_dropped"], way["pauses"]) == (0, 0)
    assert way["driven_m"] == pytest.approx(49 * 0.04 * 30.0)


def test_a_moment_over_the_line_is_a_margin_below_0(tmp_path):
    way = kept(trace(tmp_path, range(50), lambda tick: 0.795 if tick == 30 else 1.8), 2.0, HALF_WIDTH_M)
    assert way["margin_m"] < 0
    assert problems(report(), way) == ["the vehicle left its lane by 0.18 m"]


def test_what_is_driven_after_the_time_is_not_judged(tmp_path):
    way = kept(trace(tmp_path, range(50), lambda tick: 0.8 if tick == 49 else 1.8), 1.9, HALF_WIDTH_M)
    assert way["margin_m"] > 0


def test_nothing_is_claimed_from_where_the_ecu_was_blind_for_a_quarter_of_a_second(tmp_path):
    ticks = [*range(20), *range(25, 50)]
    way = kept(trace(tmp_path, ticks, lambda tick: 0.5 if tick > 30 else 1.8), 2.0, HALF_WIDTH_M)
    assert way["margin_m"] > 0
    assert way["judged_s"] == pytest.approx(19 * 0.04)
    assert (way["slots_dropped"], way["pauses"], way["blind"]) == (5, 1, 1)


def test_a_shorter_pause_is_no_excuse(tmp_path):
    ticks = [*range(20), *range(24, 50)]
    way = kept(trace(tmp_path, ticks, lambda tick: 0.5 if tick > 30 else 1.8), 2.0, HALF_WIDTH_M)
    assert way["margin_m"] < 0
    assert way["blind"] == 0


@pytest.mark.parametrize("name", [*TARGET_ERRORS, "burst_incomplete"])
def test_any_error_of_the_frames_is_a_problem(name):
    assert problems(report(**{name: 1}), WAY) == [f"{name}: 1"]


def test_what_the_sensor_says_of_itself_is_none():
    assert problems(report(sensor_not_ready=1, left_not_available=3), WAY) == []


def test_timeouts_are_excused_by_dropped_slots_alone_and_not_without_end():
    paused = {**WAY, "pauses": 2}
    assert problems(report(timeout=26), paused) == []
    assert problems(report(timeout=27), paused) == ["timeout: 27"]
    assert problems(report(crc=1), paused) == ["crc: 1"]


def test_lines_may_jump_where_nobody_steered_and_nowhere_else():
    assert problems(report(implausible_jump=1), {**WAY, "pauses": 3}) == ["implausible_jump: 1"]
    blind = {**WAY, "pauses": 3, "blind": 1}
    assert problems(report(implausible_jump=1), blind) == []
    assert problems(report(counter_lost=1), blind) == ["counter_lost: 1"]


def test_frames_that_the_ecus_kernel_threw_away_are_told():
    assert problems({**report(), "frames_overrun": 7}, WAY) == ["frames_overrun: 7"]


def test_the_bench_misses_its_target_by_one_error_or_one_wheel_over_the_line():
    fine = {
        **WAY,
        "seconds": 300,
        "driven_m": 9000.0,
        "lateral_mps2": 1.7,
        "slots_dropped": 0,
        "ecu": {"frames": 97_000},
        "errors": dict.fromkeys(TARGET_ERRORS, 0),
    }
    assert [kept_ for *_, kept_ in targets(fine)] == [True, True, None]
    wrong = {**fine, "errors": {**fine["errors"], "timeout": 1}, "margin_m": -0.1}
    assert [kept_ for *_, kept_ in targets(wrong)] == [False, False, None]

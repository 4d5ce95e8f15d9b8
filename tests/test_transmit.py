"""Frames as they leave the sensor: read back by cantools, counted, protected, never NaN."""

import math

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.bus_values import AVAILABLE, PERIOD_NS, boundary, ego, estimate, four_lines, slot
from vsensor.errors import ConfigError, DbcError
from vsensor.profile import QUANTITIES, load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit
from vsensor.types import SensorMode, Side, Tick

NATIVE = load_profile("native")
VEHICLE = VehicleConfig()
TRANSMITTER = Transmitter(NATIVE, VEHICLE)
REFERENCE = cantools.database.load_file(NATIVE.database)


def values(lines, mode=AVAILABLE):
    return values_from(VEHICLE, lines, ego(), mode)


def sent(found, index=0, state=None, transmitter=TRANSMITTER):
    return transmit(transmitter, state or initial_state(transmitter), found, slot(index))


def read(frames):
    """Return what cantools reads: signal -> physical value, without value names."""
    signals = {}
    for frame in frames:
        signals |= REFERENCE.decode_message(frame.arbitration_id, frame.data, decode_choices=False)
    return signals


def profile_of(tmp_path, dbc, toml, name="p"):
    (tmp_path / "test.dbc").write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A B\n' + dbc)
    path = tmp_path / f"{name}.toml"
    path.write_text('schema = "vsensor.profile/1"\ndatabase = "test.dbc"\n' + toml)
    return load_profile(path)


def test_cantools_reads_every_quantity_within_half_a_step():
    found = values(four_lines(index=3))
    signals = read(sent(found)[1])
    for plan in NATIVE.messages:
        for binding in plan.bindings:
            expected = found[binding.quantity] * binding.gain
            expected = expected % binding.wrap if binding.wrap else expected
            error = abs(signals[binding.signal.name] - expected)
            assert error <= binding.signal.scale / 2 * (1 + 1e-9), binding.signal.name


def test_our_own_decoding_gives_what_cantools_gives():
    frames = sent(values(four_lines(index=3)))[1]
    signals, ours = read(frames), {}
    for frame in frames:
        ours |= NATIVE.decode(frame, check=True)
    assert ours["left.offset_m"] == signals["LeftOffset"]
    assert ours["right.curvature_rate_per_m2"] == signals["RightCurvatureRate"]
    assert ours["sensor.rain"] == signals["Rain"] / 100
    assert set(ours) == NATIVE.quantities()


@pytest.mark.parametrize("mode", SensorMode)
def test_all_messages_are_sent_from_the_first_slot_in_every_state(mode):
    frames = sent(values(four_lines(), mode))[1]
    assert [frame.arbitration_id for frame in frames] == [m.frame_id for m in REFERENCE.messages]
    assert read(frames)["SensorState"] == mode


def test_without_lines_the_raw_sna_values_stand_on_the_bus():
    for frame in sent(values(estimate()))[1]:
        message = REFERENCE.get_message_by_frame_id(frame.arbitration_id)
        raws = message.decode(frame.data, decode_choices=False, scaling=False)
        for signal in message.signals:
            sna = signal.dbc.attributes.get("GenSigSNA")
            line = signal.name.startswith(("Left", "Right", "Next"))
            if sna is not None and line and not signal.name.endswith("Kind"):
                assert raws[signal.name] == int(sna.value), signal.name
            if signal.name.endswith(("Available", "Measured", "Quality", "Kind")):
                assert raws[signal.name] == 0, signal.name


def test_a_mirrored_line_flips_the_sign_on_the_bus():
    line, mirrored = [1.8, 0.02, 1e-3, -1e-5], [-1.8, -0.02, -1e-3, 1e-5]
    left = read(sent(values(estimate(boundary(Side.LEFT, line))))[1])
    right = read(sent(values(estimate(boundary(Side.RIGHT, mirrored))))[1])
    for name in ("Offset", "Heading", "Curvature", "CurvatureRate", "LaneOffset"):
        assert right[f"Right{name}"] == -left[f"Left{name}"] != 0


def test_the_frames_of_a_burst_carry_one_image_index_and_are_due_at_the_slot():
    found = values(four_lines(index=70_003))
    frames = sent(found, index=9)[1]
    signals = read(frames)
    bursts = [value for name, value in signals.items() if name.endswith("Burst")]
    assert bursts == [70_003 % 16] * 13
    assert signals["ImageIndex"] == 70_003 % 65_536
    assert signals["ImageTimestamp"] == 70_003 * 40
    assert {frame.due_ns for frame in frames} == {9 * PERIOD_NS}


def counters(frames):
    return {v for name, v in read(frames).items() if name.endswith("Counter")}


def test_alive_counters_count_sent_frames_and_wrap_after_14():
    state, seen = initial_state(TRANSMITTER), []
    for index in range(17):
        state, frames = sent(values(four_lines(index)), index, state)
        seen.append(counters(frames))
    assert seen == [{k % 15} for k in range(17)]
    assert state.frames == 17 * 13


def test_a_dropped_slot_moves_the_image_index_but_no_counter():
    state, first = sent(values(four_lines(0)), 0)
    _, dropped = sent(values(four_lines(1)), 1, state)
    _, second = sent(values(four_lines(2)), 2, state)
    assert counters(first) == {0}
    assert counters(dropped) == counters(second) == {1}
    assert read(second)["ImageIndex"] == 2


def test_the_same_state_and_values_give_the_same_frames():
    found = values(four_lines())
    assert sent(found) == sent(found)


any_float = st.one_of(
    st.floats(allow_nan=True, allow_infinity=True), st.integers(-20, 20).map(float), st.just(math.nan)
)


@settings(max_examples=200, deadline=None)
@given(st.dictionaries(st.sampled_from(sorted(QUANTITIES)), any_float, max_size=40))
def test_whatever_the_values_the_frames_are_intact_and_decode_to_finite_numbers(found):
    _, frames = sent(found)
    assert all(math.isfinite(value) for value in read(frames).values())
    assert all(NATIVE.decode(frame, check=True) is not None for frame in frames)


@settings(max_examples=200, deadline=None)
@given(st.lists(any_float, min_size=1, max_size=8), st.randoms(use_true_random=False))
def test_rounding_at_once_equals_rounding_one_by_one(numbers, rng):
    found = {name: rng.choice(numbers) for name in QUANTITIES}
    raws, saturated = TRANSMITTER.raws(found)
    expected, clipped = [], []
    for binding in (b for plan in NATIVE.messages for b in plan.bindings):
        raw, out = binding.raw(found[binding.quantity])
        expected.append(raw & ((1 << binding.signal.length) - 1))
        clipped += [binding.signal.name] * out
    assert raws == expected
    assert set(saturated) <= set(clipped)


def test_saturation_is_counted_by_signal_and_never_wraps():
    lines = estimate(boundary(Side.LEFT, [500.0, 0.0]), boundary(Side.RIGHT, [-500.0, 0.0]))
    state, frames = sent(values(lines))
    signals = read(frames)
    assert signals["LeftOffset"] == 32.767
    assert signals["RightOffset"] == -32.767  # the lowest raw value says "not available"
    assert state.saturated["LeftOffset"] == state.saturated["RightOffset"] == 1
    assert sent(values(lines), 1, state)[0].saturated["LeftOffset"] == 2
    assert sent(values(four_lines()))[0].saturated == {}


TWO = (
    'BO_ 1 Fast: 8 A\n SG_ Off : 7|16@0- (0.01,0) [0|0] "m" B\n SG_ Ok : 23|1@0+ (1,0) [0|1] "" B\n'
    ' SG_ Kind : 19|4@0+ (1,0) [0|15] "" B\n SG_ Fix : 24|8@1+ (1,0) [0|255] "" B\n'
    ' SG_ F : 32|32@1- (1,0) [0|0] "" B\n'
    'BO_ 2 Slow: 3 A\n SG_ Wide : 4|15@1+ (0.01,-100) [0|0] "" B\nSIG_VALTYPE_ 1 F : 1;\n'
)
TWO_PROFILE = """
[messages.Fast]
cycle_ms = 20
[messages.Fast.signals]
Off = { quantity = "left.offset_m", factor = -1, sna = -32768 }
Ok = { valid_of = "left.offset_m", valid_raw = 0, invalid_raw = 1 }
Kind = { quantity = "left.kind", table = { solid = 3, dashed = 5, other = 15 } }
Fix = { constant = 42 }
F = "left.heading"
[messages.Slow]
cycle_ms = 60
start_delay_ms = 40
[messages.Slow.signals]
Wide = "left.x_max_m"
"""


def test_each_message_has_its_own_cycle_and_start_delay(tmp_path):
    transmitter = Transmitter(profile_of(tmp_path, TWO, TWO_PROFILE), VEHICLE)
    state, ids = initial_state(transmitter), []
    for index in range(7):
        tick = Tick(index=index, t_ns=index * 20_000_000, period_ns=20_000_000)
        state, frames = transmit(transmitter, state, values(four_lines()), tick)
        ids.append([frame.arbitration_id for frame in frames])
    assert ids == [[1], [1], [1, 2], [1], [1], [1, 2], [1]]


def test_a_cycle_that_is_no_multiple_of_the_slot_keeps_its_mean_rate(tmp_path):
    transmitter = Transmitter(profile_of(tmp_path, TWO, TWO_PROFILE), VEHICLE)
    due = []
    for index in range(9):  # slots at 0, 40, ... 320 ms; Slow is due at 40, 100, 160, 220, 280 ms
        frames = sent(values(four_lines()), index, transmitter=transmitter)[1]
        due += [40 * index for frame in frames if frame.arbitration_id == 2]
    assert due == [40, 120, 160, 240, 280]


def test_a_slot_longer_than_the_cycle_sends_once_and_never_in_bursts(tmp_path):
    transmitter = Transmitter(profile_of(tmp_path, TWO, TWO_PROFILE), VEHICLE)
    frames = sent(values(four_lines()), 3, transmitter=transmitter)[1]
    assert [frame.arbitration_id for frame in frames].count(1) == 1


def test_big_endian_tables_validity_constants_and_floats_go_out_as_the_profile_says(tmp_path):
    profile = profile_of(tmp_path, TWO, TWO_PROFILE)
    transmitter = Transmitter(profile, VEHICLE)
    reference = cantools.database.load_file(tmp_path / "test.dbc")
    for lines, expected in (
        (four_lines(), {"Off": -1.8, "Ok": 0, "Kind": 5, "Fix": 42, "F": np.float32(0.01)}),
        (estimate(), {"Off": -327.68, "Ok": 1, "Kind": 15, "Fix": 42, "F": 0.0}),
    ):
        frame = sent(values(lines), transmitter=transmitter)[1][0]
        assert reference.decode_message(1, frame.data) == pytest.approx(expected)
        back = profile.decode(frame)
        assert back["left.offset_m"] == pytest.approx(
            -expected["Off"] if lines.boundaries else math.nan, nan_ok=True
        )


def test_can_fd_messages_leave_as_fd_frames_with_all_their_bytes(tmp_path):
    dbc = 'BO_ 5 Long: 32 A\n SG_ Off : 200|20@1- (0.001,0) [0|0] "m" B\n'
    toml = '[messages.Long]\ncycle_ms = 40\n[messages.Long.signals]\nOff = "left.offset_m"\n'
    profile = profile_of(tmp_path, dbc, toml)
    frame = sent(values(four_lines()), transmitter=Transmitter(profile, VEHICLE))[1][0]
    assert (frame.is_fd, len(frame.data)) == (True, 32)
    assert profile.decode(frame) == {"left.offset_m": pytest.approx(1.8)}


def test_a_right_positive_bus_at_the_bumper_with_inner_edges_is_sent_and_read_as_said(tmp_path):
    dbc = 'BO_ 5 M: 8 A\n SG_ Off : 0|20@1- (0.001,0) [0|0] "m" B\n'
    toml = (
        '[geometry]\npositive = "right"\norigin = "bumper"\nedge = "inner"\n'
        '[messages.M]\ncycle_ms = 40\n[messages.M.signals]\nOff = "left.offset_m"\n'
    )
    profile = profile_of(tmp_path, dbc, toml)
    frame = sent(
        values(estimate(boundary(Side.LEFT, [1.8], width_m=0.2))), transmitter=Transmitter(profile, VEHICLE)
    )[1][0]
    assert cantools.database.load_file(tmp_path / "test.dbc").decode_message(5, frame.data) == {"Off": -1.7}
    assert profile.decode(frame)["left.offset_m"] == pytest.approx(1.7)


def test_a_profile_of_what_the_sensor_listens_to_cannot_be_sent():
    with pytest.raises(ConfigError, match='role = "vehicle"'):
        Transmitter(load_profile("vehicle"), VEHICLE)


def test_protection_in_big_endian_signals_stands_where_it_belongs(tmp_path):
    dbc = (
        'BO_ 5 M: 8 A\n SG_ Crc : 23|8@0+ (1,0) [0|0] "" B\n SG_ Cnt : 27|4@0+ (1,0) [0|0] "" B\n'
        ' SG_ Off : 39|16@0- (0.001,0) [0|0] "m" B\n'
    )
    toml = (
        '[messages.M]\ncycle_ms = 40\ne2e = { crc = "Crc", counter = "Cnt", profile = "P01", data_id = 7 }\n'
        '[messages.M.signals]\nOff = "left.offset_m"\n'
    )
    profile = profile_of(tmp_path, dbc, toml)
    transmitter = Transmitter(profile, VEHICLE)
    reference, state = cantools.database.load_file(tmp_path / "test.dbc"), initial_state(transmitter)
    for index in range(17):
        state, frames = sent(values(four_lines()), index, state, transmitter)
        assert profile.decode(frames[0], check=True) == {"left.offset_m": 1.8}
        assert reference.decode_message(5, frames[0].data)["Cnt"] == index % 15


WIDE = 'BO_ 5 M: 8 A\n SG_ Off : 0|8@1- (0.1,0) [-{0}|{0}] "m" B\n'
WIDE_PROFILE = '[messages.M]\ncycle_ms = 40\nsignals = {{ Off = "left.offset_m" }}\n'


def test_a_declared_range_beyond_the_bits_is_refused_when_sending_unless_it_is_to_saturate(tmp_path):
    with pytest.raises(DbcError, match=r"M\.Off: range \[-13\|13\] exceeds what 8 bits hold"):
        Transmitter(profile_of(tmp_path, WIDE.format(13), WIDE_PROFILE.format()), VEHICLE)
    text = 'wide_ranges = "saturate"\n' + WIDE_PROFILE.format()
    transmitter = Transmitter(profile_of(tmp_path, WIDE.format(13), text), VEHICLE)
    lines = estimate(boundary(Side.LEFT, [500.0]))
    assert sent(values(lines), transmitter=transmitter)[1][0].data[0] == 127


def test_a_range_that_ends_one_step_behind_the_bits_is_a_habit(tmp_path):
    transmitter = Transmitter(profile_of(tmp_path, WIDE.format(12.8), WIDE_PROFILE.format()), VEHICLE)
    assert sent(values(four_lines()), transmitter=transmitter)[1][0].data[0] == 18

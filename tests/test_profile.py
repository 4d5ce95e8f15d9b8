"""Profiles: what they decode, one frame and many, and what they say when they are wrong."""

import math
from pathlib import Path

import numpy as np
import pytest

from tests.bus_values import AVAILABLE, ego, estimate, four_lines, slot
from tests.shared import SHARED_DATA, needs_shared
from vsensor.codec import encode, load_database
from vsensor.errors import ConfigError, DbcError
from vsensor.profile import load_profile, load_profiles
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit
from vsensor.types import Frame

NATIVE = load_profile("native")
HEAD = 'schema = "vsensor.profile/1"\ndatabase = "{database}"\n'
LDS = NATIVE.database.resolve()
RAV4_DBC = SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc"


def written(tmp_path, text, database=LDS, name="mine"):
    path = tmp_path / f"{name}.toml"
    path.write_text(HEAD.format(database=database) + text)
    return path


def native_frames(count=30):
    """Return the frames of some slots, the lines gone in every third."""
    transmitter = Transmitter(NATIVE, VehicleConfig())
    state, frames = initial_state(transmitter), []
    for index in range(count):
        lines = (
            estimate(index=index) if index % 3 == 0 else four_lines(index, bend=(0.001 * index, 1e-4, 1e-6))
        )
        found = values_from(VehicleConfig(), lines, ego(), AVAILABLE)
        state, some = transmit(transmitter, state, found, slot(index))
        frames += some
    return frames


def columns(frames, width=8):
    data = np.zeros((len(frames), width), dtype=np.uint8)
    for row, frame in zip(data, frames, strict=True):
        row[: len(frame.data)] = list(frame.data)
    ids = np.array([frame.arbitration_id for frame in frames], dtype=np.uint32)
    return ids, data, np.array([len(frame.data) for frame in frames], dtype=np.uint8)


def assert_bulk_equals_single(profile, frames, width=8, **options):
    single = [profile.decode(frame, **options) or {} for frame in frames]
    bulk = profile.decode_arrays(*columns(frames, width), **options)
    assert set(bulk) == {name for found in single for name in found}
    for name, column in bulk.items():
        rows = [row for row, found in enumerate(single) if name in found]
        assert column.rows.tolist() == rows, name
        np.testing.assert_array_equal(column.values, [single[row][name] for row in rows], err_msg=name)


@pytest.mark.parametrize("width", [8, 64])
def test_decoding_in_bulk_equals_decoding_frame_by_frame(width):
    assert_bulk_equals_single(NATIVE, native_frames(), width)


def test_checked_decoding_leaves_out_damaged_frames_one_by_one_and_in_bulk():
    frames = native_frames()
    damaged = [
        Frame(due_ns=0, arbitration_id=f.arbitration_id, data=f.data[:-1] + bytes([f.data[-1] ^ 1]))
        if k % 4 == 0
        else f
        for k, f in enumerate(frames)
    ]
    assert [NATIVE.decode(f, check=True) is None for f in damaged] == [
        k % 4 == 0 for k in range(len(damaged))
    ]
    assert_bulk_equals_single(NATIVE, damaged, check=True)


def test_foreign_short_and_extended_frames_are_not_decoded():
    frame = native_frames(2)[-1]
    assert NATIVE.decode(frame) is not None
    for arbitration_id, data, is_extended in (
        (0x7FF, frame.data, False),
        (frame.arbitration_id, frame.data[:7], False),
        (frame.arbitration_id, frame.data, True),
    ):
        other = Frame(due_ns=0, arbitration_id=arbitration_id, data=data, is_extended=is_extended)
        assert NATIVE.decode(other) is None


def test_extended_frames_with_our_ids_are_left_out_in_bulk():
    ids, data, lengths = columns(native_frames(1))
    assert NATIVE.decode_arrays(ids, data, lengths, extended=np.ones(len(ids), dtype=bool)) == {}


def test_sna_on_the_bus_is_nan_inside():
    found = {}
    for frame in native_frames(1):
        found |= NATIVE.decode(frame)
    assert found["left.available"] == 0
    assert math.isnan(found["left.offset_m"])
    assert math.isnan(found["lane.width_m"])


def test_only_the_full_image_index_is_told_not_its_low_bits():
    told = [frame for frame in native_frames(1) if "image.index" in NATIVE.decode(frame)]
    assert [frame.arbitration_id for frame in told] == [0x320]


def test_the_vehicle_bus_gives_si_units():
    profile = load_profile("vehicle")
    layout = load_database(profile.database).layouts["VEH_Motion"]
    data, _ = encode(layout, {"VehicleSpeed": 72.0, "YawRate": 10.0})
    found = profile.decode(Frame(due_ns=0, arbitration_id=layout.arbitration_id, data=bytes(data)))
    assert found == pytest.approx({"ego.speed_mps": 20.0, "ego.yaw_rate_radps": math.radians(10.0)})


def test_unit_factor_and_shift_are_undone_one_by_one_and_in_bulk(tmp_path):
    text = LINE + 'LeftOffset = { quantity = "left.offset_m", unit = "cm", factor = -0.01, shift = 0.5 }\n'
    profile = load_profile(written(tmp_path, text))
    data, _ = encode(profile.messages[0].layout, {"LeftOffset": -1.25})
    frame = Frame(due_ns=0, arbitration_id=0x323, data=bytes(data))
    assert profile.decode(frame) == {"left.offset_m": pytest.approx(1.75)}
    assert_bulk_equals_single(profile, [frame])


def test_a_quantity_in_two_messages_has_the_rows_of_both_in_order(tmp_path):
    text = (
        LINE
        + 'LeftOffset = "left.offset_m"\n'
        + LINE.replace("Left", "Right")
        + 'RightOffset = "left.offset_m"\n'
    )
    frames = native_frames(4)
    profile = load_profile(written(tmp_path, text))
    assert_bulk_equals_single(profile, frames)
    rows = profile.decode_arrays(*columns(frames))["left.offset_m"].rows
    assert len(rows) == 8
    assert (np.diff(rows) > 0).all()


def test_tables_and_validity_bits_are_undone_one_by_one_and_in_bulk(tmp_path):
    text = (
        LINE
        + 'LeftQuality = { quantity = "left.kind", table = { solid = 3, dashed = "Low", other = 7 } }\n'
        + 'LeftOffset = "left.offset_m"\n'
        + 'LeftAvailable = { valid_of = "left.offset_m", valid_raw = 0, invalid_raw = 1 }\n'
    )
    profile = load_profile(written(tmp_path, text))
    frames = []
    for quality in range(8):
        wanted = {"LeftQuality": quality, "LeftOffset": 1.0, "LeftAvailable": quality % 2}
        data, _ = encode(profile.messages[0].layout, wanted)
        frames.append(Frame(due_ns=0, arbitration_id=0x323, data=bytes(data)))
    assert_bulk_equals_single(profile, frames)
    kinds = profile.decode_arrays(*columns(frames))
    np.testing.assert_array_equal(kinds["left.kind"].values, [math.nan] * 2 + [2, 1] + [math.nan] * 4)
    np.testing.assert_array_equal(kinds["left.offset_m"].values, [1.0, math.nan] * 4)


def test_a_kind_told_by_a_bit_each_is_put_together_again(tmp_path):
    text = (
        LINE
        + 'LeftAvailable = { quantity = "left.kind", table = { solid = 1, other = 0 } }\n'
        + 'LeftMeasured = { quantity = "left.kind", table = { dashed = 1, other = 0 } }\n'
    )
    profile = load_profile(written(tmp_path, text))
    frames = []
    for solid, dashed in ((1, 0), (0, 1), (0, 0)):
        data, _ = encode(profile.messages[0].layout, {"LeftAvailable": solid, "LeftMeasured": dashed})
        frames.append(Frame(due_ns=0, arbitration_id=0x323, data=bytes(data)))
    assert_bulk_equals_single(profile, frames)
    np.testing.assert_array_equal(
        profile.decode_arrays(*columns(frames))["left.kind"].values, [1, 2, math.nan]
    )


@pytest.mark.parametrize(
    ("said", "expected_mps"),
    [('"ego.speed_mps"', 20.0), ('{ quantity = "ego.speed_mps", unit = "m/s" }', 72.0)],
)
def test_without_a_word_in_the_profile_the_databases_unit_counts(tmp_path, said, expected_mps):
    database = load_profile("vehicle").database.resolve()
    text = f'role = "vehicle"\n[messages.VEH_Motion.signals]\nVehicleSpeed = {said}\n'
    profile = load_profile(written(tmp_path, text, database))
    data, _ = encode(profile.messages[0].layout, {"VehicleSpeed": 72.0})
    found = profile.decode(Frame(due_ns=0, arbitration_id=0x100, data=bytes(data)))
    assert found == {"ego.speed_mps": pytest.approx(expected_mps)}


def rav4_frames():
    frames = []
    for line in (SHARED_DATA / "can" / "rav4_drive.log").read_text().splitlines():
        identifier, data = line.split()[2].split("#")
        frames.append(Frame(due_ns=0, arbitration_id=int(identifier, 16), data=bytes.fromhex(data)))
    return frames


@needs_shared
def test_the_recorded_drive_decodes_by_name():
    profile = load_profile("toyota_rav4", RAV4_DBC)
    found = profile.decode_arrays(*columns(rav4_frames()))
    speed_kmh = found["ego.speed_mps"].values * 3.6
    yaw_degps = np.degrees(found["ego.yaw_rate_radps"].values)
    assert len(yaw_degps) == 4974
    assert (speed_kmh.min(), speed_kmh.max()) == pytest.approx((29.38, 73.05))
    assert yaw_degps.mean() == pytest.approx(-0.41, abs=0.01)
    assert np.diff(np.unique(yaw_degps)).min() == pytest.approx(0.244)


@needs_shared
def test_the_recorded_drive_decodes_alike_one_by_one_and_in_bulk():
    assert_bulk_equals_single(load_profile("toyota_rav4", RAV4_DBC), rav4_frames()[:5000])


@needs_shared
def test_the_recorded_yaw_rate_is_positive_to_the_left():
    pose = SHARED_DATA / "ego" / "rav4_pose" / "global_pose"
    times, positions, velocities = (
        np.load(pose / f"frame_{n}") for n in ("times", "positions", "velocities")
    )
    up = positions[0] / np.linalg.norm(positions[0])
    east = np.cross([0, 0, 1], up)
    east /= np.linalg.norm(east)
    heading = np.unwrap(np.arctan2(velocities @ np.cross(up, east), velocities @ east))
    lines = (SHARED_DATA / "can" / "rav4_drive.log").read_text().splitlines()
    log_s = np.array([float(line.split()[0][1:-1]) for line in lines]) - 1533177678.415
    yaw = load_profile("toyota_rav4", RAV4_DBC).decode_arrays(*columns(rav4_frames()))["ego.yaw_rate_radps"]
    at_pose = np.interp(times, log_s[yaw.rows], yaw.values)
    smooth = np.ones(20) / 20  # one second
    pair = [np.convolve(x, smooth, "same")[60:-60] for x in (at_pose, np.gradient(heading, times))]
    assert np.corrcoef(pair)[0, 1] > 0.8


# ---- what is wrong is said in one line ---------------------------------------------------------------

LINE = "[messages.LDS_LeftLine]\ncycle_ms = 40\n[messages.LDS_LeftLine.signals]\n"


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (
            LINE + 'LeftOfset = "left.offset_m"',
            r"LDS_LeftLine has no signal LeftOfset; did you mean LeftOffset\?",
        ),
        (
            LINE + 'LeftOffset = "left.ofset_m"',
            r"quantity 'left.ofset_m' is not known; did you mean left.offset_m\?",
        ),
        (
            '[messages.LDS_LeftLin.signals]\nX = "left.kind"',
            r"not a message of .*did you mean LDS_LeftLine\?",
        ),
        (
            LINE + 'LeftOffset = "left.offset_m"\nLeftOffset = "left.heading"',
            "not TOML: Cannot overwrite a value",
        ),
        (
            LINE + 'LeftOffset = "left.offset_m"\nLeftHeading = "left.offset_m"',
            "LeftOffset and LeftHeading both carry left.offset_m",
        ),
        (
            LINE + 'LeftOffset = { quantity = "left.offset_m", constant = 1.0 }',
            "just one of quantity, constant",
        ),
        (LINE + "LeftOffset = {}", "just one of quantity, constant"),
        (
            LINE + 'LeftOffset = { quantity = "left.offset_m", unit = "km/h" }',
            "unit 'km/h' does not fit; m, cm, mm",
        ),
        (LINE + 'LeftOffset = { quantity = "left.offset_m", factor = 0 }', "factor = 0"),
        (LINE + 'LeftOffset = { quantity = "left.offset_m", sna = 40000 }', "the bits hold -32768 to 32767"),
        (LINE + "LeftQuality = { constant = 9.0 }", "constant = 9.0: the bits hold 0 to 7"),
        (
            LINE + 'LeftQuality = { quantity = "left.kind", table = { solid = 1 } }',
            "table lacks none, dashed",
        ),
        (
            LINE + 'LeftQuality = { quantity = "left.kind", table = { solid = 9 } }',
            "raw value 9: the bits hold 0 to 7",
        ),
        (
            LINE + 'LeftQuality = { quantity = "left.quality", table = { 0 = 0, 1 = 1, 2 = 2 } }',
            "table lacks 3, 4",
        ),
        (
            LINE + 'LeftHeading = { quantity = "left.heading", unit = "deg" }',
            "a slope has no angular unit; give geometry.heading",
        ),
        (LINE + 'LeftQuality = { quantity = "left.kind", table = "kinds" }', "table 'kinds' is not there"),
        (
            LINE + 'LeftQuality = { quantity = "left.kind", table = { sollid = 1, other = 0 } }',
            r"no use for 'sollid'; did you mean solid\?",
        ),
        (
            LINE + 'LeftQuality = { quantity = "left.kind", table = { solid = "Hig", other = 0 } }',
            r"no value named 'Hig'; did you mean High\?",
        ),
        (
            LINE + 'LeftAvailable = { valid_of = "left.offset_m", valid_raw = 1, invalid_raw = 1 }',
            "are both 1",
        ),
        (
            LINE.replace(
                "[messages.LDS_LeftLine.s",
                'e2e = { crc = "LeftLineCrc", counter = "LeftQuality" }\n[messages.LDS_LeftLine.s',
            )
            + 'LeftOffset = "left.offset_m"',
            "counter has 3 bits at 52, e2e P01 puts 4",
        ),
        (
            LINE.replace(
                "[messages.LDS_LeftLine.s",
                'e2e = { crc = "LeftLineCrc", counter = "LeftLineCounter", '
                'profile = "P1" }\n[messages.LDS_LeftLine.s',
            )
            + 'LeftOffset = "left.offset_m"',
            "e2e profile 'P1' is not known",
        ),
        (
            LINE.replace(
                "[messages.LDS_LeftLine.s",
                'e2e = { crc = "LeftLineCrc", counter = "LeftLineCounter" }\n[messages.LDS_LeftLine.s',
            )
            + 'LeftLineCrc = "left.kind"',
            "is the CRC or counter of this message",
        ),
        (LINE + 'LeftOffset = { quantity = "left.offset_m", sign = -1 }', "unknown key"),
        (LINE + 'LeftQuality = "left.kind"', "0 to 7, no room for road_edge, curb, unknown; give a table"),
        ("[messages]", "messages: at least one was expected"),
        (
            LINE + 'LeftOffset = "left.offset_m"\n[geometry]\norigin = "rear"',
            "geometry.origin = 'rear': bumper, camera, front_axle, rear_axle were expected",
        ),
    ],
)
def test_a_wrong_profile_is_one_line_that_names_the_file_and_the_cause(tmp_path, text, said):
    with pytest.raises(ConfigError, match=said) as caught:
        load_profile(written(tmp_path, text))
    assert "mine.toml" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_quantities_on_overlapping_bits_are_refused(tmp_path):
    dbc = tmp_path / "overlap.dbc"
    dbc.write_text(
        'VERSION ""\nNS_ :\nBS_:\nBU_: A B\nBO_ 1 M: 8 A\n SG_ X : 0|8@1+ (1,0) [0|0] "" B\n'
        ' SG_ Y : 4|8@1+ (1,0) [0|0] "" B\n'
    )
    text = '[messages.M]\ncycle_ms = 40\n[messages.M.signals]\nX = "left.kind"\nY = "right.kind"\n'
    with pytest.raises(ConfigError, match="X and Y share bits"):
        load_profile(written(tmp_path, text, dbc))


def test_a_sent_message_without_a_cycle_time_is_refused(tmp_path):
    dbc = tmp_path / "slow.dbc"
    dbc.write_text('VERSION ""\nNS_ :\nBS_:\nBU_: A B\nBO_ 1 M: 8 A\n SG_ X : 0|8@1+ (1,0) [0|0] "" B\n')
    with pytest.raises(ConfigError, match=r"M: no cycle time in .*give cycle_ms"):
        load_profile(written(tmp_path, '[messages.M.signals]\nX = "left.kind"\n', dbc))


def test_a_profile_without_a_database_asks_for_one():
    with pytest.raises(ConfigError, match="maps a database that is not shipped; give it with --dbc FILE"):
        load_profile("toyota_rav4")


def test_an_unknown_name_names_the_nearest_shipped_profile():
    with pytest.raises(ConfigError, match=r"'nativ': not shipped; did you mean native\?"):
        load_profile("nativ")


def test_a_missing_database_is_named(tmp_path):
    with pytest.raises(DbcError, match=r"gone\.dbc: no such file"):
        load_profile(written(tmp_path, LINE + 'LeftOffset = "left.offset_m"', "gone.dbc"))


@pytest.mark.parametrize("schema", ['schema = "vsensor.profile/2"', 'schema = "vsensor.scenario/1"', ""])
def test_a_foreign_or_newer_schema_is_refused(tmp_path, schema):
    path = tmp_path / "mine.toml"
    path.write_text(schema + "\n[messages]\n")
    with pytest.raises(ConfigError, match="schema"):
        load_profile(path)


@needs_shared
def test_of_several_profiles_the_given_database_goes_to_the_one_without():
    native, rav4 = load_profiles(["native", "toyota_rav4"], RAV4_DBC)
    assert (native.database.name, rav4.database) == ("lds.dbc", Path(RAV4_DBC))


NATIVE_BINDINGS = [binding for plan in NATIVE.messages for binding in plan.bindings]


@pytest.mark.parametrize("binding", NATIVE_BINDINGS, ids=lambda binding: binding.signal.name)
def test_every_raw_value_comes_back_after_decoding_and_encoding(binding):
    signal = binding.signal
    few = signal.length <= 12
    rng = np.random.default_rng(1)
    drawn = rng.integers(signal.raw_min, signal.raw_max, 500, endpoint=True).tolist()
    raws = range(signal.raw_min, signal.raw_max + 1) if few else [signal.raw_min, signal.raw_max, 0, *drawn]
    for raw in raws:
        assert binding.raw(binding.value(raw)) == (raw, False)


@pytest.mark.parametrize("seed", range(5))
def test_random_frames_never_break_decoding_and_a_check_lets_few_of_them_through(seed):
    rng = np.random.default_rng(seed)
    ids = [plan.layout.arbitration_id for plan in NATIVE.messages]
    frames = [
        Frame(due_ns=0, arbitration_id=int(rng.choice(ids)), data=rng.bytes(int(rng.integers(0, 9))))
        for _ in range(500)
    ]
    for frame in frames:
        found = NATIVE.decode(frame)
        assert (found is None) == (len(frame.data) < 8)
        assert found is None or not any(math.isinf(value) for value in found.values())
    assert (
        sum(NATIVE.decode(frame, check=True) is not None for frame in frames) <= 5
    )  # 1 of 256 of some 56 long ones
    assert_bulk_equals_single(NATIVE, frames)

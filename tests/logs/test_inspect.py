"""What is in a log: cycles, gaps, duplicates, counters and checksums that were put there are found."""

import json
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.shared import SHARED_DATA, needs_shared
from vsensor.check.busload import BusSpeed, frame_s
from vsensor.cli import main
from vsensor.codec import load_database
from vsensor.e2e import CHECKSUMS, Field, guard
from vsensor.errors import LogError
from vsensor.logs.checksums import find_checksum
from vsensor.logs.counters import find_counters
from vsensor.logs.inspect import inspect_log
from vsensor.logs.inspect_text import text_lines
from vsensor.logs.load import bits_of
from vsensor.logs.table import BITRATE_SWITCH, EXTENDED, FD, FD_LENGTHS, Record, columns_from
from vsensor.logs.write import open_output
from vsensor.profile.load import SHIPPED

T0 = 1_700_000_000_000_000_000
MS = 10**6


def write(path, records):
    with open_output(path, path, ("can0", "can1")) as writer:
        writer.write_columns(columns_from(records))
    return path


def cyclic(identifier, times_ms, data=None):
    return [
        Record(T0 + round(t * MS), identifier, 0, 0, bytes((k & 255, k >> 8)) if data is None else data)
        for k, t in enumerate(times_ms)
    ]


def only(summary):
    assert len(summary.messages) == 1
    return summary.messages[0]


def test_cycle_jitter_and_gaps_are_those_of_the_frames(tmp_path):
    times = [10.0 * k for k in range(100)]
    times[50:] = [t + 40.0 for t in times[50:]]  # four frames missing
    times[20] += 1.5
    found = only(inspect_log(write(tmp_path / "x.log", cyclic(0x100, times))))
    assert found.frames == 100
    assert found.cycle_ms == 10.0
    assert found.jitter_p99_ms == pytest.approx(np.quantile(np.abs(np.diff(times) - 10.0), 0.99), abs=1e-6)
    assert (found.gaps, found.longest_gap_ms) == (1, 50.0)


def test_a_late_frame_is_no_gap(tmp_path):
    times = [10.0 * k + (9.0 if k == 30 else 0.0) for k in range(60)]
    assert only(inspect_log(write(tmp_path / "x.log", cyclic(0x100, times)))).gaps == 0


def test_a_single_frame_has_no_cycle(tmp_path):
    found = only(inspect_log(write(tmp_path / "x.log", cyclic(0x100, [0.0]))))
    assert math.isnan(found.cycle_ms)
    assert (found.gaps, found.duplicates, found.is_constant) == (0, 0, True)
    assert found.findings() == []


def test_duplicates_have_the_time_and_the_data_of_the_one_before(tmp_path):
    records = cyclic(0x100, [0, 10, 20, 30])
    records.insert(2, records[1])
    records.insert(4, records[3]._replace(data=b"\xff\xff"))  # other data, the same time
    assert only(inspect_log(write(tmp_path / "x.log", records))).duplicates == 1


def test_an_id_is_its_own_message_on_each_channel_and_in_each_length_of_id(tmp_path):
    records = [
        Record(T0, 0x100, 0, 0, b"\1"),
        Record(T0, 0x100, 1, 0, b"\1"),
        Record(T0, 0x100, 1, EXTENDED, b"\1"),
        Record(T0, 0x101, 1, 0, b"\1"),
    ]
    found = inspect_log(write(tmp_path / "x.log", records)).messages
    assert [(m.channel, m.arbitration_id, m.is_extended) for m in found] == [
        ("can0", 0x100, False),
        ("can1", 0x100, False),
        ("can1", 0x101, False),
        ("can1", 0x100, True),
    ]


def test_constant_frames_are_told(tmp_path):
    found = only(inspect_log(write(tmp_path / "x.log", cyclic(0x100, range(30), data=b"\1\2"))))
    assert found.is_constant
    assert found.findings() == ["constant"]


def payloads(count, length, seed=1):
    return np.random.default_rng(seed).integers(0, 256, (count, length)).astype(np.uint8)


@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_counter_is_found_wherever_it_lies_and_whatever_its_modulus(data):
    bits = data.draw(st.integers(2, 8))
    low_bit = 8 * data.draw(st.integers(0, 7)) + data.draw(st.integers(0, 8 - bits))
    states = (
        data.draw(st.integers((1 << bits - 1) + 1, 1 << bits)) if bits > 2 else data.draw(st.integers(3, 4))
    )
    frames = payloads(3 * states + 40, 8, data.draw(st.integers(0, 99)))
    field = Field(low_bit, bits)
    (byte, mask), low = next(iter(field.masks().items())), low_bit % 8
    values = (np.arange(len(frames)) + data.draw(st.integers(0, 255))) % states
    frames[:, byte] = frames[:, byte] & ~np.uint8(mask) | (values << low).astype(np.uint8)
    found = find_counters(frames)
    assert [(one.field.low_bit, one.field.length, one.states) for one in found] == [(low_bit, bits, states)]


@pytest.mark.parametrize("big", [False, True])
def test_a_counter_over_two_bytes_is_found_in_both_byte_orders(big):
    frames = payloads(1500, 8)
    values = np.arange(1500)
    low, high = (5, 4) if big else (4, 5)
    frames[:, low], frames[:, high] = values & 255, values >> 8
    (found,) = find_counters(frames)
    assert found.field == Field(8 * low, 11, big)
    assert found.states is None


def test_a_counter_of_which_frames_are_missing_is_still_one():
    frames = payloads(400, 8)
    frames[:, 1] = np.arange(400) % 15
    kept = np.delete(frames, [20, 21, 90, 200, 201, 202, 300], axis=0)
    assert [(one.field, one.states) for one in find_counters(kept)] == [(Field(8, 4), 15)]


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 10_000))
def test_noise_counts_nothing_and_checks_nothing(seed):
    frames = payloads(200, 8, seed)
    assert find_counters(frames) == ()
    assert find_checksum(frames, 0x123) is None


def protected(one, count=120, seed=3):
    """Frames of a guard with random data."""
    frames = []
    for k, row in enumerate(payloads(count, one.wanted.length, seed)):
        frame = bytearray(row.tobytes())
        one.protect(frame, k % one.counter_states)
        frames.append(np.frombuffer(bytes(frame), dtype=np.uint8))
    return np.array(frames)


@pytest.mark.parametrize("byte", [0, 3, 7])
@pytest.mark.parametrize("name", [n for n, one in CHECKSUMS.items() if one.bits == 8 and n != "xor8"])
def test_a_checksum_of_a_byte_is_found_at_its_place(name, byte):
    made = guard(name, length=8, arbitration_id=0x2B4, checksum=Field(8 * byte, 8))
    found = find_checksum(protected(made), 0x2B4)
    assert (found.guard.name, found.guard.checksum_field, found.wrong) == (name, Field(8 * byte, 8), 0)


def test_an_xor_fits_at_every_byte_and_is_told_at_the_last():
    found = find_checksum(protected(guard("xor8", length=8, checksum=Field(24, 8))), 0x123)
    assert (found.guard.name, found.guard.checksum_field) == ("xor8", Field(56, 8))


def test_hondas_nibble_is_found():
    made = guard("nibble_sum", length=8, arbitration_id=0xE4, checksum=Field(56, 4), counter=Field(60, 2))
    found = find_checksum(protected(made), 0xE4)
    assert (found.guard.name, found.guard.checksum_field) == ("nibble_sum", Field(56, 4))


@pytest.mark.parametrize(
    "settings_of",
    [
        {"name": "P01", "length": 8, "data_id": 0x2B4},
        {"name": "P01", "length": 8, "data_id": 0x2B4, "offset": 4},
        {"name": "P01", "length": 8, "data_id": 0x3412, "data_id_mode": "alternating"},
        {"name": "P02", "length": 8, "data_id": tuple(range(7, 23))},
        {"name": "P22", "length": 16, "data_id": tuple(range(7, 23)), "offset": 8},
        {"name": "P04", "length": 24, "data_id": 0x0A0B0C0D},
        {"name": "P05", "length": 8, "data_id": 0xBEEF},
        {"name": "P06", "length": 16, "data_id": 0xBEEF},
        {"name": "P07", "length": 32, "data_id": 0x0A0B0C0D},
        {"name": "hyundai_canfd", "length": 16, "arbitration_id": 0x2B4, "checksum": Field(0, 16)},
        {"name": "crc8_2f", "length": 8, "data_id": 0x2B4, "checksum": Field(0, 8)},
        {"name": "crc16_ccitt", "length": 8, "checksum": Field(56, 16, True)},
    ],
    ids=lambda one: "-".join(map(str, one.values())),
)
def test_a_protection_is_found_with_its_data_id(settings_of):
    made = guard(**settings_of)
    found = find_checksum(protected(made, count=400), 0x2B4)
    assert (found.guard.name, found.guard.data_id, found.data_ids) == (made.name, made.data_id, 1)
    assert found.guard.checksum_field == made.checksum_field


def test_a_data_id_of_profile_1_that_nobody_knows_is_one_of_256_and_a_known_one_is_it():
    frames = protected(guard("P01", length=8, data_id=0xC0DE))
    unknown = find_checksum(frames, 0x123)
    assert (unknown.guard.name, unknown.data_ids) == ("P01", 256)
    assert "256 data ids fit" in unknown.text()
    assert unknown.guard.check_bulk(frames).all()
    known = find_checksum(frames, 0x123, lambda: [1, 0xC0DE])
    assert (known.guard.data_id, known.data_ids) == (0xC0DE, 1)


def test_damaged_frames_among_good_ones_are_counted():
    made = guard("P01", length=8, data_id=0x123)
    frames = protected(made, count=1000)
    frames[::100, 5] ^= 0x40
    found = find_checksum(frames, 0x123)
    assert (found.guard.name, found.wrong) == ("P01", 10)


def test_a_copied_byte_is_no_checksum():
    frames = np.zeros((100, 8), dtype=np.uint8)
    frames[:, 2] = frames[:, 7] = np.arange(100)
    assert find_checksum(frames, 0x123) is None


@settings(max_examples=100, deadline=None)
@given(
    is_fd=st.booleans(),
    switches=st.booleans(),
    extended=st.booleans(),
    stuffed=st.booleans(),
    place=st.integers(0, 15),
)
def test_the_time_of_a_frame_is_that_of_the_load_of_a_profile(is_fd, switches, extended, stuffed, place):
    length = sorted(FD_LENGTHS)[place if is_fd else min(place, 8)]
    flags = extended | is_fd * FD | (is_fd and switches) * BITRATE_SWITCH
    columns = columns_from([Record(T0, 0x100, 0, flags, bytes(length))])
    nominal, fast = bits_of(columns, stuffed=stuffed)
    speed = BusSpeed(nominal_bps=500e3, data_bps=2e6)
    expected = frame_s(length, speed, is_fd=is_fd, switches=switches, is_extended=extended, stuffed=stuffed)
    assert nominal[0] / 500e3 + fast[0] / 2e6 == pytest.approx(expected, rel=1e-12)


def test_the_load_is_the_time_that_the_frames_take(tmp_path):
    records = cyclic(0x100, [float(k) for k in range(1001)], data=bytes(8))
    (channel,) = inspect_log(write(tmp_path / "x.log", records), bitrate_bps=1e6).channels
    assert channel.load == pytest.approx((1001 * 111e-6, 1001 * 135e-6))  # 8 bytes: 111 to 135 bits


@pytest.fixture(scope="module")
def rav4():
    return inspect_log(SHARED_DATA / "can/rav4_drive.log")


@needs_shared
@pytest.mark.parametrize("identifier", [0x25, 0xB4, 0x1D2, 0x260])
def test_the_byte_sums_of_the_rav4_are_found(rav4, identifier):
    message = next(one for one in rav4.messages if one.arbitration_id == identifier)
    assert message.checksum.guard.name == "sum8_id"
    assert message.checksum.guard.checksum_field == Field(56, 8)
    assert message.checksum.wrong == 0


@needs_shared
def test_no_other_kind_of_checksum_is_seen_in_the_rav4(rav4):
    names = {one.checksum.guard.name for one in rav4.messages if one.checksum is not None}
    assert names == {"sum8_id"}
    assert sum(one.frames for one in rav4.messages) == rav4.report.frames == 53_800


@pytest.fixture(scope="module")
def lanes(tmp_path_factory):
    """A log of our own lane frames."""
    path = tmp_path_factory.mktemp("lanes") / "lanes.blf"
    assert main(["run", "--fast", "--duration", "4", "--quiet", "--log", str(path)]) == 0
    return path


@pytest.mark.parametrize(
    "database", [None, load_database(SHIPPED / "lds.dbc")], ids=["alone", "with its DBC"]
)
def test_our_own_frames_have_profile_1_with_their_data_ids_and_counters_to_14(lanes, database):
    layouts = load_database(SHIPPED / "lds.dbc").layouts.values()
    expected = {one.arbitration_id: one for one in layouts}
    found = inspect_log(lanes, database=database).messages
    assert {one.arbitration_id for one in found} <= expected.keys()
    assert len(found) == 13
    for one in found:
        layout = expected[one.arbitration_id]
        assert (one.checksum.guard.name, one.checksum.guard.data_id) == ("P01", layout.e2e_data_id)
        assert (Field(8, 4), 15) in [(counter.field, counter.states) for counter in one.counters]
        assert one.cycle_ms == pytest.approx(40.0)
        assert one.name == (layout.name if database is not None else "")


def test_the_command_prints_every_id_and_writes_the_same_as_json(lanes, tmp_path, capsys):
    assert (
        main(["log", str(lanes), "--dbc", str(SHIPPED / "lds.dbc"), "--json", str(tmp_path / "x.json")]) == 0
    )
    out = capsys.readouterr().out
    told = json.loads((tmp_path / "x.json").read_text())
    assert told["frames"] == sum(message["frames"] for message in told["messages"])
    for message in told["messages"]:
        line = next(line for line in out.splitlines() if f" {message['name']} " in line)
        assert f"{message['id']:03X}" in line
        assert f"data id 0x{message['checksum']['data_id']:X}" in line
    assert "NaN" not in (tmp_path / "x.json").read_text()


def test_a_single_frame_is_json_without_nan(tmp_path):
    write(tmp_path / "x.log", cyclic(0x100, [0.0]))
    assert main(["log", str(tmp_path / "x.log"), "--json", str(tmp_path / "x.json")]) == 0
    assert json.loads((tmp_path / "x.json").read_text())["messages"][0]["cycle_ms"] is None


def test_frames_of_one_time_make_no_load(tmp_path, capsys):
    write(tmp_path / "x.log", cyclic(0x100, [0.0, 0.0]))
    assert main(["log", str(tmp_path / "x.log"), "--json", str(tmp_path / "x.json")]) == 0
    assert "load unknown: all frames have one time" in capsys.readouterr().out
    assert json.loads((tmp_path / "x.json").read_text())["channels"][0]["load"] is None


def test_the_log_that_is_inspected_is_not_written_over(tmp_path, capsys):
    log = write(tmp_path / "x.log", cyclic(0x100, [0.0, 10.0]))
    before = log.read_bytes()
    assert main(["log", str(log), "--json", str(log)]) == 2
    assert log.read_bytes() == before
    assert "is the log that is read" in capsys.readouterr().err


def test_a_cut_log_is_told_of_and_inspected_up_to_there(tmp_path, lanes):
    whole = lanes.read_bytes()
    (tmp_path / "cut.blf").write_bytes(whole[: len(whole) // 2])
    summary = inspect_log(tmp_path / "cut.blf")
    assert summary.report.frames > 100
    assert any("cut off" in line for line in text_lines(summary))


def test_a_log_without_times_needs_a_rate(tmp_path):
    (tmp_path / "x.log").write_text("can0 123#11\n" * 20)
    with pytest.raises(LogError, match="--rate"):
        inspect_log(tmp_path / "x.log")
    assert only(inspect_log(tmp_path / "x.log", rate_hz=50.0)).cycle_ms == 20.0


def test_a_json_file_that_cannot_be_written_is_one_line(lanes, tmp_path, capsys):
    assert main(["log", str(lanes), "--json", str(tmp_path / "nowhere" / "x.json")]) == 2
    assert capsys.readouterr().err.count("\n") == 1

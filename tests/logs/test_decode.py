"""Logs decoded into rows of quantities."""

import csv

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import open_log_writer
from vsensor.logs.decode import decode_log
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig
from vsensor.transmit import Transmitter, initial_state, transmit
from vsensor.types import Frame, MarkingKind, Tick

T0 = 1_700_000_000_000_000_000
PERIOD_NS = 40_000_000
IMAGES = 10


def values_at(index: int) -> dict[str, float]:
    return {
        "image.index": float(index),
        "image.timestamp_ms": 40.0 * index,
        "sensor.state": 2.0,
        "left.available": 1.0,
        "left.offset_m": 1.5 + 0.01 * index,
        "left.x_max_m": 60.0,
        "left.quality": 4.0,
        "left.kind": float(MarkingKind.DASHED),
        "right.available": 0.0,
    }


def sent_frames():
    transmitter = Transmitter(load_profile("native"), VehicleConfig(), 1.5)
    state = initial_state(transmitter)
    for index in range(IMAGES):
        tick = Tick(index=index, t_ns=T0 + index * PERIOD_NS, period_ns=PERIOD_NS)
        state, frames = transmit(transmitter, state, values_at(index), tick)
        yield from frames


@pytest.fixture
def log(tmp_path):
    path = tmp_path / "sent.log"
    with open_log_writer(path) as writer:
        for frame in sent_frames():
            writer.write(frame)
    return path


def test_there_is_one_row_per_image_with_what_was_sent(log):
    table = decode_log(log, [load_profile("native")])
    assert table.t_ns.tolist() == [T0 + k * PERIOD_NS for k in range(IMAGES)]
    np.testing.assert_array_equal(table.columns["image.index"], np.arange(IMAGES))
    np.testing.assert_allclose(table.columns["left.offset_m"], 1.5 + 0.01 * np.arange(IMAGES), atol=1e-3)
    assert (table.columns["left.kind"] == MarkingKind.DASHED).all()
    assert np.isnan(table.columns["right.offset_m"]).all()


def test_a_frame_with_a_wrong_crc_is_left_out_and_counted(log):
    lines = log.read_text().splitlines(keepends=True)
    broken = next(k for k, line in enumerate(lines) if " 323#" in line)  # LDS_LeftLine of image 0
    digit = lines[broken].index("#") + 8
    lines[broken] = (
        lines[broken][:digit] + ("0" if lines[broken][digit] != "0" else "1") + lines[broken][digit + 1 :]
    )
    log.write_text("".join(lines))
    table = decode_log(log, [load_profile("native")])
    assert np.isnan(table.columns["left.offset_m"][0])
    assert not np.isnan(table.columns["left.offset_m"][1:]).any()
    assert any("1 of 130 frames of profile native left out" in finding for finding in table.findings)


def test_frames_of_others_between_do_not_split_a_row(log):
    lines = log.read_text().splitlines(keepends=True)
    other = [line.split(" ")[0] + " can0 7E0#00\n" for line in lines]
    log.write_text("".join(x for pair in zip(lines, other, strict=True) for x in pair))
    assert len(decode_log(log, [load_profile("native")])) == IMAGES


def test_bursts_that_a_recorder_batched_together_are_told_apart_by_their_repeating_messages(log):
    stamped = [f"(1.000000) {line.split(' ', 1)[1]}" for line in log.read_text().splitlines(keepends=True)]
    log.write_text("".join(stamped))
    table = decode_log(log, [load_profile("native")])
    np.testing.assert_array_equal(table.columns["image.index"], np.arange(IMAGES))


def test_csv_lines_read_back_as_the_columns(log):
    table = decode_log(log, [load_profile("native")])
    rows = list(csv.DictReader(table.csv_lines()))
    assert len(rows) == IMAGES
    assert rows[3]["time_s"] == "1700000000.120000000"
    assert float(rows[3]["left.offset_m"]) == pytest.approx(table.columns["left.offset_m"][3], abs=1e-8)
    assert rows[3]["right.offset_m"] == ""
    assert rows[3]["left.kind"] == "2"


def test_text_lines_are_aligned_and_name_the_codes(log):
    lines = list(decode_log(log, [load_profile("native")]).text_lines())
    assert len(lines) == IMAGES + 2
    assert lines[1].split()[0] == "time_s"
    assert "dashed" in lines[2]
    place = lines[1].index("offset_m") + len("offset_m")
    assert lines[0][:place].endswith("left")
    assert lines[5][:place].split()[-1] == "1.53"
    assert "nan" not in "".join(lines)


@pytest.mark.parametrize("width", [40, 80, 132])
def test_text_for_a_terminal_holds_the_same_columns_in_tables_that_fit(log, width):
    table = decode_log(log, [load_profile("native")])
    whole = list(table.text_lines())
    parts = "\n".join(table.text_lines(width)).split("\n\n")
    assert max(len(line) for part in parts for line in part.split("\n")) <= width
    assert all(len(part.split("\n")) == len(whole) for part in parts)
    joined = [
        [cell for part in parts for cell in part.split("\n")[row].split()[1:]] for row in range(1, len(whole))
    ]
    assert joined == [line.split()[1:] for line in whole[1:]]


def test_a_column_without_any_value_is_not_in_the_text(log):
    table = decode_log(log, [load_profile("native")])
    columns = list(zip(*(line.split() for line in list(table.text_lines())[2:]), strict=True))
    assert not any(set(column) == {"-"} for column in columns)


def test_a_log_without_the_profiles_frames_says_what_was_looked_for(tmp_path):
    path = tmp_path / "other.log"
    path.write_text("(1.0) can0 123#00\n")
    with pytest.raises(LogError, match=r"holds no intact frame of LDS_Image 0x320, .*; it has 1 ids: 0x123"):
        decode_log(path, [load_profile("native")])


@needs_shared
def test_a_car_makers_log_decodes_through_its_profile_and_agrees_with_cantools():
    import cantools

    dbc = SHARED_DATA / "dbc/toyota_rav4_2017_pt_generated.dbc"
    table = decode_log(SHARED_DATA / "can/rav4_drive.log", [load_profile("toyota_rav4", dbc)])
    speeds = table.columns["ego.speed_mps"][~np.isnan(table.columns["ego.speed_mps"])]
    message = cantools.database.load_file(dbc, strict=False).get_message_by_name("SPEED")
    lines = [
        line for line in (SHARED_DATA / "can/rav4_drive.log").read_text().splitlines() if " 0B4#" in line
    ]
    expected = [message.decode(bytes.fromhex(line.split("#")[1]))["SPEED"] / 3.6 for line in lines]
    np.testing.assert_allclose(speeds, expected, rtol=1e-12)


LDS_IDS = [*range(0x320, 0x32D)]
NOISE = st.lists(
    st.tuples(
        st.integers(0, IMAGES * 13),
        st.sampled_from(LDS_IDS) | st.integers(0, 0x1FFFFFFF),
        st.binary(min_size=8, max_size=8) | st.binary(max_size=8),
        st.sampled_from(["", "", "", "is_remote", "is_error", "is_extended"]),
    ),
    max_size=40,
)


@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(noise=NOISE)
def test_random_frames_among_good_ones_change_no_row(tmp_path, noise):
    profile = load_profile("native")
    frames = list(sent_frames())
    for place, identifier, data, flag in sorted(noise, key=lambda one: -one[0]):
        plan = profile.by_id.get((identifier, flag == "is_extended" or identifier > 0x7FF))
        if plan is not None and not flag and plan.guard.check(data):
            continue  # 1 of 256 is right by chance
        t_ns = frames[min(place, len(frames) - 1)].due_ns
        flags = {flag: True} if flag else {}
        flags |= {"is_extended": True} if identifier > 0x7FF else {}
        data = b"" if flag == "is_remote" else data
        frames.insert(place, Frame(due_ns=t_ns, arbitration_id=identifier, data=data, **flags))
    path = tmp_path / "noisy.log"
    with open_log_writer(path) as writer:
        for frame in frames:
            writer.write(frame)
    table = decode_log(path, [profile])
    expected = decode_log_of(tmp_path, list(sent_frames()), profile)
    assert table.t_ns.tolist() == expected.t_ns.tolist()
    for name, column in expected.columns.items():
        np.testing.assert_array_equal(table.columns[name], column, err_msg=name)


def decode_log_of(tmp_path, frames, profile):
    path = tmp_path / "clean.log"
    with open_log_writer(path) as writer:
        for frame in frames:
            writer.write(frame)
    return decode_log(path, [profile])

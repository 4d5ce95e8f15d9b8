"""The codec against cantools, bit for bit, and where it differs on purpose: saturation, SNA, NaN."""

import math
import random
from pathlib import Path

import cantools
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.shared import SHARED_DATA, needs_shared
from vsensor.codec import (
    audit,
    decode,
    decode_bulk,
    encode,
    load_database,
    overlaps,
    quantise,
)
from vsensor.errors import DbcError

OWN = sorted((Path(__file__).parents[1] / "dbc").glob("*.dbc"))
SHARED = [
    "canmod-gps",
    "ford_lincoln_base_pt",
    "honda_bosch_lane_lines_extract",
    "hyundai_canfd_fr_cmr_03_extract",
    "tesla_das_lanes_extract",
    "toyota_rav4_2017_pt_generated",
]
HEAD = 'VERSION ""\nNS_ :\nBS_:\nBU_: A B\n'


def database(tmp_path, text):
    path = tmp_path / "test.dbc"
    path.write_text(HEAD + text)
    return load_database(path)


def layout_of(tmp_path, signal, length=8):
    return database(tmp_path, f"BO_ 1 M: {length} A\n SG_ {signal} B\n").layouts["M"]


def assert_equals_cantools(path):
    ours, reference = load_database(path), cantools.database.load_file(path, strict=False)
    rng = random.Random(5)
    for message in reference.messages:
        layout = ours.layouts[message.name]
        rows = [rng.randbytes(message.length) for _ in range(4)]
        data = np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(4, message.length)
        bulk = decode_bulk(layout, data)
        for number, row in enumerate(rows):
            expected = {k: float(v) for k, v in message.decode(row, decode_choices=False).items()}
            assert decode(layout, row) == expected, message.name
            in_bulk = {k: float(v[number]) for k, v in bulk.items() if not math.isnan(v[number])}
            assert in_bulk == expected, message.name
            if all(signal.sna_raw is None for signal in layout.signals.values()):
                data_back, saturated = encode(layout, expected)
                assert bytes(data_back) == message.encode(expected, strict=False), message.name
                assert not saturated


@pytest.mark.parametrize("path", OWN, ids=lambda path: path.stem)
def test_own_databases_are_coded_as_cantools_codes_them(path):
    assert_equals_cantools(path)


@needs_shared
@pytest.mark.parametrize("name", SHARED)
def test_public_databases_are_coded_as_cantools_codes_them(name):
    assert_equals_cantools(SHARED_DATA / "dbc" / f"{name}.dbc")


@st.composite
def placed_signals(draw):
    """A signal somewhere in a message of up to 64 bytes: (DBC text, message length)."""
    length = draw(st.sampled_from([1, 2, 7, 8, 12, 32, 64]))
    bits = draw(st.integers(1, min(64, 8 * length)))
    sign = draw(st.sampled_from("+-"))
    first = draw(st.integers(0, 8 * length - bits))
    if draw(st.booleans()):  # little-endian: the start bit is the lowest
        return f'S : {first}|{bits}@1{sign} (0.5,-3) [0|0] ""', length
    start = 8 * (first // 8) + 7 - first % 8  # big-endian: the start bit is the highest
    return f'S : {start}|{bits}@0{sign} (0.5,-3) [0|0] ""', length


@settings(max_examples=150, deadline=None)
@given(placed=placed_signals(), seed=st.integers(0, 2**32))
def test_a_signal_anywhere_is_read_and_written_as_cantools_does(placed, seed, tmp_path_factory):
    text, length = placed
    path = tmp_path_factory.mktemp("dbc") / "one.dbc"
    path.write_text(f"{HEAD}BO_ 1 M: {length} A\n SG_ {text} B\n")
    layout = load_database(path).layouts["M"]
    message = cantools.database.load_file(path).messages[0]
    row = random.Random(seed).randbytes(length)
    physical = float(message.decode(row)["S"])
    assert decode(layout, row)["S"] == physical
    assert decode_bulk(layout, np.frombuffer(row, dtype=np.uint8)[None])["S"][0] == physical
    signal = layout.signals["S"]
    if signal.length <= 52:
        assert bytes(encode(layout, {"S": physical})[0]) == message.encode({"S": physical}, strict=False)


@pytest.mark.parametrize("order", [0, 1])
@pytest.mark.parametrize("bits", [1, 9, 57, 58, 61, 63, 64])
def test_a_signal_at_every_bit_of_a_long_message_is_read_in_bulk_as_cantools_reads_it(tmp_path, bits, order):
    length = 12
    starts = [first if order else 8 * (first // 8) + 7 - first % 8 for first in range(8 * length - bits + 1)]
    path = tmp_path / "all.dbc"
    path.write_text(
        HEAD
        + "".join(
            f'BO_ {k + 1} M{k}: {length} A\n SG_ S : {start}|{bits}@{order}+ (1,0) [0|0] "" B\n'
            for k, start in enumerate(starts)
        )
    )
    ours, rng = load_database(path), random.Random(bits)
    for message in cantools.database.load_file(path).messages:
        low = rng.getrandbits(min(bits, 53))  # what a float64 holds to the last bit
        for raw in (low, low << max(bits - 53, 0)):
            row = np.frombuffer(message.encode({"S": raw}), dtype=np.uint8)
            assert decode_bulk(ours.layouts[message.name], row[None])["S"][0] == raw, message.signals[0].start


@pytest.mark.parametrize(("bits", "kind"), [(32, 1), (64, 2)])
def test_float_signals_go_there_and_back(tmp_path, bits, kind):
    text = f'BO_ 1 M: 8 A\n SG_ S : 0|{bits}@1- (1,0) [0|0] "" B\nSIG_VALTYPE_ 1 S : {kind};\n'
    layout = database(tmp_path, text).layouts["M"]
    data, saturated = encode(layout, {"S": -1.5})
    assert decode(layout, bytes(data))["S"] == -1.5
    assert decode_bulk(layout, np.frombuffer(data, dtype=np.uint8)[None])["S"][0] == -1.5
    assert not saturated
    for value in (math.nan, math.inf, -math.inf):
        assert math.isfinite(decode(layout, bytes(encode(layout, {"S": value})[0]))["S"])


def test_rounding_is_half_to_even(tmp_path):
    layout = layout_of(tmp_path, 'S : 0|8@1+ (2,0) [0|0] ""')
    assert [quantise(layout.signals["S"], value)[0] for value in (1.0, 3.0, 5.0, 5.1)] == [0, 2, 2, 3]


@pytest.mark.parametrize(("value", "raw"), [(1e308, 127), (128.0, 127), (-1e308, -128), (-math.inf, -128)])
def test_what_the_bits_cannot_hold_saturates_and_says_so(tmp_path, value, raw):
    signal = layout_of(tmp_path, 'S : 3|8@1- (1,0) [0|1] ""').signals["S"]
    assert quantise(signal, value) == (raw, True)


def test_a_placeholder_range_does_not_clip(tmp_path):
    signal = layout_of(tmp_path, 'S : 0|12@1+ (0.004,-8.192) [0|1] ""').signals["S"]
    assert quantise(signal, -5.0) == (798, False)


@pytest.mark.parametrize("sna", [-128, 127, 5])
def test_a_number_never_becomes_the_sna_value(tmp_path, sna):
    text = (
        'BO_ 1 M: 8 A\n SG_ S : 0|8@1- (1,0) [0|0] "" B\nBA_DEF_ SG_ "GenSigSNA" STRING ;\n'
        f'BA_DEF_DEF_ "GenSigSNA" "";\nBA_ "GenSigSNA" SG_ 1 S "{sna}";\n'
    )
    signal = database(tmp_path, text).layouts["M"].signals["S"]
    raws = {quantise(signal, float(value))[0] for value in range(-300, 300)}
    assert raws == set(range(-128, 128)) - {sna}
    assert quantise(signal, math.nan) == (sna, False)


def test_nan_becomes_the_start_value_where_there_is_no_sna(tmp_path):
    text = (
        'BO_ 1 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" B\nBA_DEF_ SG_ "GenSigStartValue" INT 0 255;\n'
        'BA_DEF_DEF_ "GenSigStartValue" 0;\nBA_ "GenSigStartValue" SG_ 1 S 7;\n'
    )
    layout = database(tmp_path, text).layouts["M"]
    assert encode(layout, {"S": math.nan})[0][0] == 7
    assert encode(layout, {})[0][0] == 7


def test_a_multiplexed_signal_is_there_only_when_selected(tmp_path):
    text = (
        'BO_ 1 M: 8 A\n SG_ Sel M : 0|8@1+ (1,0) [0|0] "" B\n'
        ' SG_ X m0 : 8|8@1+ (1,0) [0|0] "" B\n SG_ Y m1 : 8|8@1+ (1,0) [0|0] "" B\n'
    )
    layout = database(tmp_path, text).layouts["M"]
    rows = [bytes([sel, 9, 0, 0, 0, 0, 0, 0]) for sel in (0, 1, 2)]
    assert [sorted(decode(layout, row)) for row in rows] == [["Sel", "X"], ["Sel", "Y"], ["Sel"]]
    bulk = decode_bulk(layout, np.frombuffer(b"".join(rows), dtype=np.uint8).reshape(3, 8))
    assert np.isnan(bulk["X"]).tolist() == [False, True, True]
    assert overlaps(layout) == []


def test_a_short_frame_is_refused(tmp_path):
    layout = layout_of(tmp_path, 'S : 0|8@1+ (1,0) [0|0] ""')
    with pytest.raises(ValueError, match="7 bytes, 8 expected"):
        decode(layout, bytes(7))


def test_the_audit_finds_ranges_start_values_overlaps_and_missing_cycle_times(tmp_path):
    text = (
        'BO_ 1 M: 8 A\n SG_ Wide : 0|4@1+ (1,0) [0|20] "" B\n SG_ Place : 8|8@1+ (1,0) [0|1] "" B\n'
        ' SG_ Over : 3|2@1+ (1,0) [0|3] "" B\nBA_DEF_ SG_ "GenSigStartValue" INT 0 1000;\n'
        'BA_DEF_DEF_ "GenSigStartValue" 0;\nBA_ "GenSigStartValue" SG_ 1 Place 300;\n'
    )
    found = "\n".join(audit(database(tmp_path, text)))
    assert "M: no cycle time" in found
    assert "M.Wide: range [0|20] exceeds what 4 bits hold, [0|15]" in found
    assert "M.Place: range [0|1] is a placeholder, the bits hold [0|255]" in found
    assert "M.Place: start value 300 (raw) is not among [0|255]" in found
    assert "M: signals Wide and Over overlap" in found


def test_a_placeholder_exceeds_nothing_even_where_the_bits_hold_less(tmp_path):
    text = 'BO_ 1 M: 8 A\n SG_ Curvature : 0|12@1+ (0.00001,-0.02048) [0|1] "" B\n'
    found = [line for line in audit(database(tmp_path, text)) if "Curvature" in line]
    assert found == ["M.Curvature: range [0|1] is a placeholder, the bits hold [-0.02048|0.02047]"]


def test_the_audit_says_nothing_of_our_own_databases():
    assert {path.name: audit(load_database(path)) for path in OWN} == {path.name: [] for path in OWN}


def test_a_missing_database_is_one_line(tmp_path):
    with pytest.raises(DbcError, match=r"nowhere\.dbc: no such file"):
        load_database(tmp_path / "nowhere.dbc")


def test_a_database_that_cantools_refuses_gives_its_reason_and_line(tmp_path):
    path = tmp_path / "broken.dbc"
    path.write_text('VERSION ""\nBO_ oops\n')
    with pytest.raises(DbcError, match=r"broken\.dbc: cantools refuses it: .*line 2") as caught:
        load_database(path)
    assert "\n" not in str(caught.value)


def test_a_signal_outside_its_message_is_refused(tmp_path):
    with pytest.raises(DbcError, match=r"M\.S: bit 60, length 8 does not fit 8 bytes"):
        layout_of(tmp_path, 'S : 60|8@1+ (1,0) [0|0] ""')


TWO_OF_A_NAME = {
    "two messages are named M, with ids 0x1 and 0x2": "BO_ 1 M: 8 A\n\nBO_ 2 M: 8 A\n",
    "M: two signals are named S, start bits 0 and 8": (
        'BO_ 1 M: 8 A\n SG_ S : 0|8@1+ (1,0) [0|0] "" B\n SG_ S : 8|8@1+ (1,0) [0|0] "" B\n'
    ),
}


@pytest.mark.parametrize(("said", "text"), TWO_OF_A_NAME.items(), ids=["messages", "signals"])
def test_two_of_one_name_are_refused_not_overwritten(tmp_path, said, text):
    with pytest.raises(DbcError, match=said):
        database(tmp_path, text)


def test_two_messages_of_one_id_are_a_finding_and_nothing_else_is_printed(tmp_path, caplog):
    found = audit(database(tmp_path, "BO_ 1 M: 8 A\n\nBO_ 1 N: 8 A\n\nBO_ 2147483649 X: 8 A\n"))
    assert [line for line in found if "id" in line] == ["M and N have the same id"]
    assert caplog.records == []


def test_a_refusal_does_not_drive_the_terminal(tmp_path):
    path = tmp_path / "binary.dbc"
    path.write_bytes(b"\x1b[31m\x07\x9b")
    with pytest.raises(DbcError) as caught:
        load_database(path)
    assert str(caught.value).isprintable()


def refusal(path):
    """Return what a database is refused with, None if it is read."""
    try:
        load_database(path)
    except DbcError as error:
        return str(error)
    return None


@pytest.mark.parametrize("cut", range(0, 4000, 137))
def test_a_database_cut_off_anywhere_is_read_or_refused_by_name(tmp_path, cut):
    path = tmp_path / "cut.dbc"
    path.write_text(OWN[0].read_text()[:cut])
    said = refusal(path)
    assert said is None or said.startswith(f"{path}: ")

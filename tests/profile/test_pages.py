"""Multiplexed messages and whole nodes: what is sent, in which order, and read back."""

import dataclasses
import math

import pytest

from tests.bus_values import boundary, estimate
from tests.made_profiles import Sender, nothing, profile_of, raws, reference, sent, values, written
from tests.test_profile import assert_bulk_equals_single
from vsensor.errors import ConfigError
from vsensor.profile import load_profile
from vsensor.types import Side

LINES = (
    'BO_ 8 M: 8 CAM\n SG_ Which M : 0|4@1+ (1,0) [0|15] "" ECU\n SG_ Cnt : 4|4@1+ (1,0) [0|15] "" ECU\n'
    ' SG_ Crc : 8|8@1+ (1,0) [0|255] "" ECU\n'
    ' SG_ LOff m2 : 16|16@1- (0.001,0) [0|0] "m" ECU\n SG_ LKind m2 : 32|8@1+ (1,0) [0|255] "" ECU\n'
    ' SG_ ROff m5 : 23|16@0- (0.001,0) [0|0] "m" ECU\n SG_ Rest m7 : 16|8@1+ (1,0) [0|255] "" ECU\n'
    ' SG_ All : 56|8@1+ (1,0) [0|255] "" ECU\n'
)
PAGES = (
    '[messages.M]\ncycle_ms = 40\nmux = "{mux}"\n'
    'e2e = {{ crc = "Crc", counter = "Cnt", profile = "crc8_j1850" }}\n'
    '[messages.M.signals]\nLOff = "left.offset_m"\nROff = "right.offset_m"\nLKind = "left.kind"\n'
    'All = {{ quantity = "image.index", wrap = true }}\n'
)


def test_pages_leave_together_in_the_order_of_their_multiplexer(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="together"))
    frames = sent(profile, values())
    found = raws(profile, frames)
    assert [raw["Which"] for raw in found] == [2, 5]
    assert (found[0]["LOff"], found[0]["LKind"], found[1]["ROff"]) == (1800, 2, -1700)
    assert [raw["Cnt"] for raw in found] == [0, 1]
    told = [profile.decode(frame, check=True) for frame in frames]
    assert set(told[0]) == {"left.offset_m", "left.kind", "image.index"}
    assert set(told[1]) == {"right.offset_m", "image.index"}
    assert_bulk_equals_single(profile, list(frames), check=True)


def test_pages_that_rotate_leave_one_in_each_slot_and_the_counter_goes_on(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="rotate"))
    sender = Sender(profile)
    found = [raws(profile, sender(values())) for _ in range(20)]
    assert [[raw["Which"] for raw in slot] for slot in found] == [[2], [5]] * 10
    assert [slot[0]["Cnt"] for slot in found] == [k % 16 for k in range(20)]


def test_a_constant_multiplexer_chooses_the_page_that_is_sent(tmp_path):
    text = "[messages.M]\ncycle_ms = 40\nsignals = { Which = { constant = 7 }, Rest = { constant = 9 } }\n"
    profile = profile_of(tmp_path, LINES, text)
    assert [(raw["Which"], raw["Rest"]) for raw in raws(profile, sent(profile, values()))] == [(7, 9)]


def test_a_signal_of_a_page_that_is_never_sent_is_refused(tmp_path):
    text = PAGES.format(mux="together") + "Which = { constant = 2 }\n"
    with pytest.raises(ConfigError, match="ROff is in no frame with Which = 2"):
        load_profile(written(tmp_path, LINES, text))


def test_a_multiplexer_cannot_carry_a_quantity_when_sent(tmp_path):
    text = PAGES.format(mux="together") + 'Which = { quantity = "image.index", wrap = true }\n'
    profile = profile_of(tmp_path, LINES, text)
    with pytest.raises(ConfigError, match=r"M\.Which: the multiplexer says which signals"):
        Sender(profile)


NESTED = (
    'BO_ 9 N: 8 CAM\n SG_ A M : 0|4@1+ (1,0) [0|15] "" ECU\n SG_ B m1M : 4|4@1+ (1,0) [0|15] "" ECU\n'
    ' SG_ X m3 : 8|8@1+ (1,0) [0|255] "" ECU\n SG_ Y m4 : 8|8@1+ (1,0) [0|255] "" ECU\n'
    ' SG_ Z m2 : 8|8@1+ (1,0) [0|255] "" ECU\n'
    "SG_MUL_VAL_ 9 B A 1-1;\nSG_MUL_VAL_ 9 X B 3-3;\nSG_MUL_VAL_ 9 Y B 4-4;\nSG_MUL_VAL_ 9 Z A 2-2;\n"
)


def test_nested_multiplexers_give_a_page_for_each_way_to_a_signal(tmp_path):
    text = (
        "[messages.N]\ncycle_ms = 40\n[messages.N.signals]\n"
        'X = "left.quality"\nY = "right.quality"\nZ = { constant = 17 }\n'
    )
    profile = profile_of(tmp_path, NESTED, text)
    assert raws(profile, sent(profile, values())) == [
        {"A": 1, "B": 3, "X": 4},
        {"A": 1, "B": 4, "Y": 4},
        {"A": 2, "Z": 17},
    ]


NODE = (
    'BO_ 16 Lanes: 8 CAM\n SG_ Off : 0|16@1- (0.001,0) [0|0] "m" ECU\n'
    'BO_ 20 Other: 4 CAM\n SG_ V : 8|8@1+ (1,0) [0|0] "" ECU\n SG_ W M : 0|2@1+ (1,0) [0|0] "" ECU\n'
    ' SG_ W1 m0 : 16|8@1+ (1,0) [0|0] "" ECU\n SG_ W2 m1 : 16|8@1+ (1,0) [0|0] "" ECU\n'
    'BO_ 18 Slow: 2 CAM\n SG_ S : 0|8@1+ (1,0) [0|0] "" ECU\n'
    'BO_ 17 Event: 2 CAM\n SG_ E : 0|8@1+ (1,0) [0|0] "" ECU\n'
    'BO_ 19 Foreign: 2 OTHER\n SG_ F : 0|8@1+ (1,0) [0|0] "" ECU\n'
    'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\nBA_DEF_ SG_ "GenSigStartValue" INT 0 65535;\n'
    'BA_DEF_DEF_ "GenMsgCycleTime" 0;\nBA_DEF_DEF_ "GenSigStartValue" 0;\n'
    'BA_ "GenMsgCycleTime" BO_ 16 40;\nBA_ "GenMsgCycleTime" BO_ 18 120;\nBA_ "GenMsgCycleTime" BO_ 20 80;\n'
    'BA_ "GenMsgCycleTime" BO_ 19 40;\n'
    'BA_ "GenSigStartValue" SG_ 18 S 77;\nBA_ "GenSigStartValue" SG_ 20 V 5;\n'
    'BA_ "GenSigStartValue" SG_ 20 W 1;\nBA_ "GenSigStartValue" SG_ 20 W1 255;\n'
    'BA_ "GenSigStartValue" SG_ 20 W2 18;\n'
)


def test_the_other_messages_of_a_node_are_sent_with_start_values_at_their_cycle_times(tmp_path):
    profile = profile_of(tmp_path, NODE, 'node = "CAM"\n[messages.Lanes.signals]\nOff = "left.offset_m"\n')
    sender = Sender(profile)
    slots = [sender(values()) for _ in range(4)]
    assert [[f.arbitration_id for f in frames] for frames in slots] == [
        [16, 18, 20],
        [16],
        [16, 20],
        [16, 18],
    ]
    assert raws(profile, slots[0]) == [{"Off": 1800}, {"S": 77}, {"V": 5, "W": 1, "W2": 18}]


def test_a_node_that_sends_nothing_is_refused_by_name(tmp_path):
    with pytest.raises(ConfigError, match=r"node: 'CAMM' sends no message; did you mean CAM\?"):
        load_profile(written(tmp_path, NODE, 'node = "CAMM"\n'))


def test_a_profile_may_be_of_a_node_alone(tmp_path):
    profile = profile_of(tmp_path, NODE, 'node = "CAM"\n')
    assert [f.arbitration_id for f in sent(profile, nothing())] == [16, 18, 20]


@pytest.mark.parametrize(
    ("length", "whole"), [(8, 8), (9, 12), (13, 16), (17, 20), (33, 48), (49, 64), (64, 64)]
)
def test_can_fd_messages_are_filled_up_to_a_length_that_can_fd_has(tmp_path, length, whole):
    dbc = f'BO_ 5 Long: {length} CAM\n SG_ Off : 0|20@1- (0.001,0) [0|0] "m" ECU\n'
    text = 'padding_byte = 0xCC\n[messages.Long]\ncycle_ms = 40\nsignals = { Off = "left.offset_m" }\n'
    profile = profile_of(tmp_path, dbc, text)
    frame = sent(profile, values())[0]
    assert frame.data[length:] == b"\xcc" * (whole - length)
    assert profile.decode(frame) == {"left.offset_m": pytest.approx(1.8)}
    assert_bulk_equals_single(profile, [frame], width=64)


@pytest.mark.parametrize(
    ("whole", "message", "attribute", "expected"),
    [
        ("", "", None, True),
        ("bitrate_switch = false\n", "", None, False),
        ("bitrate_switch = false\n", "bitrate_switch = true\n", None, True),
        ("", "", 0, False),
        ("bitrate_switch = true\n", "", 0, True),
    ],
)
def test_the_bit_rate_switch_is_the_messages_the_profiles_or_the_databases(
    tmp_path, whole, message, attribute, expected
):
    dbc = 'BO_ 5 Long: 16 CAM\n SG_ Off : 0|20@1- (0.001,0) [0|0] "m" ECU\n'
    if attribute is not None:
        dbc += 'BA_DEF_ BO_ "CANFD_BRS" ENUM "0","1";\nBA_DEF_DEF_ "CANFD_BRS" "1";\n'
        dbc += f'BA_ "CANFD_BRS" BO_ 5 {attribute};\n'
    text = f'{whole}[messages.Long]\ncycle_ms = 40\n{message}[messages.Long.signals]\nOff = "left.offset_m"\n'
    frame = sent(profile_of(tmp_path, dbc, text), values())[0]
    assert (frame.is_fd, frame.bitrate_switch) == (True, expected)


def test_several_lines_in_one_frame_and_one_line_in_several_frames_both_work(tmp_path):
    dbc = (
        'BO_ 1 Both: 8 CAM\n SG_ L : 0|16@1- (0.001,0) [0|0] "m" ECU\n'
        ' SG_ R : 16|16@1- (0.001,0) [0|0] "m" ECU\n'
        'BO_ 2 LeftA: 3 CAM\n SG_ H : 2|16@1- (0.0001,0) [0|0] "" ECU\n'
        'BO_ 3 LeftB: 3 CAM\n SG_ C : 2|20@1- (1E-7,0) [0|0] "1/m" ECU\n'
    )
    text = (
        '[messages.Both]\ncycle_ms = 40\nsignals = { L = "left.offset_m", R = "right.offset_m" }\n'
        '[messages.LeftA]\ncycle_ms = 40\nsignals = { H = "left.heading" }\n'
        '[messages.LeftB]\ncycle_ms = 40\nsignals = { C = "left.curvature_per_m" }\n'
    )
    profile = profile_of(tmp_path, dbc, text)
    told = {}
    for frame in sent(profile, values()):
        told |= profile.decode(frame)
    expected = values()
    assert told == {name: pytest.approx(expected[name], rel=1e-3) for name in told}
    assert len(told) == 4


def test_cantools_reads_a_frame_of_every_page_to_the_same(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="together"))
    for frame in sent(profile, values()):
        message = reference(profile).get_message_by_frame_id(frame.arbitration_id)
        read = message.decode(frame.data, scaling=False, decode_choices=False)
        assert bytes(message.encode(read, scaling=False, strict=False)) == frame.data


def test_a_validity_bit_says_nothing_of_a_page_that_it_is_not_in(tmp_path):
    dbc = LINES + ' SG_ ROk m5 : 33|1@1+ (1,0) [0|1] "" ECU\n'
    text = PAGES.format(mux="together")
    text += 'ROk = { valid_of = ["left", "right"], valid_raw = 0, invalid_raw = 1 }\n'
    profile = profile_of(tmp_path, dbc, text)
    frames = sent(profile, values(estimate(boundary(Side.LEFT, [1.8]))))
    assert raws(profile, frames)[1]["ROk"] == 1
    told = [profile.decode(frame) for frame in frames]
    assert told[0]["left.offset_m"] == pytest.approx(1.8)
    assert math.isnan(told[1]["right.offset_m"])
    assert_bulk_equals_single(profile, list(frames))


def test_a_page_that_is_not_mapped_is_not_sent(tmp_path):
    profile = profile_of(tmp_path, LINES, PAGES.format(mux="together"))
    assert [dict(page) for page in profile.messages[0].pages] == [{"Which": 2}, {"Which": 5}]
    assert dataclasses.is_dataclass(profile)

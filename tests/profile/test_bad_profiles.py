"""What a tester gets wrong is one line on the command line, with the file and the cause, and exit 2."""

import pytest

from tests.made_profiles import written
from tests.test_cli import assert_one_line, vsensor

DBC = (
    'BO_ 1 M: 8 CAM\n SG_ Off : 0|16@1- (0.001,0) [0|0] "m" ECU\n SG_ Kind : 16|4@1+ (1,0) [0|15] "" ECU\n'
    ' SG_ Over : 14|8@1+ (1,0) [0|255] "" ECU\n SG_ Crc : 40|8@1+ (1,0) [0|255] "" ECU\n'
    ' SG_ Cnt : 48|4@1+ (1,0) [0|15] "" ECU\n'
)
MESSAGE = "[messages.M]\ncycle_ms = 40\n"
COMMANDS = [
    ("check", "{path}"),
    ("run", "--fast", "--duration", "1", "--profile", "{path}"),
    ("decode", "any.log", "--profile", "{path}"),
    ("accept", "any.log", "--profile", "{path}"),
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda words: words[0])
@pytest.mark.parametrize(
    ("text", "said"),
    [
        (MESSAGE + 'signals = { Offf = "left.offset_m" }', "M has no signal Offf; did you mean Off?"),
        (MESSAGE + 'signals = { Off = "left.offset" }', "did you mean left.offset_m?"),
        (MESSAGE + 'signals = { Off = "left.offset_m", Over = "left.quality" }', "Off and Over share bits"),
        (MESSAGE + 'signals = { Off = "left.offset_m", Kind = "left.offset_m" }', "both carry left.offset_m"),
        (
            MESSAGE + 'signals = { Kind = { quantity = "left.kind", table = { solid = 1 } } }',
            "table lacks none",
        ),
        (MESSAGE + 'e2e = { crc = "Crc", profile = "crc16_ccitt" }', "checksum has 8 bits at 40"),
        (MESSAGE + 'e2e = { crc = "Crc", profile = "crc9" }', "e2e profile 'crc9' is not known"),
        (MESSAGE + 'e2e = { crc = "Crc" }', "no E2EProfile in the database"),
        (MESSAGE + 'e2e = { counter = "Cnt", counter_states = 17 }', "counter_states = 17"),
        (MESSAGE + 'e2e = { counter = "Cntr" }', "M has no signal Cntr; did you mean Cnt?"),
        (MESSAGE + 'signals = { Off = { quantity = "left.offset_m", error = 40000 } }', "raw value 40000"),
        (MESSAGE + 'signals = { Kind = { quantity = "left.quality", bits = [3, 1] } }', "bits = [3, 1]"),
        (MESSAGE + "signals = { Kind = { valid_of = [] } }", "valid_of names nothing"),
        (MESSAGE + 'signals = { Kind = { valid_of = "lefft" } }', "quantity 'lefft' is not known"),
        (MESSAGE + 'mux = "both"', "messages.M.mux = 'both': rotate, together were expected"),
        (MESSAGE + "padding_byte = 256", "padding_byte"),
        ('node = "CAMERA"\n', "node: 'CAMERA' sends no message"),
        ("[bursts.image]\nmessages = []\n" + MESSAGE, "messages: some, each once, were expected"),
    ],
)
def test_a_wrong_profile_is_one_line_and_exit_2(capsys, tmp_path, command, text, said):
    path = written(tmp_path, DBC, text)
    status, _, err = vsensor(capsys, *(word.format(path=path) for word in command))
    assert status == 2
    assert_one_line(err, str(path), said)


def test_a_database_that_cantools_refuses_is_told_with_its_reason_and_line(capsys, tmp_path):
    path = written(tmp_path, DBC.replace("8 CAM", "8 CAM ?"), MESSAGE)
    status, _, err = vsensor(capsys, "check", path)
    assert status == 2
    assert_one_line(err, "mine.dbc", "cantools refuses it", "line 5")


def test_two_names_for_one_signal_are_refused_by_toml_itself(capsys, tmp_path):
    text = MESSAGE + '[messages.M.signals]\nOff = "left.offset_m"\nOff = "right.offset_m"\n'
    status, _, err = vsensor(capsys, "check", written(tmp_path, DBC, text))
    assert status == 2
    assert_one_line(err, "not TOML")


def test_two_messages_of_one_id_are_no_profile(capsys, tmp_path):
    path = written(tmp_path, "BO_ 1 M: 8 CAM\n\nBO_ 1 N: 8 CAM\n", MESSAGE + MESSAGE.replace("M]", "N]"))
    status, _, err = vsensor(capsys, "check", path)
    assert status == 2
    assert_one_line(err, str(path), "messages.N: has the id of M")

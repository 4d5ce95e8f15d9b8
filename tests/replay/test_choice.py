"""What is played: by id, range, channel, message, sender; and under which id."""

import numpy as np
import pytest

from vsensor.codec import load_database
from vsensor.errors import ConfigError
from vsensor.logs import Flag, Record
from vsensor.logs.table import columns_from
from vsensor.replay.choice import Names, choice

CHANNELS = {"can0": 0, "can1": 1}
FRAMES = columns_from(
    [
        Record(0, 0x100, 0, 0, b""),
        Record(1, 0x123, 0, 0, b"\x01"),
        Record(2, 0x123, 1, int(Flag.EXTENDED), b"\x02"),
        Record(3, 0x18FF1234, 1, int(Flag.EXTENDED), b"\x03"),
        Record(4, 0x200, 1, 0, b"\x04"),
        Record(5, 0, 0, int(Flag.ERROR), b""),
    ]
)
DBC = """
VERSION ""
BS_:
BU_: CAM RADAR
BO_ 291 LANE: 8 CAM
 SG_ A : 0|8@1+ (1,0) [0|0] "" RADAR
BO_ 2566853172 TARGET: 8 RADAR
 SG_ B : 0|8@1+ (1,0) [0|0] "" CAM
BO_ 512 STATE: 8 CAM
 SG_ C : 0|8@1+ (1,0) [0|0] "" RADAR
"""


@pytest.fixture
def names(tmp_path):
    path = tmp_path / "car.dbc"
    path.write_text(DBC.lstrip())
    return Names.of([load_database(path)])


def rows(include=(), exclude=(), names=None):
    """Which of FRAMES are played."""
    mask = choice(include, exclude, (), names).mask(FRAMES, CHANNELS)
    return np.flatnonzero(mask).tolist()


@pytest.mark.parametrize(
    ("words", "played"),
    [
        ((), [0, 1, 2, 3, 4, 5]),
        (("0x123",), [1]),
        (("0x123x",), [2]),
        (("0x18FF1234",), [3]),
        (("0x100-0x123",), [0, 1, 2]),
        (("0x100", "0x200"), [0, 4]),
        (("0x100, 0x200",), [0, 4]),
        (("channel:can1",), [2, 3, 4]),
        (("channel:can9",), []),
        (("0x7FF",), []),
    ],
)
def test_what_is_included_is_played_and_nothing_else(words, played):
    assert rows(include=words) == played


def test_what_is_excluded_is_not_played_even_when_it_is_included():
    assert rows(exclude=("0x123", "channel:can1")) == [0, 5]
    assert rows(include=("0x100-0x1FF",), exclude=("0x123",)) == [0, 2]


def test_a_message_is_known_by_its_name_and_a_sender_means_all_its_messages(names):
    assert rows(include=("LANE",), names=names) == [1]
    assert rows(include=("CAM",), names=names) == [1, 4]
    assert rows(exclude=("RADAR",), names=names) == [0, 1, 2, 4, 5]


@pytest.mark.parametrize(
    ("word", "said"),
    [
        ("LANES", "did you mean LANE"),
        ("123", "hexadecimal, such as 0x123"),
        ("0x20000000", "hexadecimal, such as 0x123"),
        ("0x1-0x", "hexadecimal, such as 0x123"),
        ("0x200-0x100", "first id of a range is the lower one"),
    ],
)
def test_a_word_that_means_nothing_is_refused(word, said, names):
    with pytest.raises(ConfigError, match=f"--include {word}: .*{said}"):
        rows(include=(word,), names=names)


def test_a_name_without_a_database_is_refused_with_what_would_help():
    with pytest.raises(ConfigError, match=r"--exclude LANE: .*--dbc FILE"):
        rows(exclude=("LANE",))


def test_a_renamed_frame_has_its_new_id_and_its_kind_and_the_others_keep_theirs():
    renamed = choice((), (), ("0x100=0x18AA0001", "0x123x=0x5,0x200=0x6x"), None).renamed(FRAMES)
    assert renamed.arbitration_id.tolist() == [0x18AA0001, 0x123, 5, 0x18FF1234, 6, 0]
    assert (renamed.flags & Flag.EXTENDED).tolist() == [1, 0, 0, 1, 1, 0]
    assert FRAMES.arbitration_id[0] == 0x100


def test_two_ids_can_change_places():
    swapped = choice((), (), ("0x100=0x200", "0x200=0x100"), None).renamed(FRAMES)
    assert swapped.arbitration_id[[0, 4]].tolist() == [0x200, 0x100]


@pytest.mark.parametrize("word", ["0x1", "0x1=", "=0x1", "0x1=LANE", "a=b"])
def test_a_renaming_without_two_ids_is_refused(word):
    with pytest.raises(ConfigError, match="--rename"):
        choice((), (), (word,), None)

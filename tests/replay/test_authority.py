"""Every log of the shared folder, played: frame by frame what python-can's own reader says is in it."""

import can
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import Flag, read_log
from vsensor.replay import ReplayOptions, replay_log

FORMATS = SHARED_DATA / "can/formats"
FILES = sorted(FORMATS.iterdir()) if FORMATS.is_dir() else []
NO_BUS = "holds no frame that a bus can carry: id 0x{} in 11 bits"
REFUSED = {
    "single_frame.asc": "holds no CAN frame; 1 lines are none",  # 64 bytes of classic CAN
    "test_CanErrorFrameExt.blf": "none of its frames is .* of a kind that its bus carries",
    "test_CanErrorFrames.asc": "none of its frames is .* of a kind that its bus carries",
    "test_CanFdRemoteMessage.asc": "none of its frames is .* of a kind that its bus carries",
    "test_CanFdMessage.blf": NO_BUS.format("4444444"),
    "test_CanFdMessage64.blf": NO_BUS.format("15555555"),
    "test_CanMessage.blf": NO_BUS.format("4444444"),
    "test_CanMessage2.blf": NO_BUS.format("4444444"),
}
"""The reasons; python-can yields such frames, and its own check says that they are none."""
LONG_CLASSIC = {("issue_1299.asc", 2)}
"""A length of 13 in classic CAN means 8 bytes (ISO 11898-1); python-can takes it for CAN FD's 32."""


def is_possible(message):
    """What python-can's own check says of a message that its reader has made."""
    try:
        message._check()
    except ValueError:
        return False
    return not message.is_error_frame


def authority(path):
    with can.LogReader(path) as reader:
        found = list(reader)
    for name, place in LONG_CLASSIC:
        if name == path.name:
            found[place].dlc = 8
    return [message for message in found if is_possible(message)]


def of_message(message):
    data = b"" if message.is_remote_frame else bytes(message.data)
    kind = message.is_extended_id, message.is_fd, message.bitrate_switch, message.is_remote_frame
    return message.arbitration_id, message.dlc, data, *kind


def played(path, out):
    replay_log(ReplayOptions(path=path, fast=True, log=out), lambda text: None)
    table = read_log(out)
    bits = Flag.EXTENDED, Flag.FD, Flag.BITRATE_SWITCH, Flag.REMOTE
    rows = zip(table.arbitration_id, table.flags, table.length, table.data, strict=True)
    return [
        (
            number,
            size,
            bytes(data[: 0 if flags & Flag.REMOTE else size]),
            *(bool(flags & bit) for bit in bits),
        )
        for number, flags, size, data in rows
    ]


@needs_shared
@pytest.mark.parametrize("path", [f for f in FILES if f.name not in REFUSED], ids=lambda path: path.name)
def test_what_is_played_is_what_python_can_reads(path, tmp_path):
    expected = [of_message(message) for message in authority(path)]
    assert len(expected) > 0
    assert played(path, tmp_path / "out.blf") == expected


@needs_shared
@pytest.mark.parametrize("name", REFUSED)
def test_what_is_refused_holds_no_frame_that_python_can_would_send(name, tmp_path):
    with pytest.raises(LogError, match=REFUSED[name]):
        played(FORMATS / name, tmp_path / "out.blf")
    assert authority(FORMATS / name) == []

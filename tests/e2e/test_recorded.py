"""A recorded drive of a real car: its byte sums verify on every frame."""

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.e2e import Field, guard
from vsensor.logs import read_log

LOG = SHARED_DATA / "can" / "rav4_drive.log"
LENGTHS = {0x25: 8, 0xB4: 8, 0x1D2: 8, 0x260: 8}
FRAMES = 12_351
"""Frames with these ids in the recording."""


@pytest.fixture(scope="module")
def recorded():
    """Return id -> messages (N, 8) of the recorded drive."""
    table = read_log(LOG)
    found = {}
    for arbitration_id, length in LENGTHS.items():
        rows = np.flatnonzero(table.arbitration_id == arbitration_id)
        assert (table.length[rows] == length).all()
        found[arbitration_id] = table.data[rows, :length]
    return found


def of(arbitration_id):
    """The last byte is the sum of the bytes of id and data, and the length."""
    length = LENGTHS[arbitration_id]
    return guard("sum8_id", length=length, arbitration_id=arbitration_id, checksum=Field(8 * (length - 1), 8))


@needs_shared
def test_every_frame_of_the_recorded_drive_is_right_in_bulk(recorded):
    assert sum(len(data) for data in recorded.values()) == FRAMES
    for arbitration_id, data in recorded.items():
        assert of(arbitration_id).check_bulk(data).all()


@needs_shared
def test_every_frame_of_the_recorded_drive_is_right_one_by_one(recorded):
    for arbitration_id, data in recorded.items():
        guarding = of(arbitration_id)
        assert all(guarding.check(message.tobytes()) for message in data)


@needs_shared
def test_protecting_the_recorded_frames_again_changes_none(recorded):
    for arbitration_id, data in recorded.items():
        guarding = of(arbitration_id)
        for message in data[::10]:
            again = bytearray(message.tobytes())
            again[-1] = 0
            guarding.protect(again, 0)
            assert again == message.tobytes()


@needs_shared
def test_recorded_frames_under_another_id_are_refused(recorded):
    for arbitration_id, data in recorded.items():
        other = guard("sum8_id", length=8, arbitration_id=arbitration_id + 1, checksum=Field(56, 8))
        assert not other.check_bulk(data).any()

"""A car's own drive is judged without one false finding; what is done to it is found."""

from functools import cache

import numpy as np

from tests.shared import SHARED_DATA, needs_shared
from vsensor.accept import LimitsConfig, judged
from vsensor.logs import read_log
from vsensor.profile import load_profile

LOG = SHARED_DATA / "can" / "rav4_drive.log"
DBC = SHARED_DATA / "dbc" / "toyota_rav4_2017_pt_generated.dbc"
STEER_ANGLE = 'BO_ 37 STEER_ANGLE_SENSOR: 8 XXX\n SG_ CHECKSUM : 63|8@0+ (1,0) [0|255] "" XXX\n'


@cache
def drive():
    return read_log(LOG).columns


def toyota():
    return load_profile("toyota_rav4", DBC)


def found(columns, profile):
    return {(f.kind, f.message): f.count for f in judged(columns, profile, LimitsConfig()).findings}


def without(columns, row):
    return columns.taken(np.arange(len(columns.t_ns)) != row)


def rows_of(arbitration_id):
    return np.flatnonzero(drive().arbitration_id == arbitration_id)


@needs_shared
def test_the_drive_is_accepted_though_its_recorder_stamps_in_batches():
    verdict = judged(drive(), toyota(), LimitsConfig())
    assert verdict.findings == ()
    assert any("timestamps are batched (20.6%" in remark for remark in verdict.remarks)


@needs_shared
def test_all_byte_sums_of_the_four_protected_messages_are_right(tmp_path):
    # The public database leaves the checksum of 0x25 out; a database and a profile with it are made here.
    lines = DBC.read_text().replace("BO_ 37 STEER_ANGLE_SENSOR: 8 XXX\n", STEER_ANGLE)
    (tmp_path / "car.dbc").write_text(lines)
    names = ("STEER_ANGLE_SENSOR", "SPEED", "PCM_CRUISE", "STEER_TORQUE_SENSOR")
    protected = "".join(f'[messages.{n}]\ne2e = {{ profile = "sum8_id", crc = "CHECKSUM" }}\n' for n in names)
    head = 'schema = "vsensor.profile/1"\nrole = "vehicle"\ndatabase = "car.dbc"\n'
    (tmp_path / "car.toml").write_text(head + protected)
    verdict = judged(drive(), load_profile(tmp_path / "car.toml"), LimitsConfig())
    assert verdict.findings == ()
    assert verdict.frames == 12_351


@needs_shared
def test_with_exact_timestamps_asked_for_the_recorders_batches_are_late_frames():
    verdict = judged(drive(), toyota(), LimitsConfig(timestamps="exact"))
    assert {finding.kind for finding in verdict.findings} == {"late"}


@needs_shared
def test_one_changed_bit_is_one_wrong_checksum():
    data = drive().data.copy()
    data[rows_of(0xB4)[1000], 5] ^= 1
    assert found(drive()._replace(data=data), toyota()) == {("wrong_crc", "SPEED"): 1}


@needs_shared
def test_a_frame_taken_out_is_found_although_all_others_jitter():
    for message, arbitration_id, place in (("SPEED", 0xB4, 1234), ("KINEMATICS", 0x24, 2500)):
        assert found(without(drive(), rows_of(arbitration_id)[place]), toyota()) == {("missing", message): 1}


@needs_shared
def test_most_frames_taken_out_of_a_jittering_message_are_found():
    rows = rows_of(0x24)[100:4900:40]
    missed = [found(without(drive(), row), toyota()).get(("missing", "KINEMATICS"), 0) for row in rows[:30]]
    assert sum(missed) >= 0.8 * len(missed)

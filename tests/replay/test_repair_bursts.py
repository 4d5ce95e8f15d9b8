"""Bursts with a rolling count and one checksum; pages; what a database alone protects; a recorded car."""

import pytest
from msgspec.structs import replace

from tests.accept.streams import found
from tests.made_profiles import Sender, profile_of, values
from tests.profile.test_bursts import DBC, TEXT, images_of
from tests.replay.repairing import faster, later, repaired, told
from tests.shared import SHARED_DATA, needs_shared
from vsensor.logs import frames_of, read_log
from vsensor.profile import load_profile
from vsensor.types import Frame

MS = 1_000_000
FRAMES = 8


@pytest.fixture(scope="module")
def profile(tmp_path_factory):
    return profile_of(tmp_path_factory.mktemp("burst"), DBC, TEXT)


def stream(profile, images=20, order=range(FRAMES)):
    """The frames of some images, 0.25 ms apart, in an order."""
    sender = Sender(profile)
    bursts = [sender({**values(), "image.index": float(k + 5)}) for k in range(images)]
    return [
        replace(burst[member], due_ns=round((40 * k + 0.25 * place) * MS))
        for k, burst in enumerate(bursts)
        for place, member in enumerate(order)
    ]


def looped(frames, images=20):
    return [*frames, *later(frames, 40 * images)]


def torn(profile, frames):
    return [image for image in images_of(profile, frames) if not image.is_intact]


LAST, FIRST, MIDDLE = range(FRAMES), (7, *range(7)), (0, 1, 7, 2, 3, 4, 5, 6)


@pytest.mark.parametrize("order", [LAST, FIRST, MIDDLE])
def test_a_good_log_is_sent_as_it_is_wherever_the_checksum_comes(profile, order):
    frames = stream(profile, order=order)
    assert [f.data for f in repaired(frames, profile)] == [f.data for f in frames]


@pytest.mark.parametrize("order", [LAST, FIRST, MIDDLE])
def test_a_loop_has_whole_bursts_wherever_the_checksum_comes(profile, order):
    frames = looped(stream(profile, 21, order), 21)
    assert found(frames, profile) != {}
    sent = repaired(frames, profile)
    assert torn(profile, sent) == []
    assert len(sent) == len(frames)
    assert {kind for kind, _ in found(sent, profile)} <= {"stuck", "missing", "frozen"}


def test_frames_before_the_checksum_leave_at_once_and_those_behind_it_wait_for_the_burst(profile):
    early = repaired(stream(profile, 2, LAST), profile)
    assert [f.due_ns for f in early] == [f.due_ns for f in stream(profile, 2, LAST)]
    held = repaired(stream(profile, 2, MIDDLE), profile)
    assert [f.due_ns / MS for f in held[:8]] == [0, 0.25, *[1.75] * 6]


def test_a_changed_frame_of_a_burst_has_it_sealed_anew(profile):
    frames = stream(profile, order=FIRST)
    changed = [
        replace(f, data=f.data[:3] + b"\x77" + f.data[4:]) if k == 43 else f for k, f in enumerate(frames)
    ]
    assert len(torn(profile, changed)) == 1
    assert torn(profile, repaired(changed, profile)) == []


@pytest.mark.parametrize("speed", [1.0, 0.1])
def test_a_burst_that_lacks_a_frame_is_told_and_holds_nothing_up_for_longer_than_10_ms(profile, speed):
    frames = [f for k, f in enumerate(stream(profile, order=FIRST)) if k != 8 * 6 + 3]
    frames = faster(frames, speed)
    sent = repaired(frames, profile, speed=speed)
    assert len(sent) == len(frames)
    waited = [s.due_ns - f.due_ns for s, f in zip(sent, frames, strict=True)]
    assert max(waited) <= 10 * MS / speed
    assert len(torn(profile, sent)) == 1
    assert any(
        "1 times the burst image lacked a frame" in line for line in told(frames, profile, speed=speed)
    )


def test_the_last_burst_of_a_log_leaves_even_if_it_is_not_whole(profile):
    frames = stream(profile, 3, FIRST)[:-2]
    sent = repaired(frames, profile)
    assert len(sent) == len(frames)
    assert sent[-1].due_ns == frames[16].due_ns + 10 * MS


def test_a_member_that_is_missing_once_leaves_the_rolling_count_of_the_others_in_step(profile):
    frames = [f for k, f in enumerate(stream(profile)) if k != 8 * 6 + 3]
    assert [len(image.frames) for image in torn(profile, repaired(looped(frames), profile))] == [7, 7]


MUX = (
    'BO_ 1300 Both: 8 CAM\n SG_ Id : 0|4@1+ (1,0) [0|0] "" ECU\n SG_ Which M : 4|2@1+ (1,0) [0|0] "" ECU\n'
    ' SG_ Cnt : 8|4@1+ (1,0) [0|0] "" ECU\n SG_ L m1 : 16|16@1- (0.01,0) [0|0] "m" ECU\n'
    ' SG_ R m2 : 16|16@1- (0.01,0) [0|0] "m" ECU\n SG_ Crc : 56|8@1+ (1,0) [0|0] "" ECU\n'
)
MUX_TEXT = """
[messages.Both]
cycle_ms = 40
e2e = { crc = "Crc", counter = "Cnt", profile = "crc8_2f" }
signals = { L = "left.offset_m", R = "right.offset_m", Id = { quantity = "image.index", wrap = true } }
"""


def test_pages_of_a_multiplexed_message_share_an_image_and_count_on(tmp_path):
    profile = profile_of(tmp_path, MUX, MUX_TEXT)
    sender = Sender(profile)
    bursts = [sender({**values(), "image.index": float(k)}) for k in range(20)]
    frames = [
        replace(f, due_ns=(40 * k + n) * MS) for k, burst in enumerate(bursts) for n, f in enumerate(burst)
    ]
    assert [f.data for f in repaired(frames, profile)] == [f.data for f in frames]
    sent = repaired([*frames[:31], *later(frames, 640)], profile)
    assert [f.data[0] & 15 for f in sent[31:]] == [(16 + k // 2) % 16 for k in range(40)]
    assert [f.data[1] & 15 for f in sent] == [k % 16 for k in range(len(sent))]


PLAIN = """
VERSION ""
BS_:
BU_: CAM ECU
BO_ 256 Lane: 8 CAM
 SG_ Off : 16|16@1- (0.01,0) [0|0] "m" ECU
BO_ 257 Speed: 8 CAM
 SG_ V : 16|16@1+ (0.01,0) [0|0] "m/s" ECU
BO_ 258 Bare: 8 CAM
 SG_ X : 16|16@1+ (0.01,0) [0|0] "" ECU
BA_DEF_ BO_ "E2EProfile" STRING ;
BA_DEF_ BO_ "E2EDataId" INT 0 65535;
BA_DEF_DEF_ "E2EProfile" "";
BA_ "E2EProfile" BO_ 257 "P05";
BA_ "E2EDataId" BO_ 257 4660;
BA_ "E2EProfile" BO_ 258 "P05";
"""


def test_messages_that_only_the_database_protects_are_repaired_and_those_without_a_data_id_named(tmp_path):
    (tmp_path / "car.dbc").write_text(PLAIN.lstrip())
    (tmp_path / "car.toml").write_text(
        'schema = "vsensor.profile/1"\ndatabase = "car.dbc"\n'
        '[messages.Lane]\ncycle_ms = 40\nsignals = { Off = "left.offset_m" }\n'
    )
    profile = load_profile(tmp_path / "car.toml")
    frames = [Frame(due_ns=k * MS, arbitration_id=257, data=bytes(8)) for k in range(5)]
    assert [f.data[2] for f in repaired(frames, profile)] == [0, 1, 2, 3, 4]
    assert len({f.data[:2] for f in repaired(frames, profile)}) == 5
    lines = "\n".join(told([*frames, replace(frames[0], arbitration_id=256)], profile))
    assert "5 frames had a wrong checksum or counter before, right now: Speed 5" in lines
    assert "Bare: no E2EDataId" in lines
    assert "nothing is known that protects Lane 1" in lines


@needs_shared
def test_changed_and_renamed_frames_of_a_recorded_car_verify_again():
    dbc = SHARED_DATA / "dbc/toyota_rav4_2017_pt_generated.dbc"
    rav4 = load_profile("toyota_rav4", dbc)
    speed = next(plan for plan in rav4.messages if plan.layout.name == "SPEED")
    frames = list(frames_of(read_log(SHARED_DATA / "can/rav4_drive.log").columns.taken(slice(0, 4000))))
    assert repaired(frames, rav4) == frames
    changed = [replace(f, data=b"\x12" + f.data[1:]) if f.arbitration_id == 0xB4 else f for f in frames]
    assert speed.layout.arbitration_id == 0xB4
    mine = [f.data for f in repaired(changed, rav4) if f.arbitration_id == 0xB4]
    assert mine
    assert all(speed.guard.check(data) and data[0] == 0x12 for data in mine)
    assert not all(speed.guard.check(f.data) for f in changed if f.arbitration_id == 0xB4)
    foreign = next(
        f for f in frames if rav4.by_id.get((f.arbitration_id, False)) is None and len(f.data) == 8
    )
    renamed = [replace(f, arbitration_id=0xB4) for f in frames if f.arbitration_id == foreign.arbitration_id]
    assert all(speed.guard.check(f.data) for f in repaired(renamed, rav4))

"""Images of several frames: tied by a burst id, a rolling count and one checksum over all of them."""

import pytest
from msgspec import structs

from tests.made_profiles import Sender, profile_of, raws, values, written
from tests.test_profile import columns
from vsensor.e2e import CHECKSUMS
from vsensor.errors import ConfigError
from vsensor.profile import NOTHING_OPEN, left_over, load_profile

NAMES = "ABCDEFG"


def message(number, name):
    """Return a message with an odd place for everything, big endian in every other one."""
    order = "@0" if number % 2 else "@1"
    off = "14|9" if number % 2 else "7|9"
    return (
        f'BO_ {0x500 + number} {name}: 8 CAM\n SG_ Id : 0|3@1+ (1,0) [0|0] "" ECU\n'
        f' SG_ Cnt : 3|3@1+ (1,0) [0|0] "" ECU\n SG_ Off : {off}{order}- (0.02,0) [0|0] "m" ECU\n'
        f' SG_ Pay : 24|8@1+ (1,0) [0|0] "" ECU\n SG_ Own : 56|8@1+ (1,0) [0|0] "" ECU\n'
    )


DBC = "".join(message(number, name) for number, name in enumerate(NAMES)) + (
    'BO_ 1535 Seal: 8 CAM\n SG_ Id : 0|3@1+ (1,0) [0|0] "" ECU\n SG_ Sum : 19|16@0+ (1,0) [0|0] "" ECU\n'
    ' SG_ Cnt : 48|3@1+ (1,0) [0|0] "" ECU\n SG_ Crc : 56|8@1+ (1,0) [0|0] "" ECU\n'
)
TEXT = (
    "".join(
        f"[messages.{name}]\ncycle_ms = 40\n"
        f'signals = {{ Off = "left.offset_m", Pay = {{ constant = {number} }} }}\n'
        for number, name in enumerate(NAMES)
    )
    + '[messages.Seal]\ncycle_ms = 40\ne2e = { crc = "Crc", counter = "Cnt", profile = "crc8_2f" }\n'
    + '[bursts.image]\nmessages = ["A", "B", "C", "D", "E", "F", "G", "Seal"]\nid = "Id"\ncount = "Cnt"\n'
    + '[bursts.image.checksum]\nmessage = "Seal"\nsignal = "Sum"\n'
    'algorithm = "crc16_ccitt"\ndata_id = 0x1234\n'
)


@pytest.fixture
def profile(tmp_path):
    return profile_of(tmp_path, DBC, TEXT)


def zeroed(data, kept):
    return bytes(byte & kept.get(place, 0xFF) for place, byte in enumerate(data))


def images_of(profile, frames):
    state, images = NOTHING_OPEN, []
    for frame in frames:
        state, ended = profile.assemble(state, frame)
        images += ended
    return [*images, *left_over(profile.bursts, state)]


def slots(profile, count):
    sender = Sender(profile)
    return [sender({**values(), "image.index": float(k + 5)}) for k in range(count)]


def test_all_frames_of_an_image_carry_its_burst_id_and_one_rolling_count(profile):
    for number, frames in enumerate(slots(profile, 20)):
        found = raws(profile, frames)
        assert [raw["Id"] for raw in found] == [(number + 5) % 8] * 8
        assert [raw["Cnt"] for raw in found] == [number % 8] * 8


def test_the_checksum_is_that_of_all_frames_in_order_after_the_data_id(profile):
    frames = slots(profile, 1)[0]
    data = b"\x34\x12" + b"".join(f.data for f in frames[:-1])
    seal = frames[-1].data  # its own bits lie in bytes 2 to 4, its CRC in byte 7
    data += seal[:2] + seal[5:7]
    assert raws(profile, frames)[-1]["Sum"] == CHECKSUMS["crc16_ccitt"](data)


def test_the_frame_with_the_burst_checksum_is_itself_protected(profile):
    for frames in slots(profile, 3):
        assert profile.decode(frames[-1], check=True) is not None
        torn = structs.replace(frames[-1], data=frames[-1].data[:-1] + bytes([frames[-1].data[-1] ^ 1]))
        assert profile.decode(torn, check=True) is None


def test_whole_images_are_intact(profile):
    images = images_of(profile, [frame for frames in slots(profile, 10) for frame in frames])
    assert [(image.is_intact, len(image.frames)) for image in images] == [(True, 8)] * 10


@pytest.mark.parametrize("bit", range(0, 64, 5))
@pytest.mark.parametrize("place", range(8))
def test_any_flipped_bit_of_any_frame_spoils_its_image_and_no_other(profile, place, bit):
    frames = [list(some) for some in slots(profile, 3)]
    victim = frames[1][place]
    data = bytearray(victim.data)
    data[bit // 8] ^= 1 << bit % 8
    frames[1][place] = structs.replace(victim, data=bytes(data))
    images = images_of(profile, [frame for some in frames for frame in some])
    intact = [image.frames[0] for image in images if image.is_intact]
    assert intact == [frames[0][0], frames[2][0]]


@pytest.mark.parametrize("place", range(8))
def test_a_lost_frame_spoils_its_image_and_is_named(profile, place):
    frames = [list(some) for some in slots(profile, 3)]
    del frames[1][place]
    images = images_of(profile, [frame for some in frames for frame in some])
    assert [image.fault for image in images] == ["", f"1 of 8 frames missing: {(*NAMES, 'Seal')[place]}", ""]


def test_frames_of_two_images_do_not_make_one(profile):
    first, second = slots(profile, 2)
    images = images_of(profile, [*first[:4], *second[4:]])
    assert [image.is_intact for image in images] == [False, False]


def test_a_recording_that_ends_within_an_image_says_so(profile):
    images = images_of(profile, slots(profile, 1)[0][:5])
    assert [image.fault for image in images] == ["3 of 8 frames missing: F, G, Seal"]


def test_decoding_in_bulk_with_a_check_leaves_out_every_frame_of_a_torn_image(profile):
    frames = [frame for some in slots(profile, 4) for frame in some]
    whole = profile.decode_arrays(*columns(frames), check=True)["left.offset_m"].rows.tolist()
    assert whole == [row for row in range(32) if row % 8 != 7]
    del frames[10]
    kept = profile.decode_arrays(*columns(frames), check=True)["left.offset_m"].rows.tolist()
    assert kept == [row for row in range(31) if not 8 <= row < 15 and row not in (7, 22, 30)]
    assert len(profile.decode_arrays(*columns(frames))["left.offset_m"].rows) == 27


@pytest.mark.parametrize(
    ("more", "covered"),
    [
        # Sum is in the low nibble of byte 2, in byte 3 and in the high nibble of byte 4, Crc in byte 7.
        ('own = "zero"\n', lambda d: b"".join([*d[:7], zeroed(d[7], {2: 0xF0, 3: 0, 4: 0x0F, 7: 0})])),
        (
            'covers = ["B", { message = "A", first = 1, last = 3 }]\nbefore = [9]\nafter = [7, 8]\n',
            lambda d: b"\x09" + d[1] + d[0][1:4] + b"\x07\x08",
        ),
    ],
)
def test_what_the_checksum_covers_and_how_its_own_bytes_count_is_said(tmp_path, more, covered):
    profile = profile_of(tmp_path, DBC, TEXT.replace("data_id = 0x1234\n", more))
    frames = slots(profile, 2)[1]
    expected = covered([frame.data for frame in frames])
    assert raws(profile, frames)[7]["Sum"] == CHECKSUMS["crc16_ccitt"](expected)
    assert [image.is_intact for image in images_of(profile, frames)] == [True]


def test_a_burst_of_one_multiplexed_message_is_an_image_too(tmp_path):
    dbc = (
        'BO_ 8 M: 8 CAM\n SG_ Which M : 0|4@1+ (1,0) [0|15] "" ECU\n SG_ Id : 4|4@1+ (1,0) [0|15] "" ECU\n'
        ' SG_ Sum : 56|8@1+ (1,0) [0|255] "" ECU\n SG_ LOff m0 : 16|16@1- (0.001,0) [0|0] "m" ECU\n'
        ' SG_ ROff m1 : 23|16@0- (0.001,0) [0|0] "m" ECU\n'
    )
    text = (
        '[messages.M]\ncycle_ms = 40\nsignals = { LOff = "left.offset_m", ROff = "right.offset_m" }\n'
        '[bursts.image]\nmessages = ["M"]\nid = "Id"\n'
        'checksum = { message = "M", signal = "Sum", algorithm = "sum8" }\n'
    )
    profile = profile_of(tmp_path, dbc, text)
    frames = [frame for some in slots(profile, 3) for frame in some]
    assert [image.is_intact for image in images_of(profile, frames)] == [True] * 3
    assert frames[0].data[7] == CHECKSUMS["sum8"](frames[0].data[:7] + frames[1].data)
    assert [image.is_intact for image in images_of(profile, frames[:3])] == [True, False]


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('"crc16_ccitt"', '"crc16_ccit"', r"algorithm 'crc16_ccit' is not known; did you mean crc16_ccitt\?"),
        ('signal = "Sum"', 'signal = "Summ"', r"Seal has no signal Summ; did you mean Sum\?"),
        ('signal = "Sum"', 'signal = "Crc"', "Seal.Crc carries something else already"),
        ('message = "Seal"\n', 'message = "H"\n', "H is not among the messages of this burst"),
        ('"A", "B"', '"B", "A"', "messages are sent in the profile's order"),
        ('"G", "Seal"', '"G", "Seel"', r"Seel is not among the profile's messages; did you mean Seal\?"),
        ('id = "Id"', 'id = { A = "Idd" }', r"A has no signal Idd; did you mean Id\?"),
        (
            "data_id = 0x1234",
            'covers = [{ message = "A", last = 9 }]',
            "covers bytes 0 to 9 of A, which has 0 to 7",
        ),
        ("[messages.C]\ncycle_ms = 40", "[messages.C]\ncycle_ms = 80", "C is not sent at the times of A"),
        (
            'signal = "Sum"\nalgorithm = "crc16_ccitt"',
            'signal = "Id"\nalgorithm = "sum8"',
            "carries something else",
        ),
    ],
)
def test_a_burst_that_cannot_be_is_refused_in_one_line(tmp_path, old, new, said):
    assert old in TEXT
    with pytest.raises(ConfigError, match=said) as caught:
        load_profile(written(tmp_path, DBC, TEXT.replace(old, new)))
    assert "\n" not in str(caught.value)

"""E2E protection against an own bitwise CRC and the vectors that AUTOSAR publishes."""

import numpy as np
import pytest

from vsensor.e2e import guard


def p01(data_id=0x123, offset=0, length=8):
    return guard("P01", length=length, data_id=data_id, offset=offset)


def crc8_j1850_bitwise(data):
    """CRC-8 SAE J1850 with start value and final XOR 0, one bit at a time."""
    crc = 0
    for byte in data:
        for bit in range(7, -1, -1):
            feedback = (crc >> 7) ^ (byte >> bit & 1)
            crc = (crc << 1 & 0xFF) ^ (0x1D if feedback else 0)
    return crc


def protected(payload, data_id=0x123, offset=0):
    data = bytearray(payload)
    p01(data_id, offset, len(data)).protect(data, payload[offset + 1] & 15)
    return bytes(data)


@pytest.mark.parametrize(("counter", "crc"), [(0, 0xCC), (1, 0x91)])
def test_p01_gives_the_crc_of_autosars_published_example(counter, crc):
    assert protected([0, counter, 0, 0, 0, 0, 0, 0])[0] == crc


@pytest.mark.parametrize("seed", range(20))
def test_p01_equals_a_bitwise_crc_over_data_id_and_payload(seed):
    rng = np.random.default_rng(seed)
    data_id, length = int(rng.integers(0, 1 << 16)), int(rng.integers(2, 9))
    payload = [0, int(rng.integers(0, 15)), *rng.integers(0, 256, length - 2).tolist()]
    expected = crc8_j1850_bitwise([data_id & 0xFF, data_id >> 8, *payload[1:]])
    assert protected(payload, data_id)[0] == expected


def test_protecting_leaves_the_counter_and_the_payload_alone():
    payload = bytes([0, 0x57, 1, 2, 3, 4, 5, 6])
    assert protected(payload)[1:] == payload[1:]


def test_every_single_flipped_bit_is_found():
    data = protected([0, 3, 10, 20, 30, 40, 50, 60])
    assert p01().check(data)
    for bit in range(64):
        wrong = bytearray(data)
        wrong[bit // 8] ^= 1 << bit % 8
        assert not p01().check(bytes(wrong)), f"bit {bit}"


def test_a_frame_under_another_data_id_is_refused():
    assert not p01(0x124).check(protected([0, 3, 1, 2, 3, 4, 5, 6]))


def test_a_counter_of_15_is_refused_though_its_crc_is_right():
    assert not p01().check(protected([0, 15, 1, 2, 3, 4, 5, 6]))


def test_the_counter_has_15_states():
    assert p01().counter_states == 15


@pytest.mark.parametrize("offset", [0, 2])
def test_checking_in_bulk_equals_checking_frame_by_frame(offset):
    rng = np.random.default_rng(7)
    frames, guarding = [], p01(0xBEEF, offset)
    for k in range(300):
        frame = bytearray(rng.integers(0, 256, 8, dtype=np.uint8).tobytes())
        guarding.protect(frame, k % 15)
        if k % 3 == 0:
            frame[int(rng.integers(0, 8))] ^= int(rng.integers(1, 256))
        frames.append(bytes(frame))
    data = np.frombuffer(b"".join(frames), dtype=np.uint8).reshape(-1, 8)
    single = [guarding.check(frame) for frame in frames]
    assert 0 < sum(single) < 300
    assert guarding.check_bulk(data).tolist() == single

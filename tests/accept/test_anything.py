"""Whatever is on a bus, judging it ends in a verdict that can be printed and written."""

import json

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.accept.streams import NATIVE, verdict
from tests.ecu.streams import IDS, stream
from tests.made_profiles import profile_of
from tests.profile.test_bursts import DBC as BURST_DBC
from tests.profile.test_bursts import TEXT as BURST_TEXT
from tests.profile.test_pages import LINES, PAGES
from vsensor.accept import LimitsConfig, Stream, verdict_of
from vsensor.logs import Columns, Flag
from vsensor.profile import load_profile

GOOD = stream(3)
FD_IDS = (0x330, 0x331, 0x332)


class Profiles(list):
    """With a short name, for what hypothesis prints of a failure."""

    def __repr__(self):
        return "profiles"


@pytest.fixture(scope="module")
def profiles(tmp_path_factory):
    made = tmp_path_factory.mktemp("made")
    return Profiles(
        [
            NATIVE,
            load_profile("native_fd"),
            profile_of(made, BURST_DBC, BURST_TEXT, "bursts"),
            profile_of(made, LINES, PAGES.format(mux="together"), "pages"),
        ]
    )


def columns_of(rows, width):
    """Return frames (time, id, flags, length, seed) as columns of random bytes."""
    data = np.zeros((len(rows), width), dtype=np.uint8)
    for place, (_, _, _, length, seed) in enumerate(rows):
        length = min(length, width)
        data[place, :length] = np.random.default_rng(seed).integers(0, 256, length)
    t_ns, ids, flags, lengths = (np.array([row[k] for row in rows], dtype=np.int64) for k in range(4))
    return Columns(
        t_ns,
        ids.astype(np.uint32),
        np.zeros(len(rows), dtype=np.uint8),
        flags.astype(np.uint8),
        np.minimum(lengths, width).astype(np.uint8),
        data,
    )


ROWS = st.lists(
    st.tuples(
        st.integers(0, 2**62) | st.integers(0, 200).map(lambda ms: ms * 10**6),
        st.sampled_from([*IDS.values(), *FD_IDS, 8, 0x500, 0x501, 0x5FF, 0x7FF]) | st.integers(0, 0x1FFFFFFF),
        st.sampled_from([0, int(Flag.FD)]) | st.integers(0, 127),
        st.sampled_from([8, 32, 48]) | st.integers(0, 64),
        st.integers(0, 99),
    ),
    max_size=60,
)


@given(chunks=st.lists(ROWS, max_size=3), width=st.sampled_from([8, 64]))
@settings(max_examples=60)
def test_random_frames_at_random_times_are_judged(profiles, chunks, width):
    for profile in profiles:
        taken = Stream(profile, LimitsConfig())
        for rows in chunks:
            taken.take(columns_of(rows, width))
        taken.end()
        judgement = verdict_of(taken)
        assert "\n".join(judgement.lines())
        json.dumps(judgement.as_dict(), allow_nan=False)
        assert not judgement.is_accepted


@given(place=st.integers(0, len(GOOD) - 1), byte=st.integers(0, 7), bit=st.integers(0, 7))
@settings(max_examples=50)
def test_no_single_changed_bit_is_accepted(place, byte, bit):
    frames = list(GOOD)
    data = bytearray(frames[place].data)
    data[byte] ^= 1 << bit
    frames[place] = type(frames[place])(
        due_ns=frames[place].due_ns, arbitration_id=frames[place].arbitration_id, data=bytes(data)
    )
    assert [f.kind for f in verdict(frames).findings] == ["wrong_crc"]

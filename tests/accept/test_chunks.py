"""However a stream is cut into chunks, and whether it is a log or a bus, the same is found."""

import random
from itertools import repeat

from hypothesis import given, settings
from hypothesis import strategies as st

import vsensor.accept.listen as listen
from tests.accept.streams import NATIVE, verdict
from tests.ecu.streams import (
    burst_behind,
    counter_ahead,
    counter_at,
    crc_wrong,
    delayed,
    doubled,
    lost,
    stream,
    truncated,
    write,
)
from vsensor.accept import LimitsConfig, Stream, accept_bus, accept_log, columns_of_frames, verdict_of

CLEAN = stream(24)
SPOILERS = {
    "lost": lost,
    "doubled": doubled,
    "truncated": truncated,
    "crc_wrong": crc_wrong,
    "delayed by 3": delayed(3),
    "delayed by 20": delayed(20),
    "delayed by 70": delayed(70),
    "counter at 3": counter_at(3),
    "counter ahead": counter_ahead(2),
    "burst behind": burst_behind(1),
}
FAULTS = st.lists(
    st.tuples(st.integers(0, 12), st.integers(0, 23), st.integers(1, 12), st.sampled_from(sorted(SPOILERS))),
    max_size=4,
)
"""Message, first image, number of images, what goes wrong."""


def spoiled(faults):
    """Return the stream of which some frames, alone or in runs, went wrong."""
    spoilers = {
        image * 13 + message: SPOILERS[name]
        for message, first, length, name in faults
        for image in range(first, min(first + length, 24))
    }
    frames = []
    for place, frame in enumerate(CLEAN):
        frames += spoilers[place](frame) if place in spoilers else [frame]
    return sorted(frames, key=lambda frame: frame.due_ns)


def in_chunks(frames, sizes):
    taken = Stream(NATIVE, LimitsConfig())
    place = 0
    while place < len(frames):
        size = next(sizes)
        taken.take(columns_of_frames(frames[place : place + size]))
        place += size
    taken.end()
    return verdict_of(taken)


@given(faults=FAULTS, seed=st.integers(0, 2**32), largest=st.sampled_from([3, 30, 200]))
@settings(max_examples=15)
def test_the_chunks_make_no_difference(faults, seed, largest):
    frames = spoiled(faults)
    dice = random.Random(seed)
    sizes = iter(lambda: dice.randint(1, largest), None)
    assert in_chunks(frames, sizes) == verdict(frames)


def test_a_late_frame_soon_after_a_lost_one_is_not_missing_in_another_chunk():
    at = {8 * 13 + 3: lost, 12 * 13 + 3: delayed(30)}
    frames = []
    for place, frame in enumerate(stream(60)):
        frames += at[place](frame) if place in at else [frame]
    frames.sort(key=lambda frame: frame.due_ns)
    judged = in_chunks(frames, repeat(13))
    assert {f.kind: f.count for f in judged.findings if f.kind in ("missing", "late")} == {
        "missing": 1,
        "late": 1,
    }


class FakeBus:
    """Hands out frames in portions, as a bus that is listened to does."""

    def __init__(self, portions):
        self._portions = list(portions)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def drain(self):
        return self._portions.pop(0) if self._portions else []

    def report(self):
        return []

    @property
    def is_empty(self):
        return not self._portions


def test_a_bus_is_judged_as_the_log_of_it_is(monkeypatch, tmp_path):
    frames = list(CLEAN)
    for place, spoil in ((40, lost), (101, crc_wrong), (200, doubled), (251, delayed(20))):
        frames[place : place + 1] = spoil(frames[place])
    frames = sorted(frames, key=lambda frame: frame.due_ns)
    write(frames, tmp_path / "heard.log")
    bus = FakeBus([[], *(frames[k : k + 45] for k in range(0, len(frames), 45))])
    monkeypatch.setattr(listen, "open_bus", lambda *_, **__: bus)
    live = accept_bus("fake:0", [NATIVE], LimitsConfig(), stopped=lambda: bus.is_empty)
    logged = accept_log(tmp_path / "heard.log", [NATIVE], LimitsConfig())
    assert live.verdicts == logged.verdicts
    assert {finding.kind for finding in live.verdicts[0].findings} >= {
        "missing",
        "wrong_crc",
        "extra",
        "late",
    }


def test_what_is_kept_of_a_long_stream_does_not_grow():
    taken = Stream(NATIVE, LimitsConfig())
    for first in range(0, len(CLEAN), 13):
        taken.take(columns_of_frames(CLEAN[first : first + 13]))
    kept = [len(watch.kept) for watch in taken.watches]
    assert max(kept) <= 2 * LimitsConfig().settle_frames + 2
    assert taken.waiting <= 13

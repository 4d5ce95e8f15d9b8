"""Streams to be judged, what is done to them, and what is found."""

from msgspec.structs import replace

from tests.ecu.streams import IDS, stream, with_header
from vsensor.accept import LimitsConfig, columns_of_frames, judged
from vsensor.profile import load_profile

NATIVE = load_profile("native")
CYCLE_NS = 40_000_000


def verdict(frames, profile=NATIVE, **limits):
    """Return what is concluded from frames, heard in the order of their times."""
    heard = sorted(frames, key=lambda frame: frame.due_ns)
    return judged(columns_of_frames(heard), profile, LimitsConfig(**limits))


def found(frames, profile=NATIVE, **limits):
    """Return {(kind, message): count} of all findings."""
    counts = {}
    for finding in verdict(frames, profile, **limits).findings:
        key = finding.kind, finding.message
        counts[key] = counts.get(key, 0) + finding.count
    return counts


def spoiled(spoil, message="LDS_LeftLine", images=(30,), of=60):
    """Return a stream whose frames of a message in some images were changed by `spoil` (frame -> frames)."""
    frames, seen = [], 0
    for frame in stream(of):
        if frame.arbitration_id == IDS[message]:
            frames += spoil(frame) if seen in images else [frame]
            seen += 1
        else:
            frames.append(frame)
    return frames


def with_bits(frame, low, length, raw):
    """Return the frame with other bits (little-endian, from bit `low`) and the CRC that fits."""
    word = int.from_bytes(frame.data, "little") & ~(((1 << length) - 1) << low) | raw << low
    return with_header(replace(frame, data=word.to_bytes(len(frame.data), "little")))


def bits(low, length, raw):
    """Return a spoiler that writes some bits and the CRC that fits."""
    return lambda frame: [with_bits(frame, low, length, raw)]

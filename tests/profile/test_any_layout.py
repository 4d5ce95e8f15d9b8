"""Layouts that nobody has thought of: encoded by us, read by cantools to the same, bit for bit."""

import math

import cantools
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.made_profiles import sent, values, written
from tests.test_profile import assert_bulk_equals_single, columns
from vsensor.profile import load_profile
from vsensor.types import Frame

CARRIED = (
    *("left.offset_m", "left.heading", "left.curvature_per_m", "left.curvature_rate_per_m2", "left.x_max_m"),
    *("right.offset_m", "right.heading", "centre.offset_m", "lane.width_m", "ego.speed_mps", "left.quality"),
)


def places_of(first, bits, big):
    """Return the bits (counted from bit 0 of byte 0 upwards) that a signal covers, and its start bit."""
    if not big:
        return {*range(first, first + bits)}, first
    places = {8 * (k // 8) + 7 - k % 8 for k in range(first, first + bits)}
    return places, 8 * (first // 8) + 7 - first % 8


@st.composite
def layouts(draw):
    """A message: (length, DBC text, names of its signals); its parts do not overlap on a page."""
    length = draw(st.sampled_from([1, 3, 8, 8, 8, 13, 24, 64]))
    pages = draw(st.sampled_from([(), (), (0, 1), (2, 3, 7)]))
    used = {page: set() for page in pages or (None,)}
    lines, names, floats = [], [], []
    if pages:
        lines.append(' SG_ Mux M : 0|3@1+ (1,0) [0|0] "" ECU')
        used = {page: {0, 1, 2} for page in pages}
    for number in range(draw(st.integers(1, 8))):
        is_float = draw(st.integers(0, 9)) == 0
        bits = draw(st.sampled_from([32, 64])) if is_float else draw(st.integers(1, min(64, 8 * length)))
        if bits > 8 * length:
            continue
        big, first = draw(st.booleans()), draw(st.integers(0, 8 * length - bits))
        places, start = places_of(first, bits, big)
        page = draw(st.sampled_from([*used, None] if pages else [None]))
        if any(places & taken for key, taken in used.items() if page in (key, None)):
            continue
        for key, taken in used.items():
            if page in (key, None):
                taken |= places
        sign = "-" if is_float else draw(st.sampled_from("+-"))
        scale = draw(st.sampled_from(["0.001", "1", "-0.01", "2E-06", "0.25"]))
        offset = draw(st.sampled_from(["0", "-8.192", "3"]))
        where = "" if page is None else f" m{page}"
        names.append(f"S{number}")
        floats += [(f"S{number}", bits // 32)] * is_float
        lines.append(
            f' SG_ S{number}{where} : {start}|{bits}@{0 if big else 1}{sign} ({scale},{offset}) [0|0] "" ECU'
        )
    text = f"BO_ 1234 M: {length} CAM\n" + "\n".join(lines) + "\n"
    return text + "".join(f"SIG_VALTYPE_ 1234 {name} : {kind};\n" for name, kind in floats), names


def profile_for(folder, text, names):
    signals = "".join(f'{name} = "{CARRIED[k]}"\n' for k, name in enumerate(names))
    toml = f"[messages.M]\ncycle_ms = 40\n[messages.M.signals]\n{signals}"
    return load_profile(written(folder, text, toml))


@settings(max_examples=120, deadline=None)
@given(layout=layouts(), numbers=st.lists(st.floats(-1e4, 1e4) | st.just(math.nan), min_size=11, max_size=11))
def test_cantools_reads_what_we_encode_to_the_same_bit_for_bit(layout, numbers, tmp_path_factory):
    text, names = layout
    profile = profile_for(tmp_path_factory.mktemp("any"), text, names)
    message = cantools.database.load_file(profile.database, strict=False).messages[0]
    bindings = {binding.signal.name: binding for binding in profile.messages[0].bindings}
    found = values() | dict(zip(CARRIED, numbers, strict=True))
    seen = set()
    frames = sent(profile, found)
    for frame in frames:
        data = frame.data[: message.length]
        raws = message.decode(data, scaling=False, decode_choices=False, allow_truncated=False)
        for name in raws.keys() & bindings.keys():
            binding = bindings[name]
            value = found[binding.quantity]
            if binding.signal.is_float:
                kind = f"f{binding.signal.length // 8}"
                told = 0.0 if math.isnan(value) else (value - binding.signal.offset) / binding.signal.scale
                assert raws[name] == np.array([told], dtype=kind)[0]
            else:
                assert raws[name] == binding.raw(value)[0]
            seen.add(name)
        assert bytes(message.encode(raws, scaling=False, strict=False)) == data
    assert seen == set(names)
    assert_bulk_equals_single(profile, list(frames), width=64)


@settings(max_examples=80, deadline=None)
@given(layout=layouts(), data=st.lists(st.binary(max_size=64), max_size=12))
def test_random_bytes_never_break_decoding_and_bulk_agrees(layout, data, tmp_path_factory):
    text, names = layout
    profile = profile_for(tmp_path_factory.mktemp("any"), text, names)
    frames = [Frame(due_ns=0, arbitration_id=1234, data=row, is_fd=True) for row in data]
    single = [profile.decode(frame) for frame in frames]
    bulk = profile.decode_arrays(*columns(frames, 64)) if frames else {}
    for name, column in bulk.items():
        for row, value in zip(column.rows.tolist(), column.values.tolist(), strict=True):
            np.testing.assert_equal(value, single[row][name])
    assert sum(len(column.rows) for column in bulk.values()) == sum(len(found or {}) for found in single)

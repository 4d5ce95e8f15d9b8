"""Logs with cut and flipped bytes: a table that makes sense, or one line; never another error."""

import functools
import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from tests.shared import SHARED_DATA, needs_shared
from vsensor.errors import LogError
from vsensor.logs import read_log
from vsensor.logs.table import (
    BITRATE_SWITCH,
    ERROR,
    EXTENDED,
    FD,
    FD_LENGTHS,
    REMOTE,
    TRANSMITTED,
    Record,
    columns_from,
)
from vsensor.logs.write import OUTPUTS, open_output

T0 = 1_700_000_000_000_000_000
FORMATS = SHARED_DATA / "can/formats"
EXAMPLES = settings(
    max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
FULL = (".log", ".asc", ".blf", ".mf4")


def records(suffix):
    """Frames of every kind that the format holds."""
    flags = [0, EXTENDED, TRANSMITTED, REMOTE]
    if suffix.removesuffix(".gz") in FULL:
        flags += [FD, FD | BITRATE_SWITCH, ERROR]
    return [
        Record(
            T0 + k * 10**6, 0 if kind == ERROR else 0x100 + k, k % 2, kind, bytes(0 if kind == ERROR else 8)
        )
        for k in range(40)
        for kind in [flags[k % len(flags)]]
    ]


@functools.cache
def whole_log(folder, suffix):
    path = folder / f"whole{suffix}"
    with open_output(path, path, ("can0", "can1")) as writer:
        writer.write_columns(columns_from(records(suffix)))
    return path.read_bytes()


@st.composite
def damages(draw):
    """What is written over a file, put in or taken out, and where it is cut, as shares of its length."""
    flips = st.lists(st.tuples(st.floats(0, 1), st.integers(0, 255)), max_size=5)
    moved = st.one_of(st.none(), st.tuples(st.floats(0, 1), st.integers(-20, 20)))
    return draw(flips), draw(moved), draw(st.one_of(st.just(1.0), st.floats(0, 1)))


def damaged(content, damage):
    flips, moved, cut = damage
    changed = bytearray(content)
    for share, value in flips:
        changed[int(share * (len(changed) - 1))] = value
    if moved is not None:
        at, count = int(moved[0] * len(changed)), moved[1]
        changed[at : at + max(0, -count)] = bytes(max(0, count))
    return bytes(changed[: int(cut * len(changed))])


def assert_sane_or_refused(path):
    refused = None
    try:
        table = read_log(path)
    except LogError as error:
        refused = str(error)
    if refused is not None:
        assert "\n" not in refused
        return
    columns = np.arange(table.data.shape[1])
    assert len(table) > 0
    assert (table.data[columns >= table.length[:, None]] == 0).all()
    assert np.isin(table.length, sorted(FD_LENGTHS)).all()
    assert (table.length[table.flags & FD == 0] <= 8).all()
    assert (table.arbitration_id[table.flags & (EXTENDED | ERROR) == 0] <= 0x7FF).all()
    assert (table.arbitration_id <= 0x1FFFFFFF).all()
    assert (table.channel < max(1, len(table.channel_names))).all()
    assert all("\n" not in line for line in table.report.lines())


@pytest.mark.parametrize("suffix", OUTPUTS)
@EXAMPLES
@given(damage=damages())
def test_a_damaged_log_of_ours_is_read_sanely_or_refused(tmp_path, tmp_path_factory, suffix, damage):
    path = tmp_path / f"x{suffix}"
    path.write_bytes(damaged(whole_log(tmp_path_factory.getbasetemp(), suffix), damage))
    assert_sane_or_refused(path)


@pytest.mark.parametrize("suffix", [".asc", ".trc", ".csv", ".blf", ".mf4"])
@EXAMPLES
@given(damage=damages())
def test_a_damaged_log_in_gzip_is_read_sanely_or_refused(tmp_path, tmp_path_factory, suffix, damage):
    path = tmp_path / f"x{suffix}.gz"
    path.write_bytes(gzip.compress(damaged(whole_log(tmp_path_factory.getbasetemp(), suffix), damage), 1))
    assert_sane_or_refused(path)


@needs_shared
@pytest.mark.parametrize("name", sorted(p.name for p in FORMATS.glob("*")) if FORMATS.is_dir() else [])
@settings(max_examples=12, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damage=damages())
def test_a_damaged_log_of_others_is_read_sanely_or_refused(tmp_path, name, damage):
    content = (FORMATS / name).read_bytes()[:20_000]
    (tmp_path / name).write_bytes(damaged(content, damage))
    assert_sane_or_refused(tmp_path / name)


@pytest.fixture(scope="module")
def foreign_mf4(tmp_path_factory):
    """What asammdf writes, packed column by column, and a short piece of another logger's file."""
    asammdf = pytest.importorskip("asammdf")
    path = tmp_path_factory.mktemp("foreign") / "own.mf4"
    with open_output(path, path) as writer:
        writer.write_columns(columns_from(records(".mf4")))
    files = []
    for compression in (0, 1, 2):
        with asammdf.MDF(path, process_bus_logging=False) as mdf:
            files.append(mdf.save(path.with_name(f"packed{compression}.mf4"), compression=compression))
    if SHARED_DATA.is_dir():
        with asammdf.MDF(SHARED_DATA / "can/3BA199E2_drive_00000164_1.MF4", process_bus_logging=False) as mdf:
            cut = mdf.cut(start=0, stop=3)
            files.append(cut.save(path.with_name("logger.mf4")))
            cut.close()
    return [file.read_bytes() for file in files]


@settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(damage=damages(), which=st.integers(0, 3))
def test_a_damaged_mf4_of_others_is_read_sanely_or_refused(tmp_path, foreign_mf4, damage, which):
    (tmp_path / "x.mf4").write_bytes(damaged(foreign_mf4[which % len(foreign_mf4)], damage))
    assert_sane_or_refused(tmp_path / "x.mf4")


@pytest.mark.parametrize("suffix", OUTPUTS)
@settings(max_examples=10, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(content=st.binary(max_size=300))
def test_any_bytes_under_the_name_of_a_log_are_refused_or_a_log(tmp_path, suffix, content):
    (tmp_path / f"x{suffix}").write_bytes(content)
    assert_sane_or_refused(tmp_path / f"x{suffix}")


@pytest.mark.parametrize("suffix", FULL)
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(cut=st.floats(0, 1))
def test_of_a_log_cut_off_anywhere_the_frames_are_those_that_were_written_first(
    tmp_path, tmp_path_factory, suffix, cut
):
    content = whole_log(tmp_path_factory.getbasetemp(), suffix)
    path = tmp_path / f"x{suffix}"
    path.write_bytes(content)
    whole = read_log(path)
    path.write_bytes(content[: int(cut * len(content))])
    try:
        part = read_log(path)
    except LogError:
        return
    taken = np.isin(whole.t_ns, part.t_ns)
    if suffix != ".mf4":  # which has a table for each kind of frame
        assert not np.diff(taken.astype(int)).clip(min=0).any()
    last = suffix in (".log", ".asc")  # a line without its end may still be a line
    for one, other in zip(whole.columns, part.columns, strict=True):
        same = other if other.ndim == 1 else other[:, :8]
        kept = one[taken] if one.ndim == 1 else one[taken][:, :8]
        assert (kept == same)[: len(same) - last].all()

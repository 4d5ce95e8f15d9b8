"""MDF 4 packed in every way there is: the frames are those that were put in, and damage is one line."""

import sys

import lz4.frame
import numpy as np
import pytest
import zstandard
from asammdf import MDF, Signal

from vsensor.cli import main
from vsensor.errors import LogError, MissingExtraError
from vsensor.logs import read_log, write_log
from vsensor.logs.mf4_unzip import UnzipError, unzip
from vsensor.logs.report import Notes
from vsensor.logs.table import FD, Record, columns_from, table_from

T0 = 1_700_000_000_000_000_000
PACKING = {"none": 0, "deflate": 1, "deflate by column": 2, "zstd": 3, "lz4": 5}
"""As asammdf numbers them; the two others by column it writes, but does not read."""


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    records = [Record(T0 + k * 10**6, k, 0, FD * (k % 2), bytes([k % 256]) * 8) for k in range(1000)]
    path = tmp_path_factory.mktemp("packed") / "plain.mf4"
    write_log(path, table_from("x", columns_from(records), Notes(channels={"1": 0})))
    return path


def packed(log, method):
    with MDF(log, process_bus_logging=False) as mdf:
        newer = mdf.convert("4.30")
        path = newer.save(log.with_name(f"{method}.mf4"), compression=method, overwrite=True)
        newer.close()
    return path


@pytest.mark.parametrize("method", PACKING.values(), ids=PACKING)
def test_what_asammdf_packed_is_read_frame_by_frame(log, method):
    plain, found = read_log(log), read_log(packed(log, method))
    for one, other in zip(plain.columns, found.columns, strict=True):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize(("method", "library"), [(3, "zstandard"), (5, "lz4")])
def test_a_missing_library_is_one_line_with_the_command_that_brings_it(log, method, library, monkeypatch):
    path = packed(log, method)
    monkeypatch.setitem(sys.modules, library if library == "zstandard" else "lz4.frame", None)
    with pytest.raises(MissingExtraError, match=rf"needs {library}.*vsensor\[mf4\]"):
        read_log(path)


@pytest.mark.parametrize("method", [3, 5])
def test_a_damaged_block_is_told_by_its_place(log, method):
    path = packed(log, method)
    content = bytearray(path.read_bytes())
    at = content.index(b"##DZ") + 24 + 24
    content[at : at + 40] = bytes(40)
    path.write_bytes(content)
    with pytest.raises(LogError, match=r"packed data at \d+ are damaged"):
        read_log(path)


CONTENT = np.random.default_rng(3).integers(0, 4, 1003, dtype=np.uint8).tobytes()
PACKERS = {2: zstandard.compress, 4: lz4.frame.compress}


@pytest.mark.parametrize("method", PACKERS)
def test_what_was_stored_by_column_is_turned_back(method):
    rows = np.frombuffer(CONTENT[:1000], dtype=np.uint8).reshape(100, 10)
    turned = rows.T.tobytes() + CONTENT[1000:]
    assert unzip(PACKERS[method](turned), method + 1, 10, len(CONTENT)) == CONTENT


@pytest.mark.parametrize("method", PACKERS)
def test_no_more_is_unpacked_than_the_block_says(method):
    bomb = PACKERS[method](bytes(10_000_000))
    assert unzip(bomb, method, 0, 100) == bytes(100)


@pytest.mark.parametrize("method", PACKERS)
def test_what_ends_too_early_is_refused(method):
    with pytest.raises(UnzipError):
        unzip(PACKERS[method](CONTENT)[:-20], method, 0, len(CONTENT))


def test_a_method_that_nobody_knows_is_refused():
    with pytest.raises(UnzipError, match="method 6 is not known"):
        unzip(b"", 6, 0, 1)


def test_a_header_that_names_no_block_is_refused(log, tmp_path):
    content = bytearray(log.read_bytes())
    content[64 + 16 : 64 + 24] = bytes(8)  # of HD: how many links it has
    (tmp_path / "x.mf4").write_bytes(content)
    with pytest.raises(LogError, match="its header is damaged"):
        read_log(tmp_path / "x.mf4")


def test_a_file_of_measured_signals_without_a_bus_is_refused_for_that_reason(tmp_path, capsys):
    times = np.arange(100) / 100
    with MDF(version="4.10") as mdf:
        mdf.append([Signal(samples=times**2, timestamps=times, name="speed", unit="m/s")])
        mdf.save(tmp_path / "daq.mf4")
    with pytest.raises(LogError, match=r"daq\.mf4: .*the file holds no CAN bus logging"):
        read_log(tmp_path / "daq.mf4")
    assert main(["replay", str(tmp_path / "daq.mf4"), "--bus", "virtual:daq"]) == 2
    assert capsys.readouterr().err.count("\n") == 1

"""Decoded signals of a log as Parquet."""

import numpy as np
import pytest

from vsensor.cli import main
from vsensor.codec import decode_bulk, load_database
from vsensor.errors import LogError
from vsensor.logs import read_log
from vsensor.logs.decode import decode_log
from vsensor.logs.parquet import signals_to_parquet
from vsensor.profile import load_profile
from vsensor.profile.load import SHIPPED

polars = pytest.importorskip("polars")


@pytest.fixture(scope="module")
def lanes(tmp_path_factory):
    """A log of our own lane frames."""
    path = tmp_path_factory.mktemp("lanes") / "lanes.blf"
    assert main(["run", "--fast", "--duration", "3", "--quiet", "--log", str(path)]) == 0
    return path


def test_every_signal_of_every_frame_is_a_row(lanes, tmp_path):
    database = load_database(SHIPPED / "lds.dbc")
    signals_to_parquet(lanes, tmp_path / "x.parquet", database)
    found = polars.read_parquet(tmp_path / "x.parquet")
    log = read_log(lanes)
    for layout in database.layouts.values():
        rows = log.arbitration_id == layout.arbitration_id
        for name, values in decode_bulk(layout, log.data[rows]).items():
            own = found.filter((polars.col("message") == layout.name) & (polars.col("signal") == name))
            there = ~np.isnan(values)
            np.testing.assert_array_equal(own["value"].to_numpy(), values[there])
            np.testing.assert_array_equal(own["t_ns"].to_numpy(), log.t_ns[rows][there])


def test_units_and_channels_stand_beside_the_values(lanes, tmp_path):
    signals_to_parquet(lanes, tmp_path / "x.parquet", load_database(SHIPPED / "lds.dbc"))
    found = polars.read_parquet(tmp_path / "x.parquet")
    assert set(found["channel"]) == set(read_log(lanes).channel_names)
    units = dict(found.select("signal", "unit").unique().iter_rows())
    assert units["LeftOffset"] == "m"


def test_by_a_profile_the_table_is_that_of_decode(lanes, tmp_path):
    out = tmp_path / "x.parquet"
    assert main(["convert", str(lanes), str(out), "--profile", "native"]) == 0
    found, expected = polars.read_parquet(out), decode_log(lanes, [load_profile("native")])
    assert found.columns == ["t_ns", *expected.columns]
    for name, values in expected.columns.items():
        np.testing.assert_array_equal(found[name].fill_null(np.nan).to_numpy(), values)


def test_by_a_profile_a_log_without_times_gets_them_from_the_rate(lanes, tmp_path):
    bare, out = tmp_path / "bare.log", tmp_path / "x.parquet"
    log = read_log(lanes)
    rows = zip(log.arbitration_id.tolist(), log.data, log.length, strict=True)
    bare.write_text("".join(f"can0 {number:03X}#{data[:n].tobytes().hex()}\n" for number, data, n in rows))
    assert main(["convert", str(bare), str(out), "--profile", "native", "--rate", "13000"]) == 0
    found, expected = polars.read_parquet(out), decode_log(lanes, [load_profile("native")])
    assert found["t_ns"].max() == pytest.approx((len(log) - 13) * 1e9 / 13000, abs=2e9 / 13000)
    index = found["image.index"].drop_nulls().unique().to_list()
    assert sorted(index) == sorted(np.unique(expected.columns["image.index"]).tolist())


def test_frames_that_the_database_does_not_describe_are_counted(tmp_path, lanes):
    log = read_log(lanes)
    (tmp_path / "x.log").write_text(
        "".join(
            f"(1.0) can0 {i:03X}#{d.tobytes().hex()}\n"
            for i, d in zip(log.arbitration_id, log.data, strict=True)
        )
        + "(2.0) can0 7FF#00\n(2.0) can0 7FE#00\n(2.0) can0 7FE#00\n"
    )
    done = signals_to_parquet(tmp_path / "x.log", tmp_path / "x.parquet", load_database(SHIPPED / "lds.dbc"))
    assert done.lost == (f"3 frames of 2 ids that {SHIPPED / 'lds.dbc'} does not describe",)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["x.parquet"], "need --dbc FILE or --profile NAME"),
        (["x.blf", "--profile", "native"], "into .parquet"),
        (["x.parquet", "--dbc", str(SHIPPED / "vehicle.dbc")], "holds no frame that"),
    ],
)
def test_what_cannot_be_decoded_is_one_line_and_leaves_no_file(lanes, tmp_path, capsys, words, said):
    assert main(["convert", str(lanes), str(tmp_path / words[0]), *words[1:]]) == 2
    text = capsys.readouterr().err
    assert said in text
    assert text.count("\n") == 1
    assert list(tmp_path.iterdir()) == []


def test_a_full_disk_is_one_line(lanes, tmp_path, monkeypatch):
    def full(*_: object, **__: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(polars.LazyFrame, "sink_parquet", full)
    with pytest.raises(LogError, match="No space left"):
        signals_to_parquet(lanes, tmp_path / "x.parquet", load_database(SHIPPED / "lds.dbc"))


def test_a_damaged_log_is_decoded_up_to_the_fault_and_says_so(lanes, tmp_path):
    whole = lanes.read_bytes()
    (tmp_path / "cut.blf").write_bytes(whole[: len(whole) * 2 // 3])
    done = signals_to_parquet(
        tmp_path / "cut.blf", tmp_path / "x.parquet", load_database(SHIPPED / "lds.dbc")
    )
    assert done.frames > 0
    assert "cut off" in done.notes[0]

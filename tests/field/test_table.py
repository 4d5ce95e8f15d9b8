"""The table of errors: what is written is read, what is not of its schema is refused by name."""

import numpy as np
import polars
import pytest

from vsensor.errors import LogError, TableError
from vsensor.field.table import COLUMNS, MASKS, Masked, open_table, polars_schema, write_table


def rows(count, *, t_ns=0, **given):
    """Return `count` rows at one time, ranges 1, 3, 5 ..."""
    values = {name: np.zeros(count) for name in COLUMNS if name != "log"}
    values |= {"t_ns": np.full(count, t_ns), "range_m": 1.0 + 2.0 * np.arange(count)}
    values["masked"] = np.zeros(count, dtype=np.uint8)
    return values | given


def test_rows_of_two_folders_come_back_as_one_table_with_the_types_of_the_schema(tmp_path):
    write_table(tmp_path / "a" / "one.parquet", "one", [rows(3), rows(2, t_ns=5)], {"log": "one"})
    write_table(tmp_path / "b" / "two.parquet", "two", [rows(4)], {"log": "two"})
    table = open_table([tmp_path / "a", tmp_path / "b"])
    found = table.scan().collect()
    assert dict(found.schema) == polars_schema()
    assert found["log"].to_list() == ["one"] * 5 + ["two"] * 4
    assert [file.info["rows"] for file in table.files] == [5, 4]


def test_nan_is_null_and_a_masked_row_is_not_used(tmp_path):
    masked = np.array([MASKS.index(Masked.USED), MASKS.index(Masked.LOW_SPEED), 0], dtype=np.uint8)
    part = rows(3, masked=masked, error_m=np.array([0.1, 0.2, np.nan]), night=np.full(3, np.nan))
    write_table(tmp_path / "one.parquet", "one", [part], {"log": "one"})
    table = open_table([tmp_path])
    assert table.scan(used_only=True).select("error_m").collect().to_series().to_list() == [np.float32(0.1)]
    assert table.scan().collect()["masked"].to_list() == ["", "low_speed", ""]
    assert table.scan().collect()["night"].null_count() == 3


def test_what_is_counted_while_rows_are_made_stands_in_the_metadata(tmp_path):
    info = {"log": "one"}

    def parts():
        yield rows(2)
        info["seen"] = 7

    write_table(tmp_path / "one.parquet", "one", parts(), info)
    assert open_table([tmp_path]).files[0].info["seen"] == 7


def test_an_error_on_the_way_leaves_no_file_and_keeps_the_one_before(tmp_path):
    path = tmp_path / "one.parquet"
    write_table(path, "one", [rows(2)], {"log": "one"})

    def parts():
        yield rows(3)
        raise LogError("the log ends here")

    with pytest.raises(LogError, match="ends here"):
        write_table(path, "one", parts(), {"log": "one"})
    assert [file.name for file in tmp_path.iterdir()] == ["one.parquet"]
    assert open_table([tmp_path]).scan().select(polars.len()).collect().item() == 2


def test_a_file_of_another_schema_is_refused_by_name(tmp_path):
    write_table(tmp_path / "good.parquet", "good", [rows(1)], {"log": "good"})
    polars.DataFrame({"t_ns": [1]}).write_parquet(tmp_path / "zz.parquet")
    with pytest.raises(TableError, match=r"zz.parquet: its schema is None, 'vsensor.table/1' was expected"):
        open_table([tmp_path])


def test_a_column_of_another_type_is_refused_by_name(tmp_path):
    polars.DataFrame({"log": ["one"]}).write_parquet(
        tmp_path / "one.parquet", metadata={"vsensor.schema": "vsensor.table/1"}
    )
    with pytest.raises(TableError, match=r"one.parquet: column log is String, expected Categorical"):
        open_table([tmp_path])


def test_a_log_that_is_there_twice_is_refused_naming_both_files(tmp_path):
    for folder in "ab":
        write_table(tmp_path / folder / "one.parquet", "one", [rows(1)], {"log": "one"})
    with pytest.raises(TableError, match=r"b/one.parquet: log 'one' is in .*a/one.parquet too"):
        open_table([tmp_path / "a", tmp_path / "b"])


def test_a_truncated_file_is_refused_by_name(tmp_path):
    path = tmp_path / "one.parquet"
    write_table(path, "one", [rows(50)], {"log": "one"})
    path.write_bytes(path.read_bytes()[:-40])
    with pytest.raises(TableError, match=r"one.parquet: is no whole Parquet file"):
        open_table([tmp_path])


def test_an_empty_folder_says_how_a_table_is_made(tmp_path):
    with pytest.raises(TableError, match="vsensor scan"):
        open_table([tmp_path])

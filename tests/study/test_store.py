from pathlib import Path

import pytest

from vsensor.errors import ConfigError
from vsensor.study.store import Store, cell_key, decoded, encoded
from vsensor.study.table import replace_file


def test_the_key_does_not_depend_on_the_order_of_the_settings():
    assert cell_key({"a": 1, "b": {"c": 2, "d": 3}}) == cell_key({"b": {"d": 3, "c": 2}, "a": 1})


@pytest.mark.parametrize("other", [{"a": 2}, {"a": 1.0}, {"a": True}, {"a": "1"}, {"b": 1}, {"a": [1]}, {}])
def test_any_other_content_has_another_key(other):
    assert cell_key(other) != cell_key({"a": 1})


def test_the_key_is_the_same_in_every_process_and_release():
    assert cell_key({"a": [1, 2.5, "x"]}) == "9c075d503817fa30b85098a493264e1b"


def test_what_is_written_is_read_with_nan_as_nothing_and_floats_to_the_last_bit(tmp_path):
    store = Store(tmp_path / "new" / "cells")
    store.write("k", encoded({"a": 1}, {"nan": float("nan"), "x": 0.1 + 0.2, "n": 3}))
    assert store.read("k") == {"nan": None, "x": 0.30000000000000004, "n": 3}
    assert [path.name for path in store.folder.iterdir()] == ["k.json"]


def test_an_unfinished_cell_has_no_result(tmp_path):
    assert Store(tmp_path).read("absent") is None


def test_a_file_cut_off_anywhere_is_not_finished():
    content = encoded({"a": 1}, {"x": 2})
    assert decoded(content) == {"x": 2}
    assert all(decoded(content[:end]) is None for end in range(len(content)))


def test_a_file_of_another_schema_is_not_finished():
    assert decoded(encoded({"a": 1}, {"x": 2}).replace(b"vsensor.cell/1", b"vsensor.cell/2")) is None


def test_a_folder_that_cannot_be_is_named(tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ConfigError, match=r"file/cells: cannot be made"):
        Store(tmp_path / "file" / "cells")


def test_of_a_file_for_which_the_disk_is_full_nothing_is_left_and_the_one_before_stays(tmp_path, monkeypatch):
    def full(path, content):
        path.open("wb").close()
        raise OSError(28, "No space left on device")

    replace_file(tmp_path / "x.csv", b"before")
    monkeypatch.setattr(Path, "write_bytes", full)
    with pytest.raises(ConfigError, match=r"x\.csv: cannot be written: No space left"):
        replace_file(tmp_path / "x.csv", b"after")
    assert [path.name for path in tmp_path.iterdir()] == ["x.csv"]
    assert (tmp_path / "x.csv").read_bytes() == b"before"

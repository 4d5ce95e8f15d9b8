"""Storyboards in a matrix: bare .xosc files, their parameters as settings, what a finished run depends on."""

import csv

import pytest

from tests import stories
from tests.experiment.test_experiment import vsensor
from vsensor.errors import StoryError
from vsensor.experiment.matrix import load_matrix, points_of
from vsensor.experiment.plan import make_plan
from vsensor.sinks.trace import read_trace

SPEED = '<ParameterDeclaration name="Speed" parameterType="double" value="20"/>'
CATALOG = '<CatalogLocations><VehicleCatalog><Directory path="cars"/></VehicleCatalog></CatalogLocations>'
CARS = (
    '<OpenSCENARIO><FileHeader revMajor="1" revMinor="1"/>'
    f'<Catalog name="cars">{stories.CAR}</Catalog></OpenSCENARIO>'
)
MATRIX = """schema = "vsensor.experiment/1"
name = "stories"
scenarios = ["story.xosc"]
duration_s = 0.4
outputs = ["trace"]
[settings]
storyboard.parameters.Speed = [10, 30.5]
"""


@pytest.fixture
def matrix(tmp_path):
    """A matrix beside a storyboard whose vehicles come from a catalog and drive at a parameter's speed."""
    place = stories.private("Ego", stories.teleport(stories.lane_position(50)), stories.speed("$Speed"))
    init = place.replace("$Speed", '<AbsoluteTargetSpeed value="$Speed"/>')
    bodies = {"Ego": stories.catalog_reference("cars", "car")}
    text = stories.text(init, entities=("Ego",), parameters=SPEED, more=CATALOG, bodies=bodies)
    stories.written(tmp_path, text)
    (tmp_path / "cars").mkdir()
    (tmp_path / "cars" / "cars.xosc").write_text(CARS)
    path = tmp_path / "stories.toml"
    path.write_text(MATRIX)
    return path


def test_a_storyboard_runs_with_every_value_of_a_parameter(matrix, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("vsensor.experiment.report._page", lambda *words: [])  # pictures take their time
    out = tmp_path / "out"
    status, said, err = vsensor(capsys, "experiment", matrix, "--quiet", "--workers", 1, "--out", out)
    assert status == 0, said + err
    with (out / "table.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [(row["scenario"], row["storyboard.parameters.Speed"]) for row in rows] == [
        ("story.xosc", "10"),
        ("story.xosc", "30.5"),
    ]
    for row in rows:
        speeds = read_trace(out / "runs" / row["run"] / "trace.parquet")["speed_mps"]
        assert set(speeds) == {float(row["storyboard.parameters.Speed"])}


@pytest.mark.parametrize("name", ["map.xodr", "cars/cars.xosc"])
def test_a_finished_run_does_not_count_once_a_file_of_the_storyboard_has_changed(matrix, tmp_path, name):
    before = make_plan(load_matrix(str(matrix)), outputs=()).cells
    assert make_plan(load_matrix(str(matrix)), outputs=()).cells == before
    file = tmp_path / name
    file.write_text(file.read_text().replace("</", " </", 1))
    assert all(
        a != b for a, b in zip(before, make_plan(load_matrix(str(matrix)), outputs=()).cells, strict=True)
    )


def test_a_parameter_that_the_storyboard_does_not_declare_is_refused(matrix):
    matrix.write_text(MATRIX.replace("Speed", "Sped"))
    with pytest.raises(StoryError, match="no parameter Sped to set; declared: Speed"):
        make_plan(load_matrix(str(matrix)), outputs=())
    assert len(list(points_of(load_matrix(str(matrix))))) == 2

"""The operating range over speed."""

import math

import numpy as np
import pytest

from tests.lines import line_points, points_of
from vsensor.errors import ConfigError
from vsensor.region import RegionConfig, limit, operating_range_m, reach_at
from vsensor.schema import convert
from vsensor.types import Observation

TABLE = RegionConfig(speed_kmh=(36.0, 72.0, 108.0), range_m=(30.0, 50.0, 90.0))
X = np.arange(0.0, 101.0)


def observation(*lines):
    points = line_points(*lines)
    count = len(lines)
    return Observation(
        lines=points,
        sigma_y_m=np.arange(len(points.index), dtype=float),
        kind=np.arange(count, dtype=np.uint8),
        colour=np.ones(count, dtype=np.uint8),
        width_m=np.full(count, 0.15),
        candidates=points,
        reason=np.zeros(len(points.index), dtype=np.uint8),
    )


@pytest.mark.parametrize(
    ("speed_mps", "expected_m"),
    [(-5, 30), (0, 30), (10, 30), (15, 40), (20, 50), (25, 70), (30, 90), (80, 90)],
)
def test_the_range_is_linear_between_the_tables_points_and_constant_beyond(speed_mps, expected_m):
    assert operating_range_m(TABLE, speed_mps) == pytest.approx(expected_m, abs=1e-12)


def test_the_default_range_grows_with_speed_from_20_to_100_m():
    ranges = [operating_range_m(RegionConfig(), speed) for speed in np.linspace(0, 40, 81)]
    assert (ranges[0], ranges[-1]) == (20.0, 100.0)
    assert (np.diff(ranges) >= 0).all()


def test_an_unknown_speed_gives_the_shortest_range():
    assert operating_range_m(TABLE, math.nan) == 30.0


def test_points_beyond_the_range_are_dropped_and_the_last_one_within_stays():
    found = limit(reach_at(TABLE, 20.0), observation((X, 0 * X), (X[60:], 0 * X[60:]), (X[:5], X[:5])), 7)
    np.testing.assert_array_equal(points_of(found.lines, 0)[:, 0], X[:51])
    assert len(points_of(found.lines, 1)) == 0
    np.testing.assert_array_equal(points_of(found.lines, 2)[:, 1], X[:5])


def test_a_point_just_at_the_range_is_reported():
    found = limit(reach_at(TABLE, 0.0), observation((X, 0 * X)), 0)
    assert found.lines.points_ego_m[-1, 0] == found.operating_range_m == 30.0


def test_what_belongs_to_a_point_goes_with_it():
    seen = observation((X, 0 * X), (X, 1 + 0 * X))
    found = limit(reach_at(TABLE, 20.0), seen, 7)
    np.testing.assert_array_equal(found.sigma_y_m, np.concatenate([np.arange(51.0), np.arange(101.0, 152.0)]))
    np.testing.assert_array_equal(found.lines.index, np.concatenate([np.arange(51), np.arange(51)]))
    np.testing.assert_array_equal(found.lines.marking, seen.lines.marking)
    np.testing.assert_array_equal(found.kind, seen.kind)


def test_time_and_range_are_passed_on():
    found = limit(reach_at(TABLE, 20.0), observation((X, X)), 123)
    assert (found.exposed_at_ns, found.operating_range_m) == (123, pytest.approx(50.0))


def test_where_not_enabled_everything_passes():
    found = limit(reach_at(RegionConfig(enabled=False), 0.0), observation((X, X)), 0)
    assert len(found.lines.index) == 101
    assert found.operating_range_m == math.inf


def test_no_line_is_no_trouble():
    assert len(limit(reach_at(TABLE, 20.0), observation(), 0).lines.index) == 0


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        ({"speed_kmh": [0.0, 50.0, 100.0]}, "the same number was expected"),
        ({"speed_kmh": [50.0, 50.0]}, "rising values were expected"),
        ({"speed_kmh": [], "range_m": []}, "at least one"),
        ({"range_m": [20.0, -1.0]}, r"range_m\[1\] = -1.0"),
        ({"range": [20.0]}, "did you mean range_m"),
    ],
)
def test_a_wrong_table_is_refused_by_name(table, expected):
    with pytest.raises(ConfigError, match=expected):
        convert(table, RegionConfig, "region.toml")

"""Where a model reports: its operating range over speed, and the cells that it knows too little of."""

import dataclasses
import math

import numpy as np
import pytest

from tests.error_model.models import GRID_MPS, RANGE_M, STD_M, X_M, at, flat_model, law_of, once
from tests.lines import line_points, points_of
from tests.test_region import observation
from vsensor.error_model import reach
from vsensor.region import RegionConfig, limit, reach_at
from vsensor.schema import convert

REGION = {"region_speed_mps": np.array([5.0, 25.0]), "region_range_m": np.array([30.0, 90.0])}


def blind_at(*cells):
    blind = np.zeros(STD_M.shape, bool)
    for range_m, speed_mps in cells:
        blind[range_m == RANGE_M, speed_mps == GRID_MPS] = True
    return blind


def kept_x(model, speed_mps, **config):
    """Return x of the points that are left of a line with one every metre."""
    learned = reach(law_of(model), at(speed_mps))
    found = reach_at(convert(config, RegionConfig, "region"), speed_mps, learned)
    return limit(found, observation((X_M, 0 * X_M)), 0).lines.points_ego_m[:, 0]


@pytest.mark.parametrize(
    ("speed_mps", "end_m"), [(0.0, 30), (5.0, 30), (15.0, 60), (40.0, 90), (math.nan, 30)]
)
def test_points_beyond_the_models_operating_range_are_dropped(speed_mps, end_m):
    np.testing.assert_array_equal(kept_x(flat_model(**REGION), speed_mps), X_M[end_m >= X_M])


def test_a_table_in_the_scenario_is_the_whole_region_whatever_the_model_says():
    model = flat_model(**REGION, blind=blind_at((50.0, 20.0)))
    table = {"speed_kmh": [0.0], "range_m": [70.0]}
    np.testing.assert_array_equal(kept_x(model, 20.0, **table), X_M[X_M <= 70.0])
    np.testing.assert_array_equal(kept_x(model, 20.0, enabled=False), X_M)


def test_a_model_that_says_nothing_of_its_region_leaves_it_to_the_scenario():
    assert reach(law_of(flat_model()), at(20.0)) is None
    np.testing.assert_array_equal(kept_x(flat_model(), 0.0), X_M[X_M <= 20.0])


def test_points_in_blind_cells_are_dropped_up_to_half_way_to_the_next_cell():
    model = flat_model(**REGION, blind=blind_at((50.0, 20.0)))
    gone = (X_M >= 45.0) & (X_M < 55.0)
    np.testing.assert_array_equal(kept_x(model, 25.0), X_M[(X_M <= 90.0) & ~gone])
    np.testing.assert_array_equal(kept_x(model, 29.9), X_M[(X_M <= 90.0) & ~gone])
    np.testing.assert_array_equal(kept_x(model, 30.1), X_M[X_M <= 90.0])


def test_where_the_outermost_cell_is_blind_everything_beyond_is():
    model = flat_model(blind=blind_at((0.0, 40.0), (10.0, 40.0), (110.0, 40.0), (120.0, 40.0)))
    x = np.array([-30.0, 0.0, 14.9, 15.0, 104.9, 105.0, 400.0])
    found = limit(reach(law_of(model), at(60.0)), observation((x, 0 * x)), 0)
    np.testing.assert_array_equal(found.lines.points_ego_m[:, 0], [15.0, 104.9])


def test_at_a_speed_that_is_blind_altogether_no_point_is_left():
    model = flat_model(**REGION, blind=blind_at(*((range_m, 0.0) for range_m in RANGE_M)))
    assert len(kept_x(model, 3.0)) == 0
    assert len(kept_x(model, 12.0)) > 0


def test_where_lines_ended_beyond_the_operating_range_points_are_used_up_to_there():
    share = {"range_share_levels": np.array([0.1, 0.9]), "range_share": np.array([0.5, 1.25])}
    model = flat_model(region_speed_mps=np.array([0.0]), region_range_m=np.array([60.0]), **share)
    found = reach(law_of(model), at(20.0))
    assert (found.range_m, found.points_m) == (60.0, 75.0)


def test_values_of_blind_cells_are_those_of_the_nearest_that_is_not():
    blind = blind_at((120.0, 20.0))
    model = flat_model(blind=blind)
    absolute = model.absolute_m.copy()
    absolute[:, blind] = np.nan
    law = law_of(dataclasses.replace(model, absolute_m=absolute), "extreme")
    lines = line_points((np.array([110.0, 120.0]), np.zeros(2)))
    y = points_of(once(law, lines, speed_mps=20.0), 0)[:, 1]
    np.testing.assert_allclose(y, 0.02 * (110.0 + 20.0), atol=1e-12)

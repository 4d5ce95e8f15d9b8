import dataclasses

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tests.lines import line_points
from vsensor.quality import QualityConfig, rate, sightings
from vsensor.types import Colour, Detections, Environment, Fit, Light, MarkingKind, frozen

CONFIG = QualityConfig()
X_M = np.arange(4.0, 80.05, 0.1)


def line(x_min_m=4.0, x_max_m=80.0, points=760, std_m=0.02, residual_std_m=0.03, c0=1.75):
    """A line whose y has the same standard deviation everywhere."""
    return Fit(
        coefficients=frozen([c0, 0.0]),
        covariance=frozen(np.diag([std_m**2, 0.0])),
        x_min_m=x_min_m,
        x_max_m=x_max_m,
        residual_std_m=residual_std_m,
        points=points,
    )


def quality(x_m=X_M, environment=None, config=CONFIG, **fit):
    return rate(config, line(**fit), x_m, environment or Environment())


def with_gap(gap_m):
    return np.concatenate([np.arange(4.0, 30.0, 0.1), np.arange(29.9 + gap_m, 80.0, 0.1)])


def test_a_long_dense_line_by_day_has_the_highest_quality():
    assert quality() == 4


def test_no_line_has_quality_0():
    assert rate(CONFIG, None, X_M, Environment()) == 0


# the table of the module, just inside and just outside of each limit
@pytest.mark.parametrize(
    ("change", "limits", "step"),
    [
        (lambda v: {"x_max_m": v, "x_min_m": v - 76.0}, CONFIG.range_m, 0.1),
        (lambda v: {"x_min_m": 15.0, "x_max_m": 15.0 + v}, CONFIG.length_m, 0.1),
        (lambda v: {"x_min_m": v}, CONFIG.start_m, -0.1),
        (lambda v: {"points": round(v)}, CONFIG.points, 1),
        (lambda v: {"x_m": with_gap(v)}, CONFIG.gap_m, -0.1),
        (lambda v: {"std_m": v}, CONFIG.std_m, -0.001),
        (lambda v: {"residual_std_m": v}, CONFIG.residual_m, -0.001),
        (lambda v: {"environment": Environment(rain=v)}, CONFIG.rain, -0.001),
    ],
)
def test_each_row_of_the_table_gives_2_3_4_inside_its_limits_and_one_less_outside(change, limits, step):
    inside = [quality(**change(limit + 1e-9 * step)) for limit in limits]
    outside = [quality(**change(limit - step)) for limit in limits]
    assert inside == [2, 3, 4]
    assert outside == [1, 2, 3]


def test_night_allows_quality_3_at_most_and_dusk_changes_nothing():
    assert quality(environment=Environment(light=Light.NIGHT)) == 3
    assert quality(environment=Environment(light=Light.DUSK)) == 4
    assert quality(environment=Environment(light=Light.NIGHT), points=30) == 2


@given(
    st.floats(0.0, 60.0),
    st.floats(1.0, 60.0),
    st.integers(2, 900),
    st.floats(0.0, 0.8),
    st.floats(0.0, 1.0),
    st.sampled_from(["length", "points", "std_m", "residual_std_m", "rain"]),
    st.floats(0.0, 1.0),
)
def test_seeing_more_or_better_never_lowers_the_quality(start, length, points, bad, rain, what, by):
    def rated(length=length, points=points, std_m=bad, residual_std_m=bad, rain=rain):
        return quality(
            environment=Environment(rain=rain),
            x_min_m=start,
            x_max_m=start + length,
            points=points,
            std_m=std_m,
            residual_std_m=residual_std_m,
        )

    better = {
        "length": {"length": length + 40.0 * by},
        "points": {"points": points + round(200 * by)},
        "std_m": {"std_m": bad * (1.0 - by)},
        "residual_std_m": {"residual_std_m": bad * (1.0 - by)},
        "rain": {"rain": rain * (1.0 - by)},
    }[what]
    assert rated(**better) >= rated()


def test_more_range_of_the_same_line_never_lowers_the_quality():
    from vsensor.lanefit import LaneFitConfig, fit

    random = np.random.default_rng(5)
    found = []
    for x_max in np.arange(8.0, 100.0, 4.0):
        x = np.arange(4.0, x_max, 0.1)
        y = 1.75 + 0.01 * x + 1e-4 * x**2 + random.normal(0.0, 0.03, len(x))
        found.append(rate(CONFIG, fit(LaneFitConfig(), x, y, np.zeros(len(x))), x, Environment()))
    assert found == sorted(found)
    assert found[0] == 1
    assert found[-1] == 4


def test_a_line_that_is_well_known_at_20_m_may_be_uncertain_at_its_far_end():
    growing = dataclasses.replace(line(), covariance=frozen([[0.0, 0.0], [0.0, 0.004**2]]))
    assert (growing.std_at(20.0), growing.std_at(80.0)) == pytest.approx((0.08, 0.32))
    assert rate(CONFIG, growing, X_M, Environment()) == 4


def test_what_is_not_known_about_a_line_counts_as_poor():
    assert quality(std_m=np.nan) == 1
    assert quality(residual_std_m=np.nan) == 1


def test_a_line_that_exists_has_at_least_quality_1():
    worst = {"x_min_m": 3.0, "x_max_m": 4.0, "points": 2, "std_m": 9.0, "residual_std_m": 9.0}
    environment = Environment(light=Light.NIGHT, rain=1.0)
    assert quality(x_m=np.array([3.0]), environment=environment, **worst) == 1


# --- sightings --------------------------------------------------------------------------------------


def detections():
    lines = line_points((X_M, 0 * X_M + 1.75), (X_M[:0], X_M[:0]), (X_M[:30], 0 * X_M[:30] - 1.75))
    return Detections(
        exposed_at_ns=7,
        lines=dataclasses.replace(lines, marking=frozen([5, 6, 8], np.int64)),
        sigma_y_m=np.zeros(len(lines.points_ego_m)),
        kind=frozen([MarkingKind.SOLID, 0, MarkingKind.DASHED], np.uint8),
        colour=frozen([Colour.WHITE, 0, Colour.YELLOW], np.uint8),
        width_m=frozen([0.15, 0.0, 0.12]),
        operating_range_m=80.0,
    )


def test_a_sighting_joins_the_polynomial_the_quality_and_the_paint():
    fits = (line(), None, line(x_max_m=6.9, points=30, c0=-1.75))
    left, nothing, right = sightings(CONFIG, fits, detections(), Environment(), (15, 16, 18))
    assert nothing is None
    assert (left.quality, left.kind, left.colour) == (4, MarkingKind.SOLID, Colour.WHITE)
    assert (left.width_m, left.marking, left.marking_id) == (0.15, 5, 15)
    assert (right.quality, right.kind, right.colour) == (1, MarkingKind.DASHED, Colour.YELLOW)
    assert (right.width_m, right.marking, right.marking_id) == (0.12, 8, 18)
    assert (left.fit, right.fit) == (fits[0], fits[2])


def test_points_beyond_the_end_of_a_fit_do_not_count_as_a_gap():
    x_m = np.append(np.arange(4.0, 60.0, 0.1), [110.0, 111.0])
    seen = dataclasses.replace(
        detections(),
        lines=line_points((x_m, np.full(len(x_m), 1.75))),
        kind=np.array([1]),
        colour=np.array([1]),
    )
    (left,) = sightings(CONFIG, (line(x_max_m=59.9),), seen, Environment(), (0,))
    assert left.quality == 4

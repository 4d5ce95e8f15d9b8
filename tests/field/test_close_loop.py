"""Closing the loop through the fit: the fitted lines have the tuned law."""

import dataclasses

import numpy as np
import pytest

from tests.field.test_validate import LAW, law_model
from vsensor.field.tune.loop import close_loop
from vsensor.field.virtual import FitSetting, VirtualSensor

RANGES_M = np.arange(2.0, 60.0, 4.0)


def model_with(length_m):
    """A law on 15 ranges whose scale bends, so that a fit changes it."""
    law = dataclasses.replace(LAW, ranges_m=RANGES_M, length_m=length_m)
    region = {"region_speed_mps": np.array([0.0, 40.0]), "region_range_m": np.array([60.0, 60.0])}
    whole = law_model(law, **region)
    columns = np.arange(0, len(whole.speed_mps), 5)  # 0, 10, 20, 30, 40 m/s
    over_cells = ("absolute_m", "absolute_low_m", "absolute_high_m", "signed_m", "applied_signed_m")
    some = {name: getattr(whole, name)[..., columns] for name in (*over_cells, "rows", "seconds", "blind")}
    model = dataclasses.replace(whole, speed_mps=whole.speed_mps[columns], **some)
    bend = 1.0 + 0.5 * np.sin(RANGES_M / 20.0)[None, :, None]
    return dataclasses.replace(
        model, signed_m=model.signed_m * bend, applied_signed_m=model.applied_signed_m * bend
    )


def reported(model, speed_mps, seed=99, count=40_000):
    """Errors of fitted lines (N, R)."""
    sensor = VirtualSensor.of(model, FitSetting())
    z = np.random.default_rng(seed).standard_normal((count, len(sensor.grid_m))) @ sensor.factor.T
    return sensor.errors(z, np.full(count, speed_mps))


def from_the_fit(length_m):
    """A model whose law is what a fit makes of points that are correlated over `length_m`."""
    points = model_with(length_m)
    speeds = points.speed_mps
    law = np.stack([np.quantile(reported(points, v), points.signed_levels, axis=0) for v in speeds], axis=-1)
    return dataclasses.replace(points, signed_m=law, applied_signed_m=law)


def missed(model, target, speed_mps=20.0):
    column = int(np.argmin(np.abs(target.speed_mps - speed_mps)))
    sizes = np.quantile(reported(model, speed_mps), [0.05, 0.5, 0.95], axis=0)
    wanted = [np.interp(p, target.signed_levels, np.arange(41)) for p in (0.05, 0.5, 0.95)]
    true = np.array(
        [[np.interp(w, np.arange(41), target.signed_m[:, r, column]) for r in range(15)] for w in wanted]
    )
    return np.abs(sizes - true) / (true[2] - true[0])


@pytest.fixture(scope="module")
def target():
    return from_the_fit(25.0)


@pytest.fixture(scope="module")
def closed(target):
    return close_loop(target, FitSetting())


def test_what_is_fed_to_the_points_makes_the_fit_report_the_tuned_law(target, closed):
    before, after = missed(target, target).mean(), missed(closed.model, target).mean()
    assert before > 0.007
    assert after < 0.65 * before  # 40,000 draws leave 0.4 % themselves
    assert closed.missed[1] < 0.6 * closed.missed_open[1]


def test_the_tuned_law_itself_is_not_changed(target, closed):
    for name in ("signed_m", "absolute_m", "correlation_length_m", "correlation_time_s"):
        np.testing.assert_array_equal(getattr(closed.model, name), getattr(target, name))
    assert np.all(np.diff(closed.model.applied_signed_m, axis=0) >= 0.0)


def test_a_law_that_the_fit_keeps_is_hardly_touched():
    model = law_model(region_range_m=np.array([35.0, 35.0]))  # linear in the range, correlated over 200 m
    found = close_loop(model, FitSetting(seen_from_m=5.0))
    np.testing.assert_allclose(found.model.applied_signed_m, model.signed_m, atol=0.002)
    np.testing.assert_allclose(found.model.applied_time_s, model.correlation_time_s, rtol=0.03)
    assert found.missed[1] < 0.01


def test_the_same_seed_gives_the_same_bits(target, closed):
    again = close_loop(target, FitSetting())
    np.testing.assert_array_equal(again.model.applied_signed_m, closed.model.applied_signed_m)

"""The parts of tuning against closed forms and plain computation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from scipy.special import ndtri
from scipy.stats import expon

from vsensor.errors import TableError
from vsensor.field.tune.blocks import LAGS, add_range, add_time, band_steps, scores_of, slots_of
from vsensor.field.tune.conditions import conditions
from vsensor.field.tune.correlation import correlation_length_m, correlation_time_s
from vsensor.field.tune.dwell import dwell_quantiles, dwells_of
from vsensor.field.tune.fir import along_speed, local_scale, low_pass, wider
from vsensor.field.tune.grid import BIN_WIDTH, SIZES, bin_of, signed_edges
from vsensor.field.tune.quantiles import (
    effective_count,
    share_interval,
    signed_quantiles,
    size_quantiles,
    sizes_of,
)
from vsensor.field.tune.reading import Images
from vsensor.field.tune.region import REACH_BINS, operating_region, range_share
from vsensor.field.tune.surface import _variance, unfiltered_m

# --- bins and quantiles -----------------------------------------------------------------------------------


@given(st.lists(st.floats(-60.0, 60.0, width=32), min_size=1, max_size=50))
def test_every_error_lies_between_its_bins_edges(values):
    z = np.array(values, np.float32)
    edges, place = signed_edges(), bin_of(z)
    assert np.all((edges[place] <= z) & (z <= edges[place + 1]))


def test_bins_are_no_wider_than_stated_from_a_sixteenth_of_the_scale_on():
    edges = signed_edges()[SIZES:]
    width = np.diff(edges)[1:-1] / edges[1:-2]
    assert width.max() <= BIN_WIDTH * (1.0 + 1e-12)
    assert edges[1] == 2.0**-4


def test_errors_far_out_are_in_the_outermost_bins():
    assert bin_of(np.array([-1e6, 1e6], np.float32)).tolist() == [0, 2 * SIZES - 1]


@given(st.integers(0, 2**32 - 1), st.integers(200, 3000))
@settings(max_examples=30)
def test_quantiles_of_bins_are_those_of_the_sorted_errors_within_a_bin(seed, count):
    z = np.random.default_rng(seed).standard_t(5, count).astype(np.float32)
    counts = np.bincount(bin_of(z), minlength=2 * SIZES).astype(float)
    levels = np.array([0.5, 0.8, 0.95])
    found = size_quantiles(sizes_of(counts), levels)
    ordered = np.sort(np.abs(z))
    low, high = (ordered[np.clip(np.rint(levels * count + d).astype(int), 0, count - 1)] for d in (-2, 2))
    assert np.all((low * (1.0 - BIN_WIDTH) <= found) & (found <= high * (1.0 + BIN_WIDTH)))
    signed = signed_quantiles(counts, np.array([0.1, 0.5, 0.9]))
    assert np.all(np.diff(signed) > 0.0)


def test_quantiles_of_nothing_are_unknown():
    assert np.isnan(size_quantiles(np.zeros((3, SIZES)), np.array([0.5]))).all()


def test_what_is_shown_before_the_low_pass_is_each_speeds_own_quantile():
    random = np.random.default_rng(7)
    errors = [random.standard_t(5, 4000).astype(np.float32) * scale for scale in (0.02, 0.05)]
    scale_m = np.array([0.03, 0.04])
    counts = np.stack(
        [
            np.bincount(bin_of((one / scale).astype(np.float32)), minlength=2 * SIZES)
            for one, scale in zip(errors, scale_m, strict=True)
        ]
    )
    levels = np.array([0.5, 0.95])
    own = np.stack([np.quantile(np.abs(one), levels) for one in errors], axis=1)
    np.testing.assert_allclose(unfiltered_m(counts, levels, scale_m), own, rtol=BIN_WIDTH)


def test_the_share_interval_is_that_of_a_binomial():
    from scipy.stats import binom

    for n, p in ((100, 0.95), (400, 0.5), (2000, 0.99)):
        low, high = share_interval(np.array([p]), np.array([float(n)]))
        exact = binom.ppf([0.025, 0.975], n, p) / n
        np.testing.assert_allclose([low[0], high[0]], exact, atol=1.5 / n)


def test_the_variance_of_shares_is_that_of_the_block_bootstrap():
    random = np.random.default_rng(4)
    rows = random.integers(50, 150, 60)
    below = random.binomial(rows, random.beta(9, 1, 60))
    squares = [np.array([[[(below * below).sum()]]]), np.array([[[(below * rows).sum()]]])]
    squares.append(np.array([[(rows * rows).sum()]]))
    found, blocks = _variance(np.array([[[below.sum() / rows.sum()]]]), np.array([[rows.sum()]]), squares)
    drawn = random.integers(0, 60, (20_000, 60))
    plain = (below[drawn].sum(axis=1) / rows[drawn].sum(axis=1)).var()
    np.testing.assert_allclose(found[0, 0, 0], plain, rtol=0.05)
    np.testing.assert_allclose(blocks[0, 0], rows.sum() ** 2 / (rows**2).sum())


def covered(cycles, *, block_s=60.0, replicas=400, period_s=0.2):
    """How often the interval of |z| holds the true quantile, by level; speeds are held for 40 s.

    z is AR(1) of 0.8 s. A sixth of the speeds counts for a cell, by the taps of its low-pass: in each minute
    40 s with a weight or none, the last block the fullest. An interval of the quantile holds it if that of
    the share holds what lies below it.
    """
    random = np.random.default_rng(12)
    taps = low_pass(10, 0.2, 0.5).whole
    held = np.sort(taps[random.integers(0, 11, -(-cycles // 6))])
    size = round(40.0 / period_s)
    weight = np.repeat(held, size)
    z = np.abs(ar1(0.8, period_s, len(weight), replicas, seed=13)).T
    length = min(round(block_s / period_s), size)
    starts = np.concatenate([np.arange(at, at + size, length) for at in range(0, len(weight), size)])
    rows = np.add.reduceat(weight, starts)
    total = np.broadcast_to(rows.sum(), (1, replicas))
    order = np.argsort(z, axis=1)
    passed, inside = np.cumsum(weight[order], axis=1) / weight.sum(), []
    for level in (0.5, 0.8, 0.9, 0.95, 0.97, 0.99):
        at = (passed >= level).argmax(axis=1)
        found = z[np.arange(replicas), order[np.arange(replicas), at]]
        below = np.add.reduceat((z <= found[:, None]) * weight, starts, axis=1)
        squares = [(below * below).sum(axis=1)[None, None], (below * rows).sum(axis=1)[None, None]]
        squares.append(np.broadcast_to((rows * rows).sum(), (1, replicas)))
        variance, blocks = _variance(below.sum(axis=1)[None, None] / total, total, squares)
        one = np.array([level])
        low, high = share_interval(one, effective_count(one, variance, blocks))
        true = ((z <= ndtri(0.5 + 0.5 * level)) * weight).sum(axis=1) / weight.sum()
        inside.append(np.mean((low[0, 0] <= true) & (true <= high[0, 0])))
    return np.array(inside)


@pytest.mark.parametrize("cycles", [60, 180])
def test_intervals_hold_the_true_quantile_of_correlated_errors_in_95_percent_of_the_cases(cycles):
    found = covered(cycles)
    assert 0.93 < found.mean() < 0.975  # 400 draws know each level's to 1 %
    assert np.all((found > 0.92) & (found < 0.99))


def test_blocks_that_are_not_longer_than_the_correlation_time_make_intervals_too_narrow():
    assert covered(60, block_s=0.4).mean() < 0.85


# --- the filter -------------------------------------------------------------------------------------------


def test_the_low_pass_keeps_a_constant_and_is_symmetric_and_never_negative():
    taps = low_pass(10, 0.2, 0.5).taps
    assert taps.sum() == pytest.approx(1.0, abs=1e-9)
    np.testing.assert_allclose(taps, taps[::-1], atol=1e-12)
    assert taps.min() >= 0.0


def test_a_low_pass_with_negative_taps_is_refused():
    with pytest.raises(TableError, match="some taps are negative"):
        low_pass(20, 0.2, 0.5)


def test_along_speed_is_a_convolution():
    values, taps = np.arange(12.0) ** 2, np.array([0.25, 0.5, 0.25])
    np.testing.assert_allclose(along_speed(taps, values, 0), np.convolve(values, taps, "same"))
    np.testing.assert_allclose(
        along_speed(taps, np.stack([values, 2 * values]), 1)[1], 2 * np.convolve(values, taps, "same")
    )


def test_the_scale_follows_a_linear_trend_however_unevenly_was_driven():
    speeds = np.arange(60) * 0.5
    trend = (1.0 + 0.03 * speeds)[None, :, None]
    rows = np.random.default_rng(2).integers(1, 1000, (1, 60, 1))
    found = local_scale(wider(low_pass(10, 0.2, 0.5), 0.5), rows, trend)
    np.testing.assert_allclose(found, trend, rtol=1e-9)


# --- correlation ------------------------------------------------------------------------------------------


def ar1(time_s, period_s, images, columns, seed=0):
    keep = np.exp(-period_s / time_s)
    white = np.random.default_rng(seed).standard_normal((images, columns))
    white[1:] *= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], white, axis=0)


@pytest.mark.parametrize("time_s", [0.2, 0.8, 2.0])
def test_the_correlation_time_of_an_ar1_is_found_also_through_white_noise_and_gaps(time_s):
    scores = ar1(time_s, 0.04, 50_000, 8)
    scores += 0.3 * np.random.default_rng(1).standard_normal(scores.shape)
    scores[np.random.default_rng(2).random(len(scores)) < 0.1] = np.nan
    sums = np.zeros((len(LAGS), 3, 8))
    add_time(sums, scores)
    np.testing.assert_allclose(correlation_time_s(sums, 0.04), time_s, rtol=0.06)


@pytest.mark.parametrize("length_m", [15.0, 50.0])
def test_the_correlation_length_of_a_squared_exponential_is_found(length_m):
    range_m = np.arange(1.0, 100.0, 4.0)
    distance = (range_m[:, None] - range_m) / length_m
    factor = np.linalg.cholesky(np.exp(-0.5 * distance**2) + 1e-9 * np.eye(len(range_m)))
    scores = np.random.default_rng(3).standard_normal((8000, len(range_m))) @ factor.T
    scores[:4000, 15:] = np.nan  # the line often ends before
    sums = np.zeros((3, len(range_m), len(range_m)))
    add_range(sums, scores)
    np.testing.assert_allclose(correlation_length_m(sums, range_m), length_m, rtol=0.05)


def test_scores_of_tied_quantiles_are_in_their_middle():
    levels = np.array([0.1, 0.3, 0.5, 0.7, 0.9])
    found = scores_of(np.array([0.5, 1.0]), np.array([0.5, 1.0, 1.0, 1.0, 1.0]), levels)
    np.testing.assert_allclose(found, [ndtri(0.1), 0.5 * (ndtri(0.3) + ndtri(0.9))])


def test_a_pause_takes_as_many_places_as_no_lag_reaches_over_and_shorter_ones_their_own():
    t_ns = np.array([0, 41, 79, 200, 10**15, 10**15 + 40]) * 10**6
    assert slots_of(t_ns, 40_000_000).tolist() == [0, 1, 2, 5, 5 + LAGS[-1] + 1, 5 + LAGS[-1] + 2]


def test_steps_of_bands_are_counted_where_both_images_are_known():
    bands = np.array([[0, 1], [0, -1], [2, 1], [2, 0]])
    np.testing.assert_array_equal(band_steps(bands, 3), [[1, 0, 1], [1, 0, 0], [0, 0, 1]])


# --- dwell times -------------------------------------------------------------------------------------------


def images(reported, period_ns=40_000_000, known=True):
    count = len(reported)
    return Images(
        t_ns=np.arange(count) * period_ns,
        side=np.zeros(count, np.int8),
        speed_mps=np.full(count, 20.0),
        x_max_m=np.where(reported, 50.0, np.nan),
        quality=np.full(count, 3),
        known=np.broadcast_to(known, count).copy(),
        group=np.zeros(count, np.int32),
    )


def test_runs_at_the_ends_of_a_log_and_beside_masked_images_are_cut_off():
    reported = np.array([1, 1, 0, 0, 0, 1, 1, 1, 0, 1], bool)
    known = np.ones(10, bool)
    known[8] = False
    runs = dwells_of(images(reported, known=known), 40_000_000)
    lost, cut = runs.of(0, seen=False)
    np.testing.assert_allclose(lost, [0.12])
    assert cut.tolist() == [False]
    seen, cut = runs.of(0, seen=True)
    np.testing.assert_allclose(sorted(seen), [0.04, 0.08, 0.12])
    assert cut.all()


def test_dwell_quantiles_are_found_although_the_long_runs_are_cut_off():
    random = np.random.default_rng(6)
    whole = random.exponential(2.0, 4000)
    seconds, cut = np.minimum(whole, 3.0), whole > 3.0
    levels = np.array([0.1, 0.5, 0.75, 0.95])
    np.testing.assert_allclose(dwell_quantiles(seconds, cut, levels), expon.ppf(levels, scale=2.0), rtol=0.08)


def test_runs_that_never_ended_give_a_finite_table():
    found = dwell_quantiles(np.array([60.0, 100.0]), np.array([True, True]), np.array([0.0, 0.1, 0.9]))
    assert np.all(np.isfinite(found))
    assert found[0] == 0.0
    assert found[1] > 10.0


# --- reach -------------------------------------------------------------------------------------------------


def reach_counts(reach, speeds, seed=0, images=2000):
    counts = np.zeros((len(speeds), REACH_BINS), np.int64)
    random = np.random.default_rng(seed)
    for k, speed in enumerate(speeds):
        drawn = reach(speed) * random.beta(8, 1, images)
        np.add.at(counts[k], (drawn / 0.5).astype(int), 1)
    return counts


def test_the_operating_range_follows_a_bend():
    speeds = np.arange(0.0, 40.0, 0.5)

    def reach(v):
        return min(20.0 + 80.0 / 30.0 * v, 100.0)

    knots, found = operating_region(reach_counts(reach, speeds), 0.5, 0.95)
    share = 0.95 ** (1 / 8)  # the quantile of beta(8, 1)
    expected = np.array([share * reach(v) for v in knots])
    np.testing.assert_allclose(found, expected, atol=1.2)


def test_of_a_single_speed_the_operating_range_is_its_quantile_beyond_it_too():
    counts = np.zeros((60, REACH_BINS), np.int64)
    counts[40, 100:120] = 50  # 50 to 60 m at 20 m/s
    knots, found = operating_region(counts, 0.5, 0.95)
    assert (knots[0], len(knots)) == (20.0, 2)
    np.testing.assert_allclose(found, 59.25, atol=0.26)


def test_the_share_of_the_operating_range_is_its_distribution():
    speeds = np.arange(10.0, 40.0, 0.5)
    counts = reach_counts(lambda v: 3.0 * v, speeds)
    levels = np.array([0.1, 0.5, 0.9])
    np.testing.assert_allclose(range_share(counts, 3.0 * speeds, levels), levels ** (1 / 8), atol=0.01)


# --- conditions --------------------------------------------------------------------------------------------


def test_the_first_rule_that_fits_counts_and_what_is_unknown_fits_none():
    chosen = conditions("night,rain")
    assert chosen.names == ("night_rain", "night", "rain", "day")
    night = np.array([1.0, 1.0, 0.0, 0.0, np.nan, np.nan])
    rain = np.array([0.5, 0.1, 0.2, np.nan, 0.9, np.nan])
    assert chosen.codes({"night": night, "rain": rain}, 6).tolist() == [0, 1, 2, 3, 2, 3]


def test_without_conditions_there_is_one_model_without_one():
    chosen = conditions("")
    assert (chosen.names, chosen.rule[0].when) == (("all",), {})

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from vsensor.draws import Draws, Stage

seeds = st.integers(0, 2**64 - 1)
ticks = st.integers(0, 2**40)


@given(seeds, st.sampled_from(Stage), ticks, st.integers(-(2**63), 2**63))
def test_the_same_seed_stage_tick_and_part_give_the_same_numbers(seed, stage, tick, part):
    first = Draws(seed).at(stage, tick, part).standard_normal(8)
    np.testing.assert_array_equal(Draws(seed).at(stage, tick, part).standard_normal(8), first)


@given(seeds, ticks, ticks)
def test_what_was_drawn_before_does_not_matter(seed, tick, before):
    draws = Draws(seed)
    draws.at(Stage.CAMERA, before).integers(0, 2**32, 3, dtype=np.uint32)  # leaves half a word over
    used = draws.at(Stage.ERROR_MODEL, tick).random(5)
    np.testing.assert_array_equal(used, Draws(seed).at(Stage.ERROR_MODEL, tick).random(5))


@pytest.mark.parametrize(
    ("seed", "stage", "tick", "part"),
    [
        (2, Stage.CAMERA, 7, 3),
        (1, Stage.REGION, 7, 3),
        (1, Stage.CAMERA, 8, 3),
        (1, Stage.CAMERA, 7, 4),
        (1, Stage.CAMERA, 7, -3),
    ],
)
def test_another_seed_stage_tick_or_part_gives_other_numbers(seed, stage, tick, part):
    first = set(Draws(1).at(Stage.CAMERA, 7, 3).integers(0, 2**63, 100).tolist())
    assert not first & set(Draws(seed).at(stage, tick, part).integers(0, 2**63, 100).tolist())


def test_a_long_draw_does_not_run_into_the_next_tick_stage_or_part():
    long = set(Draws(1).at(Stage.CAMERA, 7).integers(0, 2**63, 100_000).tolist())
    for stage, tick, part in [(Stage.CAMERA, 8, 0), (Stage.REGION, 7, 0), (Stage.CAMERA, 7, 1)]:
        assert not long & set(Draws(1).at(stage, tick, part).integers(0, 2**63, 100).tolist())


def test_a_recorded_run_still_has_its_numbers():
    # written down when the scheme was set: a change would silently alter every recorded run
    found = Draws(1).at(Stage.ERROR_MODEL, 5, 3).integers(0, 2**32, 4).tolist()
    assert found == [2291199112, 4191235311, 3194942334, 2341959850]


def test_normals_over_the_ticks_are_standard_and_uncorrelated():
    draws = Draws(11)
    z = np.array([draws.at(Stage.ERROR_MODEL, tick).standard_normal(4) for tick in range(20_000)])
    assert np.abs(z.mean(axis=0)).max() < 4.0 / np.sqrt(20_000)
    assert np.abs(z.std(axis=0) - 1.0).max() < 4.0 / np.sqrt(2 * 20_000)
    neighbours = np.corrcoef(np.hstack([z[1:], z[:-1]]).T) - np.eye(8)
    assert np.abs(neighbours).max() < 4.5 / np.sqrt(20_000)


def test_large_seeds_that_differ_by_one_give_other_numbers():
    assert Draws(2**64 - 1).at(Stage.CAMERA, 0).random() != Draws(2**64 - 2).at(Stage.CAMERA, 0).random()
    assert Draws(2**63 - 1).at(Stage.CAMERA, 0).random() != Draws(2**63 - 2).at(Stage.CAMERA, 0).random()

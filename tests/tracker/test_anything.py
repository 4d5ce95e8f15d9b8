"""What holds whatever is seen: order of sides, no NaN, a bounded state."""

from collections import Counter

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.lines import ego, tick
from tests.tracker.images import LEFT, NEXT_LEFT, NEXT_RIGHT, RIGHT, SIDES_ONLY, drive, line, shown
from vsensor.tracker import TrackerConfig, assign, initial_state
from vsensor.tracker.state import MOST_TRACKS

CONFIG = TrackerConfig()
LEFT_TO_RIGHT = [NEXT_LEFT, LEFT, RIGHT, NEXT_RIGHT]

lines = st.builds(
    lambda c0, c1, c2, c3, begin, length: line(c0, c1, c2, c3, x_min_m=begin, x_max_m=begin + length),
    st.floats(-9.0, 9.0),
    st.floats(-0.3, 0.3),
    st.floats(-0.01, 0.01),
    st.floats(-1e-4, 1e-4),
    st.floats(0.0, 60.0),
    st.floats(3.0, 80.0),
)
images = st.lists(st.lists(st.none() | lines, max_size=6), min_size=1, max_size=25)
motions = st.tuples(st.floats(-5.0, 50.0) | st.just(np.nan), st.floats(-0.8, 0.8) | st.just(np.inf))


def over(shots, motion, config=CONFIG):
    """Yield state and assignment of each image."""
    state = initial_state()
    for index, fits in enumerate(shots):
        state, found = assign(config, state, shown(fits), ego(*motion), tick(index))
        yield state, found


@given(images, motions)
@settings(max_examples=150)
def test_sides_stand_from_left_to_right_and_no_side_has_two_lines(shots, motion):
    for state, found in over(shots, motion):
        reported = [one.side for one in found.boundaries]
        assert reported == sorted(set(reported))
        tracks = {track.side: track for track in state.tracks if track.side is not None}
        assert max(Counter(t.side for t in state.tracks if t.side is not None).values(), default=0) <= 1
        places = [tracks[side].position_m for side in LEFT_TO_RIGHT if side in tracks]
        assert places == sorted(places, reverse=True)
        assert all(tracks[side].is_left is (side in (LEFT, NEXT_LEFT)) for side in tracks)


@given(images, motions)
@settings(max_examples=150)
def test_nothing_reported_is_nan_and_every_range_lies_ahead(shots, motion):
    for _, found in over(shots, motion):
        for one in found.boundaries:
            assert np.isfinite([*one.coefficients, *one.covariance.ravel(), one.x_min_m, one.x_max_m]).all()
            assert one.x_min_m < one.x_max_m
            assert 1 <= one.quality <= 4
            assert one.measured == (one.points >= 0)
            assert one.measured or one.x_max_m > 0.0
            assert np.linalg.eigvalsh(one.covariance).min() >= -1e-9 * np.abs(one.covariance).max()


@given(images, motions)
@settings(max_examples=50)
def test_the_state_is_bounded_and_empties_when_nothing_is_seen_any_more(shots, motion):
    for state, _ in over([*shots, *[[]] * 80], motion):
        assert len(state.tracks) <= MOST_TRACKS
    assert state.tracks == ()


def test_a_road_with_more_lines_than_are_remembered_keeps_the_seen_ones():
    config = TrackerConfig(max_lateral_m=30.0)
    rows = [[line(0.5 * y + 0.02 * n % 0.4) for y in range(-30, 31)] for n in range(20)]
    state = initial_state()
    for state, _ in over(rows, (0.0, 0.0), config):
        assert len(state.tracks) <= 61 + MOST_TRACKS
    assert sum(track.seen_ns == state.t_ns for track in state.tracks) == 61


@given(st.lists(st.sampled_from([5.2, 1.7, -1.8, -5.3]), min_size=1, max_size=4, unique=True), st.data())
@settings(max_examples=50)
def test_with_everything_seen_in_every_image_prediction_changes_no_side(offsets, data):
    steps = data.draw(st.lists(st.floats(-0.08, 0.08), min_size=5, max_size=60))
    drift = np.cumsum(steps)
    shots = [[line(y + by) for y in offsets] for by in drift]
    predicting, _ = drive(shots, 0.0, CONFIG)
    plain, _ = drive(shots, 0.0, SIDES_ONLY)
    for one, other in zip(predicting[2:], plain[2:], strict=True):
        assert one.sides == other.sides
        assert one.lane_change == other.lane_change
        assert all(boundary.measured for boundary in one.boundaries)

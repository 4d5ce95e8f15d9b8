"""Real roads over hills: who is hidden by the road, against a triangulation of its markings.

The markings' own points, a metre apart, are triangulated (scipy's Delaunay) and sight lines sampled along
their length, where they stay above the road; of that the test of the surface knows nothing.
"""

import numpy as np
import pytest
from scipy.interpolate import LinearNDInterpolator
from scipy.spatial import Delaunay

from tests.maps import real
from tests.shared import needs_shared
from vsensor.raycast import hidden_by_surface
from vsensor.scene import SceneConfig, near, world_from_ego
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.types import Tick
from vsensor.world.corridor import Corridor

RANGE_M = 150.0
LONGEST_M = 5.0
"""A triangle with a longer side is not of the road: it fills the inside of a bend."""

FREE_M = 2e-3
"""The lift, and what the road rises between two sections."""

HIDDEN_M = 1e-3
"""What is hidden may seem free by that: the chord of a metre over a crest of 125 m radius."""

EYE = np.array([1.9, 0.0, 1.35])


def moments(name, every_s):
    """Yield the ego frame, its markings' points and the road's sections there, where there are any."""
    source = MapDrive(Corridor(real(name)), EgoConfig(speed_kmh=72.0), range_m=RANGE_M)
    for t_s in np.arange(0.0, 100.0, every_s):
        seen = source.advance(None, Tick(index=0, t_ns=round(t_s * 1e9), period_ns=40_000_000), ())[1]
        if seen is None:
            return
        if seen.scene.surface is not None:
            pose = world_from_ego(seen.ego)
            points = near(SceneConfig(range_m=RANGE_M, lateral_m=60.0), seen.ego, seen.scene).points_ego_m
            markings = np.concatenate([line.points_world_m[::10] for line in seen.scene.markings])
            yield (
                points,
                (markings - pose.translation) @ pose.rotation,
                (seen.scene.surface.points_world_m - pose.translation) @ pose.rotation,
            )


def depths(points, markings):
    """Return how deep below the triangulated road each sight line passes at most, NaN where it leaves it."""
    mesh = Delaunay(markings[:, :2])
    corners = markings[mesh.simplices][..., :2]
    is_road = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1) < LONGEST_M
    height = LinearNDInterpolator(mesh, markings[:, 2])
    deepest = np.full(len(points), np.nan)
    for place, point in enumerate(points):
        length = np.hypot(*(point - EYE)[:2])
        line = EYE + np.arange(0.0, length, 0.25)[:, None] / length * (point - EYE)
        if is_road[mesh.find_simplex(line[:, :2])].all():
            deepest[place] = np.max(height(line[:, :2]) - line[:, 2])
    return deepest


@needs_shared
@pytest.mark.parametrize(
    ("name", "hidden_at_least"),
    [
        ("crest-curve", 15),
        ("curves_elevation", 50),
        ("Town04", 300),
        ("straight_500_superelevation_elevation_curve", 50),
    ],
)
def test_what_a_real_road_hides_is_what_a_triangulation_of_it_hides(name, hidden_at_least):
    compared = hidden_points = 0
    for points, markings, sections in moments(name, 4.0):
        found = hidden_by_surface(EYE, points, sections)[::23]
        deepest = depths(points[::23], markings)
        known = ~np.isnan(deepest)
        assert not (deepest[known & ~found] > FREE_M).any()
        assert not (deepest[known & found] < -HIDDEN_M).any()
        compared += known.sum()
        hidden_points += (found & known).sum()
    assert compared > 5 * hidden_at_least
    assert hidden_points >= hidden_at_least

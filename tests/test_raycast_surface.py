"""Crests: what the road itself hides, by the horizon of a vertical parabola in closed form."""

from math import cos, pi, sin, sqrt

import numpy as np
import pytest

from tests.maps import geometry, lane, loaded, real, road, section
from tests.roads import snapshot, straight
from tests.shared import needs_shared
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.raycast import hidden_by_surface
from vsensor.scene import SceneConfig
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.transforms import rotation_from_rpy
from vsensor.types import Tick, Unseen
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load_map
from vsensor.world.route import CorridorConfig
from vsensor.world.sections import STEPS_M

EYE = np.array([0.0, 0.0, 1.35])


def sections(height, x, half_m=6.0, bank=0.0):
    """Return cross-sections at `x` of a road of this height along x."""
    y = np.array([half_m, -half_m])
    return np.stack([np.broadcast_to([a, b, height(a) + bank * b], (3,)) for a in x for b in y]).reshape(
        -1, 2, 3
    )


def lines(height, x, places=(1.75, -1.75), bank=0.0):
    """Return points of lines on that road, line after line."""
    return np.array([(a, y, height(a) + bank * y) for y in places for a in x])


def farthest_seen(hidden, points):
    return points[~hidden, 0].max()


def horizon_m(radius_m, eye_m=EYE[2]):
    """Return how far the road is seen from its highest point: the tangent to -x^2 / (2 R)."""
    return sqrt(2.0 * radius_m * eye_m)


@pytest.mark.parametrize("radius_m", [500.0, 1000.0, 2000.0, 3000.0])
@pytest.mark.parametrize("step_m", [1.0, 2.0, 4.0])
def test_a_parabola_hides_what_lies_beyond_its_tangent(radius_m, step_m):
    def height(x):
        return -x * x / (2.0 * radius_m)

    points = lines(height, np.arange(2.0, 120.0, 0.1))
    hidden = hidden_by_surface(EYE, points, sections(height, np.arange(0.0, 150.0, step_m)))
    lift = sqrt(2.0 * radius_m * 1e-3)  # where the sight line has sunk by the lift
    assert horizon_m(radius_m) <= farthest_seen(hidden, points) <= horizon_m(radius_m) + lift + step_m
    assert hidden[points[:, 0] > horizon_m(radius_m) + lift + step_m].all()


def test_lines_that_rise_again_behind_a_crest_are_seen_again():
    def height(x):
        return 4.0 * np.cos(x / 100.0 * 2 * pi) - 4.0

    points = lines(height, np.arange(2.0, 160.0, 0.1), places=(1.75,))
    hidden = hidden_by_surface(EYE, points, sections(height, np.arange(0.0, 170.0, 1.0)))
    x = points[:, 0]
    exact = np.array([_is_behind(height, a) for a in x])
    changes = x[1:][np.diff(exact.astype(int)) != 0]
    assert len(changes) == 3  # hidden behind the crest, seen on the rise, hidden behind the next crest
    far = np.abs(x[:, None] - changes).min(axis=1) > 2.5
    np.testing.assert_array_equal(hidden[far], exact[far])


def _is_behind(height, x, eye=EYE):
    between = np.linspace(0.0, x, 4000)[1:-1]
    return bool((height(between) > eye[2] + (height(x) - eye[2]) * between / x).any())


@pytest.mark.parametrize(
    ("height", "bank"),
    [
        (lambda x: 0.0 * x, 0.0),
        (lambda x: 0.07 * x, 0.0),
        (lambda x: -0.07 * x, 0.08),
        (lambda x: x * x / 400.0, 0.0),
        (lambda x: x * x / 1000.0, -0.1),
        (lambda x: 0.0 * x, 0.6),
    ],
    ids=["plane", "uphill", "downhill and banked", "sag", "sag and banked", "velodrome"],
)
def test_a_plane_a_sag_and_a_banked_road_hide_nothing(height, bank):
    points = lines(height, np.arange(0.5, 150.0, 0.1), (5.9, 1.75, -1.75, -5.9), bank)
    road_sections = sections(height, np.arange(-20.0, 160.0, 2.0), bank=bank)
    assert not hidden_by_surface(EYE, points, road_sections).any()


def test_a_flat_bend_of_the_smallest_radius_hides_nothing_though_it_comes_round_again():
    turn = np.arange(0.0, 1.6, 0.002)
    points = np.concatenate(
        [np.column_stack([r * np.sin(turn), 30 - r * np.cos(turn), 0 * turn]) for r in (25, 28.5, 32)]
    )
    ring = np.array([[(r * sin(a), 30 - r * cos(a), 0.0) for r in (25, 32)] for a in np.arange(0, 3.2, 0.05)])
    assert not hidden_by_surface(EYE, points, ring).any()


@pytest.mark.parametrize(("aside_m", "is_hidden"), [(2.9, True), (3.1, False)])
def test_a_hill_beside_the_road_hides_nothing_unless_its_verge_is_in_the_way(aside_m, is_hidden):
    hill = np.array([[(40.0, aside_m, 9.0), (40.0, aside_m + 6.0, 9.0)]])
    points = np.array([(80.0, 0.0, 0.0)])
    assert hidden_by_surface(EYE, points, hill) == [is_hidden]
    assert hidden_by_surface(EYE, points, hill[:, ::-1]) == [is_hidden]


def test_the_answer_is_the_same_far_out_turned_and_on_a_slope():
    def height(x):
        return -x * x / 2000.0

    points = lines(height, np.arange(2.0, 100.0, 0.1))
    across = sections(height, np.arange(0.0, 120.0, 2.0))
    turn = rotation_from_rpy(0.03, -0.05, 2.0)
    before = hidden_by_surface(EYE, points, across)
    after = hidden_by_surface(turn @ EYE, points @ turn.T, across @ turn.T)
    assert 0.1 < before.mean() < 0.9
    assert (before != after).mean() < 2e-3


def test_a_crowned_road_hides_by_its_crown():
    x = np.arange(0.0, 60.0, 1.0)
    crowned = np.array([[(a, y, 0.5 - 0.1 * abs(y)) for y in (5.0, 0.0, -5.0)] for a in x])
    eye = np.array([0.0, 5.0, 0.2])
    far_side = np.column_stack([np.arange(5, 50, 0.1), np.full(450, -5.0), np.zeros(450)])
    assert hidden_by_surface(eye, far_side, crowned)[50:].all()
    assert not hidden_by_surface(eye, far_side, crowned[:, ::2]).any()


def test_sections_that_narrow_and_points_that_are_not_numbers_do_no_harm():
    def height(x):
        return -x * x / 1000.0

    points = lines(height, np.arange(2.0, 60.0, 0.1))
    across = sections(height, np.arange(0.0, 80.0, 2.0))
    wider = np.concatenate([across, np.full((len(across), 1, 3), np.nan)], axis=1)
    expected = hidden_by_surface(EYE, points, across)
    np.testing.assert_array_equal(hidden_by_surface(EYE, points, wider), expected)
    with_nan = np.concatenate([points, [[np.nan, 0, 0]]])
    np.testing.assert_array_equal(hidden_by_surface(EYE, with_nan, across), [*expected, False])
    assert expected.any()
    assert hidden_by_surface(EYE, np.empty((0, 3)), across).shape == (0,)
    assert not hidden_by_surface(EYE, points, across[:0]).any()


# ---- from the map to the trace ----


def elevation(*records):
    return "".join(f'<elevation s="{s!r}" a="{a!r}" b="{b!r}" c="{c!r}" d="0"/>' for s, a, b, c in records)


def look(road_map, t_s=2.0, range_m=150.0, **camera):
    """Return the snapshot and the observation 20 m/s times `t_s` along lane -1 of road 1."""
    ego = EgoConfig(road="1", lane=-1, speed_kmh=72.0)
    source = MapDrive(Corridor(road_map, ego.corridor()), ego, range_m=range_m)
    seen = source.advance(None, Tick(index=0, t_ns=round(t_s * 1e9), period_ns=40_000_000), ())[1]
    return seen, observe(Camera.from_config(CameraConfig(**camera)), SceneConfig(range_m=range_m), seen)


def test_over_a_crest_of_the_map_lines_are_seen_up_to_the_tangent_and_the_trace_says_why(tmp_path):
    crest = road(elevation=elevation((0.0, 0.0, 0.0, -1 / 4000.0)), length=600.0)
    seen, found = look(loaded(tmp_path, crest))
    x = found.candidates.points_ego_m[:, 0]
    tangent = 1.9 + horizon_m(2000.0)
    occluded = found.reason == Unseen.OCCLUDED
    assert tangent - 0.2 <= x[found.reason == Unseen.SEEN].max() <= tangent + 2.0 + 4.0
    assert occluded[x > tangent + 6.0].all()
    assert not occluded[x < tangent].any()
    assert len(found.lines.starts) - 1 == len(seen.scene.markings)


@pytest.mark.parametrize("off", [{"crest": False}, {"occlusion": "none"}])
def test_a_crest_hides_nothing_where_the_camera_is_told_so(tmp_path, off):
    crest = road(elevation=elevation((0.0, 0.0, 0.0, -1 / 4000.0)), length=600.0)
    _, found = look(loaded(tmp_path, crest), **off)
    assert not (found.reason == Unseen.OCCLUDED).any()


@pytest.mark.parametrize(
    "records",
    [[(0.0, 5.0, 0.0, 0.0)], [(0.0, 0.0, 0.06, 0.0)], [(0.0, 0.0, -0.06, 1 / 4000.0)]],
    ids=["flat", "a steady slope", "a sag"],
)
def test_a_road_that_can_hide_nothing_of_itself_has_no_surface(tmp_path, records):
    seen, _ = look(loaded(tmp_path, road(elevation=elevation(*records), length=600.0)))
    assert seen.scene.surface is None


def test_a_bend_on_the_flat_has_no_surface(tmp_path):
    plan = geometry('<arc curvature="0.01"/>', 300.0)
    seen, _ = look(loaded(tmp_path, road(plan=plan, length=300.0)))
    assert seen.scene.surface is None


def test_sections_stand_closer_where_the_crest_is_sharper(tmp_path):
    spacing = []
    for radius_m in (500.0, 2000.0, 20000.0):
        crest = road(elevation=elevation((0.0, 0.0, 0.0, -1 / (2 * radius_m))), length=600.0)
        across = look(loaded(tmp_path, crest))[0].scene.surface.points_world_m
        spacing.append(across[1, 0, 0] - across[0, 0, 0])
        sagitta = spacing[-1] ** 2 / (8 * radius_m)
        assert sagitta <= 1.1e-3
    assert spacing == pytest.approx([STEPS_M[0], 4.0, STEPS_M[1]], rel=1e-3)


def test_sections_lie_on_the_road_from_its_left_border_to_its_right(tmp_path):
    crest = road(elevation=elevation((0.0, 0.0, 0.0, -1 / 4000.0)), length=600.0)
    across = look(loaded(tmp_path, crest))[0].scene.surface.points_world_m
    np.testing.assert_allclose(across[:, 0, 1], 3.5, atol=1e-9)
    np.testing.assert_allclose(across[:, -1, 1], -3.5, atol=1e-9)
    np.testing.assert_allclose(across[..., 2], -(across[..., 0] ** 2) / 4000.0, atol=1e-6)


def test_a_superelevated_road_that_twists_hides_nothing(tmp_path):
    twist = '<superelevation s="0" a="0" b="0.0005" c="0" d="0"/>'
    _, found = look(loaded(tmp_path, road(lateral=twist, length=300.0)))
    assert not (found.reason == Unseen.OCCLUDED).any()


def test_an_oncoming_lane_sees_the_same_crest(tmp_path):
    crest = road(
        sections=section(left=[lane(1)], right=[lane(-1)]),
        elevation=elevation((0.0, 0.0, 0.0, -1 / 4000.0)),
        length=600.0,
    )
    corridor = Corridor(loaded(tmp_path, crest), CorridorConfig(road="1", lane=1))
    across = corridor.surface_window(10.0, 200.0).points_world_m
    assert (np.diff(across[:, 0, 0]) < 0).all()
    np.testing.assert_allclose(across[:, 0, 1], -3.5, atol=1e-9)


@needs_shared
def test_on_the_velodrome_nothing_is_hidden_by_the_track_itself():
    corridor = Corridor(real("velodrome"))
    source = MapDrive(corridor, EgoConfig(speed_kmh=72.0), range_m=60.0)
    camera = Camera.from_config(CameraConfig())
    for t_s in np.arange(0.0, 20.0, 0.5):
        moment = source.advance(None, Tick(index=0, t_ns=round(t_s * 1e9), period_ns=40_000_000), ())
        if moment[1] is None:
            break
        found = observe(camera, SceneConfig(range_m=60.0), moment[1])
        assert (found.reason == Unseen.OCCLUDED).mean() < 0.3


def test_the_shipped_drive_has_a_crest_and_loses_no_point_to_it():
    from vsensor.config import load_scenario

    source = MapDrive(Corridor(load_map(load_scenario().source)), EgoConfig(speed_kmh=72.0))
    camera = Camera.from_config(CameraConfig())
    surfaces = 0
    for t_s in range(0, 120, 5):
        seen = source.advance(None, Tick(index=0, t_ns=t_s * 10**9, period_ns=40_000_000), ())[1]
        surfaces += seen.scene.surface is not None
        assert not (observe(camera, SceneConfig(), seen).reason == Unseen.OCCLUDED).any()
    assert 0 < surfaces < 24


def test_a_scene_without_a_surface_costs_no_look_at_it(monkeypatch):
    from vsensor import raycast

    monkeypatch.setattr(raycast, "hidden_by_surface", None)
    assert (
        observe(Camera.from_config(CameraConfig()), SceneConfig(), snapshot([straight(1.75)])).reason == 0
    ).any()

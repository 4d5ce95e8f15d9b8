"""Who is hidden by meshes: against a plain float64 search of all triangles, and where shapes degenerate."""

from dataclasses import replace

import numpy as np
import pytest

from tests.meshes import (
    BOX_FACES,
    ball_mesh,
    box_mesh,
    heap_mesh,
    meets,
    passes_within,
    wavy_wall,
    world_triangles,
)
from tests.roads import box
from vsensor.errors import ConfigError
from vsensor.raycast import (
    FAR_LIMIT,
    embree,
    hidden_by_obstacles,
    mesh_of,
    meshes,
    obstacles,
    pieces,
    standing,
)
from vsensor.transforms import Rigid, rotation_from_rpy
from vsensor.types import Mesh, frozen

EYE = np.array([1.9, 0.0, 1.35])
HERE = Rigid(np.eye(3), np.zeros(3))
FAR_OUT = Rigid(rotation_from_rpy(0.02, -0.01, 2.0), np.array([5.0e5, 5.4e6, 30.0]))

moving_and_standing = pytest.mark.parametrize("is_moving", [True, False], ids=["moving", "standing"])


def is_hidden(point, obstacles, eye=EYE):
    return bool(hidden_by_obstacles(HERE, np.asarray(eye), np.array([point], dtype=float), obstacles)[0])


def wearing(mesh, x, y, z=1.0, **more):
    return replace(box(x, y, z, size=(4.0, 4.0, 4.0), **more), mesh=mesh)


@pytest.fixture(autouse=True)
def _nothing_kept():
    meshes._shapes.clear()
    standing._sets.clear()


@moving_and_standing
@pytest.mark.parametrize("frame", [HERE, FAR_OUT], ids=["origin", "utm"])
@pytest.mark.parametrize("seed", range(3))
def test_hidden_points_are_those_of_a_float64_search_of_all_triangles(seed, frame, is_moving):
    rng = np.random.default_rng(seed)
    shapes = [heap_mesh(rng, 30), ball_mesh(1.5, 6, 9), box_mesh()]
    obstacles, triangles = [], []
    for number in range(9):
        angles = rng.uniform(-3, 3, 3)
        local = np.array([rng.uniform(8, 60), rng.uniform(-8, 8), rng.uniform(0, 2)])
        turned = frame.rotation @ rotation_from_rpy(*angles)
        one = replace(
            box(*(frame.rotation @ local + frame.translation), number=number),
            mesh=shapes[number % 3],
            roll_rad=np.arctan2(turned[2, 1], turned[2, 2]),
            pitch_rad=-np.arcsin(turned[2, 0]),
            yaw_rad=np.arctan2(turned[1, 0], turned[0, 0]),
            is_moving=is_moving,
        )
        obstacles.append(one)
        triangles.append((world_triangles(one) - frame.translation) @ frame.rotation)
    points = np.column_stack([rng.uniform(4, 80, 4000), rng.uniform(-12, 12, 4000), rng.uniform(-1, 2, 4000)])
    found = hidden_by_obstacles(frame, EYE, points, obstacles)
    expected, unsure = meets(EYE, points, np.concatenate(triangles), FAR_LIMIT)
    assert unsure.mean() < 0.05
    assert 0.05 < expected.mean() < 0.9
    wrong = found != expected
    assert not (wrong & ~unsure).any()
    assert wrong.mean() <= 1e-3


@moving_and_standing
@pytest.mark.parametrize(("grown_m", "expected"), [(-1e-4, True), (1e-4, False)])
def test_rays_through_the_outline_of_a_mesh_are_hidden_one_tenth_of_a_millimetre_inside(
    grown_m, expected, is_moving
):
    obstacle = replace(wearing(box_mesh((4, 2, 2)), 30, 0, 1.35), is_moving=is_moving)
    ring = np.array([(1, -1), (1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1)], dtype=float)
    edge = np.column_stack([np.full(8, 28.0), ring[:, 0], 1.35 + ring[:, 1]])
    through = edge + grown_m * (edge - [28.0, 0.0, 1.35])
    found = hidden_by_obstacles(HERE, EYE, EYE + 3.0 * (through - EYE), [obstacle])
    assert (found == expected).all()


@moving_and_standing
@pytest.mark.parametrize("far_out_m", [0.0, 1e5, 1e7])
@pytest.mark.parametrize("off_m", [0.0, 1e-6, 1e-5])
def test_rays_in_the_plane_of_a_triangle_are_hidden_by_nothing_beside_it(off_m, far_out_m, is_moving):
    rng = np.random.default_rng(11)
    frame = Rigid(rotation_from_rpy(0.02, -0.01, 0.5), np.array([far_out_m + 3.0, -far_out_m, 30.0]))
    ball = ball_mesh(2.0, 8, 12)
    one = wearing(ball, *(frame.rotation @ [30.0, 1.0, 1.0] + frame.translation), is_moving=is_moving)
    triangles = (world_triangles(one) - frame.translation) @ frame.rotation
    beside = 0
    for a, b, c in triangles[::12]:
        normal = np.cross(b - a, c - a)
        normal /= np.linalg.norm(normal)
        eye = EYE - normal * ((EYE - a) @ normal)
        through = a + rng.uniform(-4, 4, (200, 1)) * (b - a) + rng.uniform(-4, 4, (200, 1)) * (c - a)
        points = eye + 2.0 * (through - eye) + off_m * normal
        sure, unsure = meets(eye, points, triangles, FAR_LIMIT)
        near = passes_within(eye, points, triangles, 1e-4)
        found = hidden_by_obstacles(frame, eye, points, [one])
        assert not (found & ~sure & ~near).any()
        assert not (sure & ~found & ~unsure).any()
        beside += (~sure & ~near).sum()
    assert beside > 300


@moving_and_standing
def test_a_surface_larger_than_a_cell_has_no_gaps_where_it_is_cut(is_moving, monkeypatch):
    monkeypatch.setattr(pieces, "CELL_M", 3.0)
    wall = wavy_wall(20.0, 3.0, 40)
    obstacle = wearing(wall, 30, 0, 1.35, is_moving=is_moving)
    triangles = world_triangles(obstacle)
    assert len(pieces.pieces_of(triangles)) > 5
    corners = np.array([p for a, b, c in triangles for p in (a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2)])
    inner = corners[(np.abs(corners[:, 1]) < 9.9) & (np.abs(corners[:, 2] - 1.35) < 1.4)]
    assert hidden_by_obstacles(HERE, EYE, EYE + 2.0 * (inner - EYE), [obstacle]).all()


def test_a_triangle_that_spans_very_many_cells_is_in_one_piece():
    long = np.array([[[0.0, 0, 0], [9e5, 9e5, 0], [9e5, 9e5, 1]]])
    assert [len(piece.triangles_m) for piece in pieces.pieces_of(long)] == [1]


@moving_and_standing
def test_rays_through_the_edges_and_vertices_between_triangles_find_no_gap(is_moving):
    ball = ball_mesh(2.0, 12, 24)
    obstacle = replace(wearing(ball, 30, 0, 1.35), is_moving=is_moving)
    triangles = world_triangles(obstacle)
    inner = [corner for a, b, c in triangles for corner in (a, b, c, (a + b) / 2, (b + c) / 2, (c + a) / 2)]
    through = np.array([p for p in inner if np.hypot(p[1], p[2] - 1.35) < 1.8])
    assert len(through) > 500
    assert hidden_by_obstacles(HERE, EYE, EYE + 2.0 * (through - EYE), [obstacle]).all()


@moving_and_standing
def test_the_winding_of_the_triangles_does_not_matter(is_moving):
    inverted = mesh_of(box_mesh().vertices_m, BOX_FACES[:, ::-1])
    assert is_hidden((40, 0, 0.5), [wearing(inverted, 30, 0, is_moving=is_moving)])
    assert not is_hidden((40, 8, 0.5), [wearing(inverted, 30, 0, is_moving=is_moving)])


@moving_and_standing
def test_triangles_without_area_hide_nothing_and_spoil_no_other(is_moving):
    needle = np.array([[0.0, 0, 0], [0, 0, 1], [0, 0, 2]])
    alone = wearing(mesh_of(needle, [[0, 1, 2], [0, 0, 1], [2, 2, 2]]), 30, 0, 0, is_moving=is_moving)
    assert not is_hidden((40, 0, 1.3), [alone])
    both = mesh_of(np.concatenate([box_mesh().vertices_m, needle]), [*BOX_FACES.tolist(), [8, 9, 10]])
    assert is_hidden((40, 0, 0.5), [wearing(both, 30, 0, is_moving=is_moving)])


@moving_and_standing
def test_an_empty_mesh_hides_nothing(is_moving):
    empty = wearing(mesh_of(np.empty((0, 3)), np.empty((0, 3))), 30, 0, is_moving=is_moving)
    assert not is_hidden((40, 0, 0.5), [empty])


@moving_and_standing
def test_a_camera_in_a_closed_mesh_sees_what_is_in_it_and_nothing_outside(is_moving):
    around = wearing(ball_mesh(2.0, 8, 12), *EYE, is_moving=is_moving)
    assert not is_hidden(EYE + np.array([1.0, 0.3, 0.2]), [around])
    assert is_hidden((30, 0, 0), [around])
    assert is_hidden((-30, 0, 0), [around])


@moving_and_standing
def test_a_point_in_a_closed_mesh_is_hidden_and_one_before_it_is_not(is_moving):
    ball = wearing(ball_mesh(2.0, 8, 12), 30, 0, 1.35, is_moving=is_moving)
    assert is_hidden((30, 0, 1.35), [ball])
    assert not is_hidden((27.9, 0, 1.35), [ball])


@moving_and_standing
def test_a_mesh_hides_through_its_holes_nothing_where_its_box_would(is_moving):
    arch = box_mesh((0.2, 6.0, 0.2))
    gantry = wearing(arch, 30, 0, 5.0, is_moving=is_moving)
    assert not is_hidden((60, 0, 0), [gantry])
    lying = wearing(heap_mesh(np.random.default_rng(1), 1), 30, 0, is_moving=is_moving)
    assert not is_hidden((60, 0, 0), [lying])


def test_the_shadow_test_takes_a_mesh_as_its_bounding_box():
    gantry = replace(wearing(box_mesh((0.1, 0.1, 0.1)), 30, 0), size_m=(4.0, 4.0, 4.0))
    points = np.array([[60.0, 0, 0]])
    assert hidden_by_obstacles(HERE, EYE, points, [gantry], method="shadow").all()
    assert not hidden_by_obstacles(HERE, EYE, points, [gantry]).any()


def test_a_shape_that_moves_is_built_once(monkeypatch):
    built = []
    build = embree.build
    monkeypatch.setattr(embree, "build", lambda triangles: built.append(len(triangles)) or build(triangles))
    ball = ball_mesh(1.0, 8, 12)
    for k in range(20):
        assert is_hidden((90, 0, 0), [wearing(ball, 20 + k, 0), wearing(ball, 20 + k, 5)])
    assert built == [2 * 7 * 12]


def test_only_so_many_shapes_are_kept(monkeypatch):
    monkeypatch.setattr(meshes, "SHAPES_KEPT", 3)
    for _ in range(10):
        assert is_hidden((90, 0, 0.5), [wearing(box_mesh(), 30, 0)])
    assert len(meshes._shapes) == 3


def test_what_stands_is_built_once_and_again_only_when_it_changes(monkeypatch):
    built = []
    build = embree.build
    monkeypatch.setattr(embree, "build", lambda triangles: built.append(len(triangles)) or build(triangles))
    one, other = (replace(wearing(box_mesh(), 30.0, y), is_moving=False) for y in (0, 9))
    for x in (0.0, 5.0, 245.0, 1e4):
        hidden_by_obstacles(Rigid(np.eye(3), np.array([x, 0, 0])), EYE, np.ones((2, 3)), [one], [one, other])
    assert built == [24]
    hidden_by_obstacles(HERE, EYE, np.ones((2, 3)), [one], [one])
    assert built == [24, 12]


def test_only_so_many_sets_of_what_stands_are_kept():
    for _ in range(10):
        hidden_by_obstacles(
            HERE, EYE, np.ones((2, 3)), [replace(wearing(box_mesh(), 30.0, 0), is_moving=False)]
        )
    assert len(standing._sets) == standing.KEPT


def test_many_standing_boxes_hide_what_they_would_hide_as_moving_ones(monkeypatch):
    monkeypatch.setattr(obstacles, "KEEP_FROM_BOXES", 60)
    asked = []
    by_standing = obstacles.hidden_by_standing
    monkeypatch.setattr(
        obstacles, "hidden_by_standing", lambda *given: asked.append(len(given[1])) or by_standing(*given)
    )
    rng = np.random.default_rng(8)
    boxes = [
        box(*rng.uniform((8, -12, 1), (95, 12, 1.4)), size=rng.uniform(0.3, 2, 3), yaw_rad=rng.uniform(-3, 3))
        for _ in range(60)
    ]
    points = np.column_stack([rng.uniform(4, 100, 3000), rng.uniform(-15, 15, 3000), np.zeros(3000)])
    moving = hidden_by_obstacles(HERE, EYE, points, boxes, method="shadow")
    still = hidden_by_obstacles(HERE, EYE, points, [replace(one, is_moving=False) for one in boxes])
    assert asked == [60]
    assert 0.1 < moving.mean() < 0.9
    assert (moving != still).mean() < 1e-3


def test_a_camera_in_a_standing_box_sees_nothing(monkeypatch):
    monkeypatch.setattr(obstacles, "KEEP_FROM_BOXES", 40)
    boxes = [replace(box(30 + 5 * k, 9), is_moving=False) for k in range(50)]
    around = replace(box(1.0, 0, size=(4, 2, 3)), is_moving=False)
    assert is_hidden((2.5, 0, 1), [*boxes, around])


@pytest.mark.parametrize(
    ("vertices", "faces", "words"),
    [
        ([[0, 0, 0], [1, 0, np.nan], [0, 1, 0]], [[0, 1, 2]], "vertex 1 is"),
        ([[0, 0, 0], [1, 0, 0], [0, np.inf, 0]], [[0, 1, 2]], "vertex 2 is"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 3]], "beyond the 3 that there are"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, -1]], "beyond the 3 that there are"),
        ([[0, 0], [1, 0], [0, 1]], [[0, 1, 2]], r"\(V, 3\) was expected"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0.0, 1.0, 2.0]], r"integers \(F, 3\) were expected"),
        ([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2, 0]], r"integers \(F, 3\) were expected"),
    ],
)
def test_a_mesh_that_cannot_be_is_refused_in_a_sentence(vertices, faces, words):
    with pytest.raises(ConfigError, match=f"^truck: .*{words}"):
        mesh_of(np.array(vertices, dtype=float), np.array(faces), "truck")


def test_a_mesh_that_was_not_checked_is_refused_when_it_is_first_looked_at():
    unchecked = Mesh(
        vertices_m=frozen([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]), faces=frozen([[0, 1, 7]], np.int64)
    )
    with pytest.raises(ConfigError, match="beyond the 3"):
        is_hidden((40, 0, 0), [wearing(unchecked, 30, 0)])

"""Meshes from files, and what stands along the route."""

import sys
from math import pi

import numpy as np
import pytest
import trimesh

from tests.maps import geometry, loaded, road
from vsensor.camera import Camera, CameraConfig, observe
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.scene import SceneConfig
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.sources.shapes import Shapes, load_mesh
from vsensor.sources.standing import ObstacleConfig
from vsensor.sources.traffic import TrafficConfig
from vsensor.types import Tick, Unseen
from vsensor.world.corridor import Corridor

SIZE_M = (8.0, 2.5, 3.5)


@pytest.fixture(params=[".obj", ".stl", ".glb"])
def truck(request, tmp_path):
    """Write a truck-sized box, its corner at the origin, as a file of each kind."""
    path = tmp_path / f"truck{request.param}"
    trimesh.creation.box(bounds=[(0, 0, 0), SIZE_M]).export(path)
    return path


def drive(road_map, traffic=(), obstacles=(), folder=None, **ego):
    ego = EgoConfig(**{"road": "1", "lane": -1, "speed_kmh": 72.0, **ego})
    return MapDrive(
        Corridor(road_map, ego.corridor()),
        ego,
        tuple(TrafficConfig(**one) for one in traffic),
        obstacles=tuple(ObstacleConfig(**one) for one in obstacles),
        **({} if folder is None else {"folder": folder}),
    )


def at(source, t_s=0.0):
    return source.advance(None, Tick(index=0, t_ns=round(t_s * 1e9), period_ns=40_000_000), ())[1]


def hidden(snapshot):
    found = observe(Camera.from_config(CameraConfig()), SceneConfig(), snapshot)
    return int((found.reason == Unseen.OCCLUDED).sum())


def test_a_mesh_file_is_centred_and_has_its_own_size(truck):
    mesh, size_m = load_mesh(truck)
    assert size_m == pytest.approx(SIZE_M, abs=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.min(axis=0), -0.5 * np.array(SIZE_M), atol=1e-6)
    np.testing.assert_allclose(mesh.vertices_m.max(axis=0), 0.5 * np.array(SIZE_M), atol=1e-6)
    assert len(mesh.faces) == 12


def test_a_vehicle_of_a_mesh_stands_on_the_road_and_hides_what_its_box_would(truck, tmp_path):
    flat = loaded(tmp_path, road(length=400.0))
    meshes = at(drive(flat, [{"mesh": truck.name, "ahead_m": 30}], folder=tmp_path))
    boxes = at(drive(flat, [{"size_m": SIZE_M, "ahead_m": 30}]))
    vehicle = meshes.scene.obstacles[0]
    assert vehicle.centre_world_m[2] == pytest.approx(0.5 * SIZE_M[2], abs=1e-6)
    assert vehicle.mesh is not None
    assert hidden(meshes) > 100
    assert abs(hidden(meshes) - hidden(boxes)) <= 2


def test_vehicles_of_one_file_share_their_mesh(truck, tmp_path):
    one = {"mesh": truck.name}
    source = drive(
        loaded(tmp_path, road(length=400.0)), [one, {**one, "ahead_m": 90}], [{"s_m": 9, **one}], tmp_path
    )
    first, second, standing = at(source).scene.obstacles
    assert first.mesh is second.mesh is standing.mesh


def test_an_obstacle_stands_where_the_scenario_says(tmp_path):
    plan = geometry(f'<arc curvature="{1 / 200.0!r}"/>', 300.0)
    bend = loaded(tmp_path, road(plan=plan, length=300.0))
    wall = {
        "s_m": 100.0 * pi * (1 + 1.75 / 200.0),
        "offset_m": -3.0,
        "z_m": 0.5,
        "yaw_deg": 90,
        "size_m": (1, 2, 3),
    }
    (standing,) = at(drive(bend, obstacles=[{**wall, "s_m": 100.0}])).scene.obstacles
    turn = 100.0 / 201.75
    radius = 201.75 + 3.0
    np.testing.assert_allclose(
        standing.centre_world_m,
        [radius * np.sin(turn), 200.0 - radius * np.cos(turn), 0.5 + 1.5],
        atol=1e-6,
    )
    assert standing.yaw_rad == pytest.approx(turn + pi / 2, abs=1e-9)
    assert not standing.is_moving


def test_what_stands_is_the_same_object_in_every_tick(tmp_path):
    source = drive(loaded(tmp_path, road(length=400.0)), obstacles=[{"s_m": 50, "size_m": (1, 9, 3)}])
    assert at(source, 0.0).scene.obstacles[0] is at(source, 8.0).scene.obstacles[0]


def test_of_many_only_those_near_are_given_and_the_same_tuple_along_a_page(tmp_path):
    many = [{"s_m": 2.0 * k, "offset_m": 9, "size_m": (1, 1, 1)} for k in range(1000)]
    source = drive(loaded(tmp_path, road(length=2500.0)), obstacles=many)
    first, later = at(source, 0.0).scene.obstacles, at(source, 4.0).scene.obstacles
    assert 50 < len(first) < 200
    assert all(a is b for a, b in zip(first, later, strict=True))
    x = [one.centre_world_m[0] for one in at(source, 50.0).scene.obstacles]
    assert min(x) <= 980
    assert max(x) >= 1130


def test_a_wall_across_the_road_hides_it(tmp_path):
    flat = loaded(tmp_path, road(length=400.0))
    wall = {"s_m": 50, "size_m": (0.2, 40, 3)}
    assert hidden(at(drive(flat))) == 0
    assert hidden(at(drive(flat, obstacles=[wall]))) > 500
    assert hidden(at(drive(flat, obstacles=[{**wall, "z_m": 5.0}]))) == 0


@pytest.mark.parametrize(
    ("obstacle", "words"),
    [
        ({"s_m": 50}, "obstacle.0.: either mesh or size_m was expected"),
        (
            {"s_m": 50, "size_m": (1, 1, 1), "mesh": "x.obj"},
            "obstacle.0.: either mesh or size_m was expected",
        ),
        ({"s_m": 50, "size_m": (1, 0, 1)}, "length, width, height up to 1000 m were expected"),
        ({"s_m": 5000, "size_m": (1, 1, 1)}, "s_m = 5000: the route ends before that"),
        ({"s_m": 50, "mesh": "absent.obj"}, "obstacle.0..mesh = '.*absent.obj': no such file"),
        ({"s_m": 50, "mesh": "x.blend"}, r"a file .obj .stl .glb was expected"),
    ],
)
def test_an_obstacle_that_cannot_be_is_refused_in_a_sentence(tmp_path, obstacle, words):
    with pytest.raises(ConfigError, match=words):
        drive(loaded(tmp_path, road(length=400.0)), obstacles=[obstacle], folder=tmp_path)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("v 0 0 0\nv 1 0 nan\nv 0 1 0\nf 1 2 3\n", "vertex 1 is|cannot be read"),
        ("v 0 0 0\nv 90000 0 0\nv 0 1 0\nf 1 2 3\n", "metres were expected"),
        ("", "cannot be read|holds no triangles"),
    ],
    ids=["nan", "millimetres", "empty"],
)
def test_a_file_that_holds_no_shape_is_refused_in_a_sentence(tmp_path, text, words):
    (tmp_path / "bad.obj").write_text(text)
    with pytest.raises(ConfigError, match=words):
        load_mesh(tmp_path / "bad.obj")


def test_a_file_that_is_no_mesh_is_refused_in_a_sentence(tmp_path):
    (tmp_path / "bad.glb").write_bytes(b"\x00\x01" * 50)
    with pytest.raises(ConfigError, match=r"bad.glb'?: cannot be read"):
        load_mesh(tmp_path / "bad.glb")


def test_without_trimesh_one_sentence_says_what_to_install(truck, monkeypatch):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(MissingExtraError, match=r"pip install 'vsensor\[mesh\]'"):
        Shapes(truck.parent).of(truck.name, None, "traffic[0]")

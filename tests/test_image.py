"""The image: paint and boxes lie where `project` says, and look as light, rain and wear let them."""

import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from tests.lines import tick
from vsensor.camera import Camera, CameraConfig, camera_from_ego, project
from vsensor.distortion import DistortionConfig
from vsensor.draws import Draws
from vsensor.errors import ConfigError
from vsensor.image import ImageConfig, render
from vsensor.image.config import RAIN_VEIL
from vsensor.image.coverage import chained, coverage, outline
from vsensor.image.ground import worn
from vsensor.image.hills import Skyline
from vsensor.light import RAIN_EXTINCTION_PER_M, WET_PAINT
from vsensor.raycast import mesh_of
from vsensor.transforms import transform
from vsensor.types import (
    Colour,
    EgoState,
    Environment,
    Light,
    Marking,
    MarkingKind,
    Obstacle,
    Scene,
    Snapshot,
    Stripe,
    frozen,
)

CLEAN = ImageConfig(noise_std=0.0, blur_px=0.0, wear=0.0, texture=0.0)
CAMERA = Camera.from_config(CameraConfig(width_px=640, height_px=400))
QUANTUM_PX = 0.02
"""Of a centre: 8 bits round each of some ten pixels by up to half a level of about 150."""


def marking(x, y, z=None, painted=True, width_m=0.15, **changes):
    """Return a stripe by its centre; all white unless said otherwise."""
    count = len(x)
    points = np.column_stack([x, np.broadcast_to(y, count), np.zeros(count) if z is None else z])
    given = dict(
        id=1,
        group=1,
        stripe=Stripe.SINGLE,
        points_world_m=frozen(points),
        painted=frozen(np.broadcast_to(painted, count), np.bool_),
        kind=frozen(np.full(count, MarkingKind.SOLID), np.uint8),
        colour=frozen(np.full(count, Colour.WHITE), np.uint8),
        width_m=frozen(np.full(count, width_m)),
    )
    return Marking(**{**given, **changes})


def straight(y_m=0.0, slope=0.0, start_m=-10.0, **changes):
    x = np.arange(start_m, 100.0, 0.1)
    return marking(x, y_m + slope * x, **changes)


def snapshot(*markings, boxes=(), light=Light.DAY, rain=0.0, **ego):
    state = EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=20.0, **ego)
    scene = Scene(markings=markings, obstacles=tuple(boxes), environment=Environment(light=light, rain=rain))
    return Snapshot(t_ns=0, ego=state, scene=scene)


def box(x, y=0.0, size=(4.0, 2.0, 1.5), number=0):
    return Obstacle(id=number, centre_world_m=np.array([x, y, size[2] / 2]), size_m=size)


def taken(shot, config=CLEAN, camera=CAMERA, seed=0, index=0):
    return render(camera, config, shot, Draws(seed), tick(index))


def paint_in(shot, config=CLEAN, camera=CAMERA):
    """Return how much brighter each pixel is than without paint, as floats."""
    unpainted = tuple(replace(m, painted=np.zeros_like(m.painted)) for m in shot.scene.markings)
    bare = replace(shot, scene=replace(shot.scene, markings=unpainted))
    return taken(shot, config, camera).astype(float) - taken(bare, config, camera)


def pixels_of(points_ego, camera=CAMERA, shot=None):
    pose = camera_from_ego(camera, (shot or snapshot()).ego)
    return project(camera, transform(pose, np.atleast_2d(np.asarray(points_ego, dtype=float))))


def centre_errors(y_m, slope, camera, config, width_m=0.15):
    """Return rendered minus exact centre of a straight stripe in every row that holds all of its width.

    Down the image a stripe grows wider, so averaging over rows moves the centre of a slanted one by
    du/dv variance / (v - v0), with v0 where it vanishes, for the blur and for the pixel itself (1 / 12).
    """
    painted = paint_in(snapshot(straight(y_m, slope, width_m=width_m)), config, camera)
    columns = np.arange(camera.config.width_px)
    x, far = np.array([8.0, 90.0]), np.array([[1e9, slope * 1e9, 0.0]])
    aside = np.array([-slope, 1.0]) * (width_m / 2 / np.hypot(1.0, slope))
    left, right = (
        pixels_of(np.column_stack([x + s * aside[0], y_m + slope * x + s * aside[1], 0.0 * x]), camera)
        for s in (1.0, -1.0)
    )
    errors = []
    for row in range(int(max(left[1, 1], right[1, 1])) + 2, int(min(left[0, 1], right[0, 1])) - 1):
        ends = [e[0, 0] + (row - e[0, 1]) * (e[1, 0] - e[0, 0]) / (e[1, 1] - e[0, 1]) for e in (left, right)]
        margin = 8.0 + abs(ends[1] - ends[0])
        if min(ends) < margin or max(ends) > camera.config.width_px - 1 - margin:
            continue
        middle = (left + right) / 2
        slant = (middle[1, 0] - middle[0, 0]) / (middle[1, 1] - middle[0, 1])
        vanishes = project(camera, transform(camera_from_ego(camera, snapshot().ego), far))[0, 1]
        blurred = slant * (config.blur_px**2 + 1 / 12) / (row - vanishes)
        errors.append((painted[row] @ columns) / painted[row].sum() - sum(ends) / 2 - blurred)
    assert len(errors) > 20
    return np.array(errors)


@pytest.mark.parametrize("blur_px", [0.0, 0.8])
@pytest.mark.parametrize(
    ("y_m", "slope"), [(0.0, 0.0), (1.8, 0.0), (-1.8, 0.0), (-3.3, 0.02), (5.4, -0.05), (-0.5, 0.2)]
)
def test_a_rendered_stripe_has_its_centre_where_project_says(y_m, slope, blur_px):
    errors = centre_errors(y_m, slope, CAMERA, replace_config(CLEAN, blur_px=blur_px))
    assert abs(errors.mean()) < QUANTUM_PX / 4
    assert abs(errors).max() < 4 * QUANTUM_PX


def test_a_turned_and_pitched_camera_sees_the_stripe_where_project_says():
    camera = Camera.from_config(
        CameraConfig(width_px=640, height_px=400, yaw_deg=4.0, pitch_deg=3.0, roll_deg=2.0)
    )
    errors = centre_errors(1.8, 0.01, camera, CLEAN)
    assert abs(errors.mean()) < QUANTUM_PX / 4


def replace_config(config, **changes):
    return ImageConfig(**{name: getattr(config, name) for name in config.__struct_fields__} | changes)


def test_the_light_of_a_stripe_is_that_of_its_exact_width_however_far():
    painted = paint_in(snapshot(straight(1.8)))
    full = painted.max()
    for row in range(215, 330, 5):
        depth_m = CAMERA.fy_px * 1.35 / (row - CAMERA.cy_px)
        assert painted[row].sum() / full == pytest.approx(CAMERA.fx_px * 0.15 / depth_m, rel=0.03)


def test_coverage_is_the_exact_area_of_polygons_that_leave_the_image():
    turns = np.linspace(0.0, 2.0 * np.pi, 400, endpoint=False)
    circle = np.column_stack([np.cos(turns), np.sin(turns)])
    area = 0.5 * 400 * np.sin(2.0 * np.pi / 400)
    whole = coverage(outline(7.3 * circle + (20.2, 15.4)), 40, 30)
    assert whole.values.sum() == pytest.approx(area * 7.3**2, abs=1e-3)
    assert whole.values.max() == pytest.approx(1.0, abs=1e-5)
    for centre in ((-0.5, 15.0), (39.5, 15.0), (20.0, -0.5), (20.0, 29.5)):
        half = coverage(outline(7.0 * circle + centre), 40, 30)
        assert half.values.sum() == pytest.approx(area * 7.0**2 / 2, abs=1e-2)
    for centre in ((-50.0, 15.0), (99.0, 15.0), (20.0, -50.0), (20.0, 99.0)):
        assert coverage(outline(7.0 * circle + centre), 40, 30).values.sum() == pytest.approx(0.0, abs=1e-12)
    around = coverage(outline(100.0 * circle + (20.0, 15.0)), 40, 30)
    assert around.values == pytest.approx(np.ones((30, 40)), abs=1e-5)


def test_polygons_side_by_side_leave_no_seam():
    left = outline(np.array([[2.0, 2.0], [9.37, 2.0], [9.37, 12.0], [2.0, 12.0]]))
    right = outline(np.array([[9.37, 2.0], [17.0, 2.0], [17.0, 12.0], [9.37, 12.0]]))
    both = coverage(chained(left, right), 20, 15)
    assert both.values[3:9, 3:12] == pytest.approx(np.ones((6, 9)), abs=1e-6)


def test_nothing_behind_the_camera_is_drawn():
    x = np.arange(-100.0, 1.8, 0.1)
    behind = [marking(x, y) for y in (-2.0, 0.0, 0.7, 2.0)]
    assert not paint_in(snapshot(*behind)).any()


def test_a_stripe_that_passes_under_the_camera_is_cut_and_not_folded():
    """It looks the same whether it begins behind the camera or just before the lower end of the image."""
    camera = Camera.from_config(CameraConfig(width_px=320, height_px=240, hfov_deg=90.0, pitch_deg=60.0))
    through = paint_in(snapshot(straight(0.3)), CLEAN, camera)
    ahead = paint_in(snapshot(straight(0.3, start_m=1.0)), CLEAN, camera)
    assert through.any()
    assert through == pytest.approx(ahead, abs=1.0)


def test_a_stripe_of_two_points_is_cut_at_the_camera_like_one_of_many():
    ends = np.array([-60.0, 60.0])
    dense = paint_in(snapshot(marking(np.linspace(-60.0, 60.0, 1201), 1.8)))
    assert paint_in(snapshot(marking(ends, 1.8))) == pytest.approx(dense, abs=1.0)


def test_only_paint_is_drawn():
    x = np.arange(0.0, 60.0, 0.1)
    painted = (x > 20.0) & (x < 26.0)
    found = paint_in(snapshot(marking(x, 1.0, painted=painted)))
    rows = found.any(axis=1).nonzero()[0]
    (_, near), (_, far) = pixels_of([[20.05, 1.0, 0.0], [25.95, 1.0, 0.0]])
    assert rows.max() == pytest.approx(near, abs=1.0)
    assert rows.min() == pytest.approx(far, abs=1.0)


def test_both_stripes_of_a_double_line_are_drawn():
    double = [
        straight(1.8 + offset, stripe=stripe, id=number)
        for number, (offset, stripe) in enumerate([(0.15, Stripe.LEFT), (-0.15, Stripe.RIGHT)])
    ]
    found = paint_in(snapshot(*double))
    row = 300
    edges = np.count_nonzero(np.diff((found[row] > found.max() / 2).astype(int)))
    assert edges == 4


def test_paint_follows_the_height_of_its_own_road():
    x = np.arange(0.0, 80.0, 0.1)
    uphill = 0.02 * (x - 10.0).clip(0.0)
    rows = paint_in(snapshot(marking(x, 0.0, uphill))).any(axis=1).nonzero()[0]
    flat = paint_in(snapshot(marking(x, 0.0))).any(axis=1).nonzero()[0]
    assert rows.min() < flat.min() - 5


def test_a_box_hides_paint_behind_it_and_none_before_it():
    line, vehicle = straight(0.0), box(20.0)
    with_box = taken(snapshot(line, boxes=[vehicle])).astype(int)
    without = taken(snapshot(boxes=[vehicle])).astype(int)
    difference = with_box - without
    (left, bottom), (right, top) = pixels_of([[18.0, 1.0, 0.0], [18.0, -1.0, 1.5]])
    hidden = difference[int(top) + 2 : int(bottom) - 1, int(left) + 2 : int(right) - 1]
    assert not hidden.any()
    assert difference[int(bottom) + 2 :].any()


def test_a_box_has_its_outline_where_project_says():
    shot = snapshot(boxes=[box(20.0, 1.0, number=1)])
    body = taken(shot).astype(int) != taken(snapshot()).astype(int)
    (left, top), (right, bottom) = pixels_of([[18.0, 2.0, 1.5], [18.0, 0.0, 0.0]])
    rows, columns = body.any(axis=1).nonzero()[0], body.any(axis=0).nonzero()[0]
    assert rows.max() == pytest.approx(bottom, abs=1.0)
    assert columns.min() == pytest.approx(left, abs=1.0)
    assert rows.min() == pytest.approx(top, abs=1.0)
    assert (
        columns.max() == pytest.approx(right, abs=1.0) or columns.max() > right
    )  # its right side, seen aslant


def test_the_nearer_of_two_boxes_is_in_front():
    near, far = box(15.0, number=0), box(30.0, size=(4.0, 2.0, 1.5), number=1)
    alone = taken(snapshot(boxes=[near]))
    ((u, v),) = pixels_of([[13.0, 0.0, 1.3]])  # this ray meets the farther box too
    for boxes in ([near, far], [far, near]):
        assert taken(snapshot(boxes=boxes))[int(v), int(u)] == alone[int(v), int(u)]


CUBE_FACES = np.array([[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]])


def as_mesh(vehicle):
    """Return the same box as twelve triangles."""
    signs = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    return replace(
        vehicle,
        mesh=mesh_of(signs * np.array(vehicle.size_m), CUBE_FACES[:, [0, 1, 2, 0, 2, 3]].reshape(-1, 3)),
    )


@pytest.mark.parametrize(("light", "rain"), [(Light.DAY, 0.0), (Light.NIGHT, 0.6)])
def test_a_box_looks_the_same_as_a_mesh(light, rain):
    """But for the edges, a row of pixels around and between the faces, at four times the resolution."""
    boxes = [
        box(12.0, 2.4, number=0),
        replace(box(25.0, -2.0, number=4), yaw_rad=0.4),
        box(60.0, 0.0, number=2),
    ]
    exact = taken(snapshot(boxes=boxes, light=light, rain=rain)).astype(int)
    drawn = taken(snapshot(boxes=[as_mesh(b) for b in boxes], light=light, rain=rain)).astype(int)
    difference = abs(exact - drawn)
    bodies = np.count_nonzero(exact != taken(snapshot(light=light, rain=rain)))
    assert np.count_nonzero(difference > 3) < 0.06 * bodies
    assert difference.max() < 0.5 * (exact.max() - exact.min())  # at a corner, a quarter of a pixel twice


def test_a_mesh_that_leaves_the_image_or_the_front_of_the_camera_is_drawn_as_far_as_it_is_there():
    beside = taken(snapshot(boxes=[as_mesh(box(6.0, 3.0, number=4))]))
    assert np.count_nonzero(beside[:, :20] != taken(snapshot())[:, :20]) > 100
    behind = taken(snapshot(boxes=[as_mesh(box(-10.0)), as_mesh(box(10.0, 60.0))]))
    assert np.array_equal(behind, taken(snapshot()))


def test_a_mirrored_scene_gives_the_mirrored_image():
    boxes = [box(20.0, 2.5), box(40.0, -3.0, number=1)]
    mirrored = [replace(b, centre_world_m=b.centre_world_m * (1.0, -1.0, 1.0)) for b in boxes]
    lines = [straight(1.8, 0.01), straight(-1.9, 0.002)]
    flipped = [replace(m, points_world_m=frozen(m.points_world_m * (1.0, -1.0, 1.0))) for m in lines]
    image = taken(snapshot(*lines, boxes=boxes, light=Light.NIGHT, rain=0.3)).astype(int)
    other = taken(snapshot(*flipped, boxes=mirrored, light=Light.NIGHT, rain=0.3)).astype(int)
    assert abs(image[:, ::-1] - other).max() <= 1


def contrast(shot, config=CLEAN):
    """Return the paint's difference to the road beside it, over their sum, 15 m ahead."""
    image = taken(shot, config).astype(float)
    ((u, v),) = pixels_of([[15.0, 1.8, 0.0]])
    row = image[round(v)]
    paint, road = row[round(u)], row[round(u) + 40]
    return (paint - road) / (paint + road)


def test_night_is_darker_than_dusk_and_dusk_than_day():
    day, dusk, night = (taken(snapshot(straight(1.8), light=light)).mean() for light in Light)
    assert night < 0.5 * dusk
    assert dusk < 0.7 * day


def test_at_night_paint_fades_with_distance():
    painted = paint_in(snapshot(straight(0.0), light=Light.NIGHT))
    near, far = (painted[round(pixels_of([[x, 0.0, 0.0]])[0, 1])].max() for x in (8.0, 24.0))
    assert far < 0.7 * near


@pytest.mark.parametrize("light", list(Light))
def test_rain_lowers_contrast(light):
    dry, wet, heavy = (contrast(snapshot(straight(1.8), light=light, rain=rain)) for rain in (0.0, 0.5, 1.0))
    assert heavy < wet < dry


def test_the_heaviest_rain_takes_its_parts_of_the_contrast_of_paint():
    row = round(pixels_of([[10.0, 0.0, 0.0]])[0, 1])
    dry, wet = (paint_in(snapshot(straight(0.0, width_m=0.5), rain=rain))[row].max() for rain in (0.0, 1.0))
    clear = np.exp(-RAIN_EXTINCTION_PER_M * 8.1)
    assert wet / dry == pytest.approx((1.0 - WET_PAINT) * (1.0 - RAIN_VEIL) * clear, rel=0.02)


def test_wear_lowers_contrast_until_no_paint_is_left():
    line = snapshot(straight(1.8))
    new, worn, gone = (paint_in(line, replace_config(CLEAN, wear=wear)).sum() for wear in (0.0, 0.5, 1.0))
    assert 0.2 * new < worn < 0.8 * new
    assert gone == 0.0


@pytest.mark.parametrize("wear", [0.0, 0.3, 0.7, 1.0])
def test_wear_is_patchy_and_takes_its_part_on_average(wear):
    places = np.stack(np.meshgrid(np.arange(0.0, 100.0, 0.4), np.arange(0.0, 100.0, 0.4)), axis=-1).reshape(
        -1, 2
    )
    left = worn(wear, places)
    assert left.mean() == pytest.approx(1.0 - wear, abs=0.02)
    assert (left.std() > 0.05) == (0.0 < wear < 1.0)
    assert left.min() >= 0.0
    assert left.max() <= 1.0


def test_paint_of_less_contrast_is_less_bright():
    new, faded = (paint_in(snapshot(straight(1.8, contrast=part))).sum() for part in (1.0, 0.4))
    assert faded == pytest.approx(0.4 * new, rel=0.05)


def test_yellow_paint_is_yellow():
    line = straight(0.0, colour=frozen(np.full(1100, Colour.YELLOW), np.uint8))
    image = taken(snapshot(line), replace_config(CLEAN, channels="rgb"))
    assert image.shape == (400, 640, 3)
    ((u, v),) = pixels_of([[8.0, 0.0, 0.0]])
    red, green, blue = image[round(v), round(u)].astype(int)
    assert red > green > blue + 60


def test_the_horizon_of_a_rolled_camera_is_where_far_points_of_the_plane_are():
    camera = Camera.from_config(CameraConfig(width_px=640, height_px=400, roll_deg=5.0, pitch_deg=2.0))
    image = taken(snapshot(), CLEAN, camera).astype(int)
    for y in (-0.2, 0.0, 0.2):
        ((u, v),) = pixels_of([[1e7, y * 1e7, 0.0]], camera)
        column = image[:, round(u)]
        slope = int(np.abs(np.diff(column)).argmax()) + 0.5
        assert slope == pytest.approx(v, abs=1.0)


def test_exposure_multiplies_every_level():
    dark, bright = (
        taken(snapshot(straight(1.8)), replace_config(CLEAN, exposure=e)).mean() for e in (0.5, 1.0)
    )
    assert bright == pytest.approx(2.0 * dark, rel=0.01)


def test_noise_has_the_deviation_that_was_asked_for():
    noisy = taken(snapshot(), replace_config(CLEAN, noise_std=5.0)).astype(float)
    clean = taken(snapshot()).astype(float)
    assert (noisy - clean).std() == pytest.approx(5.0, rel=0.02)
    assert (noisy - clean).mean() == pytest.approx(0.0, abs=0.5)  # of rounding


def test_the_same_seed_and_tick_give_the_same_bytes_and_others_do_not():
    shot, config = snapshot(straight(1.8), boxes=[box(20.0)]), ImageConfig(channels="rgb")
    first = taken(shot, config, seed=3, index=7)
    assert np.array_equal(first, taken(shot, config, seed=3, index=7))
    assert not np.array_equal(first, taken(shot, config, seed=4, index=7))
    assert not np.array_equal(first, taken(shot, config, seed=3, index=8))


def test_the_texture_of_the_road_stays_where_it_is_while_the_vehicle_moves():
    config = replace_config(CLEAN, texture=0.3)
    here = taken(snapshot(), config).astype(float)
    there = replace(snapshot(), ego=replace(snapshot().ego, position_world_m=np.array([2.0, 0.0, 0.0])))
    moved = taken(there, config).astype(float)
    spots = np.array([[x, y, 0.0] for x in np.arange(8.5, 11.0, 0.1) for y in np.arange(-1.0, 1.0, 0.1)])
    before, after = (np.rint(pixels_of(spots - (shift, 0.0, 0.0))).astype(int) for shift in (0.0, 2.0))
    a, b = here[before[:, 1], before[:, 0]], moved[after[:, 1], after[:, 0]]
    assert np.corrcoef(a, b)[0, 1] > 0.9
    assert np.corrcoef(a, moved[before[:, 1], before[:, 0]])[0, 1] < 0.5


def test_world_coordinates_of_five_million_metres_give_the_same_image():
    far = np.array([5_400_000.0, -3_200_000.0, 100.0])
    shot = snapshot(straight(1.8), boxes=[box(20.0)])
    moved = replace(
        shot,
        ego=replace(shot.ego, position_world_m=far),
        scene=replace(
            shot.scene,
            markings=tuple(
                replace(m, points_world_m=frozen(m.points_world_m + far)) for m in shot.scene.markings
            ),
            obstacles=tuple(replace(b, centre_world_m=b.centre_world_m + far) for b in shot.scene.obstacles),
        ),
    )
    assert abs(taken(shot).astype(int) - taken(moved)).max() <= 1


def test_where_the_vehicle_is_not_known_the_road_is_empty():
    lost = snapshot(straight(1.8), boxes=[box(20.0)], yaw_rad=np.nan)
    assert np.array_equal(taken(lost), taken(snapshot()))


def test_a_lens_bends_the_stripe_as_project_says():
    """Barrel distortion: the rendered stripe's middle in a row is where the exact curve crosses that row."""
    camera = Camera.from_config(
        CameraConfig(
            width_px=640, height_px=400, hfov_deg=80.0, distortion=DistortionConfig(k1=-0.25, k2=0.05)
        )
    )
    painted = paint_in(snapshot(straight(2.4)), CLEAN, camera)
    x = np.linspace(3.5, 60.0, 5000)
    left, right = (pixels_of(np.column_stack([x, 0.0 * x + y, 0.0 * x]), camera) for y in (2.475, 2.325))
    for row in range(230, 360, 10):
        exact = np.mean([np.interp(row, edge[::-1, 1], edge[::-1, 0]) for edge in (left, right)])
        rendered = (painted[row] @ np.arange(640)) / painted[row].sum()
        assert rendered == pytest.approx(exact, abs=0.06)
    straight_lens = Camera.from_config(CameraConfig(width_px=640, height_px=400, hfov_deg=80.0))
    assert abs(pixels_of([[4.0, 2.4, 0.0]], straight_lens) - pixels_of([[4.0, 2.4, 0.0]], camera)).max() > 5.0


def test_where_a_lens_shows_nothing_it_is_dark():
    camera = Camera.from_config(
        CameraConfig(width_px=320, height_px=200, hfov_deg=110.0, distortion=DistortionConfig(k1=-0.3))
    )
    image = taken(snapshot(straight(0.0)), CLEAN, camera)
    assert image[0, 0] == image[-1, -1] == 0
    assert image[100, 160] > 0
    assert image[60, 160] > 0


def test_a_camera_that_is_bypassed_has_no_image():
    with pytest.raises(ConfigError, match="model"):
        taken(snapshot(), camera=Camera.from_config(CameraConfig(model="none")))


def test_a_run_without_images_never_imports_opencv():
    code = (
        "import sys; from vsensor.cli import main; main(['run', '--fast', '--duration', '0.4', '--quiet']); "
        "print('cv2' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "False"


def crest(x):
    """Return the height of a road that is level for 30 m and then falls away on a radius of 600 m."""
    return -((x - 30.0).clip(0.0) ** 2) / 1200.0


def test_a_crest_hides_the_paint_behind_it():
    """With d = x - 1.9, d0 = 28.1: slope (-1.35 - (d - d0)^2 / 1200) / d is largest at d^2 = d0^2 + 1620."""
    x = np.arange(0.0, 120.0, 0.1)
    touches = 1.9 + np.sqrt(28.1**2 + 1620.0)
    behind = marking(x, 1.8, crest(x), painted=x > touches + 5.0)  # where it is 2 cm below the line of sight
    assert not paint_in(snapshot(behind)).any()
    before = marking(x, 1.8, crest(x), painted=(x > touches - 6.0) & (x < touches))
    assert paint_in(snapshot(before)).any()


def test_beyond_a_crest_a_road_that_rises_again_is_hidden_up_to_the_line_of_sight():
    x = np.arange(0.0, 150.0, 0.1)
    height = crest(x.clip(0.0, 75.0)) + 0.06 * (x - 75.0).clip(0.0)
    touches = 1.9 + np.sqrt(28.1**2 + 1620.0)
    slope = (crest(np.array([touches]))[0] - 1.35) / (touches - 1.9)
    is_above = height - 1.35 > slope * (x - 1.9)
    appears = x[is_above & (x > 80.0)][0]
    hidden = marking(x, 1.8, height, painted=(x > 76.0) & (x < appears - 0.5))
    assert not paint_in(snapshot(hidden)).any()
    seen = marking(x, 1.8, height, painted=x > appears + 0.5)
    assert paint_in(snapshot(seen)).any()


def test_paint_just_behind_a_crest_takes_nothing_from_the_paint_before_it():
    x = np.arange(0.0, 120.0, 0.1)
    touches = 1.9 + np.sqrt(28.1**2 + 1620.0)
    solid = paint_in(snapshot(marking(x, 1.8, crest(x))))
    before = paint_in(snapshot(marking(x, 1.8, crest(x), painted=x < touches)))
    assert (solid >= before - 1.0).all()


def test_a_crest_hides_the_lower_part_of_a_vehicle_and_then_all_of_it():
    x = np.arange(0.0, 160.0, 0.1)
    line = marking(x, 3.0, crest(x), painted=False)

    def rows_of(distance_m, *lines):
        height = float(crest(np.array([distance_m]))[0])
        vehicle = replace(
            box(distance_m, number=1), centre_world_m=np.array([distance_m, 0.0, height + 0.75])
        )
        bare = taken(snapshot(*lines)).astype(int)
        return (taken(snapshot(*lines, boxes=[vehicle])) != bare).any(axis=1).nonzero()[0]

    assert np.array_equal(rows_of(35.0, line), rows_of(35.0))
    cut, whole = rows_of(75.0, line), rows_of(75.0)
    assert cut[0] == whole[0]  # its roof
    assert whole[0] < cut[-1] < whole[-1] - 2
    assert len(rows_of(130.0, line)) == 0
    assert len(rows_of(130.0)) > 0


def test_a_road_that_climbs_into_the_sky_is_drawn_there_with_its_paint():
    x = np.arange(0.0, 120.0, 0.1)
    climbing = 0.001 * x**2
    shot = snapshot(marking(x, 0.0, climbing))
    ((u, v),) = pixels_of([[80.0, 0.0, 6.4]])
    assert v < CAMERA.cy_px - 10
    image = taken(shot).astype(int)
    sky = int(taken(snapshot())[0, 0])
    row = image[round(v)]
    assert row[5] == sky
    assert row[round(u) - 6] < sky - 50  # road beside the paint
    assert row[round(u)] > row[round(u) - 6] + 50


def test_a_flat_road_hides_nothing_of_itself():
    line = straight(1.8)
    eye = np.array([1.9, 0.0, 1.35])
    assert Skyline(eye, np.array([1.0, 0.0, 0.0]), line.points_world_m).seen.all()

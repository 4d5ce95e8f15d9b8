from pathlib import Path

import msgspec
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.camera import Camera, CameraConfig, camera_from_ego, project
from vsensor.errors import ConfigError
from vsensor.transforms import transform
from vsensor.types import Boundary, Colour, EgoState, LaneEstimate, MarkingKind, Side
from vsensor.video.camera_file import read_camera
from vsensor.video.label_score import score_method, score_rows, score_table, scored
from vsensor.video.labels import LabelConfig, best_pitch_rad, picture_errors, read_labels

LABELS = Path(__file__).with_name("labels.toml")
CAMERAS = tuple(Path(__file__).with_name(f"{name}.toml") for name in ("carnd_960", "carnd_1280", "rav4"))
PLAIN = CameraConfig(width_px=960, height_px=540, hfov_deg=60.0, position_m=(1.9, 0.0, 1.3), pitch_deg=2.0)
WIDTH_M = 0.15


def line(side, *coefficients, x_max_m=80.0, width_m=WIDTH_M):
    """Return a reported line by its coefficients."""
    c = np.array(coefficients, dtype=float)
    return Boundary(
        side=side,
        coefficients=c,
        covariance=np.zeros((len(c), len(c))),
        x_min_m=6.0,
        x_max_m=x_max_m,
        quality=4,
        kind=MarkingKind.SOLID,
        colour=Colour.WHITE,
        width_m=width_m,
        measured=True,
        marking=-1,
        points=-1,
    )


def estimate(*lines):
    return LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=lines)


LANE = estimate(line(Side.LEFT, 1.8, 0.01, 5e-4), line(Side.RIGHT, -1.7, 0.01, 5e-4))
AHEAD_M = np.array([8.0, 11.0, 16.0, 24.0, 35.0])


def label_of(lane, config=PLAIN, pitch_rad=0.0):
    """Return what a person would mark: the paint of these lines, exactly, with the body pitched."""
    ego = EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=0.0, body_pitch_rad=pitch_rad)
    camera = Camera.from_config(config)
    pose = camera_from_ego(camera, ego)
    rows = {Side.LEFT: [], Side.RIGHT: []}
    for one in lane.boundaries:
        y = np.polynomial.polynomial.polyval(AHEAD_M, one.coefficients)
        u, v = project(camera, transform(pose, np.column_stack([AHEAD_M, y, 0.0 * y]))).T
        rows[one.side] = [(b, a - 2.0, a + 2.0) for a, b in zip(u.tolist(), v.tolist(), strict=True)]
    sides = {"left": tuple(rows[Side.LEFT]), "right": tuple(rows[Side.RIGHT])}
    return LabelConfig(file="picture.png", size_px=(960, 540), **sides)


def test_lines_that_are_where_the_paint_is_have_no_error():
    for found in picture_errors(label_of(LANE), LANE, Camera.from_config(PLAIN)):
        assert np.abs(found.centre_px).max() < 0.02
        assert np.abs(found.centre_m).max() < 1e-6
        assert found.x_m == pytest.approx(AHEAD_M, abs=1e-6)


def test_a_line_too_far_to_the_left_is_so_in_metres_and_to_the_left_in_pixels():
    off = estimate(
        *(line(one.side, one.coefficients[0] + 0.1, *one.coefficients[1:]) for one in LANE.boundaries)
    )
    camera = Camera.from_config(PLAIN)
    for found in picture_errors(label_of(LANE), off, camera):
        assert found.centre_m == pytest.approx(np.full(5, 0.1), abs=1e-6)
        # closed form for a level camera; 2 degrees of pitch change the depth by less than 1 %
        assert found.centre_px == pytest.approx(-0.1 * camera.fx_px / (AHEAD_M - 1.9), rel=0.02)


def test_the_inner_edge_is_that_towards_the_vehicle():
    # labels are 4 px wide whatever the distance, lines 0.15 m: at 8 m 4 px are 0.029 m
    camera = Camera.from_config(PLAIN)
    left, right = picture_errors(label_of(LANE), LANE, camera)
    half_px_m = 2.0 * (AHEAD_M - 1.9) / camera.fx_px
    assert left.inner_m == pytest.approx(half_px_m - WIDTH_M / 2, abs=0.002)
    assert right.inner_m == pytest.approx(WIDTH_M / 2 - half_px_m, abs=0.002)


@pytest.mark.parametrize("pitch_deg", [-0.8, 0.3])
def test_the_bodys_pitch_is_found_and_leaves_no_error(pitch_deg):
    label, camera = label_of(LANE, pitch_rad=np.radians(pitch_deg)), Camera.from_config(PLAIN)
    found = scored(label, LANE, camera)
    assert np.degrees(found.pitch_rad) == pytest.approx(pitch_deg, abs=0.005)
    assert max(np.abs(one.centre_px).max() for one in found.fitted) < 0.1
    assert max(np.abs(one.centre_px).max() for one in found.mounted) > 3.0


def test_one_line_alone_does_not_tell_a_pitch():
    alone = estimate(LANE.boundaries[0])
    assert best_pitch_rad(label_of(LANE, pitch_rad=0.01), alone, Camera.from_config(PLAIN)) == 0.0


def test_a_line_that_is_not_reported_or_ends_has_no_error_there():
    short = estimate(line(Side.LEFT, 1.8, 0.01, 5e-4, x_max_m=20.0))
    left, right = picture_errors(label_of(LANE), short, Camera.from_config(PLAIN))
    assert np.isfinite(left.centre_px).tolist() == [True, True, True, False, False]
    assert np.isfinite(left.centre_m).tolist() == [True, True, True, False, False]
    assert np.isnan(right.centre_px).all()


def test_a_lens_that_bends_is_followed():
    bent = msgspec.structs.replace(PLAIN, distortion={"k1": -0.25, "k2": 0.02})
    bent = msgspec.convert(msgspec.to_builtins(bent), CameraConfig)
    for found in picture_errors(label_of(LANE, bent), LANE, Camera.from_config(bent)):
        assert np.abs(found.centre_px).max() < 0.02
        assert np.abs(found.centre_m).max() < 1e-6


def test_a_camera_of_another_size_is_refused():
    small = Camera.from_config(msgspec.structs.replace(PLAIN, width_px=640, height_px=360))
    with pytest.raises(ConfigError, match=r"picture.png: is 960 x 540, the camera 640 x 360"):
        picture_errors(label_of(LANE), LANE, small)


@pytest.mark.parametrize(
    ("row", "said"),
    [
        ("[600, 10, 20]", r"left row \[600, 10, 20\]: v, left edge, right edge within 960 x 540"),
        ("[400, 30, 20]", r"left row \[400, 30, 20\]"),
        ("[400, 30]", "left"),
    ],
)
def test_rows_that_are_no_paint_in_the_picture_are_refused(tmp_path, row, said):
    file = tmp_path / "labels.toml"
    image = f'[[image]]\nfile = "a.png"\nsize_px = [960, 540]\nleft = [{row}]\n'
    file.write_text(f'schema = "vsensor.lane_labels/1"\n{image}')
    with pytest.raises(ConfigError, match=said):
        read_labels(file)


# ---- the labels of real pictures -------------------------------------------------------------------------


@pytest.fixture(scope="module")
def labels():
    return read_labels(LABELS)


def test_40_real_pictures_have_both_lines_marked(labels):
    assert len({label.name for label in labels}) == 40
    assert all(len(label.rows(side)) >= 3 for label in labels for side in (Side.LEFT, Side.RIGHT))
    frames = sorted(label.frame for label in labels if label.frame is not None)
    assert frames == list(range(0, 221, 9))  # spread over the drive


@needs_shared
def test_labelled_pictures_are_there_and_have_the_size_that_is_said(labels):
    cv2 = pytest.importorskip("cv2")
    for label in labels:
        path = SHARED_DATA / "camera" / label.file
        assert path.is_file()
        if label.frame is None:
            height, width = cv2.imread(str(path)).shape[:2]
            assert (width, height) == label.size_px, label.name


def parallel(label, camera):
    """Return how far rows are from parallel curves in px, and the lane's width, at the pitch that suits."""
    best = (np.inf, np.nan)
    for pitch_rad in np.radians(np.arange(-0.6, 0.61, 0.05)):
        flat = estimate(line(Side.LEFT, 0.0, x_max_m=1e3), line(Side.RIGHT, 0.0, x_max_m=1e3))
        left, right = picture_errors(label, flat, camera, pitch_rad=float(pitch_rad))
        x, y = np.concatenate([left.x_m, right.x_m]), -np.concatenate([left.centre_m, right.centre_m])
        is_left = np.arange(len(x)) < len(left.x_m)
        per_px = camera.fx_px / x
        columns = np.column_stack([is_left, ~is_left, x, x * x]) * per_px[:, None]
        found, *_ = np.linalg.lstsq(columns, y * per_px, rcond=None)
        rms_px = float(np.sqrt(np.mean((columns @ found - y * per_px) ** 2)))
        best = min(best, (rms_px, float(found[0] - found[1])))
    return best


def test_labelled_lines_are_parallel_to_a_pixel_and_lanes_of_one_width(labels):
    camera = Camera.from_config(read_camera(CAMERAS[0]).config)
    ours = [label for label in labels if label.size_px == (960, 540)][::4]
    rms_px, width_m = np.array([parallel(label, camera) for label in ours]).T
    assert len(ours) == 8
    assert rms_px.max() < 1.0
    assert width_m.mean() == pytest.approx(3.66, abs=0.03)  # 12 ft
    assert width_m.std() < 0.08  # half a pixel in the far rows moves the pitch, and with it the width


@needs_shared
def test_our_method_finds_the_labelled_lines_of_a_still_to_two_pixels(labels):
    pytest.importorskip("cv2")
    still = [label for label in labels if label.file.endswith("solidYellowCurve2.jpg")]
    found = {"ours": score_method("ours", still, SHARED_DATA / "camera", [read_camera(CAMERAS[0])])}
    rows = score_rows(found)
    assert len(rows) == 14
    assert np.sqrt(np.mean([row["centre_px"] ** 2 for row in rows])) < 2.0
    table = score_table(found)
    assert "1 stills" in table[1]
    assert "2 of 2" in table[1]


@needs_shared
def test_a_picture_without_a_camera_of_its_size_is_refused(labels):
    with pytest.raises(ConfigError, match=r"is 1280 x 720: a --camera of that size was expected"):
        score_method("ours", [labels[-3]], SHARED_DATA / "camera", [read_camera(CAMERAS[0])])

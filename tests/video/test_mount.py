"""Where a camera points and how high it is, found from the road that it saw."""

import cv2
import msgspec
import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from tests.vehicle_frames import Gateway
from tests.video.mount_drives import BEND_LANE_M, CAMERA, HIGHWAY_LANE_M, WRONG, write_drive
from vsensor.camera import Camera, project
from vsensor.cli import main
from vsensor.errors import VideoError
from vsensor.transforms import transform
from vsensor.video.camera_file import camera_of, read_camera, write_camera
from vsensor.video.frames import open_pictures
from vsensor.video.ground_speed import height_from_speed
from vsensor.video.line_points import line_points, rows_of
from vsensor.video.mount import drift_mps, find_mount
from vsensor.video.parallel import Mount, fit_lane
from vsensor.video.types import Motion, Picture
from vsensor.video.upright import upright_camera

DRIVES = {
    "day": (dict(light="day"), HIGHWAY_LANE_M),
    "night": (dict(light="night"), HIGHWAY_LANE_M),
    "bend": (dict(light="night", road="bend", speed_kmh=60.0), BEND_LANE_M),
}


@pytest.fixture(scope="module")
def drives(tmp_path_factory):
    """{name: video} of DRIVES."""
    folder = tmp_path_factory.mktemp("drives")
    return {name: write_drive(folder, name, **kind) for name, (kind, _) in DRIVES.items()}


@pytest.fixture(scope="module")
def mounts(drives):
    """{name: mount found from a wrong one}, each drive looked at once."""
    return {name: find_mount(pictures_of(drives[name]), WRONG, name) for name in DRIVES}


def pictures_of(video):
    def pictures():
        with open_pictures(video) as reader:
            yield from reader

    return pictures


@pytest.mark.parametrize("name", DRIVES)
def test_wrong_pitch_and_yaw_are_found_within_a_fifth_of_a_degree(mounts, name):
    found = mounts[name].camera.config
    assert found.pitch_deg == pytest.approx(CAMERA.config.pitch_deg, abs=0.2)
    assert found.yaw_deg == pytest.approx(CAMERA.config.yaw_deg, abs=0.2)


@pytest.mark.parametrize("name", DRIVES)
def test_a_lane_s_width_gives_the_height_within_3_percent(mounts, name):
    seen, height_m = mounts[name].width_m.value, WRONG.config.position_m[2]
    assert height_m * DRIVES[name][1] / seen == pytest.approx(CAMERA.config.position_m[2], rel=0.03)


@pytest.mark.parametrize("name", DRIVES)
def test_the_speed_gives_the_height_within_3_percent(drives, mounts, name):
    speed_mps = DRIVES[name][0].get("speed_kmh", 80.0) / 3.6
    motions = [Motion(speed_mps=speed_mps)] * 60
    height = height_from_speed(pictures_of(drives[name])(), mounts[name].camera, motions)
    assert height.value == pytest.approx(CAMERA.config.position_m[2], rel=0.03)
    assert height.std < 0.03


@pytest.mark.parametrize("name", DRIVES)
def test_nearly_all_pictures_tell_a_lane(mounts, name):
    assert mounts[name].pictures == 60
    assert mounts[name].lanes >= 54


def test_a_road_that_does_not_move_gives_no_height(drives, mounts):
    first = next(iter(pictures_of(drives["day"])()))
    still = [Picture(index=k, t_ns=k * 100_000_000, grey=first.grey) for k in range(40)]
    assert height_from_speed(still, mounts["day"].camera, [Motion(speed_mps=22.2)] * 40) is None


def test_the_command_writes_what_was_found_and_draws_it(drives, tmp_path, capsys):
    write_camera(tmp_path / "wrong.toml", WRONG, ())
    out, drawn = tmp_path / "mounted.toml", tmp_path / "mount.png"
    words = ["video", "mount", str(drives["day"]), "--camera", str(tmp_path / "wrong.toml"), "--limit", "15"]
    assert main([*words, "--lane-width", "3.75", "--out", str(out), "--picture", str(drawn)]) == 0
    said = capsys.readouterr().out
    assert "of 15 pictures show a lane" in said
    assert "(was 3)" in said
    assert "(was 1.496), from a lane 3.75 m wide" in said
    found = read_camera(out)
    assert found.config.pitch_deg == pytest.approx(CAMERA.config.pitch_deg, abs=0.2)
    assert found.config.position_m == pytest.approx((1.8, 0.19, 1.36), rel=0.03)
    assert found.config.fx_px == CAMERA.config.fx_px
    assert cv2.imread(str(drawn)) is not None


def motion_log(path, speed_mps, seconds):
    gateway = Gateway()
    frames = (gateway.motion(0, speed_mps, 0.0) for _ in range(round(seconds * 50)))
    path.write_text(
        "".join(
            f"({1000 + k * 0.02:.6f}) can0 {frame.arbitration_id:03X}#{frame.data.hex().upper()}\n"
            for k, frame in enumerate(frames)
        )
    )
    return path


def test_the_command_takes_the_speed_of_a_can_log(drives, tmp_path, capsys):
    write_camera(tmp_path / "wrong.toml", WRONG)
    out, log = tmp_path / "mounted.toml", motion_log(tmp_path / "drive.log", 80.0 / 3.6, 4.0)
    words = ["video", "mount", str(drives["day"]), "--camera", str(tmp_path / "wrong.toml"), "--limit", "25"]
    words += ["--motion", str(log), "--out", str(out)]
    assert main(words) == 0
    assert ", from the speed on CAN" in capsys.readouterr().out
    assert read_camera(out).config.position_m[2] == pytest.approx(1.36, rel=0.03)
    assert main([*words, "--motion-begins", "100"]) == 2
    assert "does not overlap the video" in capsys.readouterr().err


def test_a_hanging_camera_is_told_from_one_whose_file_does_not_say_so(drives):
    def hanging():
        for picture in pictures_of(drives["day"])():
            yield Picture(index=picture.index, t_ns=picture.t_ns, grey=picture.grey[::-1, ::-1])
            if picture.index == 14:
                return

    with pytest.raises(VideoError, match=r"d\.avi: seems to be upside down.*roll_deg = 180"):
        find_mount(hanging, WRONG, "d.avi")
    turned = upright_camera(msgspec.structs.replace(WRONG.config, roll_deg=180.0))
    said = msgspec.structs.replace(turned, roll_deg=180.0)
    found = find_mount(hanging, WRONG._replace(config=said), "d.avi").camera.config
    assert (found.pitch_deg, found.yaw_deg) == pytest.approx((1.0, -0.6), abs=0.2)
    assert found.roll_deg == 180.0


def test_half_a_turn_of_the_camera_and_of_its_picture_are_one():
    config = msgspec.structs.replace(
        WRONG.config, roll_deg=178.0, distortion=msgspec.structs.replace(WRONG.config.distortion, p1=0.01)
    )
    upright = upright_camera(config)
    assert upright.roll_deg == -2.0
    for one, other in ((config, upright), (upright, upright)):
        camera, back = Camera.from_config(one), Camera.from_config(other)
        points = np.array([[20.0, 2.0, 0.0], [8.0, -1.0, 0.0]])
        pixels = [project_ego(c, points) for c in (camera, back)]
        turned = pixels[0] if one is other else np.array((355.0, 287.0)) - pixels[0]
        np.testing.assert_allclose(turned, pixels[1], atol=1e-9)


def project_ego(camera, points):
    return project(camera, transform(camera.camera_from_body, points))


def still(level, count=12):
    grey = np.full((288, 356), level, np.uint8)
    return lambda: (Picture(index=k, t_ns=k * 100_000_000, grey=grey) for k in range(count))


def test_black_pictures_and_pictures_without_lines_are_said():
    with pytest.raises(VideoError, match=r"v\.avi: is black"):
        find_mount(still(3), WRONG, "v.avi")
    with pytest.raises(VideoError, match=r"v\.avi: no painted lines"):
        find_mount(still(120), WRONG, "v.avi")


def test_noise_is_no_lane():
    draw = np.random.default_rng(5)
    greys = [draw.integers(60, 120, (288, 356), dtype=np.uint8) for _ in range(12)]
    with pytest.raises(VideoError, match=r"no painted lines|too few to tell"):
        find_mount(
            lambda: (Picture(index=k, t_ns=k, grey=grey) for k, grey in enumerate(greys)), WRONG, "v.avi"
        )


def rays_of_lane(mount, curvature, left_m, width_m):
    """Rays (3, N) of points on two parallel arcs that the mount sees."""
    x = np.linspace(6.0, 40.0, 60)
    k_right = curvature / (1.0 + curvature * width_m)
    y = np.concatenate([left_m + curvature * x * x / 2.0, left_m - width_m + k_right * x * x / 2.0])
    x = np.concatenate([x, x])
    config = msgspec.structs.replace(
        CAMERA.config,
        pitch_deg=np.degrees(mount.pitch_rad),
        yaw_deg=np.degrees(mount.yaw_rad),
        position_m=mount.position_m,
    )
    camera = Camera.from_config(config)
    pose = camera.camera_from_body
    optical = np.column_stack([x, y, np.zeros(len(x))]) @ pose.rotation.T + pose.translation
    return (optical / optical[:, 2:]).T


@pytest.mark.parametrize("curvature", [0.0, 1 / 400, -1 / 250])
def test_a_lane_s_own_angles_come_back_exactly(curvature):
    true = Mount((1.8, 0.19, 1.36), 0.0, np.radians(1.0), np.radians(-0.6))
    start = true._replace(pitch_rad=np.radians(1.6), yaw_rad=np.radians(0.1))
    lane = fit_lane(rays_of_lane(true, curvature, 1.9, 3.5), start, 256.0)
    assert np.degrees([lane.pitch_rad, lane.yaw_rad]) == pytest.approx((1.0, -0.6), abs=0.01)
    assert (lane.left_m, lane.width_m) == pytest.approx((1.9, 3.5), abs=0.01)
    assert lane.curvature_per_m == pytest.approx(curvature, abs=2e-5)


@pytest.mark.parametrize("wide", [0.7, 1.0, 2.0])
def test_line_points_lie_on_the_middle_of_markings(wide):
    camera = Camera.from_config(msgspec.structs.replace(CAMERA.config, pitch_deg=0.0, yaw_deg=0.0))
    rows = rows_of(camera, camera.camera_from_body, 6.0, 20.0)
    grey, u = np.full((288, 356), 70.0), np.arange(356)
    centre = 120.3 + 0.2 * rows.v[:, None]
    half = wide * rows.half_px[:, None]
    cover = np.minimum(u + 0.5, centre + half) - np.maximum(u - 0.5, centre - half)
    grey[rows.v] += 100.0 * np.clip(cover, 0.0, 1.0)
    points = line_points(np.rint(grey).astype(np.uint8), rows)
    assert len(points) == len(rows.v)
    np.testing.assert_allclose(points[:, 0], 120.3 + 0.2 * points[:, 1], atol=0.12)


def test_drift_is_the_slope_of_a_line_s_offset_and_a_changed_line_is_none():
    t_s = np.arange(0.0, 8.0, 0.1)
    left = 1.5 + 0.3 * t_s
    left[40:] -= 3.5
    np.testing.assert_allclose(drift_mps(t_s, left), 0.3, atol=1e-9)


@needs_shared
def test_the_real_drive_shows_a_lane_in_every_picture_and_one_width():
    video = SHARED_DATA / "camera" / "carnd_lanelines" / "solidWhiteRight.mp4"

    def pictures():
        with open_pictures(video) as reader:
            yield from (picture for picture in reader if picture.index % 16 == 0)

    camera, _ = camera_of(None, (960, 540), "v.mp4")
    found = find_mount(pictures, camera, "v.mp4", lane_width_m=3.66)
    assert (found.pictures, found.lanes) == (14, 14)
    assert found.pitch_deg.value == pytest.approx(-2.05, abs=0.15)  # the horizon is 36 px above the middle
    assert abs(found.yaw_deg.value) < 0.4
    assert np.std(found.seen.width_m) < 0.1
    assert 1.1 < found.height_m.value < 1.4

"""A camera file is the sensor's own `[camera]`: written, read, named by a scenario; no other size."""

import msgspec
import pytest

from vsensor.camera import Camera, CameraConfig
from vsensor.cli import main
from vsensor.config import SHIPPED, load_scenario
from vsensor.distortion import DistortionConfig
from vsensor.errors import ConfigError
from vsensor.signals import VehicleConfig
from vsensor.video.camera_file import VideoCamera, camera_of, default_camera, read_camera, write_camera
from vsensor.video.frames import open_pictures

EOR = VideoCamera(
    CameraConfig(
        width_px=355,
        height_px=288,
        fx_px=255.82,
        fy_px=280.99,
        cx_px=179.39,
        cy_px=143.19,
        position_m=(1.8, 0.19, 1.36),
        pitch_deg=-1.25,
        distortion=DistortionConfig(k1=-0.25, p2=1e-5),
        inverse="ground_plane",
        crest=False,
    ),
    VehicleConfig(wheelbase_m=2.7, width_m=1.9),
)


def test_what_is_written_is_read_back_whole(tmp_path):
    for name, camera in {"eor": EOR, "default": default_camera((640, 480))}.items():
        write_camera(tmp_path / f"{name}.toml", camera, ["two lines", "of comment"])
        assert read_camera(tmp_path / f"{name}.toml") == camera


def test_every_key_of_a_camera_comes_back(tmp_path):
    changed = {
        "hfov_deg": 61.5,
        "min_range_m": 1.0,
        "max_range_m": 90.0,
        "min_width_px": 1.5,
        "min_contrast": 0.2,
        "pixel_grid": False,
        "occlusion": "none",
        "assumed_height_m": 1.3,
        "assumed_pitch_deg": 1.0,
        "assumed_roll_deg": -1.0,
    }
    camera = VideoCamera(CameraConfig(**changed))
    write_camera(tmp_path / "c.toml", camera)
    assert read_camera(tmp_path / "c.toml") == camera
    assert {field.name for field in msgspec.structs.fields(CameraConfig)} == {
        *(name for name in changed),
        *("model", "width_px", "height_px", "fx_px", "fy_px", "cx_px", "cy_px", "distortion"),
        *("position_m", "roll_deg", "pitch_deg", "yaw_deg", "crest", "inverse"),
    }


def test_a_scenario_takes_a_camera_file_beneath_its_own_keys(tmp_path):
    write_camera(tmp_path / "eor.toml", EOR)
    text = 'schema = "vsensor.scenario/1"\nsource = "m.xodr"\ncamera_file = "eor.toml"\n'
    (tmp_path / "m.xodr").touch()
    (tmp_path / "as_is.toml").write_text(text)
    as_is = load_scenario(str(tmp_path / "as_is.toml")).config
    assert VideoCamera(as_is.camera, as_is.vehicle) == EOR
    (tmp_path / "own.toml").write_text(text + "[camera]\npitch_deg = 0.5\n[vehicle]\nwidth_m = 2.0\n")
    own = load_scenario(str(tmp_path / "own.toml"), {"camera": {"yaw_deg": 1.0}}).config
    assert own.camera == msgspec.structs.replace(EOR.config, pitch_deg=0.5, yaw_deg=1.0)
    assert own.vehicle == msgspec.structs.replace(EOR.vehicle, width_m=2.0)


def test_a_drive_is_run_with_a_camera_file_as_it_is(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    write_camera(tmp_path / "eor.toml", EOR)
    (tmp_path / "s.toml").write_text(
        f'schema = "vsensor.scenario/1"\nsource = "{SHIPPED / "highway.xodr"}"\ncamera_file = "eor.toml"\n'
    )
    assert main(["run", "s.toml", "--fast", "--duration", "0.2", "--images", "images"]) == 0
    with open_pictures(tmp_path / "images") as reader:
        assert reader.size == (355, 288)


def test_a_scenario_and_a_shipped_one_serve_as_camera_files(tmp_path):
    (tmp_path / "s.toml").write_text(
        'schema = "vsensor.scenario/1"\nsource = "absent.xodr"\n[camera]\nwidth_px = 640\n'
    )
    assert read_camera(tmp_path / "s.toml").size == (640, 800)
    assert read_camera("highway").config == load_scenario("highway").config.camera


def refused(tmp_path, text):
    (tmp_path / "c.toml").write_text(text)
    with pytest.raises(ConfigError) as told:
        read_camera(tmp_path / "c.toml")
    assert "c.toml" in str(told.value)
    return str(told.value)


def test_what_is_no_camera_file_is_said(tmp_path):
    head = 'schema = "vsensor.camera/1"\n'
    assert 'expected schema = "vsensor.camera/1"' in refused(tmp_path, "[camera]\n")
    assert "camera" in refused(tmp_path, head)
    assert "did you mean width_px?" in refused(tmp_path, head + "[camera]\nwidth = 3\n")
    assert "all four were expected" in refused(tmp_path, head + "[camera]\nfx_px = 500.0\n")
    assert "pinhole was expected" in refused(tmp_path, head + '[camera]\nmodel = "none"\n')
    assert "newer" in refused(tmp_path, 'schema = "vsensor.camera/2"\n[camera]\n')
    with pytest.raises(ConfigError, match="no such file"):
        read_camera(tmp_path / "absent.toml")


def test_a_scenario_says_which_camera_file_is_wrong(tmp_path):
    (tmp_path / "m.xodr").touch()
    (tmp_path / "c.toml").write_text('schema = "vsensor.camera/1"\n[camera]\nwidht_px = 3\n')
    (tmp_path / "s.toml").write_text(
        'schema = "vsensor.scenario/1"\nsource = "m.xodr"\ncamera_file = "c.toml"\n'
    )
    with pytest.raises(ConfigError, match=r"c\.toml: camera\.widht_px: unknown key; did you mean width_px"):
        load_scenario(str(tmp_path / "s.toml"))


def test_a_video_of_another_size_than_the_camera_is_refused(tmp_path):
    write_camera(tmp_path / "eor.toml", EOR)
    assert camera_of(tmp_path / "eor.toml", (355, 288), "v.avi") == (EOR, None)
    with pytest.raises(ConfigError, match=r"v\.avi: is 710 x 576, the camera of .*eor\.toml has 355 x 288"):
        camera_of(tmp_path / "eor.toml", (710, 576), "v.avi")


def test_a_row_or_column_that_an_encoder_added_is_no_other_size(tmp_path):
    write_camera(tmp_path / "eor.toml", EOR)
    wide = msgspec.structs.replace(EOR.config, width_px=356)
    assert camera_of(tmp_path / "eor.toml", (356, 288), "v.avi") == (EOR._replace(config=wide), None)
    write_camera(tmp_path / "odd.toml", default_camera((641, 481)))
    widened, _ = camera_of(tmp_path / "odd.toml", (642, 482), "v.avi")
    seen, before = (Camera.from_config(c) for c in (widened.config, default_camera((641, 481)).config))
    assert (seen.fx_px, seen.cx_px, seen.cy_px) == (before.fx_px, before.cx_px, before.cy_px)
    with pytest.raises(ConfigError):
        camera_of(tmp_path / "odd.toml", (643, 481), "v.avi")


def test_without_a_camera_the_assumed_one_is_stated():
    camera, said = camera_of(None, (960, 540), "v.mp4")
    assert camera.size == (960, 540)
    assert "960 x 540, 52 degrees wide, 1.35 m up, 1.9 m ahead of the rear axle" in said

"""Short drives as videos, rendered by the image model with a camera that is known."""

import msgspec

from vsensor.camera import CameraConfig
from vsensor.cli import main
from vsensor.config import SHIPPED
from vsensor.video.camera_file import VideoCamera, write_camera

CAMERA = VideoCamera(
    CameraConfig(
        width_px=356,
        height_px=288,
        fx_px=255.82,
        fy_px=280.99,
        cx_px=179.39,
        cy_px=143.19,
        position_m=(1.8, 0.19, 1.36),
        pitch_deg=1.0,
        yaw_deg=-0.6,
    )
)
"""P2's EOR camera (tables 2.2, 2.3), turned a little; a video has even sizes."""

WRONG = VideoCamera(
    msgspec.structs.replace(CAMERA.config, pitch_deg=3.0, yaw_deg=0.4, position_m=(1.8, 0.19, 1.36 * 1.1))
)
"""2 degrees of pitch, 1 of yaw, 10 % of height off."""

BEND = """
schema = "vsensor.road/1"
[[road]]
line = [
  { kind = "straight", length_m = 30 },
  { kind = "bend", radius_m = 250, turn_deg = 25, clothoid_m = 50 },
  { kind = "bend", radius_m = 300, turn_deg = -25, clothoid_m = 50 },
  { kind = "straight", length_m = 80 },
]
left = [{ width_m = 3.5 }]
right = [{ width_m = 3.5 }]
"""
HIGHWAY_LANE_M, BEND_LANE_M = 3.75, 3.5


def write_drive(folder, name, *, light="day", road="highway", speed_kmh=80.0, seconds=6.0, camera=CAMERA):
    """Write `NAME.avi`, a drive of 10 pictures a second that wanders and nods; return its path."""
    folder.mkdir(exist_ok=True)
    write_camera(folder / f"{name}_camera.toml", camera)
    (folder / "bend_road.toml").write_text(BEND)
    source = SHIPPED / "highway.xodr" if road == "highway" else folder / "bend_road.toml"
    (folder / f"{name}.toml").write_text(
        f"""
schema = "vsensor.scenario/1"
source = "{source}"
camera_file = "{name}_camera.toml"
cycle_ms = 100
[ego]
speed_kmh = {speed_kmh}
offset_m = [[0, 0.0], [2, 0.2], [4, -0.15], [6, 0.0]]
[environment]
light = "{light}"
[motion]
body = true
vibration = "normal"
"""
    )
    video = folder / f"{name}.avi"
    words = ["run", str(folder / f"{name}.toml"), "--fast", "--quiet", "--duration", str(seconds)]
    assert main([*words, "--video", str(video)]) == 0
    return video

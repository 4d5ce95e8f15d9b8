"""The camera of a video: `[camera]` of the sensor, in a file of its own that a scenario can name, too.

schema = "vsensor.camera/1"        a scenario takes it with   camera_file = "camera.toml"

[camera]                           lens, size and pose, as `vsensor video calibrate` and `mount` find them
[vehicle]                          where its front axle is: lane offsets are told there
"""

import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from vsensor.camera import Camera, CameraConfig
from vsensor.camera.config import DEFAULT_HFOV_DEG
from vsensor.config import CAMERA_SCHEMA, load_scenario, read_camera_file
from vsensor.errors import ConfigError
from vsensor.schema import user_path
from vsensor.signals import VehicleConfig

_ALWAYS = ("width_px", "height_px", "position_m", "roll_deg", "pitch_deg", "yaw_deg")
"""Keys that are written though they have their defaults: who adjusts by hand sees them."""


class VideoCamera(NamedTuple):
    """The camera that took a video, and the vehicle it is on."""

    config: CameraConfig
    vehicle: VehicleConfig = VehicleConfig()

    @property
    def size(self) -> tuple[int, int]:
        """Return width and height in pixels."""
        return self.config.width_px, self.config.height_px

    @property
    def front_axle_x_m(self) -> float:
        """Return where the front axle is, in the ego frame."""
        return self.vehicle.wheelbase_m


def read_camera(name_or_path: str | Path) -> VideoCamera:
    """Read a camera file, a scenario file, or a shipped scenario by name; raises ConfigError."""
    path = user_path(str(name_or_path))
    if not path.suffix and not path.exists():
        config = load_scenario(str(name_or_path)).config
        return _with_image(VideoCamera(config.camera, config.vehicle), str(name_or_path))
    read = read_camera_file(path)
    return _with_image(VideoCamera(read.camera, read.vehicle), str(path))


def _with_image(camera: VideoCamera, where: str) -> VideoCamera:
    if camera.config.model == "none":
        raise ConfigError(f'{where}: camera.model = "none" takes no video: pinhole was expected')
    return camera


def default_camera(size: tuple[int, int]) -> VideoCamera:
    """Return the camera that is assumed where nobody says which it was: the sensor's, of the video's size."""
    return VideoCamera(CameraConfig(width_px=size[0], height_px=size[1]))


def camera_of(
    name_or_path: str | Path | None, size: tuple[int, int], video: str
) -> tuple[VideoCamera, str | None]:
    """Return the camera of a video of this size, and a sentence where it is only assumed.

    Raises ConfigError where the video has another size than the camera: every number of a calibration is in
    its own pixels. Encoders want even sizes: an odd camera's video may have one row or column more, behind.
    """
    if name_or_path is None:
        camera = default_camera(size)
        return camera, assumption(camera)
    camera = read_camera(name_or_path)
    if camera.size != size and tuple(length + length % 2 for length in camera.size) == size:
        return _widened(camera, size), None
    if camera.size != size:
        raise ConfigError(
            f"{video}: is {size[0]} x {size[1]}, the camera of {name_or_path} has {camera.size[0]} x "
            f"{camera.size[1]}: a video of the size that was calibrated was expected"
        )
    return camera, None


def _widened(camera: VideoCamera, size: tuple[int, int]) -> VideoCamera:
    """Return the camera with rows or columns added at the right and below: its other numbers stay true."""
    seen = Camera.from_config(camera.config)
    config = msgspec.structs.replace(
        camera.config,
        width_px=size[0],
        height_px=size[1],
        hfov_deg=None,
        fx_px=seen.fx_px,
        fy_px=seen.fy_px,
        cx_px=seen.cx_px,
        cy_px=seen.cy_px,
    )
    return camera._replace(config=config)


def assumption(camera: VideoCamera) -> str:
    """Return one sentence that says what a default camera is."""
    x, _, z = camera.config.position_m
    return (
        f"no --camera: one of {camera.size[0]} x {camera.size[1]}, {DEFAULT_HFOV_DEG:g} degrees wide, "
        f"{z:g} m up, {x:g} m ahead of the rear axle, level and straight is assumed; "
        "offsets are as wrong as that is"
    )


def camera_text(camera: VideoCamera, comments: Sequence[str] = ()) -> str:
    """Return a camera file; `comments` stand at its head, one line each."""
    config = camera.config
    said = msgspec.structs.asdict(config)
    default = msgspec.structs.asdict(CameraConfig())
    lens = said.pop("distortion")
    lines = [f"# {comment}" for comment in comments] + [f'schema = "{CAMERA_SCHEMA}"', "", "[camera]"]
    lines += [
        f"{key} = {_toml(value)}"
        for key, value in said.items()
        if key in _ALWAYS or (value is not None and value != default[key])
    ]
    if lens != CameraConfig().distortion:
        lines += ["", "[camera.distortion]"]
        lines += [f"{key} = {_toml(value)}" for key, value in msgspec.structs.asdict(lens).items() if value]
    lines += ["", "[vehicle]"]
    vehicle = msgspec.structs.asdict(camera.vehicle)
    plain = msgspec.structs.asdict(VehicleConfig())
    lines += [
        f"{key} = {_toml(value)}"
        for key, value in vehicle.items()
        if key == "wheelbase_m" or value != plain[key]
    ]
    return "\n".join(lines) + "\n"


def write_camera(path: Path, camera: VideoCamera, comments: Sequence[str] = ()) -> None:
    """Write a camera file, whole or not at all; raises ConfigError."""
    if path.suffix != ".toml":
        raise ConfigError(f"{path}: a camera file ends in .toml")
    beside = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        beside.write_text(camera_text(camera, comments), encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        beside.unlink(missing_ok=True)


def _toml(value: Any) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, str):
        return f'"{value}"'
    if isinstance(value, tuple):
        return f"[{', '.join(map(_toml, value))}]"
    return repr(value)

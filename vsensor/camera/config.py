"""The camera's section of a scenario."""

from typing import Annotated, Literal

from msgspec import Meta

from vsensor.distortion import DistortionConfig
from vsensor.schema import Config

DEFAULT_HFOV_DEG = 52.0

Pixels = Annotated[int, Meta(ge=16, le=16384)]
FocalPx = Annotated[float, Meta(ge=1.0, le=1e6)]
CentrePx = Annotated[float, Meta(ge=-16384.0, le=32768.0)]
MountX = Annotated[float, Meta(ge=-5.0, le=15.0)]
MountY = Annotated[float, Meta(ge=-2.0, le=2.0)]
MountZ = Annotated[float, Meta(ge=0.2, le=5.0)]
Turn = Annotated[float, Meta(ge=-180.0, le=180.0)]
Pitch = Annotated[float, Meta(ge=-90.0, le=90.0)]


class CameraConfig(Config, frozen=True, kw_only=True):
    """A camera on the body; `model = "none"` bypasses it: points are taken as they are (P1 3.4).

    Defaults: 1280 x 800 at 52 degrees is a common class of forward lane cameras (fx = 1312 px, so a
    pixel is 76 mm wide at 100 m); 1.9 m ahead of the rear axle and 1.35 m up is behind the mirror of a
    mid-size car.

    Optics: either `hfov_deg`, the full horizontal angle from edge to edge (P1's alpha is half of it),
    with square pixels and the axis through the middle; or all of `fx_px`, `fy_px`, `cx_px`, `cy_px`, as
    a calibration gives them (pixel centres at integers). `hfov_deg` is of the pinhole: distortion
    changes what lies at the edge.

    Pose: `position_m` is x, y, z on the body, the angles are about its axes (pitch positive nose down).

    Sight: `min_range_m` and `max_range_m` are the least and greatest depth along the optical axis; paint
    is seen where it is at least `min_width_px` wide in the image, across the line's direction there.
    `min_contrast` is how much lighter than the road paint must look, relative to the road (0: no matter how
    little): light, rain, fog and wear say how far that is. The default is two deviations of the asphalt's
    own unevenness. `occlusion`: boxes = shadow test (a mesh counts as its box), embree = rays, auto =
    whichever is faster for the scene, none = nothing is hidden; `crest`: the road itself hides what lies
    behind.

    Back to the road: `inverse = "true_depth"` places a pixel by the depth of what is there (P1);
    "ground_plane" as one camera alone must, where its ray meets the flat road under a camera of the
    mount's pose, or of `assumed_height_m`, `assumed_pitch_deg`, `assumed_roll_deg`. The motion of the
    body, slopes and crests then become errors of range and of offset.
    """

    model: Literal["pinhole", "none"] = "pinhole"
    width_px: Pixels = 1280
    height_px: Pixels = 800
    hfov_deg: Annotated[float, Meta(gt=1.0, lt=175.0)] | None = None
    fx_px: FocalPx | None = None
    fy_px: FocalPx | None = None
    cx_px: CentrePx | None = None
    cy_px: CentrePx | None = None
    distortion: DistortionConfig = DistortionConfig()
    position_m: tuple[MountX, MountY, MountZ] = (1.9, 0.0, 1.35)
    roll_deg: Turn = 0.0
    pitch_deg: Pitch = 0.0
    yaw_deg: Turn = 0.0
    min_range_m: Annotated[float, Meta(ge=0.01, le=50.0)] = 0.5
    max_range_m: Annotated[float, Meta(ge=1.0, le=10_000.0)] | None = None
    min_width_px: Annotated[float, Meta(ge=0.0, le=1000.0)] = 0.0
    min_contrast: Annotated[float, Meta(ge=0.0, le=10.0)] = 0.1
    pixel_grid: bool = True
    occlusion: Literal["auto", "none", "boxes", "embree"] = "auto"
    crest: bool = True
    inverse: Literal["true_depth", "ground_plane"] = "true_depth"
    assumed_height_m: MountZ | None = None
    assumed_pitch_deg: Pitch | None = None
    assumed_roll_deg: Turn | None = None

    def __post_init__(self) -> None:
        """Refuse intrinsics given twice or in part (ValueError; from a file, a ConfigError)."""
        four = {"fx_px": self.fx_px, "fy_px": self.fy_px, "cx_px": self.cx_px, "cy_px": self.cy_px}
        given = [name for name, value in four.items() if value is not None]
        if given and self.hfov_deg is not None:
            raise ValueError(f"hfov_deg and {', '.join(given)} are both given: one or the other was expected")
        if given and len(given) < len(four):
            missing = [name for name in four if name not in given]
            raise ValueError(f"{', '.join(given)} without {', '.join(missing)}: all four were expected")

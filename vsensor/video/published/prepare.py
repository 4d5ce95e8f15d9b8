r"""Before the lines are looked for: no distortion, no bonnet (P2 2.5.2.1).

maps        (u, v) of the straight picture  ->  where it is in the bent one     P2 eq. 2.14, 2.15, appendix
StaticArea  pixels that never change, with the picture's lower edge below them
                 _ - - - _   <- second-order regression through their upper border
            ____/_________\____
"""

from collections.abc import Iterable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera
from vsensor.distortion import distort
from vsensor.image import import_opencv
from vsensor.types import Array, BoolArray
from vsensor.video.published.config import PublishedConfig
from vsensor.video.types import Picture

Grey = NDArray[np.uint8]
OUTSIDE_PX = -9.0
"""Where the lens shows nothing: outside of any picture, so it becomes black."""
LEAST_COLUMNS = 0.8
MOST_JAGGED = 0.05
"""Even asphalt changes as little as a bonnet (8 to 16 levels in a real drive of 9 s), but not where paint
passes: a bonnet stands under this share of the columns at least, and its border is no further from the
parabola (root mean square, of the height)."""


class Straightener:
    """Takes the distortion out of pictures of one camera; without one it hands them on as they are."""

    def __init__(self, camera: Camera) -> None:
        self._cv2 = import_opencv("lane offset from video")
        self._maps = None if camera.distortion is None else straight_maps(camera)

    def __call__(self, grey: Grey) -> Grey:
        """Return the picture as a lens without distortion would show it (bilinear, as interp2 does)."""
        if self._maps is None:
            return grey
        cv2: Any = self._cv2
        straight: Grey = cv2.remap(grey, *self._maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
        return straight


def straight_maps(camera: Camera) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Return u and v (H, W) in the recorded picture of every pixel of the straight one."""
    shape = camera.config.height_px, camera.config.width_px
    rows, columns = np.indices(shape, dtype=np.float64)
    assert camera.distortion is not None
    x = (columns.ravel() - camera.cx_px) / camera.fx_px
    y = (rows.ravel() - camera.cy_px) / camera.fy_px
    x_seen, y_seen = distort(camera.distortion, x, y)

    def pixels(seen: Array, focal_px: float, centre_px: float) -> NDArray[np.float32]:
        return np.nan_to_num(seen * focal_px + centre_px, nan=OUTSIDE_PX).reshape(shape).astype(np.float32)

    return pixels(x_seen, camera.fx_px, camera.cx_px), pixels(y_seen, camera.fy_px, camera.cy_px)


def static_area(
    config: PublishedConfig, straighten: Straightener, pictures: Iterable[Picture]
) -> BoolArray | None:
    """Return which pixels (H, W) are bonnet or dashboard; None where there is no such area.

    All pictures of the video are compared (P2 2.5.2.1.2); too few say nothing.
    """
    cv2: Any = import_opencv("lane offset from video")
    least: Grey | None = None
    most: Grey | None = None
    count = 0
    for picture in pictures:
        grey = straighten(picture.grey)
        least = grey.copy() if least is None else cv2.min(least, grey)
        most = grey.copy() if most is None else cv2.max(most, grey)
        count += 1
    if least is None or most is None or count < config.static_pictures:
        return None
    return under_parabola(most - least <= config.static_levels)


def under_parabola(static: BoolArray) -> BoolArray | None:
    """Return what lies under the parabola along the upper border of the static pixels at the lower edge.

    `static` (H, W). Every column has as its border the top of the static pixels that stand on the lower
    edge; gaps of a pixel or two in them are closed first. None where most columns have none.
    """
    cv2: Any = import_opencv("lane offset from video")
    height, width = static.shape
    closed = cv2.morphologyEx(static.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((5, 5), np.uint8))
    standing = np.cumprod(closed[::-1], axis=0).sum(axis=0)  # rows of static pixels above the lower edge
    columns = np.flatnonzero(standing >= 3)
    if len(columns) < max(3, LEAST_COLUMNS * width):
        return None
    scaled, tops = np.arange(width) / width - 0.5, height - standing[columns]
    border = np.polynomial.polynomial.polyval(
        scaled, np.polynomial.polynomial.polyfit(scaled[columns], tops, 2)
    )
    if np.std(tops - border[columns]) > MOST_JAGGED * height:
        return None
    area: BoolArray = np.arange(height)[:, None] >= border
    return area if area.any() and not area.all() else None

"""P2's method as published: every picture for itself, from grey levels to two lines on the road.

grey --straighten--> --no bonnet--> --lower half--> white zones --OR--> Hough --> median of 3 --> road
                                                    borders -----^       per side
"""

from collections.abc import Callable, Iterable

import numpy as np

from vsensor.camera import Camera
from vsensor.types import BoolArray, Boundary, LaneEstimate, Side
from vsensor.video.published.config import PublishedConfig
from vsensor.video.published.ground import boundary, straight_camera
from vsensor.video.published.hough import side_line
from vsensor.video.published.masks import borders, white_zones
from vsensor.video.published.prepare import Straightener, static_area
from vsensor.video.steps import Show, drawn_lines, show_nothing
from vsensor.video.types import Motion, Picture

SIDES = (Side.LEFT, Side.RIGHT)


class Published:
    """P2's method for one video; it has no memory from picture to picture, so its state is None."""

    def __init__(
        self,
        config: PublishedConfig,
        camera: Camera,
        pictures: Callable[[], Iterable[Picture]] = tuple,
        show: Show = show_nothing,
    ) -> None:
        """`pictures` opens the video from its beginning, to find what never changes in it.

        `show` is given the picture of every step.
        """
        self.config = config
        self._camera, self._straighten = straight_camera(camera), Straightener(camera)
        self._show = show
        self.static: BoolArray | None = None
        if config.static_levels:
            self.static = static_area(config, self._straighten, pictures())

    def begin(self) -> None:
        """Return the state before the first picture."""

    def look(self, state: None, picture: Picture, motion: Motion) -> tuple[None, LaneEstimate]:
        """Return the lines of one picture (see Method); `motion` is not used."""
        grey = self._straighten(picture.grey)
        self._show(picture, "1_straight", grey)
        if self.static is not None:
            grey = np.where(self.static, np.uint8(0), grey)
            self._show(picture, "2_no_bonnet", grey)
        first_row = round(self.config.sky_share * grey.shape[0])
        region = grey[first_row:]
        self._show(picture, "3_region", region)
        white, edges = white_zones(self.config, region), borders(self.config, region)
        self._show(picture, "4_white", white)
        self._show(picture, "5_borders", edges)
        lines = self._lines(white | edges, first_row)
        self._show(picture, "6_lines", lambda: drawn_lines(grey, self._camera, lines))
        return None, LaneEstimate(exposed_at_ns=picture.t_ns, image_index=picture.index, boundaries=lines)

    def _lines(self, mask: BoolArray, first_row: int) -> tuple[Boundary, ...]:
        found = []
        for side in SIDES:
            line = side_line(self.config, mask, first_row, side is Side.LEFT)
            if line is not None:
                found.append(boundary(self._camera, line, side, mask, first_row))
        return tuple(one for one in found if one is not None)

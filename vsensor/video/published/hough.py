r"""Lines through a mask by the Hough transform (P2 2.5.2.2.3), with the defaults of the toolbox that P2 used.

u cos(theta) + v sin(theta) = rho      theta: of the line's normal, from the u axis towards v

    left line  /   \  right line       left  20 < theta < 80
              /     \                  right -80 < theta < -20
"""

from dataclasses import dataclass

import numpy as np

from vsensor.types import Array, BoolArray, IntArray
from vsensor.video.published.config import PublishedConfig

ANGLE_STEP_DEG = 1.0
RHO_STEP_PX = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ImageLine:
    """A line in the picture, u cos(theta) + v sin(theta) = rho; `found` is how many it is the median of."""

    rho_px: float
    theta_rad: float
    found: int

    def u_at(self, v_px: Array) -> Array:
        """Return u (N,) where the line crosses rows v (N,)."""
        crossing: Array = (self.rho_px - v_px * np.sin(self.theta_rad)) / np.cos(self.theta_rad)
        return crossing


def side_line(config: PublishedConfig, mask: BoolArray, first_row: int, is_left: bool) -> ImageLine | None:
    """Return the median of the best lines of one side; None where there is none.

    `mask` (H, W) begins at row `first_row` of the picture, whose rows the line counts.
    """
    size = int((config.most_angle_deg - config.least_angle_deg) / ANGLE_STEP_DEG + 1e-9) + 1
    degrees = config.least_angle_deg + ANGLE_STEP_DEG * np.arange(size)
    theta = np.radians(degrees if is_left else -degrees)
    votes, rho_0 = accumulate(mask, first_row, theta)
    found = peaks(votes, config.lines, max(config.least_votes, config.peak_share * int(votes.max(initial=0))))
    if not found:
        return None
    rho, angle = np.array(found).T
    return ImageLine(
        rho_px=float(np.median(rho)) * RHO_STEP_PX + rho_0,
        theta_rad=float(np.median(theta[angle])),
        found=len(found),
    )


def accumulate(mask: BoolArray, first_row: int, theta: Array) -> tuple[IntArray, float]:
    """Return the votes (R, T) of the mask's pixels for rho and theta, and the rho of row 0."""
    v, u = np.nonzero(mask)
    far = np.ceil(np.hypot(mask.shape[1] - 1, first_row + mask.shape[0] - 1) / RHO_STEP_PX)
    rhos = 2 * int(far) + 1
    rho = np.outer(np.cos(theta), u) + np.outer(np.sin(theta), v + first_row)
    cell = np.rint(rho / RHO_STEP_PX + far).astype(np.int64) + rhos * np.arange(len(theta))[:, None]
    votes = np.bincount(cell.ravel(), minlength=rhos * len(theta)).reshape(len(theta), rhos)
    return votes.T, -far * RHO_STEP_PX


def peaks(votes: IntArray, count: int, least: float) -> list[tuple[int, int]]:
    """Return the places of up to `count` peaks (R, T) of at least `least` votes, the highest first.

    Around each the next odd number of cells from a fiftieth of either size is emptied.
    """
    left, found = votes.copy(), list[tuple[int, int]]()
    half = [int(np.ceil(size / 50.0)) // 2 for size in votes.shape]
    while len(found) < count and left.size:
        rho, angle = (int(place) for place in np.unravel_index(int(left.argmax()), left.shape))
        if left[rho, angle] < least:
            break
        found.append((rho, angle))
        left[max(0, rho - half[0]) : rho + half[0] + 1, max(0, angle - half[1]) : angle + half[1] + 1] = 0
    return found

"""The two masks of P2 2.5.2.2.2: what is white, and where something begins or ends."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from vsensor.image import import_opencv
from vsensor.types import BoolArray
from vsensor.video.published.config import PublishedConfig

Grey = NDArray[np.uint8]
BORDER_FILTER = np.array([[-1.0, -1.0, 0.0, 1.0, 1.0]])
"""P2 eq. 2.19."""


def white_zones(config: PublishedConfig, grey: Grey) -> BoolArray:
    """Return the pixels (H, W) that are lighter than the road beside them, by t1 to t2 levels."""
    lighter = grey.astype(np.int16) - row_median(grey, odd(config.median_share * grey.shape[1]))
    white = (lighter > config.white_above) & (lighter < config.white_below)
    return cleaned(white, config.least_patch_px)


def odd(pixels: float) -> int:
    """Return the next odd number of pixels, 3 at least."""
    return max(3, 2 * round((pixels - 1.0) / 2.0) + 1)


def row_median(grey: Grey, size: int) -> Grey:
    """Return the median (H, W) over `size` (odd) pixels of the same row, mirrored at the ends.

    As one long row: SciPy's filter of one dimension is faster than that of an image by a factor of ten.
    """
    from scipy.ndimage import median_filter

    half = min(size // 2, grey.shape[1] - 1)
    long = np.pad(grey, ((0, 0), (half, half)), mode="reflect")
    medians: Grey = median_filter(long.ravel(), size=2 * half + 1).reshape(long.shape)
    return medians[:, half : half + grey.shape[1]]


def cleaned(mask: BoolArray, least_px: int) -> BoolArray:
    """Return the mask with holes of a pixel closed, and without patches of fewer than `least_px` pixels."""
    cv2: Any = import_opencv("lane offset from video")
    closed = cv2.morphologyEx(mask.astype(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
    _, patches, figures, _ = cv2.connectedComponentsWithStats(closed, connectivity=8)
    kept = figures[:, cv2.CC_STAT_AREA] >= least_px
    kept[0] = False  # what is in no patch
    result: BoolArray = kept[patches]
    return result


def borders(config: PublishedConfig, grey: Grey) -> BoolArray:
    """Return the pixels (H, W) of edges to either side (P2 eq. 2.18-2.23, with the errata's OR)."""
    right, left = responses(grey)
    return binary(config, right) | binary(config, left)


def responses(grey: Grey) -> tuple[Grey, Grey]:
    """Return I_R and I_L (P2 eq. 2.20, 2.21), cut off at 0 and 255 as a filter of bytes does."""
    cv2: Any = import_opencv("lane offset from video")
    right: Grey = cv2.filter2D(grey, cv2.CV_8U, BORDER_FILTER, borderType=cv2.BORDER_REPLICATE)
    left: Grey = cv2.filter2D(grey, cv2.CV_8U, BORDER_FILTER[:, ::-1].copy(), borderType=cv2.BORDER_REPLICATE)
    return right, left


def binary(config: PublishedConfig, response: Grey) -> BoolArray:
    """Return g(I_X): each half of the picture above its own optimal threshold (P2 eq. 2.22, 2.23)."""
    middle = response.shape[1] // 2
    halves = response[:, :middle], response[:, middle:]
    return np.hstack([half > max(optimal_threshold(half), config.least_edge) for half in halves])


def optimal_threshold(values: Grey) -> float:
    """Return the level in the middle between the mean of what is below it and of what is above.

    Found by iteration, as the function that P2 cites does it: to begin with, the corners are the background.
    """
    counts = np.bincount(values.ravel(), minlength=256).astype(np.float64)
    sums = counts * np.arange(256)
    corners = values[:: max(1, values.shape[0] - 1), :: max(1, values.shape[1] - 1)]
    background = float(corners.mean())
    rest = values.size - corners.size
    threshold = background if not rest else (background + (sums.sum() - corners.sum()) / rest) / 2.0
    for _ in range(256):
        upto = int(threshold) + 1
        below, above = counts[:upto].sum(), counts[upto:].sum()
        if not below or not above:
            return threshold
        found = (sums[:upto].sum() / below + sums[upto:].sum() / above) / 2.0
        if int(found) == int(threshold):
            return float(found)
        threshold = float(found)
    return threshold

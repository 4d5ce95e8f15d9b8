"""P2's method as published, step by step.

Where the paper is wrong it follows the errata, where it is silent a number in PublishedConfig.

| module      | step                                           | P2                                    |
|-------------|------------------------------------------------|---------------------------------------|
| prepare.py  | undistortion by backward mapping               | 2.5.2.1.1, eq. 2.11-2.15, appendix    |
| prepare.py  | static pixels, second-order regression         | 2.5.2.1.2                             |
| method.py   | region of interest, the lower 50 %             | 2.5.2.2.1, fig. 2.14                  |
| masks.py    | white zones: median, difference, t1 < d < t2   | 2.5.2.2.2                             |
| masks.py    | borders: filters, optimal thresholds per half  | 2.5.2.2.2, eq. 2.18-2.23              |
| hough.py    | lines of 20 to 80 degrees, median of the best 3 | 2.5.2.2.3                            |
| ground.py   | two points to the road, line at the front axle | 2.5.1.3, 2.5.2.2.4, eq. 2.16-2.17     |
| ../lov.py   | thresholds, gaps, ends                         | 2.5.3, 2.4.2, eq. 2.24-2.26           |

Where P2 is silent, and what stands here instead:

- *Significant change* of a pixel over the video: more than `static_levels` between its least and greatest
  level. Only what stands on the lower edge is wrapped and removed: the sky goes with the region anyway, and
  an even patch of road is no bonnet.
- Size of the *large horizontal median filter*, t1 and t2, the *morphological operations*: an eighth of the
  width (twice the width of near paint), 20 and 200 levels, a closing of 3 x 3 and no patches below 20 pixels.
- How the masks for white zones and for borders become the one that the Hough transform is given: OR, since
  each is to find what the other does not (a road without paint has borders alone).
- Resolution, peaks and their neighbourhood in the Hough transform: the defaults of the toolbox that P2 used,
  1 degree, 1 pixel, half of the highest peak, a fiftieth of either size. A line needs 40 pixels, which is
  that toolbox's shortest segment.
- The *median of the lines* is that of their rho and theta, each for itself.
- A black picture: an optimal threshold always finds two classes, noise too. Below `least_edge` levels it
  finds none.
- Confidence: P2 has none (its 4.1 asks for one). Here it is the number of lines found, 1 to 3.
"""

from vsensor.video.published.config import PublishedConfig
from vsensor.video.published.method import Published

__all__ = ["Published", "PublishedConfig"]

"""Make vsensor/scenarios/default_error.npz: a plausible lane camera, stated in six numbers.

The lateral error of a reported line is what errors of its offset, heading and curvature make of it:

    std(x, v)^2 = offset^2 + growth(v)^2 [ (heading x)^2 + (curvature x^2 / 2)^2 ]
    growth(v)   = 0.6 + 0.4 v / 33.3 m/s

because at speed the body moves more within one exposure and the line is followed with some lag.
With the numbers below 95 % of the errors are within 3 cm at 5 m, 5 cm at 20 m and 0.3 m at 80 m at
motorway speed (120 km/h). They are an assumption in the order of magnitude of published lane
cameras, not a measurement of one: tune your own from recorded drives. Errors of this model are
normal, so its quantiles are the normal distribution's.
"""

import argparse
from pathlib import Path
from statistics import NormalDist

import numpy as np

from vsensor.error_model import DEFAULT_FILE, ErrorLibrary, library_of, normal_model, save_library

OFFSET_M = 0.015
HEADING_RAD = 0.95e-3
CURVATURE_PER_M = 4.4e-5
CORRELATION_TIME_S = 0.8  # a few tens of images: what a lane tracker's own filter leaves
CORRELATION_LENGTH_M = 50.0  # a cubic fit keeps the law within 3 % (an exponential 20 m: 0.71 to 1.1)
LEVELS = (0.5, 0.8, 0.9, 0.95, 0.97, 0.99)
SOURCE = "assumed: offset 15 mm, heading 0.95 mrad, curvature 4.4e-5 1/m, normal; no recorded drive"


def default_library() -> ErrorLibrary:
    range_m = np.arange(0.0, 151.0, 5.0)
    speed_mps = np.arange(0.0, 71.0, 10.0)
    x, v = np.meshgrid(range_m, speed_mps, indexing="ij")
    growth = 0.6 + 0.4 * v / 33.3
    std_m = np.sqrt(OFFSET_M**2 + growth**2 * ((HEADING_RAD * x) ** 2 + (CURVATURE_PER_M * x**2 / 2) ** 2))
    factors = np.array([NormalDist().inv_cdf((1.0 + level) / 2.0) for level in LEVELS])
    model = normal_model(
        range_m=range_m,
        speed_mps=speed_mps,
        levels=np.array(LEVELS),
        absolute_m=np.round(factors[:, None, None] * std_m, 6),  # micrometres: equal on every machine
        std_m=np.round(std_m, 6),
        correlation_time_s=CORRELATION_TIME_S,
        correlation_length_m=CORRELATION_LENGTH_M,
    )
    return library_of(model, SOURCE)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=DEFAULT_FILE, help="file to write")
    save_library(default_library(), parser.parse_args().out)


if __name__ == "__main__":
    main()

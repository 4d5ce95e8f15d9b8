"""A small drive for tests of the examiner: known errors, and one image that is far off."""

import numpy as np

from tests.field.made_logs import Drive as Made
from vsensor.apps.examine.drive import load_drive
from vsensor.field.scan import ScanOptions
from vsensor.types import Side

ROUNDING_M = 0.01
"""What the native bus adds at most at 80 m."""
BEND_PER_M = 1e-4
HIT_S, HIT_M = 4.0, 0.5
UNBIASED = 'schema = "vsensor.scan/1"\nyaw_rate_offset_degps = 0.0\n'


def bent(side, t_s, x_m):
    """Report the left line bent, and in one image far more so."""
    if side is Side.RIGHT:
        return np.zeros_like(x_m)
    return (BEND_PER_M + (HIT_M / 50**2 if abs(t_s - HIT_S) < 0.01 else 0.0)) * x_m**2


def loaded(folder, made, **options):
    """Return a made drive as the examiner has it."""
    (folder / "limits.toml").write_text(UNBIASED)
    log = made.write(folder / "drive.blf")
    return load_drive(log, ScanOptions(limits=str(folder / "limits.toml"), **options))


def bent_drive(folder):
    """Return a straight of 10 s at 20 m/s, the left line reported bent."""
    return loaded(folder, Made(seconds=10, error=bent))

"""Vibration as coloured noise: a resonance driven by white noise, some of it broad, rough in stretches.

    white --> resonance at vibration_hz -+
    white --> low pass, 3 Hz ------------+--> times roughness --> pitch      (likewise roll, heave)
    white --> low pass, 5 s --> exp --------------^ (one for all three)

The rate of a damped oscillator is used, not its position: its spectrum peaks at the natural frequency
and has nothing at 0 Hz, since a lean that lasts is mounting, not vibration. All are linear processes,
discretised exactly, so the law is the same from the first tick on and for every tick length.
"""

from cmath import atan
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import cos, exp, pi, sin, sqrt

from vsensor.motion.config import MotionConfig

PRESETS_MRAD = {"none": 0.0, "smooth": 0.35, "normal": 1.0, "rough": 2.8}
"""Standard deviation of pitch above 0.3 Hz; real windscreen cameras show 0.3 to 3, 99 % within 1 to 12."""

HEAVE_M_PER_RAD = 4.0  # 4 mm for 1 mrad: what waves of two wheelbases give
COUNTED_ABOVE_HZ = 0.3  # what is slower is not told from the road's own slope when one measures
BROADBAND_HZ = 3.0
ROUGHNESS_S = 5.0  # correlation time: 100 to 150 m of road
AXES = 3
NORMALS = 3 * AXES + 1
"""Random numbers per tick: for each axis position, rate, broad band; the roughness."""

Step = tuple[float, float, float, float, float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Vibration:
    """Noise of one shape: standard deviations of pitch, roll (rad), heave (m) of both parts together."""

    std: tuple[float, float, float]
    peak_hz: float
    damping: float
    broadband: float
    spread: float

    @classmethod
    def of(cls, config: MotionConfig) -> "Vibration | None":
        """Compile the preset or the numbers; None where nothing shakes."""
        chosen = config.vibration
        pitch = (PRESETS_MRAD[chosen] if isinstance(chosen, str) else chosen) / 1e3
        roll = pitch if config.vibration_roll_mrad is None else config.vibration_roll_mrad / 1e3
        heave = HEAVE_M_PER_RAD * pitch
        if config.vibration_heave_mm is not None:
            heave = config.vibration_heave_mm / 1e3
        if chosen == "none" or not (pitch or roll or heave):
            return None
        share = _counted_share(config.vibration_hz, config.vibration_damping, config.vibration_broadband)
        scale = 1.0 / sqrt(share)
        return cls(
            std=(scale * pitch, scale * roll, scale * heave),
            peak_hz=config.vibration_hz,
            damping=config.vibration_damping,
            broadband=config.vibration_broadband,
            spread=config.vibration_spread,
        )

    def start(self, normals: Sequence[float]) -> tuple[float, ...]:
        """Return a state (NORMALS,) of the stationary law: every element is standard normal."""
        return tuple(normals)

    def advance(self, state: Sequence[float], period_ns: int, normals: Sequence[float]) -> tuple[float, ...]:
        """Return the state one tick later, exactly of the law; `normals` (NORMALS,) are fresh draws."""
        aa, ab, ba, bb, k0, k1, k2, broad, broad_kick, rough, rough_kick = _step(self, period_ns)
        after: list[float] = []
        for i in (0, 3, 6):
            a, b, w = state[i : i + 3]
            n0, n1, n2 = normals[i : i + 3]
            after += (
                aa * a + ab * b + k0 * n0,
                ba * a + bb * b + k1 * n0 + k2 * n1,
                broad * w + broad_kick * n2,
            )
        after.append(rough * state[9] + rough_kick * normals[9])
        return tuple(after)

    def motion(self, state: Sequence[float]) -> tuple[float, float, float]:
        """Return pitch, roll (rad) and heave (m) of a state."""
        roughness = exp(self.spread * (state[9] - self.spread))  # its mean square is 1
        peak, broad = roughness * sqrt(1.0 - self.broadband), roughness * sqrt(self.broadband)
        pitch, roll, heave = self.std
        return (
            pitch * (peak * state[1] + broad * state[2]),
            roll * (peak * state[4] + broad * state[5]),
            heave * (peak * state[7] + broad * state[8]),
        )


def _counted_share(peak_hz: float, damping: float, broadband: float) -> float:
    """Return the share of the variance above COUNTED_ABOVE_HZ.

    A process with autocorrelation Re(C exp(-m t)) has (2 / pi) Re(C atan(m / w)) of it above w.
    """
    w = 2.0 * pi * COUNTED_ABOVE_HZ
    root = sqrt(1.0 - damping**2)
    m = 2.0 * pi * peak_hz * complex(damping, root)  # conjugated: the real part is the same
    of_peak = (complex(1.0, -damping / root) * atan(m / w)).real
    of_broad = atan(BROADBAND_HZ / COUNTED_ABOVE_HZ).real
    return 2.0 / pi * ((1.0 - broadband) * of_peak + broadband * of_broad)


@lru_cache(maxsize=16)
def _step(vibration: Vibration, period_ns: int) -> Step:
    """Return transition and noise factor of a tick.

    With a = w times the position, b = the rate, both of unit variance and uncorrelated in the
    stationary state, the transition is M and the noise's covariance 1 - M M^T.
    """
    t = period_ns / 1e9
    w, d = 2.0 * pi * vibration.peak_hz, vibration.damping
    root = sqrt(1.0 - d * d)
    decay, c, s = exp(-d * w * t), cos(root * w * t), sin(root * w * t) / root
    aa, ab, ba, bb = decay * (c + d * s), decay * s, -decay * s, decay * (c - d * s)
    k0 = sqrt(max(1.0 - aa * aa - ab * ab, 0.0))
    k1 = -(aa * ba + ab * bb) / k0 if k0 else 0.0
    k2 = sqrt(max(1.0 - ba * ba - bb * bb - k1 * k1, 0.0))
    broad, rough = exp(-2.0 * pi * BROADBAND_HZ * t), exp(-t / ROUGHNESS_S)
    return aa, ab, ba, bb, k0, k1, k2, broad, sqrt(1.0 - broad**2), rough, sqrt(1.0 - rough**2)

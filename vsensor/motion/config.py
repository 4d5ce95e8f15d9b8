"""`[motion]` and `[[motion.bumps]]` of a scenario."""

from typing import Annotated, Literal

from msgspec import Meta

from vsensor.schema import Config

Gain = Annotated[float, Meta(ge=0.0, le=2.0)]
Lean = Gain | Literal["dynamics"]
BodyHz = Annotated[float, Meta(ge=0.3, le=10.0)]
Damping = Annotated[float, Meta(ge=0.02, le=0.95)]


class BumpConfig(Config, frozen=True, kw_only=True):
    """`[[motion.bumps]]`: a bump across the road, (1 - cos) shaped; a negative height is a hole.

    It begins `at_m` of driven way ahead of where the rear axle was at the start.
    """

    at_m: Annotated[float, Meta(ge=0.0, le=1e7)]
    length_m: Annotated[float, Meta(ge=0.05, le=100.0)] = 0.5
    height_m: Annotated[float, Meta(ge=-0.3, le=0.3)] = 0.03


class MotionConfig(Config, frozen=True, kw_only=True):
    """`[motion]`: what moves the camera beside the road itself; nothing unless it is switched on.

    `body`: pitch, roll and heave on the springs. The gains are what the body leans per m/s^2 once it
    has settled. For a mid-size car (mass 1600 kg, centre of gravity 0.55 m up, pitch inertia 2600
    kg m^2) m h / (I (2 pi 1.4 Hz)^2) = 0.25 deg per m/s^2 without anti-dive geometry, which takes off
    30 to 50 %: 0.15. Roll 0.4 deg per m/s^2 is 3.9 deg at 1 g, in the middle between sports cars
    (2 to 3) and soft vans (6 to 7). "dynamics": what masses and springs of `[dynamics]` give. 1.3 to
    1.6 Hz and a damping ratio of 0.3 to 0.4 are usual for ride.

    `vibration`: a preset, or the standard deviation of pitch in mrad above 0.3 Hz; roll has the same
    one and heave 4 mm per mrad, if not given. `vibration_hz` is the peak of the spectrum,
    `vibration_damping` its width, `vibration_broadband` the share of the variance that reaches up to
    some Hz, `vibration_spread` by how much the roughness changes along the way (standard deviation of
    the logarithm): 0 is Gaussian, 0.6 has 99 % within 3.5 standard deviations.
    `vibration_file` is a measured series instead, CSV or npz.
    """

    body: bool = False
    pitch_deg_per_mps2: Lean = 0.15
    roll_deg_per_mps2: Lean = 0.4
    pitch_hz: BodyHz = 1.4
    roll_hz: BodyHz = 1.6
    heave_hz: BodyHz = 1.3
    damping: Damping = 0.35
    bumps: tuple[BumpConfig, ...] = ()
    vibration: Literal["none", "smooth", "normal", "rough"] | Annotated[float, Meta(ge=0.0, le=20.0)] = "none"
    vibration_roll_mrad: Annotated[float, Meta(ge=0.0, le=20.0)] | None = None
    vibration_heave_mm: Annotated[float, Meta(ge=0.0, le=200.0)] | None = None
    vibration_hz: Annotated[float, Meta(ge=0.05, le=20.0)] = 0.5
    vibration_damping: Damping = 0.35
    vibration_broadband: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.1
    vibration_spread: Annotated[float, Meta(ge=0.0, le=1.0)] = 0.6
    vibration_file: str | None = None

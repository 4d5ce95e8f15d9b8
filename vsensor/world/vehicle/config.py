"""`[dynamics]` of a scenario."""

from typing import Annotated

import msgspec

from vsensor.schema import Config

_Stiffness = Annotated[float, msgspec.Meta(ge=1e3, le=2e6)]


class DynamicsConfig(Config, frozen=True, kw_only=True):
    """`[dynamics]`: what moves a steered vehicle; stiffnesses are those of a whole axle.

    `steering_ratio` is the angle of the steering wheel per angle of the front wheels.
    """

    mass_kg: Annotated[float, msgspec.Meta(ge=100, le=60_000)] = 1600.0
    yaw_inertia_kgm2: Annotated[float, msgspec.Meta(ge=50, le=1e6)] = 2600.0
    cg_to_front_axle_m: Annotated[float, msgspec.Meta(gt=0, le=15)] = 1.25
    front_stiffness_npr: _Stiffness = 120_000.0
    rear_stiffness_npr: _Stiffness = 150_000.0
    steering_ratio: Annotated[float, msgspec.Meta(ge=1, le=50)] = 15.0

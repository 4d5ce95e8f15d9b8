"""`[dynamics]` of a scenario."""

from typing import Annotated, Literal

import msgspec

from vsensor.schema import Config

_Stiffness = Annotated[float, msgspec.Meta(ge=1e3, le=2e6)]
_Lag = Annotated[float, msgspec.Meta(ge=0, le=2)]


class DynamicsConfig(Config, frozen=True, kw_only=True):
    """`[dynamics]`: what moves a steered vehicle; stiffnesses and springs are those of a whole axle.

    `steering_ratio` is the angle of the steering wheel per angle of the front wheels.

    `tyres = "nonlinear"`: side forces end at `friction` times the load (1.0 dry, 0.6 wet, 0.2 snow), with
    `tyre_shape` and `tyre_curvature` of the magic formula; braking and driving take their part of the grip
    and move load between the axles, by `cg_height_m`.

    `steering_lag_s`, `drive_lag_s`, `brake_lag_s`: time constants from what is asked for to what is there;
    `steering_rate_degps` is the fastest the front wheels turn. Those of drive and brakes count where a driver
    drives.

    Springs, `anti_dive` (the part of the pitch that the suspension's geometry takes off) and
    `roll_stiffness_nmprad` give the body's lean where `[motion]` asks for it.
    """

    mass_kg: Annotated[float, msgspec.Meta(ge=100, le=60_000)] = 1600.0
    yaw_inertia_kgm2: Annotated[float, msgspec.Meta(ge=50, le=1e6)] = 2600.0
    cg_to_front_axle_m: Annotated[float, msgspec.Meta(gt=0, le=15)] = 1.25
    cg_height_m: Annotated[float, msgspec.Meta(ge=0, le=4)] = 0.55
    front_stiffness_npr: _Stiffness = 120_000.0
    rear_stiffness_npr: _Stiffness = 150_000.0
    steering_ratio: Annotated[float, msgspec.Meta(ge=1, le=50)] = 15.0
    tyres: Literal["linear", "nonlinear"] = "linear"
    friction: Annotated[float, msgspec.Meta(ge=0.05, le=2)] = 1.0
    tyre_shape: Annotated[float, msgspec.Meta(ge=1.05, le=1.9)] = 1.3
    tyre_curvature: Annotated[float, msgspec.Meta(ge=-10, le=0.9)] = -1.0
    steering_lag_s: _Lag = 0.0
    steering_rate_degps: Annotated[float, msgspec.Meta(ge=1, le=1000)] | None = None
    drive_lag_s: _Lag = 0.3
    brake_lag_s: _Lag = 0.15
    front_spring_npm: Annotated[float, msgspec.Meta(ge=1e3, le=5e6)] = 50_000.0
    rear_spring_npm: Annotated[float, msgspec.Meta(ge=1e3, le=5e6)] = 50_000.0
    anti_dive: Annotated[float, msgspec.Meta(ge=0, le=1)] = 0.4
    roll_stiffness_nmprad: Annotated[float, msgspec.Meta(ge=1e3, le=1e8)] = 120_000.0
    roll_centre_height_m: Annotated[float, msgspec.Meta(ge=0, le=3)] = 0.05

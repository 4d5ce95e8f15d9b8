"""A vehicle that is driven: the single-track model about the rear axle's path, its actuators, a driver.

       <------ wheelbase L ------>
       <-- lr --><----- lf ------>
    rear axle   centre of        front axle
       o---------gravity----------/  front wheels turned by delta, left positive
       x, y, yaw                     slip at each axle: side force by the tyres' law

    config --> single_track, tyres, actuators --step--> trip: vehicle under way, with the step's error
                                                ^------ driver: looks ahead, asks for wheels and pedals

Below KINEMATIC_MPS the tyres roll without slip, so the model does not divide by a speed near 0. The road's
slope costs no speed: a driver's pedals make up for it, as for the drag.
"""

from vsensor.world.vehicle.config import DynamicsConfig
from vsensor.world.vehicle.driver import LARGEST_STEERING_RAD, PERIOD_NS, Driver, DriverConfig, Order, Seen
from vsensor.world.vehicle.lean import lean_degpmps2
from vsensor.world.vehicle.single_track import SingleTrack
from vsensor.world.vehicle.step import KINEMATIC_MPS, LEVEL, Tilt, VehicleState, driven, moved
from vsensor.world.vehicle.trip import Trip, cornering, grip_used, placed, pulled, steered
from vsensor.world.vehicle.tyres import GRAVITY_MPS2

__all__ = [
    "GRAVITY_MPS2",
    "KINEMATIC_MPS",
    "LARGEST_STEERING_RAD",
    "LEVEL",
    "PERIOD_NS",
    "Driver",
    "DriverConfig",
    "DynamicsConfig",
    "Order",
    "Seen",
    "SingleTrack",
    "Tilt",
    "Trip",
    "VehicleState",
    "cornering",
    "driven",
    "grip_used",
    "lean_degpmps2",
    "moved",
    "placed",
    "pulled",
    "steered",
]

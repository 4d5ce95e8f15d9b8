"""A vehicle that is steered: the linear single-track model, about the rear axle's path.

       <------ wheelbase L ------>
       <-- lr --><----- lf ------>
    rear axle   centre of        front axle
       o---------gravity----------/  front wheels turned by delta, left positive
       x, y, yaw                     slip at each axle: side force = stiffness * slip angle

Below KINEMATIC_MPS the tyres roll without slip, so the model does not divide by a speed near 0.
"""

from vsensor.world.vehicle.config import DynamicsConfig
from vsensor.world.vehicle.single_track import SingleTrack
from vsensor.world.vehicle.step import KINEMATIC_MPS, VehicleState, driven, moved

__all__ = ["KINEMATIC_MPS", "DynamicsConfig", "SingleTrack", "VehicleState", "driven", "moved"]

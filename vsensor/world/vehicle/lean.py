"""What the body leans by under acceleration, from its masses and springs: the gains that `[motion]` takes.

pitch: m h a (1 - anti_dive) = (k_front lf^2 + k_rear lr^2) pitch
roll:  m h' a = (k_roll - m g h') roll, h' the height above the roll axis; the weight leans over, too
"""

from math import degrees

from vsensor.errors import ConfigError
from vsensor.world.vehicle.config import DynamicsConfig
from vsensor.world.vehicle.tyres import GRAVITY_MPS2


def lean_degpmps2(config: DynamicsConfig, wheelbase_m: float) -> tuple[float, float]:
    """Return pitch and roll once settled, deg per m/s^2; raises ConfigError for a car that falls over."""
    front_m = config.cg_to_front_axle_m
    rear_m = wheelbase_m - front_m
    pitch_stiffness = config.front_spring_npm * front_m**2 + config.rear_spring_npm * rear_m**2
    pitch = config.mass_kg * config.cg_height_m * (1.0 - config.anti_dive) / pitch_stiffness
    lever_m = max(config.cg_height_m - config.roll_centre_height_m, 0.0)
    roll_stiffness = config.roll_stiffness_nmprad - config.mass_kg * GRAVITY_MPS2 * lever_m
    if roll_stiffness <= 0.0:
        raise ConfigError(
            f"dynamics.roll_stiffness_nmprad = {config.roll_stiffness_nmprad:g}: more than its own weight's "
            f"{config.mass_kg * GRAVITY_MPS2 * lever_m:.0f} was expected, else it falls over"
        )
    return degrees(pitch), degrees(config.mass_kg * lever_m / roll_stiffness)

"""The linear single-track model, compiled: steady cornering, understeer, how it answers at a speed."""

from dataclasses import dataclass
from math import sqrt

from vsensor.errors import ConfigError
from vsensor.world.vehicle.config import DynamicsConfig

SLOWEST_CRITICAL_MPS = 100.0


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTrack:
    """A vehicle ready to drive: mass kg, yaw inertia kg m^2, distances m, axle stiffnesses N/rad."""

    mass: float
    inertia: float
    front_m: float
    rear_m: float
    front_stiffness: float
    rear_stiffness: float

    @classmethod
    def of(cls, config: DynamicsConfig, wheelbase_m: float) -> "SingleTrack":
        """Compile; raises ConfigError for a centre of gravity off the wheelbase and for one that spins."""
        if config.cg_to_front_axle_m >= wheelbase_m:
            raise ConfigError(
                f"dynamics.cg_to_front_axle_m = {config.cg_to_front_axle_m:g}: less than the wheelbase of "
                f"{wheelbase_m:g} m was expected"
            )
        vehicle = cls(
            mass=config.mass_kg,
            inertia=config.yaw_inertia_kgm2,
            front_m=config.cg_to_front_axle_m,
            rear_m=wheelbase_m - config.cg_to_front_axle_m,
            front_stiffness=config.front_stiffness_npr,
            rear_stiffness=config.rear_stiffness_npr,
        )
        gradient = vehicle.understeer_gradient
        if gradient < 0.0 and sqrt(-wheelbase_m / gradient) < SLOWEST_CRITICAL_MPS:
            raise ConfigError(
                f"dynamics: oversteers, it spins from {sqrt(-wheelbase_m / gradient):.0f} m/s on; more "
                "rear_stiffness_npr or a smaller cg_to_front_axle_m was expected"
            )
        return vehicle

    @property
    def wheelbase_m(self) -> float:
        """Distance of the axles."""
        return self.front_m + self.rear_m

    @property
    def understeer_gradient(self) -> float:
        """Steering angle that is needed per lateral acceleration beside the geometric one, rad per m/s^2."""
        load = self.rear_m / self.front_stiffness - self.front_m / self.rear_stiffness
        return self.mass / self.wheelbase_m * load

    def steady_yaw_rate(self, speed_mps: float, steering_rad: float) -> float:
        """Return the yaw rate of steady cornering: v delta / (L + K v^2), rad/s."""
        return speed_mps * steering_rad / (self.wheelbase_m + self.understeer_gradient * speed_mps**2)

    def matrix(self, speed_mps: float) -> tuple[float, float, float, float]:
        """Return a11, a12, a21, a22 of d/dt (lateral speed, yaw rate) at a forward speed, linear tyres."""
        front, rear = self.front_stiffness, self.rear_stiffness
        moment = self.rear_m * rear - self.front_m * front
        damping = self.front_m**2 * front + self.rear_m**2 * rear
        return (
            -(front + rear) / (self.mass * speed_mps),
            moment / (self.mass * speed_mps) - speed_mps,
            moment / (self.inertia * speed_mps),
            -damping / (self.inertia * speed_mps),
        )

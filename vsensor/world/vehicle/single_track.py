"""The single-track model, compiled: axles, tyres, actuators; steady cornering, understeer, grip."""

from dataclasses import dataclass
from math import atan2, cos, inf, radians, sqrt

from vsensor.errors import ConfigError
from vsensor.world.vehicle.actuators import AT_ONCE, Actuators
from vsensor.world.vehicle.config import DynamicsConfig
from vsensor.world.vehicle.tyres import GRAVITY_MPS2, Tyres

SLOWEST_CRITICAL_MPS = 100.0

Inputs = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class SingleTrack:
    """A vehicle ready to drive: mass kg, yaw inertia kg m^2, distances m, axle stiffnesses N/rad.

    Forces follow `front` and `rear` where `is_linear` is False, else the stiffnesses alone.
    """

    mass: float
    inertia: float
    front_m: float
    rear_m: float
    front_stiffness: float
    rear_stiffness: float
    height_m: float
    friction: float
    front: Tyres
    rear: Tyres
    is_linear: bool = True
    actuators: Actuators = AT_ONCE

    @classmethod
    def of(cls, config: DynamicsConfig, wheelbase_m: float) -> "SingleTrack":
        """Compile; raises ConfigError for a centre of gravity off the wheelbase and for one that spins."""
        if config.cg_to_front_axle_m >= wheelbase_m:
            raise ConfigError(
                f"dynamics.cg_to_front_axle_m = {config.cg_to_front_axle_m:g}: less than the wheelbase of "
                f"{wheelbase_m:g} m was expected"
            )
        rear_m = wheelbase_m - config.cg_to_front_axle_m
        weight = config.mass_kg * GRAVITY_MPS2 / wheelbase_m
        law = config.friction, config.tyre_shape, config.tyre_curvature
        vehicle = cls(
            mass=config.mass_kg,
            inertia=config.yaw_inertia_kgm2,
            front_m=config.cg_to_front_axle_m,
            rear_m=rear_m,
            front_stiffness=config.front_stiffness_npr,
            rear_stiffness=config.rear_stiffness_npr,
            height_m=config.cg_height_m,
            friction=config.friction,
            front=Tyres.of(config.front_stiffness_npr, weight * rear_m, *law),
            rear=Tyres.of(config.rear_stiffness_npr, weight * config.cg_to_front_axle_m, *law),
            is_linear=config.tyres == "linear",
            actuators=_actuators(config),
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
        """Steering angle that is needed per lateral acceleration beside the geometric one, rad per m/s^2.

        With nonlinear tyres it is that of gentle bends.
        """
        load = self.rear_m / self.front_stiffness - self.front_m / self.rear_stiffness
        return self.mass / self.wheelbase_m * load

    def steady_yaw_rate(self, speed_mps: float, steering_rad: float) -> float:
        """Return the yaw rate of steady cornering, linear tyres: v delta / (L + K v^2), rad/s."""
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

    def grips(self, acceleration_mps2: float) -> tuple[float, float, float, float]:
        """Return B and D of the front axle, then of the rear one, at an acceleration ahead.

        It moves load by m a h / L, and its force is shared between the axles as their loads are.
        """
        moved = self.mass * acceleration_mps2 * self.height_m / self.wheelbase_m
        along = acceleration_mps2 / (self.friction * GRAVITY_MPS2)
        return (
            *self.front.grip(self.front.load - moved, along),
            *self.rear.grip(self.rear.load + moved, along),
        )

    def inputs(self, speed_mps: float, steering_rad: float, acceleration_mps2: float) -> Inputs:
        """Return what `forces` needs besides the motion: speed, wheels, their cosine, grip of both axles."""
        return (speed_mps, steering_rad, cos(steering_rad), *self.grips(acceleration_mps2))

    def forces(self, lateral_mps: float, yaw_rate: float, inputs: Inputs) -> tuple[float, float]:
        """Return the side forces of front and rear axle, N to the left of the vehicle, nonlinear tyres."""
        speed, steering, straight, front_slope, front_peak, rear_slope, rear_peak = inputs
        front = steering - atan2(lateral_mps + self.front_m * yaw_rate, speed)
        rear = -atan2(lateral_mps - self.rear_m * yaw_rate, speed)
        return (
            self.front.force(front_slope, front_peak, front) * straight,
            self.rear.force(rear_slope, rear_peak, rear),
        )

    def softness(self, lateral_mps: float, yaw_rate: float, inputs: Inputs) -> tuple[float, float]:
        """Return by how much front and rear tyres slip more than linear ones of the same force, rad."""
        speed, steering = inputs[:2]
        front, rear = self.forces(lateral_mps, yaw_rate, inputs)
        return (
            steering - atan2(lateral_mps + self.front_m * yaw_rate, speed) - front / self.front_stiffness,
            -atan2(lateral_mps - self.rear_m * yaw_rate, speed) - rear / self.rear_stiffness,
        )

    def grip_used(
        self, speed_mps: float, lateral_mps: float, yaw_rate: float, steering: float, acceleration: float
    ) -> tuple[float, float]:
        """Return by how much front and rear tyres slip, 1 = where the side force is largest.

        With linear tyres it is the force as a share of what the road could give.
        """
        front_slip = abs(steering - atan2(lateral_mps + self.front_m * yaw_rate, speed_mps))
        rear_slip = abs(atan2(lateral_mps - self.rear_m * yaw_rate, speed_mps))
        front_slope, front_peak, rear_slope, rear_peak = self.grips(acceleration)
        if self.is_linear:
            return self.front_stiffness * front_slip / front_peak, self.rear_stiffness * rear_slip / rear_peak
        return front_slope * front_slip / self.front.peak_x, rear_slope * rear_slip / self.rear.peak_x


def _actuators(config: DynamicsConfig) -> Actuators:
    fastest = config.steering_rate_degps
    return Actuators(
        steering_lag_s=config.steering_lag_s,
        steering_rate_radps=inf if fastest is None else radians(fastest),
        drive_lag_s=config.drive_lag_s,
        brake_lag_s=config.brake_lag_s,
    )

"""What a vehicle under way tells, whoever moves it: its motion, lost grip, the error of its steps."""

from vsensor.sources.control import Motion, Pose
from vsensor.world.vehicle import SingleTrack, Trip, grip_used

FRONT_SLIDES = "the front tyres lost their grip, the vehicle went straight on,"
REAR_SLIDES = "the rear tyres lost their grip, the vehicle skidded,"
BEYOND = "the side force was more than tyres give on this road (linear tyres do not end),"


def motion_of(trip: Trip) -> Motion:
    """Return where the vehicle is and how it moves."""
    body = trip.body
    return Motion(
        pose=Pose(x_m=body.x_m, y_m=body.y_m, yaw_rad=body.yaw_rad),
        speed_mps=trip.speed_mps,
        yaw_rate_radps=body.yaw_rate_radps,
        acceleration_mps2=trip.acceleration_mps2,
        lateral_mps2=trip.lateral_acceleration_mps2,
    )


def grip_troubles(vehicle: SingleTrack, trip: Trip) -> tuple[str, ...]:
    """Return which tyres slip more than where their side force is largest."""
    front, rear = grip_used(vehicle, trip)
    if vehicle.is_linear:
        return (BEYOND,) if max(front, rear) > 1.0 else ()
    return (FRONT_SLIDES,) * (front > 1.0) + (REAR_SLIDES,) * (rear > 1.0)


def step_remarks(trip: Trip) -> tuple[str, ...]:
    """Say what the steps in time are wrong by; nothing of a vehicle that never drove."""
    if trip.error_m == 0.0 and trip.speed_mps == 0.0:
        return ()
    return (f"vehicle: its steps in time are wrong by at most {trip.error_m:.1e} m within 60 s",)

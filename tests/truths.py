"""Outputs on maps for tests of the truth: a vehicle beside a lane's middle, all of the road seen."""

import numpy as np

from vsensor.camera import Camera, CameraConfig, observe
from vsensor.scene import SceneConfig
from vsensor.transforms import rotation_from_rpy, rpy_from_rotation
from vsensor.types import (
    Detections,
    EgoState,
    Environment,
    LaneEstimate,
    Output,
    Scene,
    Snapshot,
    Tick,
    frozen,
)
from vsensor.world.corridor import Corridor

ALL_SEEN = Camera.from_config(CameraConfig(model="none"))


def ego_on(corridor: Corridor, s_m, offset_m=0.0, turn_rad=0.0, **state):
    """Return a vehicle `offset_m` to the left of the lane's middle, turned to the left of its direction."""
    pose = corridor.pose(s_m, offset_m)
    angles = (float(pose.roll_rad[0]), float(pose.pitch_rad[0]), float(pose.yaw_rad[0]))
    if turn_rad:
        angles = rpy_from_rotation(rotation_from_rpy(*angles) @ rotation_from_rpy(0.0, 0.0, turn_rad))
    roll, pitch, yaw = angles
    return EgoState(
        t_ns=0,
        position_world_m=frozen(pose.position_world_m[0]),
        roll_rad=roll,
        pitch_rad=pitch,
        yaw_rad=yaw,
        **{"speed_mps": 30.0, **state},
    )


def output_at(ego, markings, *, camera=ALL_SEEN, obstacles=(), environment=None, values=None):
    """Return the Output of one tick in which nothing was reported."""
    scene = Scene(
        markings=tuple(markings), obstacles=tuple(obstacles), environment=environment or Environment()
    )
    snapshot = Snapshot(t_ns=0, ego=ego, scene=scene)
    seen = observe(camera, SceneConfig(), snapshot)
    found = {name: getattr(seen, name) for name in ("lines", "sigma_y_m", "kind", "colour", "width_m")}
    return Output(
        tick=Tick(index=0, t_ns=0, period_ns=40_000_000),
        snapshot=snapshot,
        observation=seen,
        detections=Detections(exposed_at_ns=0, operating_range_m=np.inf, **found),
        estimate=LaneEstimate(exposed_at_ns=0, image_index=0, boundaries=()),
        values=values or {},
        frames=(),
    )


def output_on(corridor: Corridor, s_m, offset_m=0.0, turn_rad=0.0, **more):
    """Return the Output of a vehicle on a route."""
    markings = corridor.markings_window(s_m - 20.0, s_m + 150.0)
    return output_at(ego_on(corridor, s_m, offset_m, turn_rad), markings, **more)

"""Logs of the sensor itself on a map, the vehicle's frames beside its own, as two buses in one log."""

import numpy as np

from tests.vehicle_frames import Gateway
from vsensor.logs import open_log_writer
from vsensor.session import Session

LATER_NS = 300_000
"""Frames of the vehicle stand between the sensor's."""


def record(path, *, seconds, scenario="highway", profile=None, dbc=None, start_ns=0, sink=None, **overrides):
    """Run a scenario in simulated time and log it, the vehicle's frames every 20 ms; return the path.

    A `sink` gets every output, too.
    """
    gateway, frames = Gateway(), []
    with Session(scenario, profile=profile, dbc=dbc, overrides=overrides) as sensor:
        before = None
        for _ in range(round(seconds / 0.04)):
            output = sensor.step()
            frames += output.frames
            if sink is not None:
                sink.write(output)
            ego = output.snapshot.ego
            now = (ego.t_ns, *ego.position_world_m[:2], ego.yaw_rad, ego.speed_mps, ego.yaw_rate_radps)
            if before is not None:
                frames += _between(gateway, before, now)
            frames += _vehicle(gateway, now)
            before = now
    with open_log_writer(path) as writer:
        for frame in sorted(frames, key=lambda one: one.due_ns):
            writer.write(frame, start_ns)
    return path


def _between(gateway, before, now):
    middle = [(a + b) / 2 for a, b in zip(before, now, strict=True)]
    return _vehicle(gateway, (int(middle[0]), *middle[1:]))


def _vehicle(gateway, now):
    t_ns, x, y, yaw, speed, rate = now
    due = int(t_ns) + LATER_NS
    yield gateway.motion(int(t_ns), speed, rate)
    del due
    yield from gateway.pose(int(t_ns), x, y, float(np.arctan2(np.sin(yaw), np.cos(yaw))))

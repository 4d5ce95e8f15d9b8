"""The whole line from snapshots to decoded frames, each frame checked on the way."""

import math
from functools import cache
from itertools import pairwise

import numpy as np

from vsensor.line import Line
from vsensor.profile import load_profile
from vsensor.sensor import Sensor, SensorConfig
from vsensor.signals import VehicleConfig
from vsensor.state import StateConfig
from vsensor.tracker import TrackerConfig
from vsensor.transmit import Transmitter
from vsensor.types import SIDE_NAMES, Side, Tick, Unseen
from vsensor.world.truth import line_truths

PERIOD_NS = 40_000_000
VEHICLE = VehicleConfig()
NUMBERS = ("offset_m", "heading", "curvature_per_m", "curvature_rate_per_m2", "x_min_m", "x_max_m", "width_m")
"""What a line that is there says of itself in numbers; all of it is "not available" where there is none."""

profile = cache(load_profile)


class Shown:
    """A source of given snapshots: `snapshot_at(tick)`."""

    notes = findings = ()
    duration_s = math.inf

    def __init__(self, snapshot_at):
        self.snapshot_at = snapshot_at

    def initial_state(self):
        return None

    def advance(self, state, tick, inputs):
        return None, self.snapshot_at(tick)

    def remarks(self, state):
        return ()


def line_of(snapshot_at, *, profile_name="native", seed=0, **sections):
    """Return the line that looks at given snapshots, with these sections of the sensor's configuration.

    A line is reported from its first image on.
    """
    config = SensorConfig(**{"tracker": TrackerConfig(confirm_images=1)} | sections)
    return Line(
        source=Shown(snapshot_at),
        sensor=Sensor.of(config, seed),
        vehicle=VEHICLE,
        state_config=StateConfig(init_s=0.0),
        transmitter=Transmitter(profile(profile_name), VEHICLE, config.camera.position_m[0]),
    )


def tick_at(index, period_ns=PERIOD_NS):
    return Tick(index=index, t_ns=index * period_ns, period_ns=period_ns)


def drive(line, ticks=1, *, first=0, period_ns=PERIOD_NS):
    """Yield output and decoded values of some ticks; every frame and the estimate behind it are checked."""
    state = line.initial_state()
    for index in range(first, first + ticks):
        computed = line.compute(state, tick_at(index, period_ns))
        if computed is None:
            return
        state = computed.state_if_sent
        yield computed.output, checked(line, computed.output)


def shown(snapshot, ticks=1, **more):
    """Return output and decoded values of the last of some images of one snapshot."""
    return list(drive(line_of(lambda tick: snapshot, **more), ticks))[-1]


def checked(line, output):
    """Return the values decoded from an output's frames, after checking that they are sound.

    Every message is there (or none, between the cycles), its CRC is right, and each line is either
    available, of quality 1 to 4 and with finite numbers, or not available, of quality 0 and without any;
    and then the truth says why.
    """
    values = {}
    for frame in output.frames:
        decoded = line.profile.decode(frame, check=True)
        assert decoded is not None, f"CRC of {frame.arbitration_id:#x}"
        values |= decoded
    assert len(output.frames) in (0, len(line.profile.messages))
    if not output.frames:
        return {}
    truths = line_truths(output, VEHICLE.wheelbase_m)
    for side, word in SIDE_NAMES.items():
        boundary = output.estimate.on(side)
        numbers = [values[f"{word}.{name}"] for name in NUMBERS]
        assert values[f"{word}.available"] == float(boundary is not None)
        if boundary is not None:
            assert 1 <= values[f"{word}.quality"] <= 4
            assert all(map(math.isfinite, numbers)), (word, numbers)
            assert np.isfinite(boundary.coefficients).all()
        else:
            assert values[f"{word}.quality"] == 0.0
            assert all(map(math.isnan, numbers)), (word, numbers)
            assert side not in truths or truths[side].reason_unseen is not Unseen.SEEN
    return values


def reasons(output):
    """Return why each side that has a line in truth is not reported, SEEN where it is."""
    return {side: truth.reason_unseen for side, truth in line_truths(output, VEHICLE.wheelbase_m).items()}


def reported(output):
    """Return the sides that are reported."""
    return {boundary.side for boundary in output.estimate.boundaries}


def bits(output):
    """Return what an ECU gets: the frames' ids and bytes."""
    return [(frame.arbitration_id, frame.data) for frame in output.frames]


def spans(lines):
    """Yield (marking, points (n, 3)) of each line."""
    for number, (start, stop) in zip(lines.marking.tolist(), pairwise(lines.starts.tolist()), strict=True):
        yield number, lines.points_ego_m[start:stop]


OWN = {Side.LEFT, Side.RIGHT}
ALL = set(SIDE_NAMES)

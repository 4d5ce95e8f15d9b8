"""Frames of a sensor that sees a lane, made by vsensor's transmitter, and what a bus may do to them."""

import numpy as np
from msgspec.structs import replace

from tests.bus_values import PERIOD_NS, boundary, ego, estimate, slot
from tools.independent_reader import e2e_profile_01
from vsensor.profile import load_profile
from vsensor.signals import VehicleConfig, values_from
from vsensor.transmit import Transmitter, initial_state, transmit
from vsensor.types import SensorMode, Side

VEHICLE = VehicleConfig()
TRANSMITTER = Transmitter(load_profile("native"), VEHICLE)
IDS = {plan.layout.name: plan.layout.arbitration_id for plan in TRANSMITTER.profile.messages}
PLACES_M = {Side.LEFT: 1.75, Side.RIGHT: -1.75, Side.NEXT_LEFT: 5.25, Side.NEXT_RIGHT: -5.25}
START_NS = 1_000_000_000_000
BETWEEN_NS = 250_000  # frames of a burst, about as a bus of 500 kbit/s lets them follow each other


def lane(index, mode=SensorMode.AVAILABLE, centre_m=0.0, sides=tuple(PLACES_M), bend_per_m=0.0):
    """Return the signal values of one image; the lines move as measured ones do, by a few millimetres."""
    lines = []
    for number, side in enumerate(sides):
        moved = np.random.default_rng((index, number)).normal(scale=0.004, size=3)
        y = PLACES_M[side] + centre_m + moved[0]
        curve = bend_per_m / 2 + moved[2] * 1e-4
        lines.append(boundary(side, [y, moved[1] * 0.05, curve, 1e-7]))
    if not mode.reports_lines:
        lines = []
    return dict(values_from(VEHICLE, estimate(*lines, index=index), ego(), mode))


def stream(images, values=lane, *, skipped=()):
    """Return the frames of images 0 to `images` - 1; slots in `skipped` are dropped: counters stand still."""
    state, frames = initial_state(TRANSMITTER), []
    for index in range(images):
        if index in skipped:
            continue
        state, burst = transmit(TRANSMITTER, state, values(index), slot(index))
        frames += [
            replace(frame, due_ns=START_NS + index * PERIOD_NS + place * BETWEEN_NS)
            for place, frame in enumerate(burst)
        ]
    return frames


def write(frames, path):
    """Write a log as `candump -L` does, in the order of the times."""
    with path.open("w") as file:
        for frame in sorted(frames, key=lambda frame: frame.due_ns):
            seconds, rest = divmod(frame.due_ns, 10**9)
            name = f"{frame.arbitration_id:03X}#{frame.data.hex().upper()}"
            file.write(f"({seconds}.{rest // 1000:06d}) vcan0 {name}\n")


# ---- what a bus, or a broken sensor, does ----------------------------------------------------------


def image_of(frame):
    """Return the number of the image in which a frame left."""
    return (frame.due_ns - START_NS) // PERIOD_NS


def later(frames, images):
    """Return the frames, sent so many images later."""
    return [replace(frame, due_ns=frame.due_ns + images * PERIOD_NS) for frame in frames]


def changed(frames, name, images, change):
    """Return the frames, those of one message (None: of all) in some images replaced by `change(frame)`."""
    result = []
    for frame in frames:
        hit = name is None or frame.arbitration_id == IDS[name]
        result += change(frame) if hit and image_of(frame) in images else [frame]
    return result


def lost(frame):
    return []


def doubled(frame):
    return [frame, replace(frame, due_ns=frame.due_ns + 100_000)]


def truncated(frame):
    return [replace(frame, data=frame.data[:5])]


def crc_wrong(frame):
    return [replace(frame, data=bytes([frame.data[0] ^ 0xFF]) + frame.data[1:])]


def delayed(delay_ms):
    return lambda frame: [replace(frame, due_ns=frame.due_ns + round(delay_ms * 1e6))]


def with_header(frame, counter=None, burst=None):
    """Return the frame with another counter or burst in its byte 1, and the CRC that fits."""
    counter = frame.data[1] & 15 if counter is None else counter
    burst = frame.data[1] >> 4 if burst is None else burst
    data = frame.data[:1] + bytes([counter | burst << 4]) + frame.data[2:]
    return replace(frame, data=bytes([e2e_profile_01(data, frame.arbitration_id, 0)]) + data[1:])


def counter_at(value):
    return lambda frame: [with_header(frame, counter=value)]


def counter_ahead(by):
    return lambda frame: [with_header(frame, counter=((frame.data[1] & 15) + by) % 15)]


def burst_behind(by):
    return lambda frame: [with_header(frame, burst=((frame.data[1] >> 4) - by) % 16)]

"""A few seconds of the shipped drive as frames and as logs, for readers that are not ours."""

from msgspec.structs import replace

from vsensor.codec import decode, load_database, unpack
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.logs import open_log_writer
from vsensor.profile import load_profile
from vsensor.types import Tick

DBC = load_profile("native").database
LAYOUTS = {layout.arbitration_id: layout for layout in load_database(DBC).layouts.values()}
PERIOD_NS = 40_000_000


def frames_of(ticks):
    """Return the frames of the first images of the shipped drive; the first five are those of the start."""
    line = build_line(load_scenario("highway"))
    state, frames = line.initial_state(), []
    for index in range(ticks):
        tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
        computed = line.compute(state, tick)
        state = computed.state_if_sent
        frames += [replace(frame, due_ns=tick.t_ns) for frame in computed.output.frames]
    return frames


def written(frames, path):
    """Write frames into a log and return its path."""
    writer = open_log_writer(path)
    for frame in frames:
        writer.write(frame, 1_700_000_000_000_000_000)
    writer.close()
    return path


def ours(frames):
    """Return message -> signal -> physical values in the order sent, as vsensor's codec reads them."""
    columns = {layout.name: {} for layout in LAYOUTS.values()}
    for frame in frames:
        layout = LAYOUTS[frame.arbitration_id]
        for name, value in decode(layout, frame.data).items():
            columns[layout.name].setdefault(name, []).append(value)
    return columns


def raws(frames):
    """Return signal -> raw values in the order sent."""
    columns = {}
    for frame in frames:
        for name, value in unpack(LAYOUTS[frame.arbitration_id], frame.data).items():
            columns.setdefault(name, []).append(value)
    return columns

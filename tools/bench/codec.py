"""Frames and numbers: encoding the native set tick by tick, decoding in bulk through a profile."""

import tempfile
from pathlib import Path

import can
import numpy as np

from tools.bench.measure import PERIOD_NS, ROOT, elapsed_ms, in_turns, median, one_core
from vsensor import transmit as sending
from vsensor.config import load_scenario
from vsensor.line import build_line
from vsensor.logs import open_log_writer
from vsensor.profile import load_profile
from vsensor.types import Frame, Tick

TARGET_ENCODE_US = 50.0
TARGET_FRAMES_PER_S = 1.5e6
TARGET_TIMES = 10.0
PEER_FRAMES = 13_000
"""What python-can reads and cantools decodes one by one; more only takes longer."""


def encoding(ticks: int = 500, rounds: int = 5) -> dict[str, object]:
    """Time `transmit` alone: the values of the demo's ticks into 13 frames with counters and CRCs."""
    line, outputs = _demo(ticks)
    times_us = []
    with one_core():
        for _ in range(rounds):
            state = sending.initial_state(line.transmitter)
            for output in outputs:
                kept = {}

                def work(state=state, output=output, kept=kept):
                    kept["state"], _ = sending.transmit(line.transmitter, state, output.values, output.tick)

                times_us.append(1000 * elapsed_ms(work))
                state = kept["state"]
    return {
        "frames_a_tick": len(outputs[-1].frames),
        "p50_us": float(np.median(times_us)),
        "p99_us": float(np.percentile(times_us, 99)),
        "target_us": TARGET_ENCODE_US,
    }


def decoding(frames: int = 1_300_000, rounds: int = 5) -> dict[str, object]:
    """Decode native frames in memory with every CRC checked; beside it python-can's reader and cantools."""
    import cantools

    outputs = _demo(100)[1]
    sent = [frame for output in outputs for frame in output.frames]
    profile, database = load_profile("native"), cantools.database.load_file(ROOT / "dbc" / "lds.dbc")
    ids = np.resize(np.array([frame.arbitration_id for frame in sent], dtype=np.uint32), frames)
    data = np.resize(np.array([list(frame.data) for frame in sent], dtype=np.uint8), (frames, 8))
    length = np.full(frames, 8, dtype=np.uint8)
    with tempfile.TemporaryDirectory() as folder, one_core():
        log = Path(folder) / "peer.log"
        _write(log, sent)

        def theirs() -> None:
            with can.LogReader(log) as reader:
                for message in reader:
                    database.decode_message(message.arbitration_id, message.data, decode_choices=False)

        works = {
            "checked": lambda: profile.decode_arrays(ids, data, length, check=True),
            "unchecked": lambda: profile.decode_arrays(ids, data, length),
            "python-can + cantools": theirs,
        }
        times_ms = {name: median(times) for name, times in in_turns(works, rounds).items()}
    rate = {name: frames / ms * 1000 for name, ms in times_ms.items()}
    rate["python-can + cantools"] = PEER_FRAMES / times_ms["python-can + cantools"] * 1000
    return {
        "frames": frames,
        "frames_per_s": rate,
        "times_faster": rate["checked"] / rate["python-can + cantools"],
        "unlike_cantools": unlike_cantools(sent),
        "target_frames_per_s": TARGET_FRAMES_PER_S,
        "target_times": TARGET_TIMES,
    }


def unlike_cantools(frames: list[Frame]) -> int:
    """Return how many signals of the frames differ from what cantools decodes, in any bit."""
    import cantools

    from vsensor.codec import decode, load_database

    theirs = cantools.database.load_file(ROOT / "dbc" / "lds.dbc")
    layouts = {
        layout.arbitration_id: layout for layout in load_database(ROOT / "dbc" / "lds.dbc").layouts.values()
    }
    unlike = 0
    for frame in frames:
        ours = decode(layouts[frame.arbitration_id], frame.data)
        expected = theirs.decode_message(frame.arbitration_id, frame.data, decode_choices=False)
        unlike += sum(float(expected[name]) != value for name, value in ours.items())
    return unlike


def _demo(ticks: int):
    """Return the demo's line and the outputs of its first ticks."""
    line = build_line(load_scenario("highway"))
    state, outputs = line.initial_state(), []
    for index in range(ticks):
        computed = line.compute(state, Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS))
        state = computed.state_if_sent
        outputs.append(computed.output)
    return line, outputs


def _write(path: Path, frames: list[Frame]) -> None:
    with_times = (frames * (PEER_FRAMES // len(frames) + 1))[:PEER_FRAMES]
    writer = open_log_writer(path)
    for frame in with_times:
        writer.write(frame, 0)
    writer.close()

"""`vsensor run` on a real vcan: what others read there is what was sent."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.vcan.listening import candump

REPOSITORY = Path(__file__).parents[2]
DBC = REPOSITORY / "dbc" / "lds.dbc"
READER = REPOSITORY / "tools" / "independent_reader.py"
pytestmark = pytest.mark.vcan


def cantools_program():
    return [sys.executable, "-m", "cantools"]


def recorded(folder, *words, seconds):
    """Run `vsensor run` on vcan0 with candump beside it; returns its output and both logs."""
    seen, sent = folder / "seen.log", folder / "sent.log"
    command = [sys.executable, "-m", "vsensor.cli", "run", "--duration", str(seconds), "--log", sent, *words]
    with seen.open("w") as file, candump("vcan0", file):
        run = subprocess.run(command, capture_output=True, text=True, check=True)
        time.sleep(0.3)  # candump writes what it heard a moment later
    return run, seen, sent


@pytest.fixture(scope="module")
def ten_seconds(tmp_path_factory):
    return recorded(tmp_path_factory.mktemp("vcan"), "--bus", "socketcan:vcan0", seconds=10)


def data(log):
    return [line.split()[2] for line in log.read_text().splitlines()]


def test_no_frame_is_lost(ten_seconds):
    run, seen, _ = ten_seconds  # that no slot is dropped is measured by `make bench`, not here
    sent = int(re.search(r"frames sent (\d+), refused by the bus 0", run.stdout)[1])
    assert len(data(seen)) == sent > 3000


def test_what_candump_saw_is_what_the_log_holds_bit_for_bit(ten_seconds):
    _, seen, sent = ten_seconds
    assert data(seen) == data(sent)
    assert len(data(seen)) > 3000


def test_counters_and_crcs_are_right_as_read_by_a_reader_of_its_own(ten_seconds):
    _, seen, _ = ten_seconds
    judged = subprocess.run([sys.executable, READER, seen, DBC], capture_output=True, text=True, check=False)
    sums = json.loads(judged.stdout.splitlines()[-1])
    assert judged.returncode == 0, judged.stdout
    assert sums["messages"] == 13
    assert sums["frames"] == len(data(seen))


def test_the_reader_notices_a_lost_frame_and_a_changed_bit(ten_seconds, tmp_path):
    _, seen, _ = ten_seconds
    lines = seen.read_text().splitlines()
    del lines[200]
    start = lines[400].index("#") + 5
    lines[400] = lines[400][:start] + f"{int(lines[400][start], 16) ^ 1:X}" + lines[400][start + 1 :]
    spoiled = tmp_path / "spoiled.log"
    spoiled.write_text("\n".join(lines) + "\n")
    judged = subprocess.run(
        [sys.executable, READER, spoiled, DBC], capture_output=True, text=True, check=False
    )
    sums = json.loads(judged.stdout.splitlines()[-1])
    assert judged.returncode == 1
    assert (sums["counter_errors"], sums["crc_errors"]) == (1, 1)


def test_cantools_decodes_candumps_output_to_what_was_sent_signal_by_signal(ten_seconds):
    """`candump vcan0 | cantools decode lds.dbc`, as on the bench, against our own reading of our log."""
    from vsensor.codec import decode, load_database

    _, seen, sent = ten_seconds
    piped = "".join(
        f"  vcan0  {frame[:3]}   [8]  {' '.join(re.findall('..', frame[4:]))}\n" for frame in data(seen)
    )
    printed = subprocess.run(
        [*cantools_program(), "decode", "--single-line", "--no-decode-choices", DBC],
        input=piped,
        capture_output=True,
        text=True,
        check=True,
    ).stdout
    layouts = load_database(DBC).layouts
    by_id = {layout.arbitration_id: layout for layout in layouts.values()}
    compared = 0
    for frame, line in zip(data(sent), printed.splitlines(), strict=True):
        layout = by_id[int(frame[:3], 16)]
        name, text = re.search(r":: (\w+)\((.*)\)$", line).groups()
        theirs = {key: float(value) for key, value in re.findall(r"(\w+): (-?[\d.e+-]+)", text)}
        assert name == layout.name
        assert theirs == pytest.approx(decode(layout, bytes.fromhex(frame[4:])), rel=1e-12, abs=1e-12)
        compared += len(theirs)
    assert compared > 250 * 100


def test_auto_takes_vcan0_where_it_is_up(tmp_path):
    run, seen, _ = recorded(tmp_path, seconds=1)
    assert "socketcan:vcan0" in run.stderr
    assert len(data(seen)) > 300


def test_sigint_ends_the_run_with_its_summary_and_a_readable_log(tmp_path):
    log = tmp_path / "out.log"
    process = subprocess.Popen(
        [sys.executable, "-m", "vsensor.cli", "run", "--bus", "socketcan:vcan1", "--log", log],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=dict(os.environ),
    )
    assert "sending on" in process.stderr.readline()
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    out, _ = process.communicate(timeout=20)
    assert process.returncode == 130
    sent = int(re.search(r"frames sent (\d+)", out)[1])
    assert len(data(log)) == sent > 0

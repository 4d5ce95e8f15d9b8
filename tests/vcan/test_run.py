"""`vsensor run` on a real vcan: what others read there is what was sent."""

import json
import re
import signal
from pathlib import Path

import pytest

from tests.vcan.listening import recorded, wait_for_frames
from tests.vcan.programs import Program, ran

REPOSITORY = Path(__file__).parents[2]
DBC = REPOSITORY / "dbc" / "lds.dbc"
READER = REPOSITORY / "tools" / "independent_reader.py"
pytestmark = pytest.mark.vcan


SECONDS = 5


@pytest.fixture(scope="module")
def a_run(tmp_path_factory):
    """`vsensor run` on the bus that it takes by itself, candump beside it: its output and both logs."""
    folder = tmp_path_factory.mktemp("vcan")
    seen, sent = folder / "seen.log", folder / "sent.log"
    with recorded("vcan0", seen):
        run = ran("vsensor.cli", "run", "--duration", SECONDS, "--log", sent)
    assert run.returncode == 0, run.stderr
    return run, seen, sent


def data(log):
    return [line.split()[2] for line in log.read_text().splitlines()]


def test_no_frame_is_lost(a_run):
    run, seen, _ = a_run  # that no slot is dropped is measured by `make bench`, not here
    sent = int(re.search(r"frames sent (\d+), refused by the bus 0", run.stdout)[1])
    assert len(data(seen)) == sent > 13 * 25 * SECONDS / 2


def test_what_candump_saw_is_what_the_log_holds_bit_for_bit(a_run):
    _, seen, sent = a_run
    assert data(seen) == data(sent)


def test_counters_and_crcs_are_right_as_read_by_a_reader_of_its_own(a_run):
    _, seen, _ = a_run
    judged = ran(READER, seen, DBC)
    sums = json.loads(judged.stdout.splitlines()[-1])
    assert judged.returncode == 0, judged.stdout
    assert sums["messages"] == 13
    assert sums["frames"] == len(data(seen))


def test_the_reader_notices_a_lost_frame_and_a_changed_bit(a_run, tmp_path):
    _, seen, _ = a_run
    lines = seen.read_text().splitlines()
    del lines[200]
    start = lines[400].index("#") + 5
    lines[400] = lines[400][:start] + f"{int(lines[400][start], 16) ^ 1:X}" + lines[400][start + 1 :]
    spoiled = tmp_path / "spoiled.log"
    spoiled.write_text("\n".join(lines) + "\n")
    judged = ran(READER, spoiled, DBC)
    sums = json.loads(judged.stdout.splitlines()[-1])
    assert judged.returncode == 1
    assert (sums["counter_errors"], sums["crc_errors"]) == (1, 1)


def test_cantools_decodes_candumps_output_to_what_was_sent_signal_by_signal(a_run, tmp_path):
    """`candump vcan0 | cantools decode lds.dbc`, as on the bench, against our own reading of our log."""
    from vsensor.codec import decode, load_database

    _, seen, sent = a_run
    piped = tmp_path / "piped"
    piped.write_text(
        "".join(
            f"  vcan0  {frame[:3]}   [8]  {' '.join(re.findall('..', frame[4:]))}\n" for frame in data(seen)
        )
    )
    printed = ran("cantools", "decode", "--single-line", "--no-decode-choices", DBC, stdin=piped).stdout
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
    assert compared > 100 * 25 * SECONDS / 2


def test_without_a_bus_vcan0_is_taken_where_it_is_up(a_run):
    run, seen, _ = a_run
    assert "socketcan:vcan0" in run.stderr
    assert data(seen)


def test_sigint_ends_the_run_with_its_summary_and_a_readable_log(tmp_path):
    log = tmp_path / "out.log"
    with Program("vsensor.cli", "run", "--bus", "socketcan:vcan1", "--log", log) as program:
        wait_for_frames(log, 300)
        program.send_signal(signal.SIGINT)
        done = program.ended()
    assert done.returncode == 130
    sent = int(re.search(r"frames sent (\d+)", done.stdout)[1])
    assert len(data(log)) == sent > 0

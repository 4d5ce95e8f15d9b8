"""`vsensor monitor` beside `vsensor run` on a real vcan."""

import re
import signal

import pytest

from tests.vcan.listening import receivers, wait_for
from tests.vcan.programs import Program, ran

pytestmark = pytest.mark.vcan


def test_the_monitor_shows_the_lines_of_a_run_and_the_frame_whose_checksum_is_wrong():
    fault = "kind=crc_wrong,message=LDS_LeftLine,at_s=2,times=1"
    before = receivers("vcan0")
    with Program("vsensor.cli", "monitor", "--bus", "socketcan:vcan0") as monitor:
        wait_for(lambda: receivers("vcan0") > before)
        words = ["--bus", "socketcan:vcan0", "--duration", 3, "--quiet", "--fault", fault]
        assert ran("vsensor.cli", "run", *words).returncode == 0
        monitor.send_signal(signal.SIGINT)
        done = monitor.ended()
    assert done.returncode == 130, done.stderr
    assert "0x323 LDS_LeftLine: wrong CRC" in done.stdout
    assert re.search(r"left \+\d\.\d{3} m q[1-4] to \d+ m", done.stdout)
    tables = done.stdout[done.stdout.index("message ") :].splitlines()
    head = re.split(r"  +", tables[0])
    rows = {
        cells[0]: dict(zip(head, cells, strict=True)) for cells in (re.split(r"  +", t) for t in tables[1:14])
    }
    assert len(rows) == 13
    assert {name for name, row in rows.items() if row["CRC wrong"] != "0"} == {"LDS_LeftLine"}
    assert all(int(row["frames"]) > 20 for row in rows.values())

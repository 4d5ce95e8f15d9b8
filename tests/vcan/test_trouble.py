"""A real interface that goes down, vanishes, or is shared: the run goes on and says so."""

import re
import signal
import subprocess
import time

import pytest

from tests.vcan.listening import wait_for_frames
from tests.vcan.programs import Program
from vsensor.bus import open_bus
from vsensor.types import Frame

FRAME = Frame(due_ns=0, arbitration_id=0x123, data=b"abc")
PATIENCE_S = 30.0
pytestmark = pytest.mark.vcan


def ip(*words):
    subprocess.run(["ip", "link", *words], check=True)


@pytest.fixture
def vcan2():
    """A vcan of this test's own: it may be taken away, and nothing of an earlier test is still under way."""
    ip("add", "vcan2", "up", "type", "vcan")
    yield "vcan2"
    ip("del", "vcan2")


@pytest.fixture
def bus(vcan2):
    with open_bus(f"socketcan:{vcan2}") as bus:
        bus.said = []
        bus.tell(bus.said.append)
        yield bus


def cycle(bus, frames=3):
    taken = sum(bus.send(FRAME) for _ in range(frames))
    bus.drain()
    return taken


def test_an_interface_that_was_down_takes_the_first_cycle_after_it_is_up(bus, vcan2):
    assert cycle(bus) == 3
    ip("set", vcan2, "down")
    assert [cycle(bus) for _ in range(3)] == [0, 0, 0]
    ip("set", vcan2, "up")
    assert cycle(bus) == 3
    assert [text.partition(" ")[0] for text in bus.said] == ["socketcan:vcan2:", "socketcan:vcan2"]
    assert "Network is down (ENETDOWN): ip link set vcan2 up" in bus.said[0]


def test_an_interface_that_flapped_between_two_cycles_costs_no_frame(bus, vcan2):
    ip("set", vcan2, "down")
    ip("set", vcan2, "up")
    assert cycle(bus) == 3
    assert bus.report() == []


def test_an_interface_that_vanished_and_came_back_takes_the_first_cycle(bus, vcan2):
    assert cycle(bus) == 3
    ip("del", vcan2)
    assert [cycle(bus) for _ in range(3)] == [0, 0, 0]
    ip("add", vcan2, "up", "type", "vcan")
    assert cycle(bus) == 3
    assert len(bus.said) == 2


def test_frames_of_an_outage_are_not_sent_when_it_is_over(bus, vcan2):
    ip("set", vcan2, "down")
    cycle(bus, frames=50)
    ip("set", vcan2, "up")
    with open_bus(f"socketcan:{vcan2}") as listener:
        assert cycle(bus) == 3
        assert len(eventually(listener.drain, 3)) == 3
        assert listener.drain() == []


def test_error_frames_of_bus_off_hold_frames_back_until_the_controller_restarts(bus, vcan2):
    subprocess.run(["cansend", vcan2, "20000040#0000000000000000"], check=True)
    bus.drain()
    with open_bus(f"socketcan:{vcan2}") as listener:
        assert cycle(bus) == 0
        assert listener.drain() == []
    subprocess.run(["cansend", vcan2, "20000100#0000000000000000"], check=True)
    bus.drain()
    assert cycle(bus) == 3


def test_a_foreign_node_is_told_from_ourselves(bus, vcan2):
    cycle(bus)
    assert bus.foreign == {}
    subprocess.run(["cansend", vcan2, "123#00"], check=True)
    assert [frame.data for frame in bus.drain()] == [b"\0"]
    assert bus.foreign == {0x123: 1}


def test_own_frames_are_confirmed_with_the_kernels_time(bus):
    before_ns = time.monotonic_ns()
    bus.send(FRAME)
    after_ns = time.monotonic_ns()
    ((due_ns, stamp_ns),) = eventually(lambda: [*bus.drain(), *bus.confirmed()], 1)
    tolerance_ns = 100_000  # two clocks, read one after the other
    assert due_ns == FRAME.due_ns
    assert before_ns - tolerance_ns <= stamp_ns <= after_ns + tolerance_ns


def test_a_listener_that_does_not_read_holds_nobody_up_and_knows_what_it_lost(bus, vcan2):
    sent = 5_000  # the receive buffer holds some 2700
    with open_bus(f"socketcan:{vcan2}") as lazy:
        for _ in range(sent // 100):
            assert cycle(bus, frames=100) == 100
        heard = len(lazy.drain())
        bus.send(FRAME)  # the kernel tells what it dropped with the next frame
        heard += len(eventually(lazy.drain, 1))
        assert heard < sent
        (line,) = lazy.report()
        assert line == f"{sent + 1 - heard} frames of others on socketcan:vcan2 were not read in time"


def test_a_run_goes_on_through_an_outage_says_so_twice_and_sends_nothing_twice(vcan2, tmp_path):
    log = tmp_path / "seen.log"
    words = ["run", "--bus", f"socketcan:{vcan2}", "--quiet", "--log", log]
    with Program("vsensor.cli", *words) as run:
        while "drive from" not in (line := run.stderr.readline()):
            assert line
        wait_for_frames(log, 100)
        ip("set", vcan2, "down")
        assert "ENETDOWN" in run.stderr.readline()
        ip("set", vcan2, "up")
        assert "is back after" in run.stderr.readline()
        wait_for_frames(log, 100, beyond=log.stat().st_size)
        run.send_signal(signal.SIGINT)
        status, out, rest = run.ended()
    assert (status, rest) == (130, "")
    assert re.search(r"refused \d+ frames in 1 outage, longest \d+\.\d\d s: \d+ x Network is down", out)
    assert "Traceback" not in out
    sent = int(re.search(r"frames sent (\d+)", out)[1])
    assert sent > 200
    assert len(log.read_text().splitlines()) == sent


def eventually(read, count):
    """Collect what `read()` gives until there is `count`: a busy kernel hands frames over a moment later."""
    found, deadline = [], time.monotonic() + PATIENCE_S
    while len(found) < count and time.monotonic() < deadline:
        found += read()
    return found

"""What the loop meets when a bus goes wrong: counts, two sentences, no exception, nothing sent late."""

import errno
import time

import can
import pytest
from msgspec.structs import replace

from tests.bus_frames import CLASSIC, EXTENDED
from vsensor.bus import FrameBus, open_bus
from vsensor.bus.trouble import SAID_OUTAGES

BUS_OFF = replace(CLASSIC, arbitration_id=0x40, is_error=True)
RESTARTED = replace(CLASSIC, arbitration_id=0x100, is_error=True)
DOWN = OSError(errno.ENETDOWN, "Network is down")
FULL = OSError(errno.ENOBUFS, "No buffer space available")
VANISHED = OSError(errno.ENODEV, "No such device")
PYTHON_CANS = can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS)


class FakePort:
    """An interface whose trouble is set by hand: `problem` refuses every frame, `mends` ends it on demand."""

    def __init__(self, hears_itself=False):
        self.hears_itself, self.lost = hears_itself, 0
        self.problem, self.mends, self.attempts = None, False, 0
        self.sent, self.waiting, self.reading_fails = [], [], None

    def put(self, frame):
        if self.problem is not None:
            raise self.problem
        self.sent.append(frame)

    def received(self, times):
        if self.reading_fails is not None:
            raise self.reading_fails
        waiting, self.waiting = self.waiting, []
        yield from waiting

    def mend(self, problem):
        self.attempts += 1
        if self.mends:
            self.problem = None
        return self.mends

    def close(self):
        pass


@pytest.fixture
def port():
    return FakePort()


@pytest.fixture
def said():
    return []


@pytest.fixture
def bus(port, said):
    bus = FrameBus(port, "socketcan:can0", is_simulated=False)
    bus.tell(said.append)
    return bus


def cycle(bus, frames=3):
    """Send one cycle; returns how many frames the bus took."""
    taken = sum(bus.send(replace(CLASSIC, due_ns=k)) for k in range(frames))
    bus.drain()
    return taken


@pytest.mark.parametrize("problem", [DOWN, FULL, VANISHED, PYTHON_CANS], ids=lambda p: type(p).__name__)
def test_trouble_is_told_once_when_it_begins_and_once_when_it_is_over(bus, port, said, problem):
    cycle(bus)
    port.problem = problem
    assert [cycle(bus) for _ in range(4)] == [0] * 4
    assert len(said) == 1
    port.problem = None
    assert [cycle(bus) for _ in range(4)] == [3] * 4
    assert len(said) == 2
    assert "is back after" in said[1]
    assert "12 frames refused" in said[1]


def test_frames_that_were_refused_are_not_sent_later(bus, port):
    port.problem = FULL
    cycle(bus)
    port.problem = None
    cycle(bus, frames=2)
    assert len(port.sent) == 2


@pytest.mark.parametrize("problems", [(None, FULL), (FULL, None)], ids=["its end", "its beginning"])
def test_a_cycle_that_is_refused_in_part_does_not_end_an_outage(bus, port, said, problems):
    port.problem = FULL
    cycle(bus)
    for _ in range(3):
        for port.problem in problems:
            bus.send(CLASSIC)
        bus.drain()
    assert len(said) == 1


def test_every_outage_has_its_own_count_of_frames(bus, port, said):
    for frames in (5, 2):
        port.problem = FULL
        cycle(bus, frames=frames)
        port.problem = None
        cycle(bus)
    assert "5 frames refused" in said[1]
    assert "2 frames refused" in said[3]


def test_the_report_is_one_line_with_frames_outages_and_reasons(bus, port):
    for problem in (DOWN, FULL, DOWN):
        port.problem = problem
        cycle(bus, frames=2)
        port.problem = None
        cycle(bus)
    (line,) = bus.report()
    assert "refused 6 frames in 3 outages, longest 0." in line
    assert "4 x Network is down (ENETDOWN): ip link set can0 up" in line
    assert "2 x No buffer space available (ENOBUFS): nobody acknowledges" in line
    assert "txqueuelen" in line


def test_a_bus_that_comes_and_goes_all_night_is_told_of_a_few_times_and_counted_always(bus, port, said):
    for _ in range(50):
        port.problem = DOWN
        cycle(bus)
        port.problem = None
        cycle(bus)
    assert len(said) == 2 * SAID_OUTAGES
    assert "50 outages" in bus.report()[0]


def test_an_outage_at_the_end_is_called_not_over(bus, port):
    port.problem = DOWN
    cycle(bus)
    assert "1 outage, longest 0.00 s, the last one not over" in bus.report()[0]


def test_what_can_be_mended_at_once_costs_no_frame(bus, port):
    port.problem, port.mends = VANISHED, True
    assert cycle(bus) == 3
    assert bus.report() == []


def test_mending_is_tried_once_a_cycle(bus, port):
    port.problem = VANISHED
    cycle(bus, frames=13)
    assert port.attempts == 1
    cycle(bus, frames=13)
    assert port.attempts == 2


def test_a_controller_that_is_bus_off_gets_no_frames_until_it_has_restarted(bus, port, said):
    port.waiting = [(BUS_OFF, False)]
    cycle(bus)
    before = len(port.sent)
    assert cycle(bus) == 0
    assert len(port.sent) == before
    port.waiting = [(RESTARTED, False)]
    assert cycle(bus) == 0
    assert cycle(bus) == 3
    assert "bus-off" in said[0]
    assert "is back" in said[1]


def test_a_controller_that_hears_frames_is_no_longer_bus_off(bus, port):
    port.waiting = [(BUS_OFF, False)]
    cycle(bus)
    port.waiting = [(EXTENDED, False)]
    cycle(bus)
    assert cycle(bus) == 3


def test_other_error_frames_stop_nothing(bus, port):
    port.waiting = [(replace(BUS_OFF, arbitration_id=0x4), False)] * 5
    cycle(bus)
    assert cycle(bus) == 3
    assert bus.report() == ["error frames heard on socketcan:can0: 5"]


def test_an_interface_that_goes_down_while_it_is_read_is_no_exception(bus, port):
    port.reading_fails = DOWN
    assert bus.drain() == []


def test_a_foreign_node_with_our_ids_is_told_once_and_counted_by_id(bus, port, said):
    bus.send(CLASSIC)
    bus.send(EXTENDED)
    for _ in range(3):
        port.waiting = [(CLASSIC, False), (EXTENDED, False), (replace(CLASSIC, arbitration_id=0x111), False)]
        bus.drain()
    assert len(said) == 1
    assert bus.report() == [
        "another node on socketcan:can0 sent frames with our ids: 0x123 x 3, 0x18FF1234 x 3"
    ]


def test_a_standard_id_is_another_one_than_the_same_number_in_29_bits(bus, port):
    bus.send(CLASSIC)
    port.waiting = [(replace(CLASSIC, is_extended=True), False)]
    assert len(bus.drain()) == 1
    assert bus.report() == []


def test_own_frames_come_back_as_confirmations_with_the_time_on_the_bus_not_as_heard(bus, port):
    bus.send(replace(CLASSIC, due_ns=40))
    stamp_ns = time.monotonic_ns()
    port.waiting = [(replace(CLASSIC, due_ns=stamp_ns), True)]
    assert bus.drain() == []
    assert bus.confirmed() == [(40, stamp_ns)]
    assert bus.confirmed() == []


def test_a_confirmation_that_is_read_a_cycle_later_belongs_to_the_frame_that_was_sent_before_it(
    bus, port, monkeypatch
):
    stamps = []
    for cycle_number in range(3):
        sent_ns = 40_000_000 * cycle_number
        monkeypatch.setattr(time, "monotonic_ns", lambda now_ns=sent_ns: now_ns)
        bus.send(replace(CLASSIC, due_ns=cycle_number))
        bus.drain()
        stamps.append(sent_ns + 100_000)
    port.waiting = [(replace(CLASSIC, due_ns=stamp), True) for stamp in stamps]
    bus.drain()
    assert bus.confirmed() == list(enumerate(stamps))


@pytest.fixture
def at(monkeypatch):
    """Set the time in ms."""

    def at(time_ms):
        monkeypatch.setattr(time, "monotonic_ns", lambda: 10**9 + time_ms * 1_000_000)
        return True

    at(0)
    return at


def heard_of(port, frames=3):
    port.waiting = [(replace(CLASSIC, due_ns=time.monotonic_ns()), True)] * frames


def test_frames_are_held_back_while_the_bus_takes_none_of_those_before(bus, port, said, at):
    heard_of(port)
    cycle(bus)
    taken = [cycle(bus) for k in range(1, 12) if at(40 * k)]
    assert taken[:4] == [3] * 4
    assert sum(taken[4:]) <= 1  # what could pile up in the kernel's queue has an end; one frame is tried
    assert len(said) == 1
    assert "nobody acknowledges" in said[0]


def test_a_bus_that_takes_frames_again_gets_the_next_cycle(bus, port, said, at):
    heard_of(port)
    cycle(bus)
    for k in range(1, 20):
        at(40 * k)
        cycle(bus)
    before = len(port.sent)
    heard_of(port)
    at(800)
    cycle(bus)
    at(840)
    assert cycle(bus) == 3
    assert len(port.sent) - before <= 4
    assert "is back" in said[1]


def test_while_frames_are_held_back_one_is_tried_twice_a_second(bus, port, at):
    heard_of(port)
    cycle(bus)
    tried = [sum(cycle(bus) for k in range(25) if at(1000 * second + 40 * k)) for second in (1, 2, 3, 4)]
    assert tried[1:] == [2, 2, 2]


def test_an_interface_whose_frames_never_come_back_is_never_held(bus, port, at):
    assert all(cycle(bus) == 3 for k in range(100) if at(40 * k))


def test_after_bus_off_nothing_is_waited_for(bus, port, at):
    heard_of(port)
    cycle(bus)
    port.waiting = [(BUS_OFF, False)]
    bus.drain()
    assert [cycle(bus) for k in range(1, 50) if at(40 * k)] == [0] * 49
    port.waiting = [(RESTARTED, False)]
    bus.drain()
    assert [cycle(bus) for k in range(50, 53) if at(40 * k)] == [3] * 3


def test_frames_that_nobody_read_in_time_are_reported(bus, port):
    port.lost = 17
    assert bus.report() == ["17 frames of others on socketcan:can0 were not read in time"]


def test_a_bus_that_refused_nothing_reports_nothing():
    with open_bus("virtual:quiet") as bus:
        bus.send(CLASSIC)
        bus.drain()
        assert bus.report() == []


def test_error_frame_is_refused_like_a_frame_that_the_bus_refuses():
    with open_bus("virtual:error") as bus:
        assert not bus.send(replace(CLASSIC, is_error=True))
        assert "error frame" in bus.report()[0]


def test_error_frames_heard_are_counted_not_returned():
    with (
        open_bus("virtual:disturbed") as bus,
        can.Bus("disturbed", "virtual", ignore_config=True) as disturber,
    ):
        disturber.send(can.Message(is_error_frame=True))
        assert bus.drain() == []
        assert bus.error_frames == 1


def test_a_reader_on_a_virtual_bus_that_does_not_keep_up_refuses_frames_and_holds_nobody_up():
    with open_bus("virtual:slow") as bus, can.Bus("slow", "virtual", ignore_config=True, rx_queue_size=2):
        assert [bus.send(CLASSIC) for _ in range(3)] == [True, True, False]

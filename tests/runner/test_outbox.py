"""Several due times within one image: each group at its own, and what is too late never leaves."""

import pytest

from vsensor.clock import SimulatedClock
from vsensor.runner.outbox import Outbox
from vsensor.timing import Timing
from vsensor.types import Frame, Tick

MS = 1_000_000
PERIOD_NS = 40 * MS
START_NS = 1_000 * MS


class Clock(SimulatedClock):
    """A clock that stalls once, after a deadline, and takes `step_ns` for every look at it."""

    def __init__(self, stall_at_ns=None, stall_ns=0, step_ns=0):
        super().__init__()
        self.stall_at_ns, self.stall_ns, self.step_ns = stall_at_ns, stall_ns, step_ns

    def now_ns(self):
        self._now_ns += self.step_ns
        return self._now_ns

    def sleep_until_ns(self, deadline_ns):
        super().sleep_until_ns(deadline_ns)
        if self.stall_at_ns is not None and deadline_ns >= START_NS + self.stall_at_ns:
            self._now_ns += self.stall_ns
            self.stall_at_ns = None


class Bus:
    """Notes when each frame left, in ms after slot 0."""

    def __init__(self, clock, refuses=()):
        self.clock, self.refuses, self.sent = clock, refuses, []

    def send(self, frame):
        if frame.arbitration_id in self.refuses:
            return False
        self.sent.append((frame.arbitration_id, (self.clock._now_ns - START_NS) / MS))
        return True

    def drain(self):
        return ()

    def confirmed(self):
        return ()


def frame(number, due_ms):
    return Frame(due_ns=round(due_ms * MS), arbitration_id=number, data=b"")


def run(slots, clock=None, refuses=()):
    """Pass the frames of each slot on; returns the bus, the outbox and every slot's lateness in ms."""
    clock = clock or Clock()
    bus = Bus(clock, refuses)
    outbox = Outbox(clock, bus, START_NS, PERIOD_NS, Timing())
    late = []
    for index, frames in enumerate(slots):
        tick = Tick(index=index, t_ns=index * PERIOD_NS, period_ns=PERIOD_NS)
        lateness_ns = outbox.pass_on(tick, frames)
        late.append(None if lateness_ns is None else lateness_ns / MS)
    return bus, outbox, late


def test_frames_due_at_the_slot_leave_at_the_slot_in_their_order():
    bus, _, late = run([[frame(3, 0), frame(1, 0), frame(2, 0)], [frame(3, 40)]])
    assert bus.sent == [(3, 0.0), (1, 0.0), (2, 0.0), (3, 40.0)]
    assert late == [0.0, 0.0]


def test_every_group_of_a_slot_leaves_at_its_own_time():
    slots = [[frame(1, t), frame(2, t + 10), frame(3, t + 10), frame(4, t + 32.5)] for t in (0, 40)]
    bus, _, _ = run(slots)
    assert bus.sent == [
        *[(1, 0.0), (2, 10.0), (3, 10.0), (4, 32.5)],
        *[(1, 40.0), (2, 50.0), (3, 50.0), (4, 72.5)],
    ]


@pytest.mark.parametrize("latency_ms", [5, 39, 40, 60, 200])
def test_a_latency_of_any_length_delays_every_slot_by_it(latency_ms):
    bus, _, late = run([[frame(1, 40 * k + latency_ms)] for k in range(5)])
    assert bus.sent == [(1, 40.0 * k + latency_ms) for k in range(5)]
    assert late == [0.0] * 5


def test_a_frame_delayed_beyond_later_slots_leaves_between_their_frames():
    bus, _, _ = run([[frame(1, 0), frame(9, 95)], [frame(1, 40)], [frame(1, 80)], [frame(1, 120)]])
    assert bus.sent == [(1, 0.0), (1, 40.0), (1, 80.0), (9, 95.0), (1, 120.0)]


def test_a_slot_that_is_more_than_half_a_period_late_is_dropped_with_all_its_groups():
    slots = [[frame(1, 40 * k), frame(2, 40 * k + 30)] for k in range(4)]
    bus, outbox, late = run(slots, Clock(stall_at_ns=40 * MS, stall_ns=21 * MS))
    assert bus.sent == [(1, 0.0), (2, 30.0), (1, 80.0), (2, 110.0), (1, 120.0), (2, 150.0)]
    assert late == [0.0, None, 0.0, 0.0]
    assert outbox.groups_dropped == 0


def test_a_delayed_frame_of_an_earlier_slot_leaves_although_a_later_slot_is_dropped():
    slots = [[frame(1, 0), frame(9, 70)], [frame(1, 40), frame(2, 75)], [frame(1, 80)]]
    bus, _, late = run(slots, Clock(stall_at_ns=40 * MS, stall_ns=21 * MS))
    assert bus.sent == [(1, 0.0), (9, 70.0), (1, 80.0)]
    assert late == [0.0, None, 0.0]


def test_the_latency_is_that_of_the_earliest_frame_so_far():
    bus, _, _ = run([[frame(1, 30)], [frame(1, 40), frame(9, 105)], [frame(1, 80)]])
    assert bus.sent == [(1, 30.0), (1, 40.0), (1, 80.0), (9, 105.0)]


def test_a_slot_that_is_half_a_period_late_is_sent():
    bus, _, late = run([[frame(1, 0)], [frame(1, 40)]], Clock(stall_at_ns=0, stall_ns=20 * MS))
    assert (bus.sent, late) == ([(1, 20.0), (1, 40.0)], [20.0, 0.0])


def test_a_later_group_that_is_too_late_is_dropped_alone_and_counted():
    slots = [[frame(1, 0), frame(2, 10), frame(3, 35)], [frame(1, 40)]]
    bus, outbox, late = run(slots, Clock(stall_at_ns=10 * MS, stall_ns=24 * MS))
    assert bus.sent == [(1, 0.0), (3, 35.0), (1, 40.0)]
    assert outbox.groups_dropped == 1
    assert late == [0.0, 0.0]


def test_a_message_of_a_faster_cycle_is_dropped_when_half_of_that_is_over():
    slots = [[*(frame(1, 40 * k + 10 * n) for n in range(4)), frame(2, 40 * k + 10)] for k in range(2)]
    bus, outbox, _ = run(slots, Clock(stall_at_ns=10 * MS, stall_ns=7 * MS))
    assert [at for number, at in bus.sent if number == 1] == [0.0, 20.0, 30.0, 40.0, 50.0, 60.0, 70.0]
    assert outbox.groups_dropped == 1


def test_messages_with_phases_closer_than_they_are_late_are_all_sent():
    bus, outbox, _ = run(
        [[frame(1, 0), frame(2, 1), frame(3, 2)]], Clock(stall_at_ns=1 * MS, stall_ns=5 * MS)
    )
    assert bus.sent == [(1, 0.0), (2, 6.0), (3, 6.0)]
    assert outbox.groups_dropped == 0


def test_after_a_stall_nothing_that_is_past_is_sent_in_a_burst():
    bus, _, late = run([[frame(1, 40 * k)] for k in range(8)], Clock(stall_at_ns=40 * MS, stall_ns=150 * MS))
    assert bus.sent == [(1, 0.0), (1, 190 + 10), (1, 240.0), (1, 280.0)]
    assert late.count(None) == 4


def test_a_slot_without_frames_waits_for_its_time_and_can_be_late():
    clock = Clock(stall_at_ns=40 * MS, stall_ns=30 * MS)
    bus, _, late = run([[frame(1, 0)], [], [frame(1, 80)]], clock)
    assert late == [0.0, None, 0.0]
    assert bus.sent == [(1, 0.0), (1, 80.0)]


def test_a_slot_without_frames_is_not_late_where_frames_have_a_latency():
    _, _, late = run([[frame(1, 90)], [], [frame(1, 170)]])
    assert late == [0.0] * 3


def test_what_was_taken_by_the_bus_is_told_once_in_the_order_of_leaving():
    _, outbox, _ = run([[frame(2, 10), frame(1, 0), frame(3, 10)]], refuses={2})
    assert [f.arbitration_id for f in outbox.taken_away()] == [1, 3]
    assert outbox.taken_away() == ()
    assert outbox.frames_refused == 1


def test_burst_and_lateness_are_measured_for_each_group():
    clock = Clock(step_ns=1000)
    outbox = Outbox(clock, Bus(clock), START_NS, PERIOD_NS, timing := Timing())
    outbox.pass_on(Tick(index=0, t_ns=0, period_ns=PERIOD_NS), [frame(1, 0), frame(2, 10)])
    assert list(timing.lateness) == [1000, 1000]
    assert list(timing.burst) == [1000, 1000]

"""What a gateway sends and when, on a simulated clock: buses that are scripts, a sensor that is told."""

from contextlib import nullcontext

import pytest

from tests.replay.laying import CAMERA, PERIOD_NS, Told
from tests.replay.playing import MS
from vsensor.bus import open_bus
from vsensor.cli import main
from vsensor.clock import SimulatedClock
from vsensor.errors import SessionError
from vsensor.gateway.loop import Gateway, Sensor
from vsensor.types import Frame

START_NS = 100 * MS
KEYS = frozenset((number, False) for number in CAMERA)
SPEED_ID = 0x100


class Script:
    """A bus on which frames of others arrive at their due_ns; keeps (time in ms, frame) of what is sent."""

    def __init__(self, clock, frames=(), cost_ns=0):
        self.clock, self.waiting, self.cost_ns = clock, sorted(frames, key=lambda f: f.due_ns), cost_ns
        self.sent = []

    def send(self, frame):
        self.clock.sleep_until_ns(self.clock.now_ns() + self.cost_ns)
        self.sent.append((self.clock.now_ns() / MS, frame))
        return True

    def drain(self):
        now_ns = self.clock.now_ns()
        here = [frame for frame in self.waiting if frame.due_ns <= now_ns]
        self.waiting = self.waiting[len(here) :]
        return here

    def next_ns(self):
        return self.waiting[0].due_ns if self.waiting else 1 << 62

    def ids(self):
        return [frame.arbitration_id for _, frame in self.sent]


class Slow(Told):
    """Answers `takes_ns` after it was asked; `more_ns`: for some images."""

    def __init__(self, clock, takes_ns=3 * MS, more_ns=None):
        super().__init__()
        self.clock, self.takes_ns, self.more_ns, self.ready_ns = clock, takes_ns, more_ns or {}, []
        self.asked_ms = []

    def ask(self, wish):
        super().ask(wish)
        self.asked_ms.append(self.clock.now_ns() / MS)
        takes_ns = self.more_ns.get(wish.number, self.takes_ns)
        self.ready_ns.append(max(self.clock.now_ns() + takes_ns, *self.ready_ns[-1:], 0))

    @property
    def is_ready(self):
        return bool(self.ready_ns) and self.clock.now_ns() >= self.ready_ns[0]

    def answer(self):
        assert self.is_ready, "the gateway would wait for an image"
        self.ready_ns.pop(0)
        return super().answer()


class Bench:
    """A gateway between two scripts; `run` until a time of the clock, in ms."""

    def __init__(self, near=(), far=(), heard=frozenset(), cost_ns=0, both_ways=False, **desk):
        self.clock = SimulatedClock()
        self.near, self.far = Script(self.clock, near, cost_ns), Script(self.clock, far, cost_ns)
        self.desk = Slow(self.clock, **desk)
        sensor = Sensor(period_ns=PERIOD_NS, keys=KEYS, heard=heard)
        self.gateway = Gateway(
            self.near,
            self.far,
            self.desk,
            sensor,
            self.clock,
            self.wait,
            start_ns=START_NS,
            both_ways=both_ways,
        )

    def wait(self, until_ns):
        answer_ns = self.desk.ready_ns[0] if self.desk.ready_ns else 1 << 62
        self.clock.sleep_until_ns(min(until_ns, answer_ns, self.near.next_ns(), self.far.next_ns()))
        now_ns = self.clock.now_ns()
        return self.near.next_ns() <= now_ns, self.far.next_ns() <= now_ns

    def run(self, until_ms):
        while self.clock.now_ns() < until_ms * MS:
            self.gateway.advance()
        return self

    def images(self):
        """Return (ms after slot 0, number) of the images sent."""
        own = [(ms, frame) for ms, frame in self.far.sent if frame.arbitration_id == CAMERA[0]]
        return [(ms - START_NS / MS, int.from_bytes(frame.data, "big")) for ms, frame in own]


def frame(ms, number, data=b""):
    return Frame(due_ns=round(ms * MS), arbitration_id=number, data=data)


def test_a_frame_is_passed_on_when_it_arrives_also_while_an_image_is_computed():
    times = [10 + 0.7 * k for k in range(300)]
    bench = Bench([frame(ms, 0x400 + k) for k, ms in enumerate(times)], takes_ns=35 * MS).run(300)
    passed = [(ms, one.arbitration_id) for ms, one in bench.far.sent if one.arbitration_id >= 0x400]
    assert [number for _, number in passed] == [0x400 + k for k in range(300)]
    assert [ms for ms, _ in passed] == pytest.approx(times)
    assert bench.gateway.ways.latency.max_ns == 0


def test_latency_is_the_time_from_arrival_to_after_sending():
    bench = Bench([frame(50, 1), frame(60, 2)], cost_ns=200_000).run(90)
    assert list(bench.gateway.ways.latency) == [200_000, 200_000]


def test_an_image_leaves_at_each_slot():
    bench = Bench().run(500)
    assert bench.images() == [(40.0 * k, k) for k in range(10)]
    assert list(bench.gateway.ways.lateness) == [0] * 10


def test_frames_with_the_sensors_ids_are_not_passed_on_in_either_direction():
    bench = Bench([frame(20, CAMERA[0]), frame(21, 1)], [frame(22, CAMERA[1]), frame(23, 2)], both_ways=True)
    bench.run(90)
    assert (bench.far.ids(), bench.near.ids()) == ([1], [2])
    assert bench.gateway.ways.left_out == 1


def test_without_both_ways_nothing_comes_back():
    bench = Bench((), [frame(20, 1)]).run(90)
    assert bench.near.sent == []


def test_an_image_that_comes_too_late_is_not_sent_and_the_next_one_is_told_so():
    bench = Bench(more_ns={2: 55 * MS}).run(500)
    assert [k for _, k in bench.images()] == [0, 1, 4, 5, 6, 7, 8, 9]
    assert [number for number, wish in bench.desk.wishes.items() if wish.is_lost] == [4]
    assert bench.gateway.ways.lost == 2  # itself, and the slot that passed meanwhile


def test_a_desk_that_is_too_slow_makes_fewer_images_not_none():
    bench = Bench(takes_ns=45 * MS).run(1000)
    assert [k for _, k in bench.images()] == list(range(0, 24, 2))


def test_an_image_that_comes_a_little_late_is_sent_late():
    bench = Bench(more_ns={2: 38 * MS}).run(300)
    assert bench.images()[2] == (80.0 + 8.0, 2)
    assert bench.gateway.ways.lost == 0


def test_what_is_heard_on_either_bus_until_it_is_asked_for_moves_the_vehicle():
    heard = frozenset({(SPEED_ID, False), (0x300, False)})
    near = [frame(100 + 5 * k, SPEED_ID) for k in range(8)]
    bench = Bench(near, [frame(131, 0x300)], heard=heard).run(300)
    told = {k: [(f.arbitration_id, f.due_ns / MS) for f in w.heard] for k, w in bench.desk.wishes.items()}
    assert told[1] == [(SPEED_ID, 0.0), (SPEED_ID, 5.0), (SPEED_ID, 10.0)]  # 30 ms before its slot
    late = [(SPEED_ID, 15.0), (SPEED_ID, 20.0), (SPEED_ID, 25.0), (SPEED_ID, 30.0), (0x300, 31.0)]
    assert told[2] == [*late, (SPEED_ID, 35.0)]


def test_frames_that_arrive_while_an_image_is_sent_go_between_its_frames():
    bench = Bench([frame(100.1, 1)], cost_ns=200_000)
    bench.desk.frames = 13
    bench.run(120)
    ids = bench.far.ids()
    assert 0 < ids.index(1) < len(ids) - 1


def test_a_sensor_that_stands_still_is_an_error_in_one_line():
    with pytest.raises(SessionError, match=r"has stood still for 2\.04 s"):
        Bench(takes_ns=10**12).run(5000)


def test_the_command_passes_on_and_sends_images_that_an_ecu_reads(capsys, monkeypatch):
    from vsensor.profile import load_profile

    words = ["--in", "virtual:gwi", "--out", "virtual:gwo", "--overlay", "highway", "--duration", "120"]
    frames = []
    with open_bus("virtual:gwi", echo=False) as car, open_bus("virtual:gwo", echo=False) as ecu:

        def has_an_image():
            frames.extend(ecu.drain())
            return len({one.arbitration_id for one in frames}) == 13

        monkeypatch.setattr("vsensor.cli.playing.stop_signals", lambda: nullcontext(has_an_image))
        assert main(["gateway", *words]) == 130
        assert car.drain() == []
    native = load_profile("native")
    assert all(native.decode(one, check=True) is not None for one in frames)
    printed = capsys.readouterr().out
    assert "0 frames virtual:gwi -> virtual:gwo, 0 with the sensor's ids left out" in printed
    assert "lateness of the first frame of an image: p50" in printed


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--in", "virtual:a", "--out", "virtual:a", "--overlay", "highway"), "two different buses"),
        (("--in", "nosuch0", "--out", "virtual:a", "--overlay", "highway"), "nosuch0"),
        (("--in", "virtual:a", "--out", "virtual:b", "--overlay", "log.log"), "a map was expected"),
    ],
)
def test_what_cannot_be_is_refused_in_one_line(words, said, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "log.log").write_text("(1.000000) can0 100#00\n")
    assert main(["gateway", *words]) == 2
    assert said in capsys.readouterr().err.strip().splitlines()[-1]

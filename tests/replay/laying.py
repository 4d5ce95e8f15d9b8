"""A sensor that is told instead of computed, and a drive with motion frames to lay a real one over."""

from fractions import Fraction

from tests.replay.playing import Bus, reel_of
from tests.vehicle_frames import Gateway
from vsensor.clock import SimulatedClock
from vsensor.logs import open_log_writer
from vsensor.overlay import Made
from vsensor.replay.overlaid import Lay, Overlaid
from vsensor.replay.player import Player
from vsensor.types import Frame

PERIOD_NS = 40_000_000
T0 = 1_700_000_000_000_000_000
CAMERA = (0x320, 0x321)


class Told:
    """A desk that keeps the wishes; image k is two frames of data k, the second due `after_ns` later."""

    def __init__(self, after_ns=0):
        self.wishes, self.after_ns, self.frames, self._made = {}, after_ns, len(CAMERA), []

    def ask(self, wish):
        assert wish.number > max(self.wishes, default=-1), "asked out of order"
        self.wishes[wish.number] = wish
        due_ns, data = wish.number * PERIOD_NS, wish.number.to_bytes(2, "big")
        frames = tuple(
            Frame(due_ns=due_ns + k * self.after_ns, arbitration_id=number, data=data)
            for k, number in enumerate((CAMERA * self.frames)[: self.frames])
        )
        self._made.append(Made(wish.number, frames))

    def answer(self):
        return self._made.pop(0)

    @property
    def is_ready(self):
        return bool(self._made)

    def rewind(self, number):
        self.wishes = {k: wish for k, wish in self.wishes.items() if k < number}
        self._made = [made for made in self._made if made.number < number]

    def remarks(self):
        return ()


def lay(speed=1, **more):
    keys = frozenset((number, False) for number in CAMERA)
    return Lay(PERIOD_NS, Fraction(speed), 0, keys, **more)


def laid_player(path, *, speed=1, desk=None, heard=frozenset(), real_time=True, clock=None, **wishes):
    """A player of a log with a told sensor over it; returns it, its bus and its desk."""
    clock, desk = clock or SimulatedClock(), desk or Told()
    bus = Bus(clock)
    reel = Overlaid(reel_of(path, **wishes), desk, lay(speed, heard=heard))
    return Player(reel, bus, clock, real_time=real_time), bus, desk


def write_drive(path, seconds=4.0, speed_mps=20.0, yaw_rate=lambda t_s: 0.0, others=()):
    """A log of VEH_Motion every 20 ms, and of `others` (id) 5 ms after each."""
    gateway = Gateway()
    with open_log_writer(path) as writer:
        for k in range(round(seconds * 50)):
            writer.write(gateway.motion(T0 + k * 20_000_000, speed_mps, yaw_rate(k * 0.02)))
            for number in others:
                data = k.to_bytes(4, "big")
                writer.write(Frame(due_ns=T0 + k * 20_000_000 + 5_000_000, arbitration_id=number, data=data))
    return path

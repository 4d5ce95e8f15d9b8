"""A log of a few frames, a bus that records, and a player on a simulated clock."""

from vsensor.clock import SimulatedClock
from vsensor.replay.choice import choice
from vsensor.replay.player import Player, played
from vsensor.replay.reading import survey
from vsensor.replay.reel import Reel

MS = 1_000_000
EVERYTHING = choice((), (), (), None)


def write_log(path, times_ms, ids=None):
    """A candump log of frames at these times; frame k has id k (or ids[k]) and the data k."""
    lines = []
    for k, t_ms in enumerate(times_ms):
        t_us = round(t_ms * 1000)
        number = k if ids is None else ids[k]
        lines.append(f"({t_us // 10**6}.{t_us % 10**6:06d}) can0 {number:03X}#{k % 256:02X}\n")
    path.write_text("".join(lines))
    return path


class Bus:
    """Records (time of the clock in ms, id) of what is sent; `refuses` are ids that it does not take."""

    def __init__(self, clock, refuses=(), cost_ns=0):
        self.clock, self.refuses, self.cost_ns = clock, refuses, cost_ns
        self.sent, self.frames, self.drained = [], [], 0

    def send(self, frame):
        if frame.arbitration_id in self.refuses:
            return False
        self.sent.append((self.clock.now_ns() / MS, frame.arbitration_id))
        self.frames.append(frame)
        self.clock.sleep_until_ns(self.clock.now_ns() + self.cost_ns)
        return True

    def drain(self):
        self.drained += 1
        return []

    @property
    def ids(self):
        return [number for _, number in self.sent]


def reel_of(path, **wishes):
    wishes.setdefault("choice", EVERYTHING)
    return Reel(path, survey(path, getattr(wishes.get("cut"), "rate_hz", None)), **wishes)


def player_of(path, *, stages=(), record=None, refuses=(), cost_ns=0, **wishes):
    """A player at time 0 of a simulated clock; returns it and its bus."""
    clock = SimulatedClock()
    bus = Bus(clock, refuses, cost_ns)
    player = Player(reel_of(path, **wishes), bus, clock, stages=stages, record=record)
    return player, bus


def play(player, until_ms=None):
    """Play to the end, or until the clock shows a time; returns the player's report."""
    clock = player._clock
    for _ in played(player, lambda: until_ms is not None and clock.now_ns() >= until_ms * MS):
        pass
    return player.report

"""The gateway itself: what arrives is passed on at once, what is due is sent, everything else waits.

    in ──► camera's ids out ──► out     slot k - 3/4 cycle   what was heard until then goes to the desk
     ▲                           │      slot k               its image is sent, if it is there by then
     └────────── (both ways) ────┘      slot k + 1/2 cycle   an image that is not there now is lost

While an image is not there, no other one is asked for: a desk that is too slow makes fewer, not none. One
thread that sleeps until a frame arrives or something is due. Images are computed elsewhere, so that no frame
waits for one.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from msgspec.structs import replace

from vsensor.clock import Clock
from vsensor.errors import SessionError
from vsensor.overlay import Desk, Wish
from vsensor.timing import Samples
from vsensor.types import Frame

STUCK = 50
"""Slots that passed while an image was computed: the process that does so stands still."""
IN_A_ROW = 4
"""Frames of an image that are sent between two looks at what has arrived."""


class Bus(Protocol):
    """What the gateway needs of a bus; see vsensor.bus.FrameBus."""

    def send(self, frame: Frame) -> bool:
        """Send now; False if the bus refused the frame (counted, never raised)."""
        ...

    def drain(self) -> Sequence[Frame]:
        """Return what has arrived since the last call, `due_ns` its receive time by the clock."""
        ...


@dataclass(slots=True)
class Ways:
    """What a gateway did; `latency`: receive time (the kernel's, if it tells) to after the send call."""

    passed: int = 0
    back: int = 0
    left_out: int = 0  # frames with the sensor's ids
    refused: int = 0
    images: int = 0
    lost: int = 0  # images that were made too late
    latency: Samples = field(default_factory=Samples)
    back_latency: Samples = field(default_factory=Samples)
    lateness: Samples = field(default_factory=Samples)  # of an image's first frame

    def lines(self, names: tuple[str, str]) -> list[str]:
        """Return it as a person reads it; `names` are those of the buses, in and out."""
        near, far = names
        said = [f"{self.passed} frames {near} -> {far}, {self.left_out} with the sensor's ids left out"]
        if self.passed:
            said.append(f"latency, receive time to sent: {self.latency.text()}")
        if self.back:
            said.append(f"{self.back} frames {far} -> {near}; latency: {self.back_latency.text()}")
        said.append(f"{self.images} images sent, {self.lost} lost because they were computed too late")
        if self.images:
            said.append(f"lateness of the first frame of an image: {self.lateness.text()}")
        return said


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensor:
    """The sensor's cycle, its messages (id, is 29-bit), and those that move its vehicle."""

    period_ns: int
    keys: frozenset[tuple[int, bool]]
    heard: frozenset[tuple[int, bool]] = frozenset()


class Gateway:
    """Between two buses; `advance` for ever. Slot 0 is at `start_ns` of the clock."""

    def __init__(
        self,
        near: Bus,
        far: Bus,
        desk: Desk,
        sensor: Sensor,
        clock: Clock,
        wait: Callable[[int], tuple[bool, bool]],
        *,
        start_ns: int,
        both_ways: bool = False,
    ) -> None:
        """`wait(until_ns)` sleeps until then, or until something arrives on a bus or at the desk.

        It returns whether there may be something on `near`, and on `far`.
        """
        self.ways = Ways()
        self._near, self._far, self._desk, self._sensor = near, far, desk, sensor
        self._clock, self._wait, self._start_ns, self._both_ways = clock, wait, start_ns, both_ways
        self._lead_ns, self._late_ns = sensor.period_ns * 3 // 4, sensor.period_ns // 2
        self._next = 0  # number of the next slot
        self._asked: int | None = None  # number of the image that is computed
        self._is_lost = False  # whether the latest image was
        self._arrived = (True, True)  # whether there may be something on the buses
        self._heard: list[Frame] = []
        self._due: list[Frame] = []  # frames of images, in the order of their times; due_ns of the clock
        self._firsts: list[int] = []  # due times of images whose first frame is not sent

    def advance(self) -> None:
        """Do what is to be done now, then sleep until there is more."""
        self._pass()
        now_ns = self._clock.now_ns()
        while now_ns >= self._ask_ns():
            self._arrived = (True, True)  # once an image: there an outage of a bus begins or ends
            self._pass()
            self._ask()
        self._collect()
        self._send_due(now_ns)
        self._arrived = self._wait(min(self._ask_ns(), self._due[0].due_ns if self._due else self._ask_ns()))

    def _slot_ns(self, number: int) -> int:
        return self._start_ns + number * self._sensor.period_ns

    def _ask_ns(self) -> int:
        return self._slot_ns(self._next) - self._lead_ns

    def _pass(self) -> None:
        """Pass on what has arrived."""
        near, far = self._arrived
        arrived = self._near.drain() if near else ()
        if arrived:
            rest = [frame for frame in arrived if _key(frame) not in self._sensor.keys]
            self.ways.left_out += len(arrived) - len(rest)
            self.ways.passed += self._handed_on(rest, self._far, self.ways.latency)
            self._hear(rest)
        returned = self._far.drain() if far else ()
        if returned:
            self._hear(returned)
            if self._both_ways:
                rest = [frame for frame in returned if _key(frame) not in self._sensor.keys]
                self.ways.back += self._handed_on(rest, self._near, self.ways.back_latency)

    def _handed_on(self, frames: Sequence[Frame], bus: Bus, latency: Samples) -> int:
        """Send frames; those that were read together count as sent when the last one is."""
        taken = sum(bus.send(frame) for frame in frames)
        self.ways.refused += len(frames) - taken
        now_ns = self._clock.now_ns()
        for frame in frames:
            latency.add(now_ns - frame.due_ns)
        return taken

    def _hear(self, frames: Sequence[Frame]) -> None:
        self._heard += [
            replace(frame, due_ns=frame.due_ns - self._start_ns)
            for frame in frames
            if _key(frame) in self._sensor.heard
        ]

    def _ask(self) -> None:
        """Ask for the next slot's image; while one is computed, the slot is lost."""
        self._collect()
        number, self._next = self._next, self._next + 1
        if self._asked is not None:
            self.ways.lost += 1
            if number - self._asked > STUCK:
                seconds = (number - self._asked) * self._sensor.period_ns / 1e9
                raise SessionError(f"the sensor's process has stood still for {seconds:g} s")
            return
        heard = tuple(self._heard)
        self._heard.clear()
        self._desk.ask(Wish(number, is_lost=self._is_lost, heard=heard))
        self._asked = number

    def _collect(self) -> None:
        """Take the image that was asked for, if it is there; half a cycle after its slot it is too late."""
        if self._asked is None or not self._desk.is_ready:
            return
        made = self._desk.answer()
        self._is_lost = self._clock.now_ns() > self._slot_ns(self._asked) + self._late_ns
        self._asked = None
        if self._is_lost:
            self.ways.lost += 1
        elif made.frames:
            frames = [replace(one, due_ns=one.due_ns + self._start_ns) for one in made.frames]
            self._due = sorted((*self._due, *frames), key=_due_ns)
            self._firsts.append(frames[0].due_ns)

    def _send_due(self, now_ns: int) -> None:
        """Send the frames whose time has come; what arrives meanwhile goes between them."""
        while self._due and self._due[0].due_ns <= now_ns:
            if self._firsts and self._due[0].due_ns >= self._firsts[0]:
                self.ways.lateness.add(now_ns - self._firsts.pop(0))
                self.ways.images += 1
            some = [frame for frame in self._due[:IN_A_ROW] if frame.due_ns <= now_ns]
            del self._due[: len(some)]
            self.ways.refused += sum(not self._far.send(frame) for frame in some)
            if self._due and self._due[0].due_ns <= now_ns:
                self._arrived = (True, False)
                self._pass()


def _key(frame: Frame) -> tuple[int, bool]:
    return frame.arbitration_id, frame.is_extended


def _due_ns(frame: Frame) -> int:
    return frame.due_ns

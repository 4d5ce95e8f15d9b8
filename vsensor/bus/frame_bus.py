"""The bus as the loop sees it: send, hear, and no exception whatever happens to the interface."""

import time
from collections import deque
from collections.abc import Callable

import can

from vsensor.bus.ports import Port, Times
from vsensor.bus.silence import Silence
from vsensor.bus.trouble import Outages, reason_of
from vsensor.types import Frame

CAN_ERR_BUSOFF, CAN_ERR_RESTARTED = 0x40, 0x100  # classes of error frames (linux/can/error.h)
UNCONFIRMED = 4  # a frame comes back at once, or one or two cycles later where the kernel is busy
CLOCKS_APART_NS = 50_000  # a stamp is brought from the wall clock to the monotonic one


def nobody(text: str) -> None:
    """Say something to nobody."""


class FrameBus:
    """An open bus. Frames that it refuses are counted and never sent later; the cycle goes on.

    `tell` sets who hears of trouble when it happens; `report` sums it up.
    """

    def __init__(self, port: Port, name: str, *, is_simulated: bool, remark: str = "") -> None:
        self.name = name
        self.is_simulated = is_simulated
        self.remark = remark  # why "auto" did not take a vcan0 that is there
        self.frames_refused = 0
        self.error_frames = 0
        self.foreign: dict[int, int] = {}  # id of ours -> frames that somebody else sent with it
        self._port = port
        self._say: Callable[[str], None] = nobody
        self._outages = Outages(name, lambda text: self._say(text))
        self._bus_off, self._may_mend = False, True
        self._silence = Silence()
        self._cycle_ns: int | None = None  # when this cycle's first frame was handed over
        self._sent: dict[tuple[int, bool], deque[tuple[int, int]]] = {}  # id, is 29-bit -> its latest frames
        self._confirmed: list[tuple[int, int]] = []

    def __enter__(self) -> "FrameBus":
        """Return this bus; leaving the block closes it."""
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def tell(self, say: Callable[[str], None]) -> None:
        """Tell `say` when trouble begins and when it is over, a sentence each."""
        self._say = say

    def send(self, frame: Frame) -> bool:
        """Send now, whatever `frame.due_ns` says; False if the bus refused the frame."""
        if self._cycle_ns is None:  # read once a cycle: in a user-mode kernel that takes some 10 us
            self._cycle_ns = time.monotonic_ns()
        try:
            self._hand_over(frame, self._cycle_ns)
        except (can.CanError, OSError, ValueError) as problem:
            self.frames_refused += 1
            self._outages.refused(reason_of(problem, self.name.partition(":")[2]), self._cycle_ns)
            return False
        if self._outages.is_out:
            self._outages.taken(self._cycle_ns)
        key = frame.arbitration_id, frame.is_extended
        if key not in self._sent:
            self._sent[key] = deque(maxlen=UNCONFIRMED)
        self._sent[key].append((self._cycle_ns, frame.due_ns))
        return True

    def drain(self) -> list[Frame]:
        """Return what has arrived since the last call, in order; `due_ns` is the receive time.

        Call it once a cycle, after the cycle's frames: here an outage begins or ends. Receive times are
        CLOCK_MONOTONIC, from the kernel's or adapter's stamp where that counts from 1970, else the time
        of this call. Error frames are counted in `error_frames`.
        """
        times = Times.read()
        heard: list[Frame] = []
        try:
            for frame, is_own in self._port.received(times):
                if self._concerns_others(frame, is_own):
                    heard.append(frame)
        except (can.CanError, OSError):  # the interface went down: sending tells that, too
            self._bus_off = False
            self._silence.forget()
        self._silence.cycle_ends(self._cycle_ns)
        self._outages.cycle_ends(times.now_ns)
        self._may_mend, self._cycle_ns = True, None
        return heard

    def confirmed(self) -> list[tuple[int, int]]:
        """Return (`due_ns` of the frame, time it was on the bus by the kernel's clock) since the last call.

        Only interfaces that say so (SocketCAN) have any; times are CLOCK_MONOTONIC.
        """
        confirmed, self._confirmed = self._confirmed, []
        return confirmed

    def report(self) -> list[str]:
        """Return what went wrong and how often, a line for each kind of trouble."""
        foreign = ", ".join(f"0x{number:X} x {count}" for number, count in sorted(self.foreign.items()))
        lost = self._port.lost
        lines = {
            self._outages.text(): self._outages.count,
            f"another node on {self.name} sent frames with our ids: {foreign}": foreign,
            f"error frames heard on {self.name}: {self.error_frames}": self.error_frames,
            f"{lost} frames of others on {self.name} were not read in time": lost,
        }
        return [line for line, happened in lines.items() if happened]

    def fileno(self) -> int:
        """Return the descriptor that is readable when something has arrived, -1 if the interface has none."""
        return self._port.fileno()

    def close(self) -> None:
        """Release the interface; closing twice does no harm."""
        self._port.close()

    def _hand_over(self, frame: Frame, now_ns: int) -> None:
        if frame.is_error:
            raise ValueError("an error frame cannot be sent")
        if self._bus_off:  # a controller that is bus-off, or its queue, would send it when it is back
            self._silence.forget()
            channel = self.name.partition(":")[2]
            raise ValueError(f"controller is bus-off: ip link set {channel} type can restart-ms 100")
        if self._silence.holds_back(now_ns):
            raise ValueError("nobody acknowledges: no other node, or another bit rate")
        try:
            self._port.put(frame)
        except (can.CanError, OSError) as problem:
            self._silence.forget()
            if not self._may_mend:
                raise
            self._may_mend = False  # once a cycle: no cycle is spent on opening sockets
            if not self._port.mend(problem):
                raise
            self._port.put(frame)

    def _concerns_others(self, frame: Frame, is_own: bool) -> bool:
        """Keep books on a received frame; returns whether who listens on the bus should get it."""
        if frame.is_error:
            self.error_frames += 1
            self._bus_off = bool(frame.arbitration_id & CAN_ERR_BUSOFF) or (
                self._bus_off and not frame.arbitration_id & CAN_ERR_RESTARTED
            )
            return False
        self._bus_off = False  # a controller that is bus-off hears nothing
        key = frame.arbitration_id, frame.is_extended
        if is_own:
            self._silence.comes_back()
            self._confirm(key, frame.due_ns)
            return self._port.hears_itself
        if key in self._sent:
            self._count_foreign(frame.arbitration_id)
        return True

    def _confirm(self, key: tuple[int, bool], stamp_ns: int) -> None:
        """Find the frame that was on the bus at `stamp_ns`: the latest one handed over before."""
        if self._port.hears_itself:  # stamped by python-can when it was told to send
            return
        sent = self._sent.get(key, ())
        before = [due_ns for sent_ns, due_ns in sent if sent_ns <= stamp_ns + CLOCKS_APART_NS]
        if before:
            self._confirmed.append((before[-1], stamp_ns))

    def _count_foreign(self, number: int) -> None:
        if not self.foreign:
            self._say(f"another node on {self.name} sends 0x{number:X}, too, which is ours: ECUs hear both")
        self.foreign[number] = self.foreign.get(number, 0) + 1

"""How long a frame occupies the bus, and what part of the time a profile's frames do.

Classic CAN (ISO 11898-1), n data bytes, g = 34 or (29-bit id) 54 bits of start, id, control and CRC that can
be stuffed, 13 that cannot (CRC delimiter, acknowledgement, end, gap). After the first bit every four may be
followed by a stuff bit: at worst 8 n + g + 13 + floor((8 n + g - 1) / 4) (Davis, Burns, Bril, Lukkien 2007).

CAN FD: 17 or 36 bits up to the switch of the bit rate, stuffed as above; then 5 bits (error state, length)
and the data, stuffed; 4 bits of stuff count and a CRC of 17 (up to 16 bytes) or 21 with a fixed stuff bit
before every fourth; and the same 13 bits, at the nominal rate again.
"""

from dataclasses import dataclass

from vsensor.profile import MessagePlan

_TAIL = 13
_NANOSECONDS = 1e9


@dataclass(frozen=True, slots=True, kw_only=True)
class BusSpeed:
    """Bit rates of a bus: nominal, and that of CAN FD's data phase."""

    nominal_bps: float = 500e3
    data_bps: float = 2e6

    def text(self, is_fd: bool) -> str:
        """Return the bit rates as a person says them."""
        data = f" ({_rate(self.data_bps)} data)" if is_fd else ""
        return f"{_rate(self.nominal_bps)}{data}"


DEFAULT_SPEED = BusSpeed()


def frame_s(
    length: int, speed: BusSpeed, *, is_fd: bool, switches: bool, is_extended: bool, stuffed: bool
) -> float:
    """Return the seconds that a frame of `length` bytes occupies, with the most stuff bits or with none."""
    if not is_fd:
        head = 54 if is_extended else 34
        return (8 * length + head + _TAIL + (8 * length + head - 1) // 4 * stuffed) / speed.nominal_bps
    head, body = 36 if is_extended else 17, 5 + 8 * length
    crc = 4 + (17 if length <= 16 else 21)
    crc += -(-crc // 4)  # fixed stuff bits are always there
    in_head = (head - 1) // 4
    in_body = (head + body - 1) // 4 - in_head
    nominal = head + _TAIL + in_head * stuffed
    data = body + crc + in_body * stuffed
    return nominal / speed.nominal_bps + data / (speed.data_bps if switches else speed.nominal_bps)


def frames_per_s(plan: MessagePlan) -> float:
    """Return how often time alone sends a message, while it is active if it then goes faster."""
    sending = plan.sending
    cycle_ns = min([t for t in (sending.cycle_ns, sending.fast_cycle_ns) if t], default=0)
    pages = len(plan.pages) if plan.mux == "together" else 1
    return pages * _NANOSECONDS / cycle_ns if cycle_ns else 0.0


def load(plans: tuple[MessagePlan, ...], speed: BusSpeed, *, stuffed: bool) -> float:
    """Return the part of the time, 1 = all, that the frames of some messages occupy."""
    return sum(
        frames_per_s(plan)
        * frame_s(
            plan.layout.length + len(plan.padding),
            speed,
            is_fd=plan.layout.is_fd,
            switches=plan.bitrate_switch,
            is_extended=plan.layout.is_extended,
            stuffed=stuffed,
        )
        for plan in plans
    )


def _rate(bps: float) -> str:
    return f"{bps / 1e6:g} Mbit/s" if bps >= 1e6 else f"{bps / 1e3:g} kbit/s"

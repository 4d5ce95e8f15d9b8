"""How many bits of the bus a frame takes.

Classic CAN (ISO 11898-1): of n data bytes 8 n + 34 bits that can be stuffed (54 with a 29-bit id) and 13 that
cannot, gap between frames included; after the first, every fourth may be followed by a stuff bit. CAN FD: 17
(36) bits up to the switch of the bit rate, then 5 and the data, stuffed; a stuff count of 4 and a CRC of 17
(over 16 bytes 21) with a fixed stuff bit before every fourth; 13 at the nominal rate.
"""

import numpy as np

from vsensor.logs.table import BITRATE_SWITCH, ERROR, EXTENDED, FD, REMOTE, Columns
from vsensor.types import Array

_TAIL = 13
_ERROR_BITS = 6 + 6 + 8 + 3
"""Error flag, its echo, delimiter, gap: at most; the part of the frame before it is not known."""


def bits_of(columns: Columns, *, stuffed: bool) -> tuple[Array, Array]:
    """Return bits at the nominal and at the data bit rate (N,), with the most stuff bits or with none."""
    extended = columns.flags & EXTENDED != 0
    data_bits = 8.0 * np.where(columns.flags & REMOTE, 0, columns.length)
    head = np.where(extended, 54, 34)
    classic = data_bits + head + _TAIL + (data_bits + head - 1) // 4 * stuffed
    fd_head = np.where(extended, 36, 17)
    crc = np.where(columns.length <= 16, 21, 25)
    crc = crc + -(-crc // 4)
    body = 5 + data_bits
    in_head = (fd_head - 1) // 4
    fd_nominal = fd_head + _TAIL + in_head * stuffed
    fd_data = body + crc + ((fd_head + body - 1) // 4 - in_head) * stuffed
    is_fd, switches = columns.flags & FD != 0, columns.flags & BITRATE_SWITCH != 0
    nominal = np.where(is_fd, fd_nominal + np.where(switches, 0.0, fd_data), classic)
    fast = np.where(is_fd & switches, fd_data, 0.0)
    error = columns.flags & ERROR != 0
    return np.where(error, float(_ERROR_BITS), nominal), np.where(error, 0.0, fast)

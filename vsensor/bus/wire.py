"""Frames as SocketCAN carries them: struct can_frame and struct canfd_frame of linux/can.h.

byte 0..3  id, with flags for 29-bit ids, remote and error frames
byte 4     length of the data
byte 5     flags of CAN FD (0 in a classic frame)
byte 8..   data: 8 bytes, or 64 of CAN FD
"""

import struct

from vsensor.types import Frame

CAN_EFF_FLAG = 0x80000000  # 29-bit identifier
CAN_RTR_FLAG = 0x40000000
CAN_ERR_FLAG = 0x20000000
CANFD_BRS, CANFD_ESI, CANFD_FDF = 0x01, 0x02, 0x04  # flags of struct canfd_frame
CANFD_SIZE = 72  # a classic frame has 16
_EXTENDED_ID, _STANDARD_ID = 0x1FFFFFFF, 0x7FF
_CLASSIC, _FD = struct.Struct("=IBxxx8s"), struct.Struct("=IBBxx64s")
_HEAD = struct.Struct("=IBB")


def to_wire(frame: Frame) -> bytes:
    """Return what a raw CAN socket sends for a frame; raises ValueError if it has too many bytes."""
    can_id = frame.arbitration_id | (CAN_EFF_FLAG if frame.is_extended else 0)
    can_id |= CAN_RTR_FLAG if frame.is_remote else 0
    length = len(frame.data)
    if length > (64 if frame.is_fd else 8):
        raise ValueError(f"frame {frame.arbitration_id:#x} has {length} bytes of data, too many")
    if not frame.is_fd:
        return _CLASSIC.pack(can_id, length, frame.data)
    flags = CANFD_FDF | (CANFD_BRS if frame.bitrate_switch else 0)
    flags |= CANFD_ESI if frame.error_state_indicator else 0
    return _FD.pack(can_id, length, flags, frame.data)


def from_wire(data: bytes, t_ns: int) -> Frame:
    """Return the frame that a raw CAN socket received at `t_ns`; an error frame has its class as id."""
    can_id, length, flags = _HEAD.unpack_from(data)
    is_fd = len(data) == CANFD_SIZE
    is_extended = bool(can_id & CAN_EFF_FLAG)
    is_error, is_remote = bool(can_id & CAN_ERR_FLAG), bool(can_id & CAN_RTR_FLAG)
    return Frame(
        due_ns=t_ns,
        arbitration_id=can_id & (_EXTENDED_ID if is_extended or is_error else _STANDARD_ID),
        data=bytes(length) if is_remote else data[8 : 8 + length],
        is_extended=is_extended,
        is_fd=is_fd,
        bitrate_switch=is_fd and bool(flags & CANFD_BRS),
        error_state_indicator=is_fd and bool(flags & CANFD_ESI),
        is_remote=is_remote,
        is_error=is_error,
    )

"""Frames of every kind that a bus carries."""

from msgspec.structs import replace

from vsensor.types import Frame

CLASSIC = Frame(due_ns=1, arbitration_id=0x123, data=bytes(range(8)))
EXTENDED = Frame(due_ns=2, arbitration_id=0x18FF1234, data=b"\x01", is_extended=True)
EMPTY = Frame(due_ns=3, arbitration_id=0x7FF, data=b"")
REMOTE = Frame(due_ns=4, arbitration_id=0x321, data=bytes(5), is_remote=True)
FD = Frame(
    due_ns=5,
    arbitration_id=0x200,
    data=bytes(range(32)),
    is_fd=True,
    bitrate_switch=True,
    error_state_indicator=True,
)
ALL = {"classic": CLASSIC, "extended": EXTENDED, "empty": EMPTY, "remote": REMOTE, "fd": FD}


def content(frame):
    """Return a frame without its time."""
    return replace(frame, due_ns=0)

"""Raw signals of a log, as the profiles' databases have them: any signal of any message."""

from collections.abc import Iterator

import numpy as np

from vsensor.apps.examine.drive import Drive
from vsensor.codec import decode_bulk
from vsensor.errors import LogError
from vsensor.profile import MessagePlan
from vsensor.types import NANOSECONDS_PER_SECOND, Array, IntArray


def signal_names(drive: Drive) -> Iterator[str]:
    """Yield MESSAGE.SIGNAL of every message that is in the log."""
    for plan in _plans(drive):
        if len(_rows(drive, plan)):
            yield from (f"{plan.layout.name}.{name}" for name in plan.layout.signals)


def signal_series(drive: Drive, name: str) -> tuple[Array, Array, str]:
    """Return times in seconds since the first image, values (M,) as on the bus, and the unit.

    Frames that are too short are left out, those with a wrong CRC are not. Raises LogError if no
    message has the signal.
    """
    message, _, signal = name.partition(".")
    plan = next((p for p in _plans(drive) if p.layout.name == message and signal in p.layout.signals), None)
    if plan is None:
        raise LogError(f"{drive.log}: no profile has a signal {name}")
    rows = _rows(drive, plan)
    used = drive.scanned.frames.used
    values = decode_bulk(plan.layout, used.data[rows, : plan.layout.length], (signal,))[signal]
    t_s = (used.t_ns[rows] - drive.images.t_ns[0]) / NANOSECONDS_PER_SECOND
    return t_s, values, plan.layout.signals[signal].unit


def _plans(drive: Drive) -> Iterator[MessagePlan]:
    for profile in drive.scanned.profiles:
        yield from profile.messages


def _rows(drive: Drive, plan: MessagePlan) -> IntArray:
    used, layout = drive.scanned.frames.used, plan.layout
    mine = (used.arbitration_id == layout.arbitration_id) & (used.flags & 1 == layout.is_extended)
    if used.data.shape[1] < layout.length:
        return np.empty(0, dtype=np.int64)
    return np.flatnonzero(mine & (used.length >= layout.length))

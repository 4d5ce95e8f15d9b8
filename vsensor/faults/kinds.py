"""Which kinds of faults there are, where each acts, and what it is told."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

Stage = Literal["sensor", "line", "image", "value", "signal", "counter", "frame", "bus"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Kind:
    """One kind: the `stage` where it acts, the keys that it `needs`, and others that it `takes`.

    `lasts` are the keys that may end it; without any it happens once.
    """

    stage: Stage
    needs: tuple[str, ...] = ()
    takes: tuple[str, ...] = ()
    lasts: tuple[str, ...] = ("for_s", "times")

    @property
    def is_of_frames(self) -> bool:
        """Whether it acts on frames one by one, so that `times` counts frames of each message."""
        return self.stage in ("signal", "counter", "frame")


_MESSAGE = ("message",)

KINDS: Mapping[str, Kind] = {
    "frame_lost": Kind(stage="frame", takes=_MESSAGE),
    "frame_delayed": Kind(stage="frame", needs=("delay_ms",), takes=_MESSAGE),
    "frame_doubled": Kind(stage="frame", takes=_MESSAGE),
    "frame_truncated": Kind(stage="frame", takes=(*_MESSAGE, "length")),
    "crc_wrong": Kind(stage="frame", takes=_MESSAGE),
    "counter_frozen": Kind(stage="counter", takes=_MESSAGE),
    "counter_jumped": Kind(stage="counter", needs=("by",), takes=_MESSAGE, lasts=()),
    "counter_offset": Kind(stage="counter", needs=("by",), takes=_MESSAGE),
    "signal_stuck": Kind(stage="signal", needs=("signal",), takes=_MESSAGE),
    "signal_sna": Kind(stage="signal", needs=("signal",), takes=_MESSAGE),
    "signal_raw": Kind(stage="signal", needs=("signal", "raw"), takes=_MESSAGE),
    "signal_value": Kind(stage="signal", needs=("signal", "value"), takes=_MESSAGE),
    "override": Kind(stage="value", needs=("quantity", "value")),
    "line_lost": Kind(stage="line", takes=("line",)),
    "ghost_line": Kind(stage="line", needs=("line", "offset_m"), takes=("marking", "colour")),
    "line_kind": Kind(stage="line", needs=("marking",), takes=("line",)),
    "line_colour": Kind(stage="line", needs=("colour",), takes=("line",)),
    "image_frozen": Kind(stage="image"),
    "sensor_blocked": Kind(stage="sensor"),
    "sensor_failed": Kind(stage="sensor", lasts=()),
    "reset": Kind(stage="sensor", lasts=("for_s",)),
    "bus_off": Kind(stage="bus", lasts=("for_s",)),
}

"""What a fault is told as: a table of a scenario, the arguments of a Python call, a line of JSON."""

from typing import Annotated, Literal

import msgspec

from vsensor.schema import Config

Line = Literal["left", "right", "next_left", "next_right"]
Marking = Literal[
    "solid",
    "dashed",
    "double_solid",
    "double_dashed",
    "solid_dashed",
    "dashed_solid",
    "botts_dots",
    "road_edge",
    "curb",
    "unknown",
]
Colour = Literal["unknown", "white", "yellow", "blue", "red", "green", "orange"]
_Raw = Annotated[int, msgspec.Meta(ge=-(2**63), le=2**63 - 1)]  # what TOML holds
_Time = Annotated[float, msgspec.Meta(ge=0, le=31_536_000)]


class FaultConfig(Config, frozen=True, kw_only=True):
    """`[[fault]]`: one fault; which keys a kind takes says `vsensor.faults.KINDS`.

    It begins at `at_s` (without: at once) and lasts for `for_s`, or for `times` frames of each message
    (of a fault of frames or signals) or images (of any other), or without either until it is cleared.
    """

    kind: str
    message: str | None = None
    signal: str | None = None
    quantity: str | None = None
    line: Line | None = None
    value: Annotated[float, msgspec.Meta(ge=-1e15, le=1e15)] | None = None
    raw: _Raw | None = None
    by: Annotated[int, msgspec.Meta(ge=-(2**31), le=2**31)] | None = None
    length: Annotated[int, msgspec.Meta(ge=0, le=63)] | None = None
    delay_ms: Annotated[float, msgspec.Meta(gt=0, le=10_000)] | None = None
    offset_m: Annotated[float, msgspec.Meta(ge=-30, le=30)] | None = None
    marking: Marking | None = None
    colour: Colour | None = None
    at_s: _Time | None = None
    for_s: Annotated[float, msgspec.Meta(gt=0, le=31_536_000)] | None = None
    times: Annotated[int, msgspec.Meta(ge=1, le=1_000_000_000)] | None = None

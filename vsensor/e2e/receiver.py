"""What a consumer concludes from protected frames: each frame's status, and whether to trust the stream.

    data or None ──► status of the frame ──► window of statuses ──► state of the stream

               not WRONG_CRC, not NO_NEW_DATA            enough OK, few errors
        NODATA ────────────────────────────► INIT ──────────────────────────────► VALID
                                               │ too many errors                   │ ▲  enough OK,
                                               └─────────► INVALID ◄───────────────┘ │  few errors
                                                              └──────────────────────┘
                                      too few OK or too many errors

AUTOSAR PRS E2E protocol, state machine: OK and SOME_LOST count as OK, WRONG_CRC as an error; REPEATED,
WRONG_SEQUENCE and NO_NEW_DATA as neither, so a stream that falls silent becomes INVALID for want of OK.
"""

from dataclasses import dataclass
from enum import Enum
from typing import Annotated

import msgspec

from vsensor.e2e.guard import Guard
from vsensor.schema import Config


class Status(Enum):
    """What one reception brought."""

    OK = "ok"
    SOME_LOST = "some lost"
    REPEATED = "repeated"
    WRONG_SEQUENCE = "wrong sequence"
    WRONG_CRC = "wrong CRC"
    NO_NEW_DATA = "no new data"

    @property
    def is_fresh(self) -> bool:
        """Whether the frame is right and new, with no more lost before it than is tolerated."""
        return self in (Status.OK, Status.SOME_LOST)


class Reception(Enum):
    """State of the stream; its data may be used while it is VALID."""

    NODATA = "nodata"
    INIT = "init"
    VALID = "valid"
    INVALID = "invalid"


Window = Annotated[int, msgspec.Meta(ge=1, le=255)]
Count = Annotated[int, msgspec.Meta(ge=0, le=255)]


class ReceiverConfig(Config, frozen=True, kw_only=True):
    """Tolerances of a receiver; names and relations as in AUTOSAR's E2E_SMConfigType.

    `max_delta_counter`: largest step of the counter that is still SOME_LOST. In each state, the last
    `window_size_*` statuses must hold at least `min_ok_*` that are OK and at most `max_error_*` errors.
    """

    max_delta_counter: Annotated[int, msgspec.Meta(ge=1, le=0xFFFFFFFF)] = 3
    window_size_init: Window = 5
    window_size_valid: Window = 5
    window_size_invalid: Window = 5
    min_ok_init: Window = 2
    min_ok_valid: Window = 1
    min_ok_invalid: Window = 3
    max_error_init: Count = 1
    max_error_valid: Count = 2
    max_error_invalid: Count = 1
    clear_to_invalid: bool = False

    def __post_init__(self) -> None:
        """Refuse tolerances that contradict each other: a state would be left as soon as it is entered."""
        windows = (self.window_size_init, self.window_size_valid, self.window_size_invalid)
        if max(windows) > self.window_size_valid:
            raise ValueError("window_size_valid must not be smaller than the other window sizes")
        if not self.min_ok_valid <= self.min_ok_init <= self.min_ok_invalid:
            raise ValueError("min_ok_valid <= min_ok_init <= min_ok_invalid was expected")
        if not self.max_error_invalid <= self.max_error_init <= self.max_error_valid:
            raise ValueError("max_error_invalid <= max_error_init <= max_error_valid was expected")
        least = (self.min_ok_init, self.min_ok_valid, self.min_ok_invalid)
        if any(ok > size for ok, size in zip(least, windows, strict=True)):
            raise ValueError("each min_ok must fit into the window size of its state")


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceiverState:
    """A receiver between two frames; `window` holds the latest statuses, oldest first."""

    counter: int | None = None
    reception: Reception = Reception.NODATA
    window: tuple[Status, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """What is concluded from one frame; `lost` frames are missing before it, by its counter."""

    status: Status
    reception: Reception
    lost: int = 0


def receive(
    config: ReceiverConfig, state: ReceiverState, guard: Guard, data: bytes | None
) -> tuple[ReceiverState, Check]:
    """Return the state after one cycle, and what is concluded; `data` None = no frame came.

    The first right frame is OK, whatever its counter. A wrong frame leaves the counter as it was; every right
    one sets it, so that a sender which was reset costs one WRONG_SEQUENCE (or none).
    """
    status, step = _status(config, state, guard, data)
    counter = state.counter
    if data is not None and status is not Status.WRONG_CRC:
        counter = guard.counter(data)
    reception, window = _judged(config, state, status)
    after = ReceiverState(counter=counter, reception=reception, window=window)
    return after, Check(status=status, reception=reception, lost=max(0, step - 1))


def _status(
    config: ReceiverConfig, state: ReceiverState, guard: Guard, data: bytes | None
) -> tuple[Status, int]:
    """Return the status and the step of the counter, 1 where it says nothing."""
    if data is None:
        return Status.NO_NEW_DATA, 1
    if not guard.check(data):
        return Status.WRONG_CRC, 1
    counter = guard.counter(data)
    if counter is None or state.counter is None:
        return Status.OK, 1
    step = (counter - state.counter) % guard.counter_states
    if step == 0:
        return Status.REPEATED, 1
    if step > config.max_delta_counter:
        return Status.WRONG_SEQUENCE, 1
    return (Status.OK if step == 1 else Status.SOME_LOST), step


def _judged(
    config: ReceiverConfig, state: ReceiverState, status: Status
) -> tuple[Reception, tuple[Status, ...]]:
    """Return the next state of the stream and its window; what leads to INIT is not counted there."""
    before = state.reception
    if before is Reception.NODATA:
        heard = status not in (Status.WRONG_CRC, Status.NO_NEW_DATA)
        return (Reception.INIT if heard else Reception.NODATA), ()
    window = (*state.window, status)[-_size(config, before) :]
    after = _next(config, before, window)
    if after is Reception.INVALID and before is not Reception.INVALID and config.clear_to_invalid:
        return after, ()
    return after, window


def _next(config: ReceiverConfig, before: Reception, window: tuple[Status, ...]) -> Reception:
    right = sum(status.is_fresh for status in window)
    errors = window.count(Status.WRONG_CRC)
    if before is Reception.INIT:
        if errors > config.max_error_init:
            return Reception.INVALID
        return Reception.VALID if right >= config.min_ok_init else Reception.INIT
    if before is Reception.VALID:
        stays = errors <= config.max_error_valid and right >= config.min_ok_valid
    else:
        stays = errors <= config.max_error_invalid and right >= config.min_ok_invalid
    return Reception.VALID if stays else Reception.INVALID


def _size(config: ReceiverConfig, reception: Reception) -> int:
    if reception is Reception.INIT:
        return config.window_size_init
    return config.window_size_valid if reception is Reception.VALID else config.window_size_invalid

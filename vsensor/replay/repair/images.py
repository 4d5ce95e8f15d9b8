"""Which frames are of one image, and the index and milliseconds that they share in the replay.

    recorded index   7  7  7  8  8  8 | 2  2  2  3        | a loop seam, or a seek
    sent             7  7  7  8  8  8   9  9  9 10
    recorded ms     280      320      |80      120
    sent            280      320       361     401        goes on with the replay's own time

The index steps as recorded where the replay's time agrees, else by the time that passed, at least 1. The
milliseconds step as recorded, kept within BAND_NS of the replay's time.
"""

from collections.abc import Mapping
from typing import NamedTuple

BAND_NS = 20_000_000
"""Adapters stamp frames in batches of up to 16 ms, and clocks of sensor and recorder drift apart."""
TRUSTED = 0.75  # of an interval: what a recorded step may be off the time that passed
SETTLING = 8  # images over which the interval is averaged
MS = 1_000_000


class Recorded(NamedTuple):
    """What a frame of an image says, as recorded: its index modulo the fewest states, None without one.

    `kind`: message and page, `may_repeat` if it comes more than once in an image. `wide` is the index modulo
    `wide_states`.
    """

    kind: object
    data: bytes
    may_repeat: bool
    tie: int | None
    wide: int | None = None
    wide_states: int = 0


class ImageState(NamedTuple):
    """Where the images of one sensor stand; `serial` counts them, 0 = none yet.

    `number` (the index, right modulo `anchored`) and `stamp_ns` are those sent; `tie` and `stamp_ms` as
    recorded; `stamped` is the serial of the image that `stamp_ns` is of; `interval_ns` of images in the
    replay, 0 = not known.
    """

    serial: int = 0
    number: int = 0
    tie: int | None = None
    begun_ns: int = 0
    interval_ns: float = 0.0
    anchored: int = 1
    seen: Mapping[object, bytes] = {}
    stamped: int = 0
    stamp_ns: int = 0
    stamp_ms: int = 0
    stamp_due_ns: int = 0
    stamp_off_ns: int = 0


def joined(state: ImageState, frame: Recorded, due_ns: int, states: int) -> ImageState:
    """Return the state with this frame in the image before, or in a new one; `states` of the ties."""
    if state.serial and _is_same(state, frame, due_ns, states):
        if frame.kind in state.seen and frame.tie is None:
            return state
        tie = state.tie if frame.tie is None else frame.tie
        state = state._replace(seen={**state.seen, frame.kind: frame.data}, tie=tie)
    else:
        state = _begun(state, frame, due_ns, states)
    if frame.wide is not None and frame.wide_states > state.anchored:
        ahead = (frame.wide - state.number) % frame.wide_states
        number = state.number + ahead // state.anchored * state.anchored
        state = state._replace(number=number, anchored=frame.wide_states)
    return state


def _is_same(state: ImageState, frame: Recorded, due_ns: int, states: int) -> bool:
    if frame.tie is not None and state.tie is not None and frame.tie != state.tie:
        return False
    since_ns = due_ns - state.begun_ns
    if state.interval_ns and since_ns > state.interval_ns * max(2, states // 2):
        return False  # the index came round
    if frame.may_repeat or frame.kind not in state.seen:
        return True
    twice = state.seen[frame.kind] == frame.data  # one frame, recorded twice
    return twice and since_ns < state.interval_ns / 2


def _begun(state: ImageState, frame: Recorded, due_ns: int, states: int) -> ImageState:
    if not state.serial:
        number = 0 if frame.tie is None else frame.tie
        anchored = states if frame.tie is not None else 1
        return ImageState(
            serial=1,
            number=number,
            tie=frame.tie,
            begun_ns=due_ns,
            anchored=anchored,
            seen={frame.kind: frame.data},
        )
    gap_ns = due_ns - state.begun_ns
    step, interval_ns = _step(state, frame, gap_ns, states)
    return state._replace(
        serial=state.serial + 1,
        number=state.number + step,
        tie=frame.tie,
        begun_ns=due_ns,
        interval_ns=interval_ns,
        seen={frame.kind: frame.data},
    )


def _step(state: ImageState, frame: Recorded, gap_ns: int, states: int) -> tuple[int, float]:
    """Return how many images further this one is, and the interval as known then."""
    known = frame.tie is not None and state.tie is not None
    recorded = (frame.tie - state.tie) % states if frame.tie is not None and state.tie is not None else 1
    interval_ns = state.interval_ns
    if not interval_ns:
        step = recorded if known and 1 <= recorded <= 2 else 1
        return step, gap_ns / step
    passed = gap_ns / interval_ns
    expected = max(1, round(passed))
    nearest = recorded + max(0, round((passed - recorded) / states)) * states if known else expected
    step = nearest if nearest >= 1 and abs(nearest - passed) <= TRUSTED else expected
    if nearest == step and step <= 2:
        interval_ns += (gap_ns / step - interval_ns) / SETTLING
    return step, interval_ns


def stamped(state: ImageState, recorded_ms: int | None, states: int) -> ImageState:
    """Return the state with the milliseconds of the present image; `recorded_ms` modulo `states`."""
    if state.stamped == state.serial or recorded_ms is None:
        return state
    due_ns = state.begun_ns
    if not state.stamped:
        now_ns, off_ns = recorded_ms * MS, recorded_ms * MS - due_ns
    else:
        off_ns, passed_ns = state.stamp_off_ns, due_ns - state.stamp_due_ns
        step_ms = recorded_ms - state.stamp_ms
        step_ns = (step_ms % states if states else step_ms) * MS
        step_ns = step_ns if abs(step_ns - passed_ns) <= BAND_NS else passed_ns
        middle_ns = due_ns + off_ns
        now_ns = min(max(state.stamp_ns + step_ns, middle_ns - BAND_NS), middle_ns + BAND_NS)
        now_ns = max(now_ns, state.stamp_ns + MS)
    return state._replace(
        stamped=state.serial,
        stamp_ns=now_ns,
        stamp_ms=recorded_ms,
        stamp_due_ns=due_ns,
        stamp_off_ns=off_ns,
    )

"""Bursts on their way: one rolling count for their frames, and the checksum over all of them.

A frame leaves at once, unless the checksum of its burst is in it, or in one held before it, and frames that
the checksum covers are still to come: then it waits for them, as long as `hold_ns`, or until the next burst.
"""

from collections.abc import Mapping
from typing import NamedTuple

from msgspec.structs import replace

from vsensor.profile import Burst, FrameKey
from vsensor.replay.repair.patch import Patch
from vsensor.types import Frame


class BurstState(NamedTuple):
    """The present burst: of which image, its frames as repaired, `held` that wait (the checksum's first).

    `rolled`: bursts so far, as the rolling count says. `guard_count`: counter of the frame with the checksum.
    `torn`: bursts that ended before their checksum could be made.
    """

    serial: int = -1
    rolled: int = 0
    recorded: int | None = None
    payloads: Mapping[FrameKey, bytes] = {}
    held: tuple[Frame, ...] = ()
    carrier: Patch | None = None
    guard_count: int = 0
    deadline_ns: int = 0
    is_sealed: bool = False
    torn: int = 0


def entered(
    state: BurstState | None, patch: Patch, key: FrameKey, serial: int, recorded: int | None
) -> tuple[BurstState, tuple[Frame, ...]]:
    """Return the burst that a frame belongs to, and frames of the one before that still waited.

    `serial` of its image, 0 without any; `recorded`: its rolling count in the log, None without one.
    """
    if state is None:
        return BurstState(serial=serial, rolled=recorded or 0, recorded=recorded), ()
    counted = recorded is not None and state.recorded is not None and recorded != state.recorded
    is_new = serial != state.serial or key in state.payloads or (not serial and counted)
    if not is_new:
        return state if state.recorded is not None else state._replace(recorded=recorded), ()
    fresh = BurstState(
        serial=serial, rolled=state.rolled + 1, recorded=recorded, torn=state.torn + _is_torn(state, patch)
    )
    return fresh, state.held


def _is_torn(state: BurstState, patch: Patch) -> bool:
    return patch.burst is not None and patch.burst.seal is not None and not state.is_sealed


def collected(
    state: BurstState, patch: Patch, key: FrameKey, frame: Frame, count: int, hold_ns: int
) -> tuple[BurstState, tuple[Frame, ...]]:
    """Return the state with a repaired frame in it, and the frames that leave now."""
    burst = patch.burst
    payload = frame.data[: patch.layout.length]
    state = state._replace(payloads={**state.payloads, key: payload})
    if burst is None or burst.seal is None:
        return state, (frame,)
    if key == burst.seal.carrier:
        state = state._replace(carrier=patch, guard_count=count, deadline_ns=frame.due_ns + hold_ns)
    elif not state.held:
        return state, (frame,)
    held = (*state.held, frame)
    if not is_whole(burst, state):
        return state._replace(held=held), ()
    sealed = (_sealed(burst, state, held[0]), *held[1:])
    return state._replace(held=(), is_sealed=True), tuple(replace(f, due_ns=frame.due_ns) for f in sealed)


def is_whole(burst: Burst, state: BurstState) -> bool:
    """Return whether all is there that the checksum covers."""
    return burst.seal is not None and all(key in state.payloads for key, _ in burst.seal.covers)


def _sealed(burst: Burst, state: BurstState, frame: Frame) -> Frame:
    """Return the frame that carries the checksum, with it, and protected again."""
    assert burst.seal is not None
    assert state.carrier is not None
    payloads = {key: bytearray(data) for key, data in state.payloads.items()}
    burst.seal.write(payloads)
    payload, guard = payloads[burst.seal.carrier], state.carrier.guard
    if guard is not None:
        guard.protect(payload, state.guard_count)
    return replace(frame, data=bytes(payload) + frame.data[len(payload) :])

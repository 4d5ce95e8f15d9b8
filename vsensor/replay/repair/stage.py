"""`repaired`: one frame of the log into the frame that a strict receiver accepts here and now.

frame ──► message known? ──► image: index, ms ──► counter ──► CRC ──► burst's checksum ──► frame(s)
             │ no, too short, remote: passed on as it is, and counted
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from msgspec.structs import replace

from vsensor.profile import FrameKey, Profile
from vsensor.replay.repair.bursts import BurstState, collected, entered
from vsensor.replay.repair.counts import INDEX, counts_of
from vsensor.replay.repair.images import ImageState, Recorded, joined, stamped
from vsensor.replay.repair.patch import Patch, patches_of
from vsensor.replay.stages import Stage
from vsensor.types import Frame

HOLD_NS = 10_000_000
"""Frames of a burst leave within less; at a speed below 1 it takes longer."""

Key = tuple[int, int, bool]
"""Channel, arbitration id, whether it is one of 29 bits."""


class Sent(NamedTuple):
    """Frames of one message so far: all, those whose protection was wrong in the log, those not repaired."""

    frames: int = 0
    counter: int = 0
    wrong: int = 0
    short: int = 0
    long: int = 0


class RepairState(NamedTuple):
    """What a repair remembers; a value. `others`: frames that no profile knows, by id."""

    messages: Mapping[Key, Sent] = {}
    others: Mapping[Key, int] = {}
    images: Mapping[tuple[int, int], ImageState] = {}
    bursts: Mapping[tuple[int, int, str], BurstState] = {}


class Repair:
    """Profiles compiled for repairing; immutable. Raises ConfigError if two of them have an id.

    `speed` of the replay: how long a burst may take. `keep_wrong`: a frame whose protection is wrong in the
    log stays as it is. `unprotected`: what cannot be protected, as sentences.
    """

    def __init__(self, profiles: Sequence[Profile], *, speed: float = 1.0, keep_wrong: bool = False) -> None:
        self.profiles, self.keep_wrong = tuple(profiles), keep_wrong
        self.patches, self.unprotected = patches_of(profiles)
        self.hold_ns = round(HOLD_NS / min(1.0, speed))
        self.tie_states = [_tie_states(self.patches, owner) for owner in range(len(profiles))]
        self.has_index = [any(counts_of(plan, INDEX) for plan in p.messages) for p in profiles]

    def stage(self) -> Stage:
        """Return it as a stage of a player."""
        from vsensor.replay.repair.told import told

        return Stage(
            lambda state, frame: repaired(self, state, frame),
            RepairState(),
            due=lambda state: next_release_ns(state),
            wake=lambda state, due_ns: released(state, due_ns),
            told=lambda state: told(self, state),
        )


def _tie_states(patches: Mapping[tuple[int, bool], Patch], owner: int) -> int:
    states = [p.ties.states for p in patches.values() if p.owner == owner and p.ties is not None]
    return min(filter(None, states), default=1 << 62)


def repaired(
    repair: Repair, state: RepairState, frame: Frame
) -> tuple[RepairState, Frame | tuple[Frame, ...]]:
    """Return the state after a frame, and what is sent for it: the frame repaired, or none or several."""
    key = frame.channel, frame.arbitration_id, frame.is_extended
    patch = repair.patches.get(key[1:])
    if patch is None or patch.is_idle or frame.is_remote:
        others = dict(state.others)
        others[key] = others.get(key, 0) + 1
        return state._replace(others=others), frame
    sent = state.messages.get(key)
    length = patch.layout.length
    if len(frame.data) < length:
        sent = sent or Sent()
        return _noted(state, key, sent._replace(short=sent.short + 1)), frame
    payload = bytearray(frame.data[:length])
    guard = patch.guard
    right = guard is None or guard.check(bytes(payload))
    recorded = None if guard is None else guard.counter(bytes(payload))
    counter = _next_counter(patch, sent, recorded)
    sent = sent or Sent()
    sent = Sent(
        sent.frames + 1,
        counter,
        sent.wrong + (not right),
        sent.short,
        sent.long + (len(frame.data) not in patch.lengths),
    )
    if repair.keep_wrong and not right:
        return _noted(state, key, sent), frame
    image = None
    if patch.indices or patch.stamps:
        state, image = _imaged(repair, state, patch, frame.channel, payload, frame.due_ns)
    if patch.burst is not None:
        return _in_burst(repair, state, patch, key, sent, frame, payload, image, recorded)
    if guard is not None:
        guard.protect(payload, counter)
    return _noted(state, key, sent), _with_payload(frame, payload)


def _next_counter(patch: Patch, sent: Sent | None, recorded: int | None) -> int:
    """Return the counter of the next frame: the log's own at first."""
    if patch.guard is None or recorded is None:
        return 0
    if sent is None or not sent.frames:
        return recorded % patch.guard.counter_states
    return (sent.counter + 1) % patch.guard.counter_states


def _noted(state: RepairState, key: Key, sent: Sent) -> RepairState:
    messages = dict(state.messages)
    messages[key] = sent
    return RepairState(messages, state.others, state.images, state.bursts)


def _with_payload(frame: Frame, payload: bytearray) -> Frame:
    data = bytes(payload) + frame.data[len(payload) :]
    return frame if data == frame.data else replace(frame, data=data)


def _imaged(
    repair: Repair, state: RepairState, patch: Patch, channel: int, payload: bytearray, due_ns: int
) -> tuple[RepairState, ImageState]:
    """Return the state with the frame in its image, whose index and milliseconds are written."""
    place = channel, patch.owner
    image = state.images.get(place, ImageState())
    stamps = patch.stamps[0] if patch.stamps else None
    milliseconds = None if stamps is None else stamps.read(payload)
    if patch.ties is not None:
        image = joined(image, _recorded(repair, patch, payload), due_ns, repair.tie_states[patch.owner])
        for count in patch.indices:
            if count.read(payload) is not None:
                count.write(payload, image.number)
    if stamps is not None and milliseconds is not None and image.serial:
        image = stamped(image, milliseconds, stamps.states)
        for count in patch.stamps:
            count.write(payload, image.stamp_ns // 1_000_000)
    return state._replace(images={**state.images, place: image}), image


def _recorded(repair: Repair, patch: Patch, payload: bytearray) -> Recorded:
    assert patch.ties is not None
    tie = patch.ties.read(payload)
    wide = patch.indices[0].read(payload) if patch.indices else None
    page = patch.page(payload) if patch.page is not None else ()
    return Recorded(
        kind=(patch.layout.arbitration_id, page),
        data=bytes(payload),
        may_repeat=patch.may_repeat,
        tie=None if tie is None else tie % repair.tie_states[patch.owner],
        wide=wide,
        wide_states=patch.indices[0].states if patch.indices else 0,
    )


def _in_burst(
    repair: Repair,
    state: RepairState,
    patch: Patch,
    key: Key,
    sent: Sent,
    frame: Frame,
    payload: bytearray,
    image: ImageState | None,
    recorded: int | None,
) -> tuple[RepairState, tuple[Frame, ...]]:
    """Return the state after a frame of a burst, and what leaves."""
    assert patch.burst is not None
    part = _part(patch, payload)
    if part is None:
        return _noted(state, key, sent), (frame,)
    place = frame.channel, patch.owner, patch.burst.name
    serial = image.serial if image is not None else 0
    count = recorded if patch.counted else None
    burst, late = entered(state.bursts.get(place), patch, part, serial, count)
    guard = patch.guard
    if guard is not None:
        if patch.counted:
            sent = sent._replace(counter=burst.rolled % guard.counter_states)
        guard.protect(payload, sent.counter)
    late = tuple(replace(one, due_ns=frame.due_ns) for one in late)
    frame = _with_payload(frame, payload)
    burst, leaving = collected(burst, patch, part, frame, sent.counter, repair.hold_ns)
    state = _noted(state, key, sent)
    return state._replace(bursts={**state.bursts, place: burst}), (*late, *leaving)


def _part(patch: Patch, payload: bytearray) -> FrameKey | None:
    assert patch.keys is not None
    return patch.keys.get(patch.page(payload) if patch.page is not None else ())


def next_release_ns(state: RepairState) -> int | None:
    """Return when frames that wait for their burst have waited long enough; None if none waits."""
    return min((burst.deadline_ns for burst in state.bursts.values() if burst.held), default=None)


def released(state: RepairState, due_ns: int) -> tuple[RepairState, tuple[Frame, ...]]:
    """Return the state, and the frames that have waited until `due_ns`; their burst has no checksum."""
    bursts, leaving = dict(state.bursts), list[Frame]()
    for place, burst in state.bursts.items():
        if burst.held and burst.deadline_ns <= due_ns:
            leaving += [replace(frame, due_ns=due_ns) for frame in burst.held]
            bursts[place] = burst._replace(held=())
    return state._replace(bursts=bursts), tuple(leaving)

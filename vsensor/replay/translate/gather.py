"""The source's frames put together to images, and each given out when its last frame is there."""

import math
from collections.abc import Mapping
from typing import NamedTuple

from vsensor.profile import LINES, Profile
from vsensor.replay.repair.images import ImageState, Recorded, joined, stamped
from vsensor.replay.repair.patch import Patch, patches_of
from vsensor.types import Frame, SignalValues

OTHERS_NS = 1_000_000_000  # how long what is not of an image (speed, rain) counts as told
MS = 1_000_000


class Gathered(NamedTuple):
    """Where the images stand: `told` of the present one, `others` with the time they were told.

    `expected`: messages and pages that the two images before had. `given`: serial of the latest image that
    was whole. `torn` images lacked a frame, `wrong` frames had a wrong CRC or were too short.
    """

    image: ImageState = ImageState()
    told: Mapping[str, float] = {}
    others: Mapping[str, tuple[int, SignalValues]] = {}
    expected: frozenset[object] = frozenset()
    before: frozenset[object] = frozenset()
    given: int = 0
    torn: int = 0
    wrong: int = 0


class Whole(NamedTuple):
    """An image whose frames are all there; values as the bus describes them."""

    told: SignalValues
    number: int
    milliseconds: int


class Gatherer:
    """A profile compiled for gathering its images; immutable."""

    def __init__(self, profile: Profile) -> None:
        self.profile = profile
        self.patches: Mapping[tuple[int, bool], Patch] = patches_of([profile])[0]
        self.of_image = frozenset(
            plan.layout.name
            for plan in profile.messages
            if any(_is_of_lane(binding.quantity) for binding in plan.bindings)
        )
        states = [patch.ties.states for patch in self.patches.values() if patch.ties is not None]
        self.tie_states = min(filter(None, states), default=1 << 62)
        self.is_tied = bool(states)
        self.has_index = any(patch.indices for patch in self.patches.values())


def _is_of_lane(quantity: str) -> bool:
    return quantity.partition(".")[0] in (*LINES, "lane")


def gathered(gatherer: Gatherer, state: Gathered, frame: Frame) -> tuple[Gathered, Whole | None]:
    """Return the state after a frame of the source, and the image that is whole with it, if one is."""
    patch = gatherer.patches[frame.arbitration_id, frame.is_extended]
    values = None if frame.is_remote else gatherer.profile.decode(frame, check=True)
    if values is None:
        return state._replace(wrong=state.wrong + 1), None
    if patch.name not in gatherer.of_image and (patch.ties is None or not gatherer.is_tied):
        return state._replace(others={**state.others, patch.name: (frame.due_ns, values)}), None
    before = state.image.serial
    image = _image(gatherer, state.image, patch, frame)
    if image.serial != before:
        state = _next_image(state)
    told = {name: v for name, v in values.items() if not math.isnan(v) or name not in state.told}
    state = state._replace(image=image, told={**state.told, **told})
    if image.serial == state.given or not state.expected or not state.expected <= image.seen.keys():
        return state, None
    return state._replace(given=image.serial), _whole(gatherer, state, frame.due_ns)


def _image(gatherer: Gatherer, image: ImageState, patch: Patch, frame: Frame) -> ImageState:
    data = frame.data[: patch.layout.length]
    tie = patch.ties.read(data) if patch.ties is not None else None
    recorded = Recorded(
        kind=(patch.name, patch.page(data) if patch.page is not None else ()),
        data=data,
        may_repeat=patch.may_repeat and gatherer.is_tied,
        tie=None if tie is None else tie % gatherer.tie_states,
        wide=patch.indices[0].read(data) if patch.indices else None,
        wide_states=patch.indices[0].states if patch.indices else 0,
    )
    image = joined(image, recorded, frame.due_ns, gatherer.tie_states)
    if patch.stamps:
        image = stamped(image, patch.stamps[0].read(data), patch.stamps[0].states)
    return image


def _next_image(state: Gathered) -> Gathered:
    """Return the state at the beginning of another image: what the last two had is expected of it."""
    seen = frozenset(state.image.seen)
    torn = state.torn + (state.image.serial > 1 and state.given != state.image.serial)
    return state._replace(told={}, expected=seen | state.before, before=seen, torn=torn)


def _whole(gatherer: Gatherer, state: Gathered, due_ns: int) -> Whole:
    told: dict[str, float] = {}
    for at_ns, values in state.others.values():
        if due_ns - at_ns <= OTHERS_NS:
            told |= values
    image = state.image
    is_stamped = image.stamped == image.serial
    return Whole(
        told={**told, **state.told},
        number=image.number if gatherer.has_index else image.serial - 1,
        milliseconds=(image.stamp_ns if is_stamped else image.begun_ns) // MS,
    )

"""What is known of one message that is repaired, compiled."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from vsensor.codec import Layout, load_database
from vsensor.e2e import Guard
from vsensor.errors import ConfigError
from vsensor.profile import Burst, FrameKey, Page, Profile
from vsensor.profile.config import E2eConfig
from vsensor.profile.protection import guard_of
from vsensor.replay.repair.counts import INDEX, STAMP, Count, counts_of, field_of, page_reader

MessageId = tuple[int, bool]
"""Arbitration id, and whether it is one of 29 bits."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Patch:
    """One message: what protects it, where it has index and milliseconds of the image, which burst it is of.

    `owner` is the place of its profile; `lengths` what a frame may have. `may_repeat`: it comes more than
    once in an image. `counted`: its counter is the rolling count of `burst`.
    """

    name: str
    owner: int
    layout: Layout
    lengths: tuple[int, ...]
    guard: Guard | None
    indices: tuple[Count, ...] = ()
    stamps: tuple[Count, ...] = ()
    ties: Count | None = None
    may_repeat: bool = False
    page: Callable[[bytes | bytearray], tuple[int, ...]] | None = None
    burst: Burst | None = None
    counted: bool = False
    keys: Mapping[tuple[int, ...], FrameKey] | None = None

    @property
    def is_idle(self) -> bool:
        """Whether there is nothing to repair in it."""
        return self.guard is None and not self.indices and not self.stamps and self.burst is None


def patches_of(profiles: Sequence[Profile]) -> tuple[dict[MessageId, Patch], list[str]]:
    """Return the messages of all profiles, and what of their databases cannot be protected, as sentences.

    A message that the profile does not name is protected if its database says how (an AUTOSAR profile with
    its data id). Raises ConfigError for an id that two profiles have.
    """
    found: dict[MessageId, Patch] = {}
    said: list[str] = []
    for owner, profile in enumerate(profiles):
        mine = {(p.layout.arbitration_id, p.layout.is_extended): p for p in _named(owner, profile)}
        if both := sorted(found.keys() & mine.keys()):
            other = profiles[found[both[0]].owner]
            raise ConfigError(f"--repair: 0x{both[0][0]:X} is both in {other.path} and in {profile.path}")
        found |= mine
    for owner, profile in enumerate(profiles):
        for patch in _unnamed(owner, profile, said):
            found.setdefault((patch.layout.arbitration_id, patch.layout.is_extended), patch)
    return found, said


def _named(owner: int, profile: Profile) -> list[Patch]:
    carriers = [plan for plan in profile.messages if counts_of(plan, INDEX) or counts_of(plan, STAMP)]
    image_ns = max((plan.cycle_ns for plan in carriers), default=0)
    has_index = any(counts_of(plan, INDEX) for plan in carriers)
    bursts = {name: burst for burst in profile.bursts for name in burst.layouts}
    patches = []
    for plan in profile.messages:
        indices, stamps = counts_of(plan, INDEX), counts_of(plan, STAMP)
        ties = indices if has_index else stamps
        burst = bursts.get(plan.layout.name)
        patches.append(
            Patch(
                name=plan.layout.name,
                owner=owner,
                layout=plan.layout,
                lengths=(plan.layout.length, plan.layout.length + len(plan.padding)),
                guard=plan.guard,
                indices=indices,
                stamps=stamps,
                ties=ties[-1] if ties else None,
                may_repeat=plan.sending.is_event or plan.mux == "rotate" or 0 < plan.cycle_ns < image_ns,
                page=page_reader(plan),
                burst=burst,
                counted=burst is not None and _is_counted(burst, plan.layout, plan.guard),
                keys=None if burst is None else _keys(plan.layout, plan.pages),
            )
        )
    return patches


def _is_counted(burst: Burst, layout: Layout, guard: Guard | None) -> bool:
    """Return whether the message's counter is the burst's rolling count."""
    if guard is None or guard.counter_field is None:
        return False
    ties = [field_of(layout, layout.signals[name]) for name in burst.ties[layout.name]]
    return guard.counter_field in ties


def _keys(layout: Layout, pages: Sequence[Page]) -> dict[tuple[int, ...], FrameKey]:
    """Return which frame of its burst a page is, by the raw bits of all multiplexers."""
    names = sorted(layout.muxers)
    masks = {name: (1 << layout.signals[name].length) - 1 for name in names}
    return {
        tuple(page.get(name, 0) & masks[name] for name in names): (layout.name, number)
        for number, page in enumerate(pages)
    }


def _unnamed(owner: int, profile: Profile, said: list[str]) -> list[Patch]:
    """Return the other messages of the database that say how they are protected."""
    named = {plan.layout.name for plan in profile.messages}
    patches = []
    for layout in load_database(profile.database).layouts.values():
        if layout.name in named or not layout.e2e_profile:
            continue
        try:
            guard = guard_of(layout, E2eConfig(), f"{profile.database}: {layout.name}")
        except ConfigError as error:
            said.append(f"not repaired: {error}")
            continue
        lengths = (layout.length,)
        patches.append(Patch(name=layout.name, owner=owner, layout=layout, lengths=lengths, guard=guard))
    return patches

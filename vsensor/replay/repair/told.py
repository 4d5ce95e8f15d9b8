"""What a repair did and what it could not, as lines for people."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from vsensor.replay.repair.stage import Key, Repair, RepairState

SHOWN = 6


def told(repair: "Repair", state: "RepairState") -> list[str]:
    """Return what was repaired, what was wrong before, and what was not repaired and why."""
    return [*_repaired(repair, state), *_not_repaired(repair, state), *repair.unprotected]


def _repaired(repair: "Repair", state: "RepairState") -> Iterator[str]:
    for owner, profile in enumerate(repair.profiles):
        mine = {key: sent for key, sent in state.messages.items() if repair.patches[key[1:]].owner == owner}
        frames = sum(sent.frames for sent in mine.values())
        silent = [p.name for p in repair.patches.values() if p.owner == owner and not p.is_idle]
        heard = {repair.patches[key[1:]].name for key in mine}
        yield f"repair {profile.name}: {frames} frames of {len(heard)} messages" + (
            f"; not in the log: {_listed(name for name in silent if name not in heard)}"
            if len(heard) < len(silent)
            else ""
        )
    wrong = {repair.patches[key[1:]].name: sent.wrong for key, sent in state.messages.items() if sent.wrong}
    if wrong:
        kept = "kept so" if repair.keep_wrong else "right now"
        total = sum(wrong.values())
        yield f"{total} frames had a wrong checksum or counter before, {kept}: {_counted(wrong)}"


def _not_repaired(repair: "Repair", state: "RepairState") -> Iterator[str]:
    patches = repair.patches
    unknown = {key: n for key, n in state.others.items() if key[1:] not in patches}
    if unknown:
        ids = {_id(key): n for key, n in sorted(unknown.items(), key=lambda item: -item[1])}
        total = sum(ids.values())
        yield f"not repaired: {total} frames of {len(ids)} ids that no profile has: {_counted(ids)}"
    bare = {patches[key[1:]].name: n for key, n in state.others.items() if key[1:] in patches}
    if bare:
        yield f"not repaired: nothing is known that protects {_counted(bare)}"
    for what, field in (
        ("shorter than their message, passed as they are", "short"),
        ("of another length than their message, repaired in its bytes", "long"),
    ):
        found = {patches[k[1:]].name: getattr(s, field) for k, s in state.messages.items()}
        if any(found.values()):
            yield f"{sum(found.values())} frames {what}: {_counted({k: n for k, n in found.items() if n})}"
    for (_, _, name), burst in state.bursts.items():
        if burst.torn:
            yield f"{burst.torn} times the burst {name} lacked a frame, so its checksum could not be made"


def _id(key: "Key") -> str:
    return f"0x{key[1]:X}{'x' * (key[2] and key[1] <= 0x7FF)}"


def _counted(counts: Mapping[str, int]) -> str:
    return _listed(f"{name} {count}" for name, count in counts.items())


def _listed(words: Iterable[str]) -> str:
    listed = list(words)
    rest = len(listed) - SHOWN
    return ", ".join(listed[:SHOWN]) + (f" and {rest} more" if rest > 0 else "")

"""What a translation did and what it lost, as lines for people."""

from collections.abc import Iterable, Iterator, Mapping
from typing import TYPE_CHECKING

from vsensor.profile import QUANTITIES
from vsensor.replay.translate.loss import COUNTS, Loss
from vsensor.types import SIDE_NAMES

if TYPE_CHECKING:
    from vsensor.replay.translate.stage import Translate, TranslateState

EVERY_LINE = "lines"


def told(translate: "Translate", state: "TranslateState") -> list[str]:
    """Return what was translated, the loss by rounding in SI units, and what one of the two does not have."""
    source, target = translate.source, translate.target
    frames = state.sent.frames if state.sent is not None else 0
    said = [
        f"translated {source.name} to {target.name}: {state.removed} frames, {state.images} whole images, "
        f"into {frames} frames"
    ]
    if state.gathered.torn or state.gathered.wrong:
        said.append(
            f"left out: {state.gathered.torn} images that lacked a frame, {state.gathered.wrong} frames "
            "with a wrong checksum or length"
        )
    if state.clashing:
        said.append(f"left out: {state.clashing} frames of the log with an id that {target.name} sends")
    said += _lost(f"{target.name} less {source.name}", state.losses)
    derived = (target.quantities() - translate.known) & set(state.losses)
    missing = target.quantities() - translate.known - derived - set(COUNTS)
    said += _named(f"{target.name} has no", source.quantities() - translate.target_known - set(COUNTS))
    said += _named(f"{source.name} has no, so not available or a default", missing)
    said += _named(f"{source.name} has no, so derived or assumed", derived)
    if state.sent is not None and state.sent.saturated:
        saturated = (f"{name} in {count}" for name, count in state.sent.saturated.items())
        said.append(f"saturated: {', '.join(saturated)} images")
    return said


def _lost(what: str, losses: Mapping[str, Loss]) -> Iterator[str]:
    """Yield the loss of each quantity, that of several lines together; those without any in one line."""
    together: dict[str, Loss] = {}
    names: dict[str, str] = {}
    for name, loss in losses.items():
        line, _, last = name.partition(".")
        label = f"{EVERY_LINE}.{last}" if line in SIDE_NAMES.values() else name
        together[label], names[label] = together.get(label, Loss()).and_also(loss), name
    same = [label for label, loss in together.items() if not loss.unlike and not loss.lost]
    if same:
        yield f"{what}, the same: {', '.join(sorted(same))}"
    for label in sorted(together.keys() - set(same)):
        loss, quantity = together[label], QUANTITIES[names[label]]
        gone = f"; {loss.lost} became not available" if loss.lost else ""
        if quantity.codes is not None:
            yield f"{what}, {label}: another code in {loss.unlike} of {loss.images}{gone}"
        else:
            size = f"max {loss.largest:.3g}, rms {loss.rms:.3g} {quantity.unit}".rstrip()
            yield f"{what}, {label}: {size}{gone}"


def _named(what: str, names: Iterable[str]) -> list[str]:
    """Return the names in one line; what all four lines lack is said once."""
    left = set(names)
    lasts = {name.partition(".")[2] for name in left}
    for last in lasts:
        every = {f"{word}.{last}" for word in SIDE_NAMES.values()}
        if every <= left:
            left = left - every | {f"{EVERY_LINE}.{last}"}
    return [f"{what}: {', '.join(sorted(left))}"] if left else []

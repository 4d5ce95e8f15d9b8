"""Multiplexed messages: which values their multiplexers take, one page of signals for each."""

from collections.abc import Iterable, Mapping

from vsensor.codec import Layout, SignalLayout
from vsensor.errors import ConfigError

Page = Mapping[str, int]
"""Raw values of the multiplexers of one frame, by name."""

_MOST_PAGES = 256


def pages_of(layout: Layout, carried: Iterable[str], fixed: Page, where: str) -> tuple[Page, ...]:
    """Return the pages that a message is sent as, so that each carried signal is in one at least.

    `fixed`: multiplexers that are constant. One page without values where nothing is multiplexed. Raises
    ConfigError for a signal that no page can carry.
    """
    found: dict[tuple[tuple[str, int], ...], None] = {}
    for name in carried:
        chains = _chains(layout, layout.signals[name], fixed)
        if not chains:
            raise ConfigError(f"{where}: {name} is in no frame with {_shown(fixed)}")
        found |= {tuple(sorted(chain.items())): None for chain in chains}
    pages = [dict(page) for page in found]
    # A page that says less than another needs no frame of its own: its signals are in the other, too.
    kept = [page for page in pages if not any(page.items() < other.items() for other in pages)]
    if len(kept) > _MOST_PAGES:
        raise ConfigError(f"{where}: {len(kept)} multiplexer values, at most {_MOST_PAGES} are sent")
    return tuple(sorted(kept, key=lambda page: tuple(page.values()))) or ({},)


def _chains(layout: Layout, signal: SignalLayout, fixed: Page) -> list[dict[str, int]]:
    """Return every set of multiplexer values under which the signal is in the frame."""
    if signal.mux_signal is None:
        return [{}]
    parent = layout.signals[signal.mux_signal]
    ids = [value for value in sorted(signal.mux_ids) if fixed.get(parent.name, value) == value]
    return [{**chain, parent.name: value} for chain in _chains(layout, parent, fixed) for value in ids]


def _shown(fixed: Page) -> str:
    return ", ".join(f"{name} = {raw}" for name, raw in fixed.items()) or "any multiplexer value"

"""What a player plays: a reel, or one with something laid over it."""

from collections.abc import Iterable, Sequence
from typing import Protocol

from vsensor.replay.reading import Reading
from vsensor.replay.reel import Piece
from vsensor.types import Frame


class Pulled(Protocol):
    """Frames with the times they are due, pulled in that order.

    `lead_ns`: so long before it is due the new place of a seek is told, at the least, while there is time.
    `grain`: about how many frames are pulled at a time, which may be changed.
    """

    start_ns: int
    grain: int
    ended: bool
    most_ahead: int
    lead_ns: int

    @property
    def opens_ns(self) -> int:
        """The replay's time before which there is nothing to pull."""
        ...

    def pull(self) -> Piece | None:
        """Return the next few frames; None if there is none yet, or (`ended`) any more."""
        ...

    def reading(self, log_ns: int) -> Reading:
        """Return what can be read up to `log_ns`, little by little, while this plays on: for `seek`."""
        ...

    def seek(
        self,
        log_ns: int,
        due_ns: int,
        loop: int = 0,
        unsent: Sequence[Frame] = (),
        reading: Reading | None = None,
    ) -> None:
        """Go on with the first frame not before `log_ns`, due at `due_ns`; `unsent` were pulled in vain."""
        ...

    def whole(self, frames: Iterable[Frame]) -> int:
        """Return how many of the coming frames, at the least, are sent before a seek that tears no image."""
        ...

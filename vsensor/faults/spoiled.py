"""What faults have done to frames so far, as a value."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from vsensor.types import Frame


@dataclass(frozen=True, slots=True, kw_only=True)
class Spoiled:
    """What faults of frames remember; messages by their place in the profile, faults by their number.

    `used`: (fault, message) -> frames that it has had. `held`: fault -> raw bits of a stuck signal. `shifts`:
    message -> by how much its alive counter is off the number of frames, for good. `waiting`: delayed frames.
    """

    used: Mapping[tuple[int, int], int] = field(default_factory=dict[tuple[int, int], int])
    held: Mapping[int, int] = field(default_factory=dict[int, int])
    shifts: Mapping[int, int] = field(default_factory=dict[int, int])
    waiting: tuple[Frame, ...] = ()

    @property
    def is_nothing(self) -> bool:
        """Whether frames leave as if there had never been a fault."""
        return not (self.used or self.held or self.shifts or self.waiting)


NOT_SPOILED = Spoiled()

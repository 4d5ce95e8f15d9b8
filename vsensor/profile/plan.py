"""One message of a profile, compiled."""

from collections.abc import Mapping
from dataclasses import dataclass

from vsensor.codec import Layout
from vsensor.e2e import Guard
from vsensor.profile.binding import Binding, Validity
from vsensor.profile.pages import Page
from vsensor.profile.sending import SendPlan


@dataclass(frozen=True, slots=True, kw_only=True)
class MessagePlan:
    """One message of a profile.

    `bindings` are encoded, `told` of them are decoded. `constants` are the raw values of all other signals.
    Of the signals `unnamed` the profile has no word.
    `pages`: the multiplexers' values of its frames, sent as `mux` says; `padding` follows its data.
    """

    layout: Layout
    sending: SendPlan
    bindings: tuple[Binding, ...]
    told: tuple[Binding, ...]
    validities: tuple[Validity, ...]
    constants: Mapping[str, int]
    guard: Guard | None
    pages: tuple[Page, ...] = ({},)
    mux: str = "together"
    padding: bytes = b""
    bitrate_switch: bool = False
    unnamed: tuple[str, ...] = ()

    @property
    def cycle_ns(self) -> int:
        """The cycle time, 0 if it has none."""
        return self.sending.cycle_ns

    def intact(self, data: bytes) -> bool:
        """Return whether the frame's CRC is right; True for a message without protection."""
        return self.guard is None or self.guard.check(data)

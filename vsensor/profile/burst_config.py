"""What `[bursts.NAME]` says: which messages make up one image, and what ties them together."""

from typing import Annotated, Literal

import msgspec

from vsensor.schema import Config

_Byte = Annotated[int, msgspec.Meta(ge=0, le=255)]
_Place = Annotated[int, msgspec.Meta(ge=0, le=63)]


class CoverConfig(Config, frozen=True, kw_only=True):
    """Bytes of one message that a burst's checksum covers: `first` to `last`, all without a word."""

    message: str
    first: _Place = 0
    last: _Place | None = None


class BurstChecksumConfig(Config, frozen=True, kw_only=True):
    """The checksum over a whole burst, in one signal of one of its messages.

    It is taken, by the named `algorithm`, over the bytes `before`, the low and the high byte of `data_id`,
    what it `covers` (messages in that order; without a word all of them, whole), and the bytes `after`.
    Its `own` bytes, and those of the CRC of the message that carries it, are left out or count as 0.
    """

    message: str
    signal: str
    algorithm: str
    data_id: Annotated[int, msgspec.Meta(ge=0, le=0xFFFF)] | None = None
    before: tuple[_Byte, ...] = ()
    after: tuple[_Byte, ...] = ()
    covers: tuple[CoverConfig | str, ...] | None = None
    own: Literal["skip", "zero"] = "skip"


class BurstConfig(Config, frozen=True, kw_only=True):
    """`[bursts.NAME]`: the messages of one image, in the order they are sent.

    `id` and `count` name a signal of every message (one name for all, or message = signal): the burst id
    counts images, the rolling count counts sent frames of the message.
    """

    messages: tuple[str, ...]
    id: str | dict[str, str] | None = None
    count: str | dict[str, str] | None = None
    checksum: BurstChecksumConfig | None = None

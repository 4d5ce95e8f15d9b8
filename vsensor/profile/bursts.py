"""Several frames that make up one image: sealed when sent, put together and judged when received."""

from collections.abc import Callable, Mapping, MutableMapping, Sequence
from dataclasses import dataclass
from typing import Literal

from vsensor.codec import Layout, SignalLayout, unpack
from vsensor.profile.pages import Page
from vsensor.types import Frame

FrameKey = tuple[str, int]
"""Message, and which of its pages (0 where nothing is multiplexed)."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Seal:
    """The checksum over a burst: value of `algorithm` over `before`, the covered bytes, `after`.

    `covers`: frame, places of its bytes; `blank`: bits (of the little-endian integer) that count as 0 in
    the frame `carrier`, which has it in `signal`.
    """

    carrier: FrameKey
    layout: Layout
    signal: SignalLayout
    algorithm: Callable[[bytes], int]
    before: bytes
    after: bytes
    covers: tuple[tuple[FrameKey, tuple[int, ...]], ...]
    blank: int

    def value(self, payloads: Mapping[FrameKey, bytes] | Mapping[FrameKey, bytearray]) -> int:
        """Return the checksum of these frames, as its signal holds it."""
        data = bytearray(self.before)
        for key, places in self.covers:
            payload = payloads[key]
            if key == self.carrier and self.blank:
                word = int.from_bytes(payload[: self.layout.length], "little") & ~self.blank
                payload = word.to_bytes(self.layout.length, "little")
            data += bytes(payload[place] for place in places)
        return self.algorithm(bytes(data + self.after)) & ((1 << self.signal.length) - 1)

    def is_right(self, payloads: Mapping[FrameKey, bytes]) -> bool:
        """Return whether the checksum of these frames is the one that they carry."""
        order, mask = self._order(), (1 << self.signal.length) - 1
        word = int.from_bytes(payloads[self.carrier][: self.layout.length], order)
        return word >> self.signal.shift & mask == self.value(payloads)

    def write(self, payloads: Mapping[FrameKey, bytearray]) -> None:
        """Write the checksum into the frame that carries it."""
        payload, order = payloads[self.carrier], self._order()
        mask = ((1 << self.signal.length) - 1) << self.signal.shift
        word = int.from_bytes(payload, order) & ~mask | self.value(payloads) << self.signal.shift
        payload[:] = word.to_bytes(self.layout.length, order)

    def _order(self) -> Literal["little", "big"]:
        return "big" if self.signal.big_endian else "little"


@dataclass(frozen=True, slots=True, kw_only=True)
class Burst:
    """The frames of one image. `ties` are the signals of a message that must be equal in all its frames."""

    name: str
    frames: tuple[FrameKey, ...]
    layouts: Mapping[str, Layout]
    pages: Mapping[str, tuple[Page, ...]]
    ties: Mapping[str, tuple[str, ...]]
    seal: Seal | None

    def close(self, payloads: Mapping[FrameKey, bytearray]) -> FrameKey | None:
        """Write the checksum over a whole burst; return the frame that has it, None if nothing was done."""
        if self.seal is None or any(key not in payloads for key in self.frames):
            return None
        self.seal.write(payloads)
        return self.seal.carrier

    def place_of(self, message: str, data: bytes) -> tuple[FrameKey | None, tuple[int, ...]]:
        """Return which frame of the burst this is, None if it is none of them, and the values that tie it."""
        layout = self.layouts[message]
        raws = unpack(layout, data)
        ties = tuple(
            raws.get(name, 0) & ((1 << layout.signals[name].length) - 1) for name in self.ties[message]
        )
        for number, page in enumerate(self.pages[message]):
            if all(raws.get(name) == raw for name, raw in page.items()):
                return (message, number), ties
        return None, ties


@dataclass(frozen=True, slots=True, kw_only=True)
class Image:
    """The frames of one burst as they came in, and what is wrong with it ("" = it is intact)."""

    burst: str
    frames: tuple[Frame, ...]
    fault: str

    @property
    def is_intact(self) -> bool:
        """Whether all its frames are there, belong together and have the right checksum."""
        return not self.fault


@dataclass(frozen=True, slots=True, kw_only=True)
class Assembly:
    """The frames of each burst that is not complete yet, by the burst's name; a value."""

    open: Mapping[str, Mapping[FrameKey, Frame]]
    ties: Mapping[str, tuple[int, ...]]


NOTHING_OPEN = Assembly(open={}, ties={})


def assemble(
    bursts: Sequence[Burst], message: str, state: Assembly, frame: Frame, *, is_right: bool = True
) -> tuple[Assembly, tuple[Image, ...]]:
    """Take in a frame of `message`; return the state after it and the images that it ended.

    A frame ends the image before it, incomplete, if that has the frame already or differs in burst id or
    rolling count. `is_right`: whether the frame's own protection holds; otherwise it is no part of an image.
    """
    for burst in bursts:
        if message in burst.layouts:
            return _collected(burst, message, state, frame, is_right)
    return state, ()


def _collected(
    burst: Burst, message: str, state: Assembly, frame: Frame, is_right: bool
) -> tuple[Assembly, tuple[Image, ...]]:
    images: list[Image] = []
    collected = dict(state.open.get(burst.name, {}))
    key, ties = burst.place_of(message, frame.data)
    if not is_right or key is None:
        cause = "wrong CRC" if not is_right else "a page that the profile does not have"
        return state, (Image(burst=burst.name, frames=(frame,), fault=f"{message}: {cause}"),)
    if collected and (key in collected or state.ties.get(burst.name) != ties):
        images.append(_incomplete(burst, collected))
        collected = {}
    collected[key] = frame
    if len(collected) == len(burst.frames):
        images.append(_complete(burst, collected))
        collected = {}
    after = Assembly(open={**state.open, burst.name: collected}, ties={**state.ties, burst.name: ties})
    return after, tuple(images)


def left_over(bursts: Sequence[Burst], state: Assembly) -> tuple[Image, ...]:
    """Return the images that are not complete at the end of a recording."""
    return tuple(
        _incomplete(burst, collected) for burst in bursts if (collected := state.open.get(burst.name))
    )


def _incomplete(burst: Burst, collected: Mapping[FrameKey, Frame]) -> Image:
    missing = [message for message, page in burst.frames if (message, page) not in collected]
    fault = f"{len(missing)} of {len(burst.frames)} frames missing: {', '.join(missing)}"
    return Image(burst=burst.name, frames=tuple(collected.values()), fault=fault)


def _complete(burst: Burst, collected: Mapping[FrameKey, Frame]) -> Image:
    payloads: MutableMapping[FrameKey, bytes] = {key: frame.data for key, frame in collected.items()}
    right = burst.seal is None or burst.seal.is_right(payloads)
    frames = tuple(collected[key] for key in burst.frames)
    return Image(burst=burst.name, frames=frames, fault="" if right else "wrong checksum over the burst")

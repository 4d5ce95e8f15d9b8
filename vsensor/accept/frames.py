"""The frames of one message, and what their length, CRC and page say of each."""

from dataclasses import dataclass

import numpy as np

from vsensor.accept.book import Book
from vsensor.codec import BulkReader
from vsensor.profile import MessagePlan
from vsensor.types import BoolArray, CodeArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Frames:
    """Frames of one message (N,); `data` (N, L) padded to its length, `right`: length and CRC are."""

    t_ns: IntArray
    data: CodeArray
    right: BoolArray

    def __len__(self) -> int:
        return len(self.t_ns)

    def part(self, first: int, last: int) -> "Frames":
        """Return the frames from `first` to `last` - 1."""
        rows = slice(first, last)
        return Frames(t_ns=self.t_ns[rows], data=self.data[rows], right=self.right[rows])

    def where(self, mask: BoolArray) -> "Frames":
        """Return the frames of a mask (N,)."""
        return Frames(t_ns=self.t_ns[mask], data=self.data[mask], right=self.right[mask])

    def then(self, other: "Frames") -> "Frames":
        """Return these frames and the others after them."""
        return Frames(
            t_ns=np.concatenate([self.t_ns, other.t_ns]),
            data=np.concatenate([self.data, other.data]),
            right=np.concatenate([self.right, other.right]),
        )


def checked(plan: MessagePlan, t_ns: IntArray, data: CodeArray, lengths: CodeArray, book: Book) -> Frames:
    """Return the frames of a message with what their length and CRC say; notes those that are wrong."""
    layout = plan.layout
    whole = layout.length + len(plan.padding)
    wide = np.zeros((len(data), layout.length), dtype=np.uint8)
    width = min(layout.length, data.shape[1])
    wide[:, :width] = data[:, :width]
    fits = (lengths == layout.length) | (lengths == whole)
    off = np.abs(lengths[~fits].astype(np.int64) - layout.length).astype(float)
    book.note("wrong_length", layout.name, t_ns[~fits], worst=off, limit=0.0, unit="bytes off")
    long_enough = lengths >= layout.length
    right = long_enough & fits
    if plan.guard is not None:
        holds = plan.guard.check_bulk(wide)
        wrong = long_enough & ~holds
        book.note("wrong_crc", layout.name, t_ns[wrong])
        right &= holds
    return Frames(t_ns=t_ns, data=wide, right=right)


def page_numbers(frames: Frames, plan: MessagePlan) -> IntArray:
    """Return which page (N,) each frame is of those that leave together; 0 where there is one alone."""
    numbers = np.zeros(len(frames), dtype=np.int64)
    if has_pages(plan):
        reader = BulkReader(plan.layout, frames.data)
        for number, page in enumerate(plan.pages):
            numbers[np.all([reader.raw(name) == raw for name, raw in page.items()], axis=0)] = number
    return numbers


def has_pages(plan: MessagePlan) -> bool:
    """Return whether several frames of the message leave together, so that its intervals are no cycles."""
    return len(plan.pages) > 1 and plan.mux == "together"

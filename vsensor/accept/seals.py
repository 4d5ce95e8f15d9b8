"""The bursts that a profile declares: put together as a consumer does, their checksum among them."""

from vsensor.accept.book import Book
from vsensor.accept.images import Mixed
from vsensor.profile import NOTHING_OPEN, FrameKey, Image, Profile
from vsensor.types import Frame


class Seals:
    """Puts declared bursts together frame by frame; the first and the last image may be cut."""

    def __init__(self, profile: Profile, book: Book) -> None:
        self._profile, self._book = profile, book
        self._state = NOTHING_OPEN
        self._members = {name for burst in profile.bursts for name in burst.layouts}
        self._begun: set[str] = set()
        self._last: dict[FrameKey | str, Frame] = {}

    def take(self, frames: Mixed) -> None:
        """Take in right frames of all messages, in order; what is there twice must have been left out."""
        if not self._members:
            return
        for row in range(len(frames)):
            plan = self._profile.messages[int(frames.plan[row])]
            if plan.layout.name in self._members and frames.right[row]:
                self._step(
                    Frame(
                        due_ns=int(frames.t_ns[row]),
                        arbitration_id=plan.layout.arbitration_id,
                        is_extended=plan.layout.is_extended,
                        data=frames.data[row, : plan.layout.length].tobytes(),
                    )
                )

    def _step(self, frame: Frame) -> None:
        self._state, images = self._profile.assemble(self._state, frame)
        for image in images:
            self._judge(image)

    def _judge(self, image: Image) -> None:
        first = image.burst not in self._begun
        self._begun.add(image.burst)
        if image.is_intact:
            return
        t_ns = [image.frames[0].due_ns]
        if "checksum" in image.fault:
            self._book.note("burst_checksum", image.burst, t_ns)
        elif "missing" in image.fault and not first:
            self._book.note("burst_incomplete", image.burst, t_ns)

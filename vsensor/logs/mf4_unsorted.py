"""MDF 4 data in which the records of several channel groups are mixed: taken apart, all in memory."""

from vsensor.logs.mf4_blocks import Data


class Whole:
    """The bytes of one channel group, or of one channel of variable length, in memory."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.fault: str | None = None

    @property
    def size(self) -> int:
        """Number of bytes."""
        return len(self.content)

    def read(self, start: int, size: int) -> bytes:
        """Return bytes `start` to `start + size`."""
        return bytes(self.content[start : start + size])


def split_records(data: Data, id_bytes: int, sizes: dict[int, tuple[int, int | None]]) -> dict[int, Whole]:
    """Return the records by the place of their channel group.

    `sizes`: record id -> place of its group and bytes of a record; None: a u32 length and as many bytes,
    kept with their length, as they stand in an SD block. What cannot be read is told in the `fault` of all.
    """
    found = {place: Whole() for place, _ in sizes.values()}
    content = data.read(0, data.size)
    at, end, fault = 0, len(content), data.fault
    while at + id_bytes <= end:
        number = int.from_bytes(content[at : at + id_bytes], "little")
        if number not in sizes:
            fault = fault or f"a record of the unknown group {number} at {at}"
            break
        place, size = sizes[number]
        start = at + id_bytes
        at = start + (4 + int.from_bytes(content[start : start + 4], "little") if size is None else size)
        if at > end:
            fault = fault or "the last record is cut off"
            break
        found[place].content += content[start:at]
    for whole in found.values():
        whole.fault = fault
    return found

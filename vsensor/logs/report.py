"""What is found in a log while it is read: channels, garbage, faults."""

from dataclasses import dataclass, field

SHOWN_GARBAGE = 5


@dataclass(slots=True)
class Notes:
    """What a reader finds while it reads: channels by name, garbage lines, the fault that ended it.

    `read_bytes` is how much of the file has been read. `place` is where the same reader can go on behind the
    frames that it gave last, None where it cannot tell.
    """

    read_bytes: int = 0
    place: tuple[int, ...] | None = None
    channels: dict[str, int] = field(default_factory=dict[str, int])
    garbage_lines: int = 0
    first_garbage: list[tuple[int, str]] = field(default_factory=list[tuple[int, str]])
    other_lines: int = 0
    impossible_frames: int = 0
    first_impossible: str = ""
    fault: str | None = None

    def channel(self, name: str) -> int:
        """Return the number of a channel, given out in order of appearance; 255 takes all beyond it."""
        return self.channels.setdefault(name, min(len(self.channels), 255))

    def garbage(self, line_number: int, text: str) -> None:
        """Count a line that holds no frame and should."""
        self.garbage_lines += 1
        if len(self.first_garbage) < SHOWN_GARBAGE:
            self.first_garbage.append((line_number, text.strip()[:60]))

    def impossible(self, count: int, text: str) -> None:
        """Count frames of a binary log that no bus can carry; `text` describes the first."""
        if count and not self.impossible_frames:
            self.first_impossible = text
        self.impossible_frames += count

    def why_empty(self) -> str:
        """Return why a log in which no frame was found has none."""
        if self.fault is not None:
            return f"no frame could be read: {self.fault}"
        if self.impossible_frames:
            return f"holds no frame that a bus can carry: {self.first_impossible}"
        if self.garbage_lines:
            number, text = self.first_garbage[0]
            return f"holds no CAN frame; {self.garbage_lines} lines are none, first line {number}: {text!r}"
        return "holds no CAN frame"

    def problems(self) -> list[str]:
        """Return what is wrong with the log, as sentences; [] for a clean one."""
        return _problems(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class LogReport:
    """What is in a log and what was wrong with it.

    `first_garbage` holds (line number, start of the text) of the first few garbage lines, `other_lines`
    counts lines that are no frames by right (events, statistics), `impossible_frames` those of a binary
    log that no bus can carry (an 11-bit id above 0x7FF); all of them are left out. `repeated_timestamps` and
    `backward_timestamps` count the intervals of 0 and below 0; `fault` says why reading ended early.
    """

    path: str
    frames: int
    channels: tuple[str, ...]
    ids: int
    first_ns: int
    last_ns: int
    repeated_timestamps: int
    backward_timestamps: int
    error_frames: int
    remote_frames: int
    garbage_lines: int
    first_garbage: tuple[tuple[int, str], ...]
    other_lines: int
    impossible_frames: int
    first_impossible: str
    fault: str | None

    def lines(self) -> list[str]:
        """Return what is in the log and what is wrong with it, as sentences; the first says what was read."""
        seconds = (self.last_ns - self.first_ns) / 1e9
        channels = ", ".join(self.channels)
        found = [f"{self.path}: {self.frames} frames, {self.ids} ids, {seconds:.3f} s, channels {channels}"]
        if self.repeated_timestamps:
            share = self.repeated_timestamps / max(1, self.frames - 1)
            found.append(f"{self.repeated_timestamps} intervals between frames are 0 ({share:.1%})")
        return found + self.problems()

    def problems(self) -> list[str]:
        """Return what is wrong with the log, as sentences; [] for a clean one."""
        found = _problems(self)
        if self.backward_timestamps:
            found.append(f"{self.backward_timestamps} timestamps run backwards")
        return found


def _problems(found: Notes | LogReport) -> list[str]:
    lines = []
    if found.garbage_lines:
        number, text = found.first_garbage[0]
        lines.append(f"{found.garbage_lines} lines are no CAN frames, first line {number}: {text!r}")
    if found.impossible_frames:
        lines.append(f"{found.impossible_frames} frames left out: {found.first_impossible}")
    if found.fault is not None:
        lines.append(f"reading ended early: {found.fault}")
    return lines

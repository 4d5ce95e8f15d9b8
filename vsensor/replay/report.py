"""What a replay did, as figures and as the lines that a person reads at its end."""

from dataclasses import dataclass, field

from vsensor.timing import Timing


@dataclass(slots=True)
class Report:
    """What a replay did; `text()` is what a person sees at its end."""

    real_time: bool = True
    by_channel: dict[int, int] = field(default_factory=dict[int, int])
    refused: int = 0
    reordered: int = 0
    timing: Timing = field(default_factory=Timing)
    first_late_ns: int | None = None
    last_late_ns: int = 0
    due_ns: int = 0  # of the latest frame
    wall_s: float = 0.0  # 0: nobody measured it
    interrupted: bool = False
    names: dict[str, int] = field(default_factory=dict[str, int])  # of the channels -> their numbers
    fault: str | None = None  # why the log was not played to its end
    seeks: int = 0
    silence_ns: int = 0  # the longest without a frame while one was under way
    notes: list[str] = field(default_factory=list[str])

    @property
    def frames_sent(self) -> int:
        """Frames that a bus took, of all channels."""
        return sum(self.by_channel.values())

    @property
    def duration_error_ns(self) -> int:
        """Time from the first to the last frame as sent, less the same as planned, pauses left out."""
        return self.last_late_ns - (self.first_late_ns or 0)

    def sent(self, channel: int, taken: bool) -> None:
        """Count a frame."""
        if taken:
            self.by_channel[channel] = self.by_channel.get(channel, 0) + 1
        else:
            self.refused += 1

    def order(self, before_ns: int, due_ns: int) -> None:
        """Note that the frame due at `due_ns` left after the one due at `before_ns`."""
        self.reordered += due_ns < before_ns
        self.due_ns = due_ns

    def late(self, late_ns: int) -> None:
        """Note how late the first of the frames of one time left."""
        self.timing.lateness.add(late_ns)
        if self.first_late_ns is None:
            self.first_late_ns = late_ns
        self.last_late_ns = late_ns

    def silent(self, silence_ns: int) -> None:
        """Note how long no frame was sent during a seek."""
        self.silence_ns = max(self.silence_ns, silence_ns)

    def text(self) -> str:
        """Return the summary as lines."""
        by_number = {number: name for name, number in self.names.items()}
        each = ", ".join(
            f"{by_number.get(number, number)} {count}" for number, count in sorted(self.by_channel.items())
        )
        lines = [
            f"frames sent {self.frames_sent}"
            + (f" in {self.wall_s:.2f} s" if self.wall_s else "")
            + (f" ({each})" if len(self.by_channel) > 1 else "")
            + f", refused by the bus {self.refused}, reordered {self.reordered}"
        ]
        if self.real_time and self.frames_sent:
            lines += [f"{name}: {samples.text()}" for name, samples in self.timing.named().items()]
            planned_s, off_ms = self.due_ns / 1e9, self.duration_error_ns / 1e6
            lines.append(f"duration {planned_s:.3f} s as planned, error {off_ms:.3f} ms")
        if self.real_time and self.seeks:
            lines.append(f"seeks {self.seeks}, longest silence at one {self.silence_ns / 1e6:.3f} ms")
        return "\n".join([*lines, *self.notes])

"""The car's frames from where on an ECU steers: they tell the simulated motion, not the recorded one."""

from collections import deque
from collections.abc import Callable, Sequence
from typing import NamedTuple, Protocol

from vsensor.overlay import Made, MovedFrames
from vsensor.replay.reel import Piece
from vsensor.types import Frame


class Ears(Protocol):
    """Who hears the ECU."""

    def taken(self) -> Sequence[Frame]:
        """Return what was heard since the last call, times from the replay's beginning."""
        ...


class Steered(NamedTuple):
    """From `from_ns` of the log on an ECU steers: `ears` hear it, `frames` of the car tell the new motion.

    `recorded(log_ns)` and `simulated(made)` give the quantities of MovedFrames.
    """

    from_ns: int
    ears: Ears
    frames: MovedFrames
    recorded: Callable[[int], dict[str, float]]
    simulated: Callable[[Made], dict[str, float]]


class Motions:
    """The motion at the latest two slots of a steered vehicle."""

    def __init__(self) -> None:
        self._latest: deque[tuple[int, dict[str, float]]] = deque(maxlen=2)  # log time

    def forget(self) -> None:
        """Begin anew, where the log has moved the vehicle."""
        self._latest.clear()

    def take(self, steered: Steered | None, log_ns: int, made: Made) -> None:
        """Note the motion of an image at `log_ns`."""
        if steered is not None and made.is_steered:
            self._latest.append((log_ns, steered.simulated(made)))
        else:
            self._latest.clear()

    def told_anew(self, steered: Steered | None, run: Piece) -> Piece:
        """Return the car's frames as they are once the vehicle moves otherwise than recorded."""
        if steered is None or not self._latest:
            return run
        pairs = []
        for frame, log_ns in zip(run.frames, run.log_ns, strict=True):
            moved = frame if log_ns < steered.from_ns else self._told(steered, frame, log_ns)
            if moved is not None:
                pairs.append((moved, log_ns))
        return Piece([frame for frame, _ in pairs], [log_ns for _, log_ns in pairs], run.loop)

    def _told(self, steered: Steered, frame: Frame, log_ns: int) -> Frame | None:
        """Return a frame with the motion of its time, extrapolated from the latest two slots."""
        (first_ns, first), (last_ns, last) = self._latest[0], self._latest[-1]
        part = (log_ns - last_ns) / (last_ns - first_ns) if last_ns > first_ns else 0.0
        recorded = steered.recorded(log_ns)
        changes = {
            name: value + part * (value - first[name]) - recorded[name] for name, value in last.items()
        }
        return steered.frames.moved(frame, changes)

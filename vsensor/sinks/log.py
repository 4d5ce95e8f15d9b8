"""Writes what was sent into a CAN log."""

from pathlib import Path

from vsensor.logs import open_log_writer
from vsensor.types import Output


class LogSink:
    """A CAN log of the frames of every tick, at their due time plus `epoch_ns` (start of the run since 1970).

    Where opening the sinks takes part of the time to the start, `starts_at` says it afterwards. The log
    is complete after `close`, also when the run ended early.
    """

    def __init__(self, path: Path | str, epoch_ns: int = 0, channels: tuple[str, ...] = ()) -> None:
        """Open the file; raises LogError for an unknown suffix or a path that cannot be written."""
        self._writer = open_log_writer(path, channels)
        self._epoch_ns = epoch_ns

    def starts_at(self, epoch_ns: int) -> None:
        """Set the time of slot 0 since 1970, before the first write."""
        self._epoch_ns = epoch_ns

    def write(self, output: Output) -> None:
        """Write the frames of one tick."""
        for frame in output.frames:
            self._writer.write(frame, self._epoch_ns)

    def close(self) -> None:
        """Write what is left and close the file."""
        self._writer.close()

"""CAN logs: read, written, decoded in bulk."""

from vsensor.logs.chunks import CHUNK, iter_chunks
from vsensor.logs.read import READERS, iter_frames, log_format, read_log
from vsensor.logs.report import LogReport, Notes
from vsensor.logs.table import Columns, Flag, LogTable, Record, frames_of
from vsensor.logs.write import WRITERS, LogWriter, open_log_writer, write_log

__all__ = [
    "CHUNK",
    "READERS",
    "WRITERS",
    "Columns",
    "Flag",
    "LogReport",
    "LogTable",
    "LogWriter",
    "Notes",
    "Record",
    "frames_of",
    "iter_chunks",
    "iter_frames",
    "log_format",
    "open_log_writer",
    "read_log",
    "write_log",
]

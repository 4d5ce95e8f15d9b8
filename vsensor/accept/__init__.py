"""Acceptance check: judges a stream of frames, ours or a car's, as a consumer would.

accept_log(path, profiles, limits) -> Judgement                    a recording
accept_bus("socketcan:can0", profiles, limits, duration_s=...)     a live bus
Stream(profile, limits): take(columns) ... end(); verdict_of(stream)       any frames, in any chunks
"""

from vsensor.accept.book import Finding
from vsensor.accept.config import SCHEMA, LimitsConfig, load_limits
from vsensor.accept.kinds import CONSUMER, Kind
from vsensor.accept.listen import accept_bus, accept_log, columns_of_frames, judged
from vsensor.accept.stream import Stream
from vsensor.accept.verdict import REPORT_SCHEMA, Intervals, Judgement, Verdict, verdict_of, write_report

__all__ = [
    "CONSUMER",
    "REPORT_SCHEMA",
    "SCHEMA",
    "Finding",
    "Intervals",
    "Judgement",
    "Kind",
    "LimitsConfig",
    "Stream",
    "Verdict",
    "accept_bus",
    "accept_log",
    "columns_of_frames",
    "judged",
    "load_limits",
    "verdict_of",
    "write_report",
]

"""What a CAN log says of lanes and motion, as series in time that a video's frames are compared with.

log ──decode──► quantity: times, values ──► at the times of frames: between two values, or the last one
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsensor.errors import LogError
from vsensor.logs import read_log
from vsensor.logs.decode import decode_frames
from vsensor.profile import Profile
from vsensor.types import NANOSECONDS_PER_SECOND, Array

STALE_S = 0.5
"""Between two values farther apart than this, and so long after the last one, nothing is known: five cycles
of the slowest lane cameras."""
EDGE_S = 0.1
"""So far before the first value and after the last one a measured quantity still stands for it."""

Series = tuple[Array, Array]
"""Times in s since the log's first frame, ascending (N,), and values (N,); NaN = not available."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CanSignals:
    """The decoded series of one log; `seconds` is its length, `notes` are sentences for the user."""

    path: Path
    seconds: float
    series: Mapping[str, Series]
    notes: tuple[str, ...] = ()

    def linear(self, name: str, t_s: Array) -> Array:
        """Return a quantity at times (M,), between its values; NaN where one of the two is not available."""
        times, values = self.series.get(name, _NOTHING)
        if not len(times):
            return np.full(len(t_s), np.nan)
        after = np.clip(np.searchsorted(times, t_s, side="left"), 0, len(times) - 1)
        before = np.where(times[after] > t_s, np.maximum(after - 1, 0), after)
        step = times[after] - times[before]
        part = np.clip((t_s - times[before]) / np.where(step > 0.0, step, 1.0), 0.0, 1.0)
        found = np.where(step > 0.0, values[before] * (1.0 - part) + values[after] * part, values[before])
        is_inside = (t_s >= times[0] - EDGE_S) & (t_s <= times[-1] + EDGE_S)
        return np.where(is_inside & (step <= STALE_S), found, np.nan)

    def held(self, name: str, t_s: Array) -> Array:
        """Return a quantity at times (M,) as it was last told: for codes, between which there is nothing."""
        times, values = self.series.get(name, _NOTHING)
        if not len(times):
            return np.full(len(t_s), np.nan)
        place = np.searchsorted(times, t_s + 1e-9, side="right") - 1
        found = values[np.maximum(place, 0)]
        return np.where((place >= 0) & (t_s - times[np.maximum(place, 0)] <= STALE_S), found, np.nan)

    def require_overlap(self, begins_s: float, ends_s: float) -> None:
        """Raise LogError where a video from `begins_s` to `ends_s` of the log's time lies beside the log."""
        if begins_s > self.seconds or ends_s < 0.0:
            raise LogError(
                f"{self.path}: does not overlap the video: the log has 0 to {self.seconds:.1f} s, the video "
                f"{begins_s:.1f} to {ends_s:.1f} s of its time; a log of the same drive was expected, or "
                "another time for the video's beginning"
            )


_NOTHING: Series = (np.empty(0), np.empty(0))


def read_can(path: Path, profiles: Sequence[Profile]) -> CanSignals:
    """Read a log; raises LogError if it cannot be read or holds no frame of the profiles."""
    table = read_log(path)
    frames = decode_frames(table, profiles)
    begin = table.report.first_ns
    series: dict[str, Series] = {}
    for name in frames.columns:
        t_ns, values = frames.series(name)
        order = np.argsort(t_ns, kind="stable")
        series[name] = (t_ns[order] - begin) / NANOSECONDS_PER_SECOND, values[order]
    seconds = (table.report.last_ns - begin) / NANOSECONDS_PER_SECOND
    return CanSignals(path=path, seconds=seconds, series=series, notes=frames.findings[1:])

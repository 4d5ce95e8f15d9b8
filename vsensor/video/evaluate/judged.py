"""Events with all that is known of them: what methods say, what the CAN log says, what is true."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from vsensor.errors import TableError, VsensorError
from vsensor.profile import load_profiles
from vsensor.types import Array
from vsensor.video import lov
from vsensor.video.can_signals import CanSignals, read_can
from vsensor.video.evaluate.categories import Compared, compared
from vsensor.video.evaluate.lateness import Timed
from vsensor.video.evaluate.pairing import Reference, reference_of
from vsensor.video.evaluate.rules import Rules
from vsensor.video.evaluate.statistics import Pooled
from vsensor.video.evaluate.truth import Truth
from vsensor.video.event_folder import EventFolder
from vsensor.video.methods import METHODS
from vsensor.video.rows import Rows, read_rows

CAN, TRUTH = "CAN", "truth"
Figures = Mapping[tuple[str, str], Mapping[str, Pooled]]
"""By (method, what it was compared with) and type of case."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Judged:
    """One event: the methods' rows, all of the same times, the reference, and the truth if it is known.

    `can` is the log that the reference is from.
    """

    folder: EventFolder
    rows: Mapping[str, Rows]
    reference: Reference
    truth: Truth | None
    can: CanSignals

    @property
    def name(self) -> str:
        """The event's name."""
        return self.folder.name

    def offsets(self, method: str) -> Array:
        """Return a method's offsets (N, 2) of left and right, positive to the left."""
        rows = self.rows[method]
        return np.column_stack([rows.left_offset_m, rows.right_offset_m])

    def confidences(self, method: str) -> Array:
        """Return a method's confidences (N, 2)."""
        rows = self.rows[method]
        return np.column_stack([rows.left_confidence, rows.right_confidence]).astype(np.float64)

    def timed(self, method: str) -> Timed:
        """Return what says by how much the method's signal is late."""
        return Timed(
            can=self.can,
            at_s=self.reference.t_s + self.folder.config.video_starts_at_log_s,
            offset_m=self.offsets(method),
            counts=np.isfinite(self.reference.offset_m),
        )

    def against_can(self, method: str) -> Compared:
        """Return the errors against the CAN log."""
        return compared(self.name, self.reference, self.offsets(method))

    def against_truth(self, method: str) -> Compared:
        """Return the errors against the truth; all unknown where there is none."""
        offset = np.full((len(self.reference.t_s), 2), np.nan) if self.truth is None else self.truth.offset_m
        return compared(self.name, self.reference, self.offsets(method), offset)


def judge_events(
    folders: Sequence[EventFolder],
    rows: Mapping[tuple[str, str], Rows],
    methods: Sequence[str],
    rules: Rules,
) -> tuple[list[Judged], list[str]]:
    """Return the events that all methods ran on, and a sentence for each that cannot be compared."""
    found, refused = [], []
    for folder in folders:
        if any((folder.name, method) not in rows for method in methods):
            continue
        try:
            found.append(judged(folder, {method: rows[folder.name, method] for method in methods}, rules))
        except VsensorError as error:
            refused.append(f"{folder.name}: {error}")
    return found, refused


def judged(folder: EventFolder, rows: Mapping[str, Rows], rules: Rules) -> Judged:
    """Put an event together; raises LogError, TableError where a file cannot be compared with the video."""
    t_s = next(iter(rows.values())).t_s
    can = read_can(folder.log, load_profiles(folder.profiles))
    reference = reference_of(can, t_s, folder.config.video_starts_at_log_s, rules)
    truth = None if folder.truth is None else read_truth(folder.truth, t_s)
    if rules.fill:
        rows = {name: _filled(one) if METHODS[name].has_lov else one for name, one in rows.items()}
    return Judged(folder=folder, rows=rows, reference=reference, truth=truth, can=can)


def _filled(rows: Rows) -> Rows:
    return lov.processed(lov.LovConfig(fill=True), rows)


def read_truth(path: Path, t_s: Array) -> Truth:
    """Return the truth of an event at the times of its frames (N,); raises TableError where it has none."""
    rows = read_rows(path)
    if not len(rows):
        raise TableError(f"{path}: is empty: a row for each frame was expected")
    after = np.minimum(np.searchsorted(rows.t_s, t_s), len(rows) - 1)
    before = np.maximum(after - 1, 0)
    place = np.where(np.abs(rows.t_s[before] - t_s) < np.abs(rows.t_s[after] - t_s), before, after)
    away = np.abs(rows.t_s[place] - t_s)
    if away.max() > MOST_AWAY_S:
        at_s = t_s[away.argmax()]
        raise TableError(
            f"{path}: has no row at {at_s:.3f} s of the video, the nearest is {away.max():.3f} s away"
        )
    confidence = np.column_stack([rows.left_confidence, rows.right_confidence])[place]
    return Truth(
        offset_m=np.column_stack([rows.left_offset_m, rows.right_offset_m])[place],
        is_near=confidence == NEAR_CONFIDENCE,
    )


MOST_AWAY_S = 0.005
"""A row of the truth this near to a frame is its own: at 0.5 m/s across that is 2.5 mm."""
NEAR_CONFIDENCE = 4
"""A truth has this where a marking is seen in the first 20 m."""

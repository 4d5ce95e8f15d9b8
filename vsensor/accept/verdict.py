"""What is concluded from a stream: findings, remarks, and how a person and a program read them."""

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from vsensor.accept.book import Finding
from vsensor.accept.kinds import Kind
from vsensor.accept.ranges import remarks as range_remarks
from vsensor.accept.stream import Stream
from vsensor.errors import ConfigError

REPORT_SCHEMA = "vsensor.accept_report/1"

_BATCH_SHARE = 0.02  # of the intervals: that many late frames, and as many stamps twice, are the recorder's
_TIMES_SHOWN = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervals:
    """Intervals of one message in ms, beside its cycle (None without one)."""

    message: str
    frames: int
    cycle_ms: float | None
    p50_ms: float
    p99_ms: float
    max_ms: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Verdict:
    """A stream judged by one profile; accepted if nothing was found. Times count from `start_ns`."""

    profile: str
    frames: int
    start_ns: int
    seconds: float
    findings: tuple[Finding, ...]
    remarks: tuple[str, ...]
    intervals: tuple[Intervals, ...]

    @property
    def is_accepted(self) -> bool:
        """Whether a consumer would have nothing to complain about."""
        return not self.findings

    def time_s(self, t_ns: int) -> float:
        """Return seconds since the first frame."""
        return (t_ns - self.start_ns) / 1e9

    def lines(self) -> Iterator[str]:
        """Yield the verdict for people: a line for each finding, the worst first, then the remarks."""
        yield f"profile {self.profile}: {self.frames} frames in {self.seconds:.2f} s"
        cells = [_HEAD, *(self._cells(finding) for finding in self.findings)]
        widths = [max(len(row[k]) for row in cells) for k in range(len(_HEAD))]
        for row in cells if self.findings else ():
            yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
        yield from (f"remark: {text}" for text in self.remarks)
        yield "accepted" if self.is_accepted else f"not accepted: {len(self.findings)} findings"

    def _cells(self, finding: Finding) -> tuple[str, ...]:
        return (
            finding.kind,
            finding.message,
            str(finding.count),
            f"{self.time_s(finding.first_ns):.3f}",
            _size(finding.worst, finding.unit),
            _size(finding.limit, "") if finding.worst is not None else "",
            f"{finding.subject}: {finding.consumer}" if finding.subject else finding.consumer,
        )

    def as_dict(self) -> dict[str, Any]:
        """Return the verdict for programs."""
        return {
            "profile": self.profile,
            "accepted": self.is_accepted,
            "frames": self.frames,
            "start_ns": self.start_ns,
            "seconds": self.seconds,
            "findings": [self._entry(finding) for finding in self.findings],
            "remarks": list(self.remarks),
            "intervals": [
                {name: _plain(getattr(row, name)) for name in row.__dataclass_fields__}
                for row in self.intervals
            ],
        }

    def _entry(self, finding: Finding) -> dict[str, Any]:
        return {
            "kind": finding.kind,
            "message": finding.message,
            "subject": finding.subject,
            "count": finding.count,
            "first_s": self.time_s(finding.first_ns),
            "last_s": self.time_s(finding.last_ns),
            "worst": finding.worst,
            "limit": finding.limit,
            "unit": finding.unit,
            "consumer": finding.consumer,
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class Judgement:
    """A recording or a bus judged by each profile, and remarks on itself."""

    source: str
    verdicts: tuple[Verdict, ...]
    remarks: tuple[str, ...]

    @property
    def is_accepted(self) -> bool:
        """Whether all profiles accept it."""
        return all(verdict.is_accepted for verdict in self.verdicts)

    def lines(self) -> Iterator[str]:
        """Yield all of it for people."""
        yield from (f"remark: {text}" for text in self.remarks)
        for verdict in self.verdicts:
            yield from verdict.lines()


def write_report(path: Path, judgement: Judgement) -> None:
    """Write a judgement as JSON for programs. Raises ConfigError if the file cannot be written."""
    report = {
        "schema": REPORT_SCHEMA,
        "source": judgement.source,
        "accepted": judgement.is_accepted,
        "remarks": list(judgement.remarks),
        "verdicts": [verdict.as_dict() for verdict in judgement.verdicts],
    }
    try:
        path.write_text(json.dumps(report, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    except OSError as error:
        raise ConfigError(f"{path}: cannot be written: {error.strerror or error}") from None


_HEAD = ("kind", "message", "count", "first s", "worst", "limit", "what about: what a consumer does")


def _size(value: float | None, unit: str) -> str:
    return "" if value is None else f"{value:.4g} {unit}".rstrip()


def _plain(value: object) -> object:
    return None if isinstance(value, float) and math.isnan(value) else value


def verdict_of(stream: Stream) -> Verdict:
    """Return what is concluded from a stream that has ended."""
    unheard = _note_unheard(stream)
    batched = _forgive_batches(stream)
    findings, allowed = _without_allowed(stream)
    begin_ns, end_ns = stream.bus_ns
    return Verdict(
        profile=stream.profile.name,
        frames=sum(watch.count for watch in stream.watches),
        start_ns=begin_ns,
        seconds=(end_ns - begin_ns) / 1e9,
        findings=findings,
        remarks=(*unheard, *batched, *allowed, *_of_messages(stream), *_of_bus(stream)),
        intervals=tuple(_intervals(stream)),
    )


def _note_unheard(stream: Stream) -> list[str]:
    """Note the messages that never came; return those that need not come."""
    silent = []
    for watch in stream.watches:
        if watch.count:
            continue
        for finding in stream.book.of("burst_incomplete", watch.name):
            stream.book.drop(finding.kind, watch.name)
        if watch.plan.sending.is_event and not watch.plan.cycle_ns:
            silent.append(f"{watch.name} (sent by events alone) never came")
        else:
            stream.book.note("never_heard", watch.name, [stream.bus_ns[0]])
    return silent


def _forgive_batches(stream: Stream) -> list[str]:
    """Forget late frames where the recorder stamps in batches; return the remark that says so."""
    how = stream.limits.timestamps
    same = stream.same_time / max(1, stream.frames - 1)
    watches = (*stream.watches, *stream.pages.values())
    late = [watch for watch in watches if watch.late > _BATCH_SHARE * watch.count]
    if how == "exact" or (how == "auto" and (same < _BATCH_SHARE or not late)):
        return []
    forgiven = sum(stream.book.drop("late", watch.name) for watch in stream.watches)
    if not forgiven:
        return []
    return [
        f"timestamps are batched ({same:.1%} of the frames have that of the one before):"
        f" {forgiven} late frames are not counted"
    ]


def _without_allowed(stream: Stream) -> tuple[tuple[Finding, ...], list[str]]:
    allow: dict[Kind, int] = stream.limits.allow
    findings = stream.book.findings()
    passing = [finding for finding in findings if finding.count <= allow.get(finding.kind, 0)]
    said = [f"allowed: {finding.count} {finding.kind} in {finding.message}" for finding in passing]
    return tuple(finding for finding in findings if finding not in passing), said


def _of_messages(stream: Stream) -> list[str]:
    paced = {watch.name for watch in (*stream.watches, *stream.pages.values()) if watch.is_paced}
    unpaced = [watch.name for watch in stream.watches if watch.count and watch.name not in paced]
    back = sum(watch.backwards for watch in stream.watches)
    saturated: dict[str, int] = {}
    for ranges in stream.ranges:
        for name, count in ranges.saturated.items():
            saturated[name] = saturated.get(name, 0) + count
    said = [f"no cycle is known, so silence is not judged: {', '.join(unpaced)}"] * bool(unpaced)
    said += [f"{back} timestamps run backwards"] * bool(back)
    changes = stream.steps.lane_changes
    said += [f"{changes} steps of an offset as wide as a lane count as lane changes"] * bool(changes)
    return [*said, *stream.contradictions.remarks(), *range_remarks(saturated)]


def _of_bus(stream: Stream) -> list[str]:
    said = [f"{stream.error_frames} error frames on the bus"] * bool(stream.error_frames)
    begin_ns, end_ns = stream.bus_ns
    if stream.fd_frames or end_ns <= begin_ns:
        return said
    load = stream.bits / ((end_ns - begin_ns) / 1e9) / (1e3 * stream.limits.bitrate_kbps)
    kbps, others = stream.limits.bitrate_kbps, len(stream.foreign)
    others_said = f", {others} other ids among it" if others else ""
    return [*said, f"bus load about {load:.1%} of {kbps:g} kbit/s{others_said}"]


def _intervals(stream: Stream) -> Iterator[Intervals]:
    for watch in stream.watches:
        p50_ms, p99_ms, max_ms = watch.intervals.quantiles_ms().tolist()
        cycle_ns = watch.plan.cycle_ns
        yield Intervals(
            message=watch.name,
            frames=watch.count,
            cycle_ms=cycle_ns / 1e6 if cycle_ns else None,
            p50_ms=p50_ms,
            p99_ms=p99_ms,
            max_ms=max_ms,
        )

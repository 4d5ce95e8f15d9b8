"""`vsensor video evaluate`: methods over events, compared; figures, and the same as text."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from vsensor.errors import ConfigError
from vsensor.pages import require_folder
from vsensor.study.table import aligned
from vsensor.video.evaluate.categories import by_category, table_of
from vsensor.video.evaluate.files import write_files
from vsensor.video.evaluate.judged import CAN, TRUTH, Figures, Judged, judge_events
from vsensor.video.evaluate.lateness import lateness_s
from vsensor.video.evaluate.rules import Rules
from vsensor.video.evaluate.runs import RunOptions, run_methods
from vsensor.video.evaluate.truth import Presence, presence, presence_table
from vsensor.video.event_folder import find_events

CHOICES = ("reliable", "unreliable", "all")


@dataclass(frozen=True, slots=True, kw_only=True)
class EvaluateOptions:
    """What the command line says; `which` of CHOICES."""

    out: Path
    methods: tuple[str, ...]
    rules: Rules = field(default_factory=Rules)
    which: str = "reliable"
    run: RunOptions = field(default_factory=RunOptions)
    pictures: bool = True


@dataclass(frozen=True, slots=True, kw_only=True)
class Evaluation:
    """What an evaluation found: figures, text, what went wrong, and what an extra would have added."""

    figures: Figures
    presence: Mapping[str, Presence]
    lines: tuple[str, ...]
    failures: tuple[str, ...]
    interrupted: bool
    missing: tuple[str, ...] = ()


def evaluate(place: Path, options: EvaluateOptions, say: Callable[[str], None]) -> Evaluation:
    """Run what is not finished yet, and write the files; raises VsensorError subclasses.

    An event that fails is a line in `failures`; the others go on.
    """
    folders = find_events(place)
    require_folder(options.out)
    say(f"{len(folders)} events, {' and '.join(options.methods)}, into {options.out}")
    rows, outcome = run_methods(folders, options.methods, options.out, options.run)
    failures = [
        f"{Path(one.cell['event']).name}, {one.cell['method']}: {one.error}" for one in outcome.failures
    ]
    judged, refused = judge_events(folders, rows, options.methods, options.rules)
    failures += refused
    chosen = [one for one in judged if _is_chosen(one, options)]
    if not chosen:
        if outcome.interrupted:
            return Evaluation(figures={}, presence={}, lines=(), failures=tuple(failures), interrupted=True)
        raise ConfigError(_none_left(place, judged, failures, options))
    figures = _figures(chosen, options.methods)
    present = _presence(chosen, options)
    lines = _lines(len(folders), judged, chosen, options, figures, present)
    late = late_lines(chosen, options.methods)
    said = [*lines[:2], *late]
    missing = write_files(
        options.out, said, chosen, options.methods, figures, present, pictures=options.pictures
    )
    return Evaluation(
        figures=figures,
        presence=present,
        lines=(*lines, *([""] if late else []), *late),
        failures=tuple(failures),
        interrupted=outcome.interrupted,
        missing=tuple(missing),
    )


def _is_chosen(one: Judged, options: EvaluateOptions) -> bool:
    reliable = one.reference.reliable_share >= options.rules.share
    return options.which == "all" or reliable == (options.which == "reliable")


def _none_left(
    place: Path, judged: Sequence[Judged], failures: Sequence[str], options: EvaluateOptions
) -> str:
    if not judged:
        return f"{place}: no event could be used: {failures[0] if failures else 'none ran'}"
    shares = [100.0 * one.reference.reliable_share for one in judged]
    return (
        f"{place}: none of {len(judged)} events is {options.which}: {100 * options.rules.share:g} % of the "
        f"CAN offsets with confidence {options.rules.least_confidence} or more were asked for, they have "
        f"{min(shares):.0f} to {max(shares):.0f} %"
    )


def _figures(chosen: Sequence[Judged], methods: Sequence[str]) -> Figures:
    found = {}
    true = [one for one in chosen if one.truth is not None]
    for method in methods:
        found[method, CAN] = by_category([one.against_can(method) for one in chosen])
        if true:
            found[method, TRUTH] = by_category([one.against_truth(method) for one in true])
    return found


def _presence(chosen: Sequence[Judged], options: EvaluateOptions) -> dict[str, Presence]:
    found = {}
    for method in options.methods:
        pairs = [(one.truth, one.offsets(method)) for one in chosen if one.truth is not None]
        if pairs:
            found[method] = presence(pairs, options.rules.gross_m)
    return found


def _lines(
    events: int,
    judged: Sequence[Judged],
    chosen: Sequence[Judged],
    options: EvaluateOptions,
    figures: Figures,
    present: Mapping[str, Presence],
) -> list[str]:
    rules = options.rules
    filled = ", gaps filled" if rules.fill else ""
    lines = [
        f"{events} events, {len(judged)} can be compared, {len(chosen)} taken ({options.which}: at least "
        f"{100 * rules.share:g} % of the CAN offsets have confidence {rules.least_confidence}{filled})",
        "errors in m: distance from the vehicle to the marking less the reference's, positive is too far out",
    ]
    for (method, against), found in figures.items():
        lines += ["", f"{method} against {against}", *_left_first(table_of(found))]
    if present:
        lines += ["", *_left_first(presence_table(present))]
    return lines


def late_lines(events: Sequence[Judged], methods: Sequence[str]) -> list[str]:
    """Return by how much each method's signal is late against the CAN log's, where that can be said."""
    found = []
    for method in methods:
        late_s = lateness_s([one.timed(method) for one in events])
        if late_s == late_s:
            word = "late" if late_s > 0.0 else "early"
            found.append(f"{method}: its signal is {abs(late_s):.2f} s {word} against the CAN log's")
    return found


def _left_first(rows: Sequence[Sequence[str]]) -> list[str]:
    width = max(len(row[0]) for row in rows)
    return aligned([[row[0].ljust(width), *row[1:]] for row in rows])

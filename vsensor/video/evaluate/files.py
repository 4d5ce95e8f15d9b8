"""What an evaluation leaves: tables, rows, and the page with both methods side by side.

| file | what |
|---|---|
| `report.html` | tables in the form of P2's 3.2, histograms, events, pictures; loads nothing from outside |
| `table.csv` | the same tables: a row per method, reference and type of case |
| `events.csv` | a row per event and method: number, mean, standard deviation (P2's table 3.1), conditions |
| `rows/METHOD/EVENT.csv` | what the method said of each frame |
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera
from vsensor.errors import MissingExtraError
from vsensor.pages import require_folder
from vsensor.study.table import replace_file, write_csv
from vsensor.video.evaluate import figures as draw
from vsensor.video.evaluate.categories import csv_rows, published_table, table_of
from vsensor.video.evaluate.judged import CAN, TRUTH, Figures, Judged
from vsensor.video.evaluate.page import beside, drawing, page_of, paragraph, photograph, table
from vsensor.video.evaluate.statistics import Moments
from vsensor.video.evaluate.truth import Presence, presence_table
from vsensor.video.frames import open_pictures
from vsensor.video.rows import write_rows
from vsensor.video.views import CYAN, GREEN, MAGENTA, ORANGE, REFERENCE_PX, Signal, Views

_VIEW_COLOURS = {"published": MAGENTA, "ours": CYAN}
SHOWN_EVENTS = 4
"""Events whose signals are drawn, evenly among all by their error, the least and the greatest with them."""


def write_files(
    out: Path,
    said: Sequence[str],
    events: Sequence[Judged],
    methods: Sequence[str],
    figures: Figures,
    present: Mapping[str, Presence],
    *,
    pictures: bool = True,
) -> list[str]:
    """Write all files; returns what an extra would have added to the page."""
    write_csv(out / "table.csv", [row for key, found in figures.items() for row in csv_rows(*key, found)])
    write_csv(out / "events.csv", [row for one in events for row in _event_rows(one, methods)])
    for method in methods:
        require_folder(out / "rows" / method)
        for one in events:
            write_rows(out / "rows" / method / f"{one.name}.csv", one.rows[method])
    parts = [*map(paragraph, said), *_tables(methods, figures, present)]
    missing: list[str] = []
    try:
        parts += _pictures(events, methods, figures) if pictures else []
    except MissingExtraError as error:
        missing = [str(error)]
    replace_file(out / "report.html", page_of("Lane offsets of videos", parts).encode())
    return missing


def _event_rows(one: Judged, methods: Sequence[str]) -> list[dict[str, Any]]:
    rows = []
    for method in methods:
        can, true = (
            Moments.of(errors.error_m) for errors in (one.against_can(method), one.against_truth(method))
        )
        rows.append(
            {
                "event": one.name,
                "method": method,
                "light": one.reference.light,
                "reliable_share": one.reference.reliable_share,
                **_three("can", can),
                **_three("truth", true),
            }
        )
    return rows


def _three(name: str, one: Moments) -> dict[str, Any]:
    known = {"count": one.count, "mean_m": one.mean_m, "std_m": one.std_m}
    return {f"{name}_{key}": None if value != value else value for key, value in known.items()}


# ---- the page -------------------------------------------------------------------------------------------


def _tables(methods: Sequence[str], figures: Figures, present: Mapping[str, Presence]) -> list[str]:
    parts = []
    for against in (TRUTH, CAN):
        tables = [
            (method, table_of(figures[method, against])) for method in methods if (method, against) in figures
        ]
        if tables:
            tables.append(("P2, on its own drives", published_table()))
            parts += [f"<h2>Errors against {against}</h2>", beside(tables)]
    parts.append(
        paragraph(
            "Standard deviation: within events, pooled, as published; between events: that of their means, "
            "which the published one leaves out; total RMS: of all values, bias included. m."
        )
    )
    if present:
        parts += ["<h2>What is reported</h2>", table(presence_table(present))]
    return parts


def _pictures(events: Sequence[Judged], methods: Sequence[str], figures: Figures) -> list[str]:
    """Return histograms, normal fits, events, signals and photographs; raises MissingExtraError."""
    has_truth = (methods[0], TRUTH) in figures
    against = TRUTH if has_truth else CAN
    known = [one for one in events if one.truth is not None] if has_truth else events
    errors = {method: [_errors(one, method, against) for one in known] for method in methods}
    parts = [f"<h2>Distributions of the errors against {against}</h2>"]
    for method in methods:
        drawn = draw.histograms(errors[method], figures[method, against], draw.SHOWN)
        parts.append(drawing(drawn, f"{method}: errors and normal distributions"))
    fits = {method: figures[method, against] for method in methods}
    parts += [
        drawing(draw.normals(fits), "normal distribution of each type of case, as published"),
        drawing(draw.event_biases(errors), f"events: mean error against {against}"),
        drawing(
            draw.errors_by_confidence(_by_confidence(known, errors)), "errors by the method's confidence"
        ),
        "<h2>Events</h2>",
    ]
    for one in _shown(events, methods[-1], against):
        parts += _event_pictures(one, methods, against)
    return parts


def _errors(one: Judged, method: str, against: str) -> Any:
    return one.against_truth(method) if against == TRUTH else one.against_can(method)


def _by_confidence(known: Sequence[Judged], errors: Mapping[str, Sequence[Any]]) -> dict[str, Any]:
    return {
        method: (
            np.concatenate([one.error_m.ravel() for one in found]),
            np.concatenate([one.confidences(method).ravel() for one in known]),
        )
        for method, found in errors.items()
    }


def _shown(events: Sequence[Judged], method: str, against: str) -> list[Judged]:
    """Return events from the least to the greatest error of a method, evenly chosen."""
    size = [float(np.nanmean(np.append(_errors(one, method, against).error_m ** 2, 0.0))) for one in events]
    order = np.argsort(size)
    places = np.unique(np.linspace(0, len(events) - 1, min(SHOWN_EVENTS, len(events))).round().astype(int))
    return [events[int(order[place])] for place in places]


def _event_pictures(one: Judged, methods: Sequence[str], against: str) -> list[str]:
    offsets = {"CAN": one.reference.offset_m, **{method: one.offsets(method) for method in methods}}
    truth = None if one.truth is None else one.truth.offset_m
    conditions = ", ".join(f"{key} {value}" for key, value in one.folder.config.conditions.items())
    error = np.abs(_errors(one, methods[-1], against).error_m)
    middle, worst = len(error) // 2, int(np.nan_to_num(np.nanmax(np.nan_to_num(error), axis=1)).argmax())
    signals = drawing(
        draw.offsets_over_time(one.name, one.reference.t_s, offsets, truth), f"{one.name}: {conditions}"
    )
    views = [photograph(image, caption) for image, caption in _views(one, methods, {middle, worst})]
    return [f"<h3>{one.name}</h3>", signals, *views]


def _views(one: Judged, methods: Sequence[str], frames: set[int]) -> list[tuple[Any, str]]:
    """Return front and top view of some rows of an event."""
    config = one.folder.config
    views = Views(Camera.from_config(config.camera), config.vehicle.wheelbase_m)
    times_ns = {round(float(one.reference.t_s[k]) * 1e9): k for k in frames}
    found = []
    with open_pictures(one.folder.video, config.rate_hz) as pictures:
        for picture in pictures:
            if picture.t_ns in times_ns:
                k = times_ns[picture.t_ns]
                image = views.both(picture, _signals(one, methods, k))
                found.append((image, f"{one.name}, {picture.t_ns / 1e9:.2f} s: CAN green, video in colours"))
    return found


def _signals(one: Judged, methods: Sequence[str], k: int) -> list[Signal]:
    headings = [float(one.rows[method].heading_rad[k]) for method in methods]
    known = [heading for heading in headings if heading == heading]
    heading = known[-1] if known else 0.0
    told = [("CAN", GREEN, one.reference.offset_m, heading, REFERENCE_PX)]
    told += [
        (method, _VIEW_COLOURS.get(method, ORANGE), one.offsets(method), own, 2)
        for method, own in zip(methods, headings, strict=True)
    ]
    return [
        Signal(
            name=name,
            colour=colour,
            left_m=float(offset[k, 0]),
            right_m=float(offset[k, 1]),
            heading_rad=own,
            thick_px=thick,
        )
        for name, colour, offset, own, thick in told
    ]

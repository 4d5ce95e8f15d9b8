"""`vsensor video sensitivity`: the published plots, shares of all parameters together, tables, one page."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import CameraConfig
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.pages import require_folder
from vsensor.study.table import aligned, replace_file, write_csv
from vsensor.types import Array
from vsensor.video.camera_file import VideoCamera
from vsensor.video.evaluate.page import drawing, page_of, paragraph, table
from vsensor.video.evaluate.runs import RunOptions
from vsensor.video.event_folder import read_event
from vsensor.video.rows import Rows, read_rows
from vsensor.video.sensitivity.figures import published_plots, share_plots
from vsensor.video.sensitivity.one_by_one import Course, one_by_one, slopes_at_zero
from vsensor.video.sensitivity.reproject import PARAMETERS, Lines, changed_offsets
from vsensor.video.sensitivity.rerun import Rerun, rerun, rerun_table
from vsensor.video.sensitivity.together import Shares, shares

WITHIN: Mapping[str, float] = {"height": 0.05, "lateral": 0.05, "yaw": 1.0, "pitch": 1.0, "roll": 1.0}
"""How well a mount is known that was measured with a rule and a level: an assumption, in m and degrees."""
LINES = 64
"""Of all lines so many, drawn, stand for the others where all parameters change together."""
NEGLECTED = (
    "Measured lines are seen again through the changed camera. That leaves out what the change does to the "
    "detection itself, and lines are taken as straight from the front axle to 20 m ahead."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensitivityOptions:
    """What the command line says; of the files at most `events` are drawn, as P2 drew 90 of 818."""

    out: Path
    events: int = 90
    seed: int = 0
    angle_deg: float = 3.0
    distance_m: float = 0.3
    within: Mapping[str, float] = field(default_factory=lambda: dict(WITHIN))
    again: Path | None = None
    method: str = "ours"
    run: RunOptions = field(default_factory=RunOptions)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sensitivity:
    """What was found, and text about it."""

    courses: Mapping[str, Course]
    together: Shares
    lines: tuple[str, ...]
    missing: tuple[str, ...] = ()


def sensitivity(files: Sequence[Path], camera: VideoCamera, options: SensitivityOptions) -> Sensitivity:
    """Write report.html, one_by_one.csv, together.csv; raises ConfigError, TableError."""
    require_folder(options.out)
    random = np.random.default_rng(options.seed)
    chosen = _drawn(rows_files(files), options.events, random)
    sides = lines_of([read_rows(path) for path in chosen])
    axle_m = camera.front_axle_x_m
    courses = one_by_one(
        camera.config, axle_m, sides, angle_deg=options.angle_deg, distance_m=options.distance_m
    )
    together = _together(camera.config, axle_m, sides, options, random)
    again = [] if options.again is None else _run_again(options.again, options)
    texts = _texts(len(chosen), sides, courses, together, options, again)
    write_csv(options.out / "one_by_one.csv", _course_rows(courses))
    write_csv(options.out / "together.csv", _share_rows(together))
    missing = _write_page(options, texts, courses, together, again)
    return Sensitivity(courses=courses, together=together, lines=tuple(texts), missing=tuple(missing))


def _run_again(place: Path, options: SensitivityOptions) -> list[Rerun]:
    return rerun(read_event(place), options.method, options.within, options.out, options.run)


def rows_files(places: Sequence[Path]) -> list[Path]:
    """Return the files of rows among files and folders of them; raises ConfigError where there is none."""
    found = []
    for place in places:
        inside = (
            sorted(p for p in place.iterdir() if p.suffix in (".csv", ".parquet")) if place.is_dir() else []
        )
        if place.is_dir() and not inside:
            raise ConfigError(f"{place}: holds no rows of a video: .csv, .parquet were expected")
        found += inside or [place]
    return found


def _drawn(files: Sequence[Path], most: int, random: np.random.Generator) -> list[Path]:
    if len(files) <= most:
        return list(files)
    return [files[k] for k in sorted(random.choice(len(files), most, replace=False).tolist())]


def lines_of(tables: Sequence[Rows]) -> list[Lines]:
    """Return the left and the right lines that were seen; raises ConfigError where a side has none."""
    found = []
    for side in ("left", "right"):
        offset, heading = (
            np.concatenate([getattr(rows, name) for rows in tables])
            for name in (f"{side}_offset_m", "heading_rad")
        )
        known = np.isfinite(offset) & np.isfinite(heading)
        if not known.any():
            raise ConfigError(f"no {side} line in {len(tables)} files of rows: nothing to see again")
        found.append(Lines(offset_m=offset[known], slope=np.tan(heading[known])))
    return found


def _together(
    camera: CameraConfig,
    axle_m: float,
    sides: Sequence[Lines],
    options: SensitivityOptions,
    random: np.random.Generator,
) -> Shares:
    offset, slope = (np.concatenate([getattr(one, name) for one in sides]) for name in ("offset_m", "slope"))
    some = random.choice(len(offset), min(LINES, len(offset)), replace=False)
    lines = Lines(offset_m=offset[some], slope=slope[some])

    def outputs(changes: Array) -> Array:
        found = changed_offsets(camera, axle_m, lines, changes) - lines.offset_m
        if not np.isfinite(found).all():
            raise ConfigError(
                "pitch and roll this uncertain put the road above the horizon: less was expected in --within"
            )
        return found

    return shares(outputs, {name: options.within[name] for name in PARAMETERS}, seed=options.seed)


# ---- text -----------------------------------------------------------------------------------------------


def _texts(
    files: int,
    sides: Sequence[Lines],
    courses: Mapping[str, Course],
    together: Shares,
    options: SensitivityOptions,
    again: Sequence[Rerun],
) -> list[str]:
    slopes = slopes_at_zero(courses)
    rows = [["parameter", "left", "right", "m per"]]
    rows += [[name, f"{-a:+.4f}", f"{-b:+.4f}", PARAMETERS[name]] for name, (a, b) in slopes.items()]
    return [
        f"{files} files of rows, {len(sides[0])} left and {len(sides[1])} right lines",
        "one at a time: by how much the distance to the marking grows",
        *_left_first(rows),
        "",
        f"all together, each within its tolerance: standard deviation {together.std:.3f} m, "
        f"95 % of the changes within {together.abs_95:.3f} m; shares of the variance:",
        *_left_first(share_table(together, options.within)),
        "",
        *_left_first(joint_table(together)),
        "",
        *(_left_first(rerun_table(again)) if again else []),
        NEGLECTED,
    ]


def share_table(together: Shares, within: Mapping[str, float]) -> list[list[str]]:
    """Return the shares as words."""
    rows = [["parameter", "within", "alone", "+-", "with others", "+-"]]
    for name, (first, first_half) in together.first.items():
        total, total_half = together.total[name]
        tolerance = f"{within[name]:g} {PARAMETERS[name]}"
        values = [f"{100.0 * value:.1f} %" for value in (first, first_half, total, total_half)]
        rows.append([name, tolerance, *values])
    return rows


def joint_table(together: Shares) -> list[list[str]]:
    """Return the joint effects of pairs, the largest first."""
    ordered = sorted(together.joint.items(), key=lambda item: -abs(item[1][0]))
    rows = [["joint effect", "share", "+-"]]
    rows += [
        [" and ".join(pair), f"{round(100 * v, 2) + 0.0:+.2f} %", f"{100 * h:.2f} %"]
        for pair, (v, h) in ordered
    ]
    return rows


def _left_first(rows: Sequence[Sequence[str]]) -> list[str]:
    width = max(len(row[0]) for row in rows)
    return aligned([[row[0].ljust(width), *row[1:]] for row in rows])


def _course_rows(courses: Mapping[str, Course]) -> list[dict[str, Any]]:
    return [
        {
            "parameter": name,
            "unit": PARAMETERS[name],
            "change": change,
            "side": side,
            **{
                key: float(getattr(course, key)[row, k])
                for key in ("mean_m", "mean_percent", "low_m", "high_m")
            },
        }
        for name, course in courses.items()
        for row, side in enumerate(("left", "right"))
        for k, change in enumerate(course.change.tolist())
    ]


def _share_rows(together: Shares) -> list[dict[str, Any]]:
    kinds: dict[str, Mapping[tuple[str, ...], tuple[float, float]]] = {
        "first order": {(name,): value for name, value in together.first.items()},
        "total": {(name,): value for name, value in together.total.items()},
        "joint": dict(together.joint.items()),
    }
    return [
        {"index": kind, "parameters": "+".join(names), "share": value, "half_interval": half}
        for kind, found in kinds.items()
        for names, (value, half) in found.items()
    ]


def _write_page(
    options: SensitivityOptions,
    texts: Sequence[str],
    courses: Mapping[str, Course],
    together: Shares,
    again: Sequence[Rerun],
) -> list[str]:
    """Write report.html; returns what an extra would have added."""
    parts = [paragraph(f"{texts[0]}. {NEGLECTED}"), "<h2>One at a time</h2>"]
    missing: list[str] = []
    caption = "mean over all lines; band: 5 to 95 % of them (fig. 3.17 to 3.20 of the published analysis)"
    try:
        pictures = [drawing(published_plots(courses), caption)]
        pictures.append(
            drawing(share_plots(together, options.within), "shares of the variance, 95 % intervals")
        )
    except MissingExtraError as error:
        pictures, missing = ["", ""], [str(error)]
    parts += [pictures[0], "<h2>All together</h2>", pictures[1], table(share_table(together, options.within))]
    parts.append(table(joint_table(together)))
    if again:
        parts += [f"<h2>{options.method} run again with each changed camera</h2>", table(rerun_table(again))]
        parts.append(paragraph("By how much the distance to the marking grows, m, mean over the event."))
    replace_file(options.out / "report.html", page_of("Sensitivity to the camera", parts).encode())
    return missing

"""What `vsensor density` writes and says."""

import csv
import io
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.field.density import Density, edges_of
from vsensor.field.thin import Stretch, Thin
from vsensor.field.tune.survey import REACH_BINS, REACH_STEP_M
from vsensor.pages import png_of, require_folder
from vsensor.study.table import replace_file


def csv_text(header: list[str], rows: list[list[Any]]) -> bytes:
    """Return a table as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows(rows)
    return text.getvalue().encode()


def files_of(found: Density, thin: list[Thin], fill: list[Stretch]) -> dict[str, bytes]:
    """Return name -> content of the arrays and tables."""
    arrays = io.BytesIO()
    np.savez_compressed(
        arrays,
        share=found.share,
        rows=found.cube,
        range_m=found.grid.range_m,
        speed_edges_mps=found.speed_edges_mps,
        error_edges_m=found.error_edges_m,
        seconds=found.seconds,
        reach_rows=found.survey.reach[0, : found.grid.speeds],
        reach_edges_m=np.arange(REACH_BINS + 1) * REACH_STEP_M,
    )
    cells = [
        [f"{r:g}", f"{v:g}", int(found.cube[i, k].sum()), f"{found.seconds[i, k]:.2f}"]
        for i, r in enumerate(found.grid.range_m)
        for k, v in enumerate(found.grid.speed_mps)
    ]
    return {
        "density.npz": arrays.getvalue(),
        "cells.csv": csv_text(["range_m", "speed_mps", "rows", "seconds"], cells),
        "distributions.csv": csv_text(["dimension", "from", "to", "share"], _distributions(found)),
        "thin.csv": csv_text(
            ["speed_mps", "operating_range_m", "seconds", "missing_s"],
            [[f"{x.speed_mps:g}", f"{x.to_m:.1f}", f"{x.seconds:.0f}", f"{x.missing_s:.0f}"] for x in thin],
        ),
        "fill.csv": csv_text(
            ["log", "from_s", "to_s", "speed_low_mps", "speed_high_mps", "fills_s"],
            [
                [
                    x.log,
                    *(f"{v:.2f}" for v in (x.from_s, x.to_s, x.speed_low_mps, x.speed_high_mps, x.fills_s)),
                ]
                for x in fill
            ],
        ),
    }


def _distributions(found: Density) -> list[list[Any]]:
    total = max(int(found.cube.sum()), 1)
    dimensions = [
        ("range_m", found.range_edges_m, found.cube.sum(axis=(1, 2))),
        ("speed_mps", found.speed_edges_mps, found.cube.sum(axis=(0, 2))),
        ("error_m", found.error_edges_m, found.cube.sum(axis=(0, 1))),
        *((name, edges_of(name), counts) for name, counts in found.spreads.items()),
    ]
    return [
        [name, f"{low:.6g}", f"{high:.6g}", f"{count / total:.6g}"]
        for name, edges, counts in dimensions
        for low, high, count in zip(edges[:-1], edges[1:], counts, strict=True)
    ]


def write_density(
    folder: Path, found: Density, thin: list[Thin], fill: list[Stretch], *, pictures: bool = True
) -> None:
    """Write arrays, tables, pictures; raises MissingExtraError (before anything is written), ConfigError."""
    files = files_of(found, thin, fill)
    if pictures:
        from vsensor.field.density_plot import pages

        files |= {name: png_of(figure) for name, figure in pages(found).items()}
    require_folder(folder)
    for name, content in files.items():
        replace_file(folder / name, content)


def text_lines(found: Density, thin: list[Thin], fill: list[Stretch], most: int = 8) -> list[str]:
    """Return what was found, for people."""
    hours, filled = found.survey.images_ns / 3.6e12, int(np.count_nonzero(found.cube))
    lines = [
        f"{found.survey.logs} logs, {hours:.2f} h, {found.survey.rows} rows; rows in {filled} of "
        f"{found.cube.size} sub cubes ({found.cube.shape[0]} ranges x {found.cube.shape[1]} speeds x "
        f"{found.cube.shape[2]} sizes of the error)"
    ]
    if not thin:
        return [*lines, "no speed lacks driving"]
    lines.append(f"{len(thin)} speeds lack driving, most of all:")
    for one in sorted(thin, key=lambda one: -one.missing_s)[:most]:
        lines.append(
            f"  {one.speed_mps:3.0f} m/s: {one.seconds / 60.0:.0f} min within {one.to_m:.0f} m, "
            f"{one.missing_s / 60.0:.0f} min missing"
        )
    lines.append("drives that have most of it:" if fill else "no drive at hand has any of it")
    for stretch in fill[:most]:
        lines.append(
            f"  {stretch.log}: {stretch.from_s:.0f} to {stretch.to_s:.0f} s at "
            f"{stretch.speed_low_mps:.0f} to {stretch.speed_high_mps:.0f} m/s, worth {stretch.fills_s:.0f} s"
        )
    return lines

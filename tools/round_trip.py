"""From a known law to CAN logs and back: make drives, scan, tune, validate, and compare with the truth.

    python -m tools.round_trip --out DIR --hours 10 --held 5 --generations 2

Goes on where it stopped (drives and tables are kept). The truth is what the fit makes of the known law
(`tools.made_law`), at the speeds of the model's grid every 2 m/s. The second generation is learned from
drives that the learned model made, and is compared with both.
"""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from tools.made_drives import drive_cells, made, make_drives
from tools.made_law import CORRELATION_TIME_S, reported_quantiles_m
from vsensor.error_model import ErrorModel, load_library, save_library
from vsensor.field.scan import ScanOptions
from vsensor.field.scan_many import scan_logs
from vsensor.field.table import open_table
from vsensor.field.tune import TuneOptions, tune_table
from vsensor.field.validate import validate_model

HOUR_S = 3600.0
COLUMN_STEP = 4
Truth = Callable[[np.ndarray, np.ndarray, float], np.ndarray]
"""(levels, ranges, speed) -> quantiles (L, R) of the size of the reported error, NaN where nothing is."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A model beside the truth, at every `COLUMN_STEP`-th speed: `off` (L, N) relative, `inside` (L, N).

    `seconds` (N,) of driving within the filter's width; `time_off` of the correlation time, relative.
    """

    levels: np.ndarray
    off: np.ndarray
    inside: np.ndarray
    seconds: np.ndarray
    range_m: np.ndarray
    time_off: float

    def lines(self) -> list[str]:
        """Return the figures of the issue."""
        place = int(np.argmin(np.abs(self.levels - 0.95)))
        off, long = np.abs(self.off[place]), self.seconds >= HOUR_S
        inside = zip(self.levels.tolist(), self.inside.mean(axis=1).tolist(), strict=True)
        lines = [
            f"95 % surface: mean {self.off[place].mean():+.1%}, median size {np.median(off):.1%}, "
            f"largest {off.max():.1%} of {off.size} cells",
            "inside of the 95 % interval: "
            + ", ".join(f"{level:.0%} {share:.1%}" for level, share in inside),
            f"correlation time {self.time_off:+.1%}",
        ]
        if long.any():
            lines.append(
                f"{long.sum()} cells with an hour of driving: largest {off[long].max():.1%}, "
                f"within 10 %: {np.mean(off[long] < 0.1):.1%}"
            )
        return lines


def law_truth(law: ErrorModel, count: int = 60_000) -> Truth:
    """Return the truth of a known symmetric law."""

    def truth(levels: np.ndarray, range_m: np.ndarray, speed_mps: float) -> np.ndarray:
        return reported_quantiles_m(law, 0.5 + 0.5 * levels, range_m, speed_mps, count=count)

    return truth


def model_truth(model: ErrorModel) -> Truth:
    """Return the law that a learned model claims for its reported lines, as the truth of what it made."""

    def truth(levels: np.ndarray, range_m: np.ndarray, speed_mps: float) -> np.ndarray:
        column = int(np.argmin(np.abs(model.speed_mps - speed_mps)))
        here = np.where(model.blind[:, column], np.nan, model.absolute_m[:, :, column])
        return np.array([np.interp(range_m, model.range_m, row, right=np.nan) for row in here])

    return truth


def compare(model: ErrorModel, truth: Truth, time_s: float) -> Compared:
    """Compare the cells that both know."""
    parts = []
    for column in range(0, len(model.speed_mps), COLUMN_STEP):
        seen = ~model.blind[:, column]
        if seen.any():
            wanted = truth(model.levels, model.range_m, float(model.speed_mps[column]))
            good = seen & np.isfinite(wanted).all(axis=0)
            found, low, high = (
                surface[:, good, column]
                for surface in (model.absolute_m, model.absolute_low_m, model.absolute_high_m)
            )
            wanted = wanted[:, good]
            parts.append(
                (
                    found / wanted - 1.0,
                    (low <= wanted) & (wanted <= high),
                    model.seconds[good, column],
                    model.range_m[good],
                )
            )
    off, inside, seconds, range_m = (np.concatenate(part, axis=-1) for part in zip(*parts, strict=True))
    return Compared(
        levels=model.levels,
        off=off,
        inside=inside,
        seconds=seconds,
        range_m=range_m,
        time_off=model.correlation_time_s / time_s - 1.0,
    )


def scanned(
    folder: Path,
    hours: float,
    first_seed: int,
    *,
    drive_s: float = 600.0,
    law: Path | None = None,
    workers: int | None = None,
) -> Path:
    """Make drives in `folder/drives` and scan them into `folder/table`, what is missing; returns the table.

    With `workers` 0 in this process.
    """
    cells = drive_cells(folder / "drives", hours, first_seed=first_seed, drive_s=drive_s, law=law)
    if workers == 0:
        logs = [Path(cell["path"]) for cell in cells if Path(cell["path"]).exists() or made(cell)]
    else:
        logs = make_drives(folder / "drives", cells, workers)
    options = ScanOptions(reference=str(folder / "drives" / "map.xodr"))
    report = scan_logs(logs, folder / "table", options, workers=workers or 1)
    if report.failures:
        raise SystemExit(report.failures[0])
    return folder / "table"


def learned(table: Path, path: Path, options: TuneOptions | None = None) -> ErrorModel:
    """Tune a table into a model file, and return its only model."""
    save_library(tune_table(open_table([table]), options or TuneOptions()).library, path)
    return load_library(path).models["all"]


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True, help="folder of drives, tables, models")
    parser.add_argument("--hours", type=float, default=1.0, help="of driving to learn from (1)")
    parser.add_argument("--held", type=float, default=0.5, help="hours of held-out driving (0.5)")
    parser.add_argument(
        "--generations", type=int, default=1, help="2: learn again from what the model made (1)"
    )
    parser.add_argument("--seed", type=int, default=1, help="of the first drive (1)")
    parser.add_argument("--workers", type=int, help="processes (all cores)")
    told = parser.parse_args(words)
    law_path, held = None, scanned(told.out / "held", told.held, told.seed + 5000, workers=told.workers)
    truth, time_s = None, CORRELATION_TIME_S
    for generation in range(1, told.generations + 1):
        place = told.out / f"generation_{generation}"
        table = scanned(
            place, told.hours, told.seed + 1000 * (generation - 1), law=law_path, workers=told.workers
        )
        model = learned(table, place / "model.npz")
        law = load_library(told.out / "held" / "drives" / "law.npz").models["day"]
        print(f"generation {generation}, against the known law, {told.hours:g} h:")
        print("\n".join(compare(model, law_truth(law), CORRELATION_TIME_S).lines()))
        if truth is not None:
            print("against the generation before it:")
            print("\n".join(compare(model, truth, time_s).lines()))
        report = validate_model(place / "model.npz", open_table([held]), out=place / "report.html")
        print("\n".join(report.lines), end="\n\n")
        law_path, truth, time_s = place / "model.npz", model_truth(model), model.correlation_time_s


if __name__ == "__main__":
    main()

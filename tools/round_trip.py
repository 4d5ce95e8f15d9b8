"""From a known law to CAN logs and back: make drives, scan, tune, validate, and compare with the truth.

    python -m tools.round_trip --out DIR --hours 10 --held 5 --generations 2
    python -m tools.round_trip --out DIR --hours 10 --profile honda --dbc FILE --within 30
    python -m tools.round_trip --out DIR --hours 10 --gta

Goes on where it stopped (drives and tables are kept). The truth is what the fit makes of the known law
(`tools.made_law`) on the dashed lines of the map, at the speeds of the model's grid every 2 m/s. The second
generation is learned from drives that the learned model made, and is compared with both. `--gta` tunes the
same logs with the reference along the driven path too. `tools.drawn_drives` draws many seeds, without logs.
"""

import argparse
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from tools.compared import Compared, compare, law_truth, model_truth
from tools.made_drives import drive_cells, made, make_drives
from tools.made_law import CORRELATION_TIME_S, cubic_at, parabola_at
from vsensor.error_model import ErrorModel, load_library, save_library
from vsensor.field.config import ScanLimits
from vsensor.field.scan import ScanOptions
from vsensor.field.scan_many import scan_logs
from vsensor.field.table import open_table
from vsensor.field.tune import TuneOptions, tune_table
from vsensor.field.validate import validate_model
from vsensor.field.virtual import FitSetting

DASHED = FitSetting(dashes_m=(6.0, 12.0))
"""Both lines of the lane that is driven."""


def scanned(
    folder: Path,
    hours: float,
    first_seed: int,
    *,
    drive_s: float = 600.0,
    law: Path | None = None,
    profile: str = "native",
    dbc: Path | None = None,
    workers: int | None = None,
) -> Path:
    """Make drives in `folder/drives` and scan them into `folder/table`, what is missing; returns the table.

    With `workers` 0 in this process.
    """
    cells = drive_cells(
        folder / "drives", hours, profile, dbc, first_seed=first_seed, drive_s=drive_s, law=law
    )
    if workers == 0:
        logs = [Path(cell["path"]) for cell in cells if Path(cell["path"]).exists() or made(cell)]
    else:
        logs = make_drives(folder / "drives", cells, workers)
    options = ScanOptions(
        reference=str(folder / "drives" / "map.xodr"),
        profiles=(profile, "vehicle"),
        dbc=None if dbc is None else str(dbc),
    )
    return scanned_logs(logs, folder / "table", options, workers)


def scanned_logs(logs: Sequence[Path], table: Path, options: ScanOptions, workers: int | None) -> Path:
    """Scan logs into a table, what is missing; returns it."""
    report = scan_logs(logs, table, options, workers=1 if workers == 0 else workers, progress=workers != 0)
    if report.failures:
        raise SystemExit(report.failures[0])
    return table


def learned(table: Path, path: Path, options: TuneOptions | None = None) -> ErrorModel:
    """Tune a table into a model file, and return its only model."""
    save_library(tune_table(open_table([table]), options or TuneOptions()).library, path)
    return load_library(path).models["all"]


def within(model: ErrorModel, range_m: float) -> ErrorModel:
    """Return the model as if it were blind beyond a range."""
    return replace(model, blind=model.blind | (model.range_m > range_m)[:, None])


def gta_lines(gta: ErrorModel, by_map: ErrorModel) -> list[str]:
    """Return what the reference along the driven path makes of the same errors, beside that of a map."""
    found: Compared = compare(gta, model_truth(by_map), by_map.correlation_time_s)
    return ["the driven path as reference, against the map:", *found.lines()]


def main(words: Sequence[str] | None = None) -> None:
    told = _told(words)
    law_path, how = None, {"profile": told.profile, "dbc": told.dbc, "workers": told.workers}
    held = scanned(told.out / "held", told.held, told.seed + 5000, **how) if told.held else None
    truth, time_s, options = None, CORRELATION_TIME_S, TuneOptions(setting=DASHED)
    for generation in range(1, told.generations + 1):
        place = told.out / f"generation_{generation}"
        table = scanned(place, told.hours, told.seed + 1000 * (generation - 1), law=law_path, **how)
        model = learned(table, place / "model.npz", options)
        known = within(model, told.within)
        law = load_library(told.out / "generation_1" / "drives" / "law.npz").models["day"]
        print(f"generation {generation}, against the known law, {told.hours:g} h:")
        print("\n".join(compare(known, law_truth(law, DASHED, _read(told)), CORRELATION_TIME_S).lines()))
        if truth is not None:
            print("against the generation before it:")
            print("\n".join(compare(known, truth, time_s).lines()))
        if told.gta:
            logs = sorted((place / "drives").glob("*.blf"))
            profiles = (told.profile, "vehicle")
            gta_options = ScanOptions(profiles=profiles, dbc=None if told.dbc is None else str(told.dbc))
            gta = scanned_logs(logs, place / "table_gta", gta_options, told.workers)
            print("\n".join(gta_lines(learned(gta, place / "gta.npz", options), model)))
        if held is not None:
            report = validate_model(
                place / "model.npz", open_table([held]), out=place / "report.html", setting=DASHED
            )
            print("\n".join(report.lines))
        print(flush=True)
        law_path, truth, time_s = place / "model.npz", model_truth(model), model.correlation_time_s


def _read(told: argparse.Namespace) -> Any:
    """Return how a reader of the profile makes y of what is on the bus."""
    if Path(told.profile).stem != "honda":
        return cubic_at
    return lambda range_m: parabola_at(range_m, ScanLimits().camera_x_m)


def _told(words: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    option = parser.add_argument
    option("--out", type=Path, required=True, help="folder of drives, tables, models")
    option("--hours", type=float, default=1.0, help="of driving to learn from (1)")
    option("--held", type=float, default=0.0, help="hours of held-out driving (0: none)")
    option("--generations", type=int, default=1, help="2: learn again from what the model made (1)")
    option("--profile", default="native", help="of the lane frames (native)")
    option("--dbc", type=Path, help="database of a profile without one")
    option("--within", type=float, default=np.inf, metavar="M", help="compare no farther than this range")
    option("--gta", action="store_true", help="tune with the driven path as reference, too")
    option("--seed", type=int, default=1, help="of the first drive (1)")
    option("--workers", type=int, help="processes (all cores)")
    return parser.parse_args(words)


if __name__ == "__main__":
    main()

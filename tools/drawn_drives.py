"""Many seeds of tables that are drawn and not driven: how well tuning knows what it knows.

    python -m tools.drawn_drives --out DIR --hours 10 --held 5 --seeds 20
    python -m tools.drawn_drives --out DIR --hours 3 --seeds 1 --generations 2

A drive is what `tools.made_drives` makes: the same speeds, the same law through the same fit, losses and
ranges; but straight into a table, without roads, bus and log. Ten hours take some half a minute, and the same
to tune them. A seed that is done is not done again.
"""

import argparse
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from shutil import rmtree
from typing import Any

import numpy as np
from scipy.signal import lfilter
from scipy.special import ndtr

from tools.compared import BANDS_M, HOUR_S, Compared, compare, law_truth
from tools.made_drives import DRIVE_S, PERIOD_NS, drive_speeds
from tools.made_law import CORRELATION_TIME_S, student_model
from vsensor.error_model import load_library, save_library
from vsensor.field.table import MASKS, Masked, Table, open_table, write_table
from vsensor.field.tune import TuneOptions, tune_table
from vsensor.field.validate import validate_model
from vsensor.field.virtual import FitSetting, VirtualSensor, lost_runs_s, reach_of
from vsensor.study import run_cells
from vsensor.types import Array

PERIOD_S = PERIOD_NS * 1e-9
LEVELS = (0.5, 0.8, 0.9, 0.95, 0.97, 0.99)
HELD_SEED = 100_000


def law_sensor(ranges_m: Array) -> VirtualSensor:
    """Return the known law, read at the table's ranges, for speeds in steps of 0.5 m/s."""
    model = student_model(range_m=ranges_m, speed_mps=np.arange(0.0, 40.0, 0.5))
    return VirtualSensor.of(model, FitSetting())


def drawn_drive(sensor: VirtualSensor, seed: int, seconds: float) -> dict[str, Any]:
    """Return the columns of a drive's table."""
    random = np.random.default_rng([11, seed])
    images = round(seconds / PERIOD_S)
    times, kmh = np.array(drive_speeds(seed, seconds)).T
    speed = np.interp(np.arange(images) * PERIOD_S, times, kmh) / 3.6
    driven = np.cumsum(speed) * PERIOD_S
    sides = [dict(_side(sensor, random, speed, driven)) for _ in range(2)]
    joined = {name: np.concatenate([side[name] for side in sides]) for name in sides[0]}
    joined["side"] = np.repeat([0, 1], [len(side["image"]) for side in sides])
    order = np.lexsort((joined["range_m"], joined["side"], joined["image"]))
    joined = {name: values[order] for name, values in joined.items()}
    image = joined.pop("image")
    is_lost = np.isnan(joined["range_m"])
    nothing = np.zeros(len(image))
    return joined | {
        "t_ns": 10**18 + image * PERIOD_NS,
        "masked": np.where(is_lost, MASKS.index(Masked.NO_LINE), 0).astype(np.uint8),
        "speed_mps": speed[image],
        **dict.fromkeys(("acceleration_mps2", "yaw_rate_radps", "future_yaw_rate_radps"), nothing),
        **dict.fromkeys(("curvature_per_m", "rain"), nothing),
        "night": nothing.astype(bool),
        "quality": np.where(is_lost, 0, 4),
        "measured": ~is_lost,
        "lane_width_m": np.full(len(image), 3.5),
    }


def _side(
    sensor: VirtualSensor, random: np.random.Generator, speed: Array, driven: Array
) -> Iterator[tuple[str, Array]]:
    """Yield columns of one side's rows, by image and range; an image without a line has one row."""
    model = sensor.model
    error = sensor.errors(sensor.drive(np.full(len(speed) - 1, PERIOD_S), random), speed, driven)
    keep = np.exp(-PERIOD_S / model.range_time_s)
    white = random.standard_normal(len(speed))
    white[1:] *= np.sqrt(1.0 - keep * keep)
    share = np.interp(ndtr(lfilter([1.0], [1.0, -keep], white)), model.range_share_levels, model.range_share)
    x_max = share * reach_of(model, speed)
    seen = np.ones(len(speed), bool)
    at = 0
    for is_seen, seconds in lost_runs_s(model, len(speed) * PERIOD_S, random):
        count = max(round(seconds / PERIOD_S), 1)
        seen[at : at + count] = is_seen
        at += count
    column = np.argmin(np.abs(model.speed_mps[:, None] - speed[None, :]), axis=0)
    here = seen[:, None] & (model.range_m <= x_max[:, None]) & ~model.blind[:, column].T
    image, place = np.nonzero(here)
    lost = np.flatnonzero(~here.any(axis=1))
    nothing = np.full(len(lost), np.nan)
    yield "image", np.concatenate([image, lost])
    yield "range_m", np.concatenate([model.range_m[place], nothing])
    yield "error_m", np.concatenate([error[here], nothing])
    yield "x_max_m", np.concatenate([x_max[image], nothing])


def drawn_table(folder: Path, hours: float, first_seed: int, sensor: VirtualSensor) -> Table:
    """Draw a table of so many hours, in drives of ten minutes."""
    seconds = min(DRIVE_S, hours * HOUR_S)
    for seed in range(first_seed, first_seed + max(round(hours * HOUR_S / seconds), 1)):
        name = f"drive_{seed}"
        columns = drawn_drive(sensor, seed, seconds)
        write_table(folder / f"{name}.parquet", name, [columns], {"log": name, "source": "drawn"})
    return open_table([folder])


def one_seed(cell: Mapping[str, Any]) -> dict[str, Any]:
    """Draw, tune and compare one seed; how well held-out drives are covered. A cell of `run_cells`."""
    ranges = np.arange(1.0, 100.0, cell["range_step_m"])
    folder = Path(cell["out"]) / f"seed_{cell['seed']}"
    rmtree(folder, ignore_errors=True)
    first = 1 + 1000 * cell["seed"]
    sensor, options = (
        law_sensor(ranges),
        TuneOptions(close_loop=cell["held"] > 0.0 or cell["generations"] > 1),
    )
    for generation in range(cell["generations"]):
        rmtree(folder / "table", ignore_errors=True)
        table = drawn_table(folder / "table", cell["hours"], first + 500 * generation, sensor)
        save_library(tune_table(table, options).library, folder / "model.npz")
        model = load_library(folder / "model.npz").models["all"]
        sensor = VirtualSensor.of(model, FitSetting())
    found = compare(model, _truth(ranges), CORRELATION_TIME_S)
    rmtree(folder / "table")
    result = {
        name: getattr(found, name).tolist() for name in ("off", "inside", "seconds", "range_m", "speed_mps")
    }
    result |= {"levels": model.levels.tolist(), "time_off": found.time_off, "coverage": []}
    if cell["held"] > 0.0:
        held = drawn_table(folder / "table", cell["held"], first + HELD_SEED, law_sensor(ranges))
        result["coverage"] = validate_model(folder / "model.npz", held).judged[0].coverage.tolist()
    rmtree(folder)
    return result


_TRUTHS: dict[tuple[float, ...], Any] = {}


def _truth(ranges_m: Array) -> Any:
    """Return the truth, which all seeds of a process share."""
    key = tuple(ranges_m.tolist())
    if key not in _TRUTHS:
        _TRUTHS[key] = law_truth(law_sensor(ranges_m).model, count=100_000)
    return _TRUTHS[key]


def compared(result: Mapping[str, Any]) -> Compared:
    """Return what a cell's result holds."""
    arrays = ("levels", "off", "inside", "seconds", "range_m", "speed_mps")
    return Compared(**{name: np.array(result[name]) for name in arrays}, time_off=result["time_off"])


def lines_of(results: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return the figures of the issue over all seeds."""
    every = [compared(one) for one in results]
    inside = np.array([one.inside.mean(axis=1) for one in every])
    largest = [np.abs(one.off_at(0.95)[one.seconds >= HOUR_S]) for one in every]
    spread = inside.mean(axis=1).std() / np.sqrt(len(every))
    lines = [
        f"{len(every)} seeds; inside of the 95 % interval: {inside.mean():.1%} +- {spread:.1%} "
        f"(seeds from {inside.mean(axis=1).min():.1%} to {inside.mean(axis=1).max():.1%})",
        "by level: "
        + ", ".join(f"{p:.0%} {s:.1%}" for p, s in zip(every[0].levels, inside.mean(axis=0), strict=True)),
        "by range: " + _by(every, "range_m", BANDS_M, "m"),
        "by driving: " + _by(every, "seconds", (0.0, 300.0, 900.0, 1800.0, 3600.0, 1e9), "s"),
        f"95 % surface: mean {np.mean([one.off_at(0.95).mean() for one in every]):+.2%}, largest "
        f"{max(np.abs(one.off_at(0.95)).max() for one in every):.1%}",
        f"correlation time: {min(one.time_off for one in every):+.1%} to "
        f"{max(one.time_off for one in every):+.1%}",
    ]
    if any(len(one) for one in largest):
        joined = np.concatenate(largest)
        lines.append(
            f"cells with an hour of driving: largest {joined.max():.1%}, "
            f"within 10 %: {(joined < 0.1).mean():.2%}"
        )
    covered = np.array([one["coverage"] for one in results if one["coverage"]])
    if len(covered):
        off = np.abs(covered - np.array(LEVELS))
        lines.append(
            f"levels covered on held-out drives: mean {', '.join(f'{c:.2%}' for c in covered.mean(axis=0))}; "
            f"farthest off {', '.join(f'{o:.2%}' for o in off.max(axis=0))}"
        )
    return lines


def _by(every: Sequence[Compared], name: str, edges: Sequence[float], unit: str) -> str:
    values = np.concatenate([getattr(one, name) for one in every])
    inside = np.concatenate([one.inside.mean(axis=0) for one in every])
    band = np.digitize(values, edges)
    return ", ".join(f"{edges[k - 1]:g} {unit}.. {inside[band == k].mean():.1%}" for k in np.unique(band))


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    option = parser.add_argument
    option("--out", type=Path, required=True, help="folder of the results")
    option("--hours", type=float, default=1.0, help="of driving for each seed (1)")
    option("--held", type=float, default=0.0, help="hours of held-out driving (0: none)")
    option("--generations", type=int, default=1, help="2: the last, drawn by the model before it (1)")
    option("--seeds", type=int, default=20, help="how many (20)")
    option("--range-step", type=float, default=4.0, metavar="M", help="between ranges (4)")
    option("--workers", type=int, help="processes (all cores)")
    told = parser.parse_args(words)
    cells = [
        {
            "seed": seed,
            "hours": told.hours,
            "held": told.held,
            "generations": told.generations,
            "range_step_m": told.range_step,
            "out": str(told.out.resolve()),
        }
        for seed in range(told.seeds)
    ]
    outcome = run_cells(one_seed, cells, told.out / "cells", workers=told.workers, progress=True)
    if outcome.failures:
        raise SystemExit(outcome.failures[0].error)
    print("\n".join(lines_of([one for one in outcome.results if one is not None])))


if __name__ == "__main__":
    main()

"""`vsensor tune`, `validate`: an error model from tables, and judged by others."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, rows_bar, shows_progress, tables_argument
from vsensor.cli.values import dashes, even, levels, metres, positive, seed, share

TUNE_HELP = """\
Learn an error model from tables that `vsensor scan` wrote: how large errors are over range and speed.

  vsensor tune table --out model.npz
  vsensor tune table more/table --by night,rain --out model.npz --plots pages
  vsensor tune table --by curvature_per_m:0.001:0.004 --levels 0.5,0.95 --out model.npz

Quantiles of the error with 95 % intervals (blocks of driving, for rows are correlated), a low-pass along
speed, correlation in time and along the range, operating range, line loss, quality; for each condition of
--by a model of its own. The law is that of the reported line: what is fed to the points is corrected until
the fit gives it. Cells with too little driving are blind: the sensor reports nothing there. MODEL appears
when it is whole.
"""

VALIDATE_HELP = """\
Judge an error model by recorded drives that it was not learned from: does the sensor err as the model says?

  vsensor validate model.npz held_out/table --out report.html
  vsensor validate model.npz held_out/table --limits mine.toml

Coverage of each surface, evenness of the errors' places in the law, distance of recorded and virtual errors
by range and speed, correlation in time, how long lines stay lost. A figure fails where it is beyond its limit
by more than chance explains. A limits file has schema = "vsensor.validate/1" and the keys that differ:
coverage, pit, wasserstein, correlation_time, lost_time, outside. Exit 0 within the limits, 1 beyond, 2 bad
input.
"""


def tune(arguments: argparse.Namespace) -> int:
    """`vsensor tune`: an error model from tables of recorded drives."""
    from vsensor.error_model import save_library
    from vsensor.field.table import open_table
    from vsensor.field.tune import TuneOptions, tune_table
    from vsensor.field.tune.text import text_lines, write_plots
    from vsensor.field.virtual import FitSetting
    from vsensor.pages import require_pictures, require_place

    options = TuneOptions(
        levels=arguments.levels or TuneOptions().levels,
        by=arguments.by or "",
        step_mps=arguments.speed_step,
        order=arguments.order,
        cutoff_s_per_m=arguments.cutoff,
        region_level=arguments.region_level,
        block_s=arguments.block,
        least_seconds=arguments.least_seconds,
        close_loop=not arguments.open_loop,
        setting=FitSetting(seen_from_m=arguments.seen_from, dashes_m=arguments.dashes),
        seed=arguments.seed or 0,
        scheduler=arguments.scheduler,
        progress=shows_progress(arguments),
    )
    require_place(arguments.out)
    if arguments.plots is not None:
        require_pictures(arguments.plots, "--plots")
    tuned = tune_table(open_table(arguments.tables), options)
    save_library(tuned.library, arguments.out)
    print("\n".join(text_lines(tuned)))
    if arguments.plots is not None:
        write_plots(arguments.plots, tuned)
    return 0


def validate(arguments: argparse.Namespace) -> int:
    """`vsensor validate`: an error model against held-out drives."""
    from vsensor.field.table import open_table
    from vsensor.field.validate import validate_model, write_json
    from vsensor.field.virtual import FitSetting
    from vsensor.pages import require_place

    if arguments.json is not None:
        require_place(arguments.json)
    table = open_table(arguments.tables)
    with rows_bar(table, 1, arguments) as advance:
        found = validate_model(
            arguments.model,
            table,
            out=arguments.out,
            limits=arguments.limits,
            setting=FitSetting(seen_from_m=arguments.seen_from, dashes_m=arguments.dashes),
            seed=arguments.seed or 0,
            progress=advance,
        )
    if arguments.json is not None:
        write_json(arguments.json, found.judged)
    print("\n".join(found.lines))
    return 0 if found.good else 1


def add_tune(commands: Commands) -> None:
    """Add `vsensor tune`."""
    added = command(commands, "tune", tune, TUNE_HELP)
    option = added.add_argument
    tables_argument(added)
    option("--out", required=True, type=Path, metavar="MODEL", help="the error model: .npz")
    option("--levels", type=levels, metavar="P,P", help="of the surfaces (0.5,0.8,0.9,0.95,0.97,0.99)")
    option(
        "--by",
        metavar="COLUMN,...",
        help="a model for each: night, rain, or a column with edges: rain:0.2:0.6",
    )
    option("--speed-step", type=positive, default=0.5, metavar="MPS", help="grid along speed (0.5 m/s)")
    option(
        "--order",
        type=even,
        default=10,
        metavar="N",
        help="of the low-pass along speed, in steps; 0: none (10)",
    )
    option("--cutoff", type=positive, default=0.2, metavar="S/M", help="of the low-pass (0.2 s/m)")
    option(
        "--region-level", type=share, default=0.95, metavar="P", help="quantile of the reported range (0.95)"
    )
    option(
        "--block",
        type=positive,
        default=60.0,
        metavar="S",
        help="blocks that the intervals come from (60 s)",
    )
    option(
        "--least-seconds",
        type=positive,
        default=60.0,
        metavar="S",
        help="of driving, or a cell is blind (60)",
    )
    option("--open-loop", action="store_true", help="do not correct for the fit")
    _fit_options(added)
    option("--plots", type=Path, metavar="DIR", help="pages of pictures")
    option("--seed", type=seed, metavar="N", help="of the draws that close the loop (0)")
    option("--scheduler", metavar="ADDRESS", help="Dask scheduler; its workers must see the same table")
    option("--quiet", action="store_true", help="no progress bar")


def add_validate(commands: Commands) -> None:
    """Add `vsensor validate`."""
    added = command(commands, "validate", validate, VALIDATE_HELP)
    added.add_argument("model", type=Path, metavar="MODEL", help="the error model: .npz")
    tables_argument(added)
    option = added.add_argument
    option("--out", type=Path, metavar="FILE", help="a page of figures and pictures: .html or .pdf")
    option("--json", type=Path, metavar="FILE", help="write the verdict for programs")
    option("--limits", type=Path, metavar="FILE", help="limits that differ from the defaults: .toml")
    _fit_options(added)
    option("--seed", type=seed, metavar="N", help="of the virtual drives (0)")
    option("--quiet", action="store_true", help="no progress bar")


def _fit_options(added: argparse.ArgumentParser) -> None:
    option = added.add_argument
    option("--seen-from", type=metres, default=0.0, metavar="M", help="where the sensor's points begin (0 m)")
    option(
        "--dashes",
        type=dashes,
        default=(1.0, 0.0),
        metavar="PAINT,GAP",
        help="m of paint and gap where most lines were dashed: a fit errs more at their ends (solid)",
    )

"""`vsensor experiment`: many runs, a table, a report page."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, note, shows_progress
from vsensor.cli.values import count, positive

EXPERIMENT_HELP = """\
Run scenarios x seeds x settings on all cores: a table of figures, a report page, each run kept as you say.

  vsensor experiment p3                                   a shipped one
  vsensor experiment mine.toml --out results --outputs trace,log
  vsensor experiment mine.toml --workers 4 --duration 5   a quick look
  vsensor experiment euro_ncap_lss --bus socketcan:can0 --out my_ecu    a standard lane test of your ECU

Shipped: p3; the lane tests un_r130, iso_11270, euro_ncap_lss, euro_ncap_2026.

MATRIX.toml:
  schema = "vsensor.experiment/1"
  scenarios = ["highway", "mine.toml", "town.xodr"]       files, or shipped names
  seeds = 3                                               from each scenario's on; or a list
  duration_s = 20
  outputs = ["trace", "truth", "log", "images"]           of each run, in a folder of its own
  [settings]                                              every combination of the values of all keys
  environment.light = ["day", "night"]
  [[variant]]                                             settings that go together
  name = "slow"
  settings = { ego.speed_kmh = 60 }
  [[limit]]                                               exit 1 if a run is beyond it
  column = "error_50m_abs_95_m"
  at_most = 0.3

Into the folder: table.csv (a row per run), sides.csv, conditions.csv (errors by radius, gap, speed, what is
hidden, light, rain), the same as .parquet, report.html, runs/, cells/. Stopped by Ctrl-C or a crash, the same
command goes on with what is missing. Exit 1 if a run failed or is beyond a limit.
"""


def experiment(arguments: argparse.Namespace) -> int:
    """`vsensor experiment`: scenarios x seeds x settings, in simulated time."""
    from vsensor.experiment import ExperimentOptions, run_experiment

    outputs = None if arguments.outputs is None else tuple(filter(None, arguments.outputs.split(",")))
    options = ExperimentOptions(
        out=arguments.out,
        outputs=outputs,
        ecu=arguments.ecu,
        bus=arguments.bus,
        duration_s=arguments.duration,
        scheduler=arguments.scheduler,
        workers=arguments.workers,
        progress=shows_progress(arguments),
    )
    report = run_experiment(arguments.matrix, options, say=note)
    print("\n".join(report.lines))
    for line in (*report.failures, *report.broken):
        note(line)
    return report.status


def add_experiment(commands: Commands) -> None:
    """Add `vsensor experiment`."""
    added = command(commands, "experiment", experiment, EXPERIMENT_HELP)
    added.add_argument("matrix", metavar="MATRIX", help="matrix file or shipped name")
    added.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (experiment_NAME)")
    added.add_argument(
        "--outputs",
        metavar="KINDS",
        help="kept of each run: trace,truth,log,images; '' none (the matrix's)",
    )
    added.add_argument("--duration", type=positive, metavar="S", help="of each run (the matrix's)")
    added.add_argument(
        "--bus", metavar="INTERFACE:CHANNEL", help="the ECU under test is there: in real time, one by one"
    )
    added.add_argument("--ecu", metavar="NAME", help="of this program: reference, late, none (the matrix's)")
    added.add_argument("--workers", type=count, metavar="N", help="processes (all cores)")
    added.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster instead: tcp://HOST:8786")
    added.add_argument("--quiet", action="store_true", help="no progress bar")

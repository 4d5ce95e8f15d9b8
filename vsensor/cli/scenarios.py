"""`vsensor run`, `check`, `score`, `sweep`: scenarios, and what came of them."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.values import bitrate, count, positive, seed, ticks
from vsensor.stop import stop_signals

RUN_HELP = """\
Run a scenario and send its lane frames on a fixed cycle.

  vsensor run                             the shipped highway drive on vcan0, or on a virtual bus
  vsensor run --bus socketcan:can0        the same on real hardware
  vsensor run mine.toml --log out.blf --trace out.npz
  vsensor run town.xodr --fast --duration 60 --trace town.csv     a bare map, as quickly as it goes
  vsensor run cut_in.xosc --fast          OpenSCENARIO: its storyboard drives, its Ego carries the sensor
  vsensor run drive.log --profile native  a recorded drive: the road is laid along the driven path
"""

CHECK_HELP = """\
Load everything that FILE needs, say which models are on and what they cost, audit the DBC, send nothing.

FILE is a scenario (.toml, .xosc), a profile (.toml), a map (.xodr), a DBC (.dbc), a CAN log, or the name of a
shipped scenario or profile. Exit 1 if the audit found something that an ECU would stumble over.
"""

SCORE_HELP = """\
Compare output with truth in a trace that `vsensor run --trace FILE` wrote.

Lateral error at 10, 20, 50, 80 m (mean, std, 95 % of the absolute error), range, availability.
"""

SWEEP_HELP = """\
Run a scenario over a grid of settings and seeds on all cores, and score every run against the truth.

  vsensor sweep highway --vary camera.width_px=320,640,1280 --seeds 5 --duration 20
  vsensor sweep mine.toml --vary camera.pitch_deg=-2:2:0.5 --vary camera.occlusion=none,auto --out pitch

Into a folder: table.csv, table.parquet, plot.png (error and range against each setting), cells/. Stopped by
Ctrl-C or a crash, the same command goes on with what is missing. Exit 1 if a cell failed.
"""


def run(arguments: argparse.Namespace) -> int:
    """`vsensor run`: a scenario in real time, or as quickly as it goes."""
    with stop_signals() as stopped:  # from before numpy is imported, which may swallow a KeyboardInterrupt
        return _run(arguments, stopped)


def _run(arguments: argparse.Namespace, stopped: Callable[[], bool]) -> int:
    from vsensor.config import load_scenario
    from vsensor.run import RunOptions, run_scenario

    overrides = {
        key: value
        for key, value in (("seed", arguments.seed), ("duration_s", arguments.duration))
        if value is not None
    }
    if arguments.ego is not None:
        overrides["storyboard"] = {"ego": arguments.ego}
    scenario = load_scenario(arguments.scenario, overrides)
    options = RunOptions(
        bus=arguments.bus,
        log=arguments.log,
        trace=arguments.trace,
        truth=arguments.truth,
        truth_every=arguments.truth_every,
        picture=arguments.picture,
        images=arguments.images,
        image_every=arguments.image_every,
        video=arguments.video,
        fast=arguments.fast,
        realtime=arguments.realtime,
        faults=tuple(arguments.fault),
        control=arguments.control,
        profile=arguments.profile,
        dbc=arguments.dbc,
        table=sys.stdout.isatty() and not arguments.quiet,
        progress=sys.stderr.isatty() and arguments.fast and not arguments.quiet,
    )
    summary = run_scenario(scenario, options, say=note, stopped=stopped)
    print(summary.text())
    return 130 if summary.interrupted else 0


def check(arguments: argparse.Namespace) -> int:
    """`vsensor check`: load everything, say what is on, audit the DBC, send nothing."""
    from vsensor.check import BusSpeed, check_file

    bus = BusSpeed(nominal_bps=arguments.bitrate, data_bps=arguments.data_bitrate)
    report = check_file(arguments.file, profile=arguments.profile, dbc=arguments.dbc, bus=bus)
    print("\n".join(report.lines))
    return 1 if report.findings else 0


def score(arguments: argparse.Namespace) -> int:
    """`vsensor score`: output against truth."""
    from vsensor.score import score_trace
    from vsensor.sinks.trace import read_trace

    print(score_trace(read_trace(arguments.trace)).text())
    return 0


def sweep(arguments: argparse.Namespace) -> int:
    """`vsensor sweep`: a scenario over a grid of settings, in simulated time."""
    from vsensor.study import SweepOptions, sweep_scenario

    options = SweepOptions(
        vary=tuple(arguments.vary),
        seeds=arguments.seeds,
        out=arguments.out,
        duration_s=arguments.duration,
        scheduler=arguments.scheduler,
        workers=arguments.workers,
        progress=shows_progress(arguments),
    )
    report = sweep_scenario(arguments.scenario, options, say=note)
    print("\n".join(report.lines))
    for failure in report.failures:
        note(failure)
    return 130 if report.interrupted else int(bool(report.failures))


def add_run(commands: Commands) -> None:
    """Add `vsensor run`."""
    added = command(commands, "run", run, RUN_HELP)
    added.add_argument(
        "scenario",
        nargs="?",
        help="scenario file or shipped name, or a bare map (.xodr), storyboard (.xosc) or CAN log; highway",
    )
    added.add_argument(
        "--bus",
        metavar="INTERFACE:CHANNEL",
        help="python-can bus; default auto: vcan0 if it is there, otherwise an in-process virtual bus",
    )
    added.add_argument("--log", type=Path, metavar="FILE", help="write what was sent: .log .asc .blf .mf4")
    added.add_argument("--trace", type=Path, metavar="FILE", help="truth beside output: .npz .csv .parquet")
    added.add_argument(
        "--truth",
        type=Path,
        metavar="FILE",
        help="every 0.1 m of the true lines, and why unseen: .npz .parquet",
    )
    added.add_argument("--truth-every", type=ticks, default=1, metavar="N", help="of every N-th tick (1)")
    added.add_argument("--picture", type=Path, metavar="FILE", help="draw lanes and camera view: .png .svg")
    added.add_argument(
        "--images", type=Path, metavar="DIR", help="draw what the camera sees: PNGs; with --fast"
    )
    added.add_argument(
        "--image-every", type=ticks, default=25, metavar="N", help="one PNG every N ticks (25: each second)"
    )
    added.add_argument("--video", type=Path, metavar="FILE", help="every tick: .mp4, or .avi without loss")
    added.add_argument("--duration", type=positive, metavar="S", help="end after S seconds (the scenario's)")
    added.add_argument("--ego", metavar="NAME", help="with an .xosc: who carries the sensor (Ego)")
    added.add_argument("--fast", action="store_true", help="simulated clock, as quickly as it goes; no bus")
    added.add_argument(
        "--realtime", action="store_true", help="real-time priority and locked memory, where allowed"
    )
    added.add_argument("--seed", type=seed, metavar="N", help="seed of all random draws (the scenario's)")
    added.add_argument("--profile", metavar="NAME", help="bus profile, shipped name or file")
    dbc_option(added, "the database that the profile maps")
    added.add_argument(
        "--fault",
        action="append",
        default=[],
        metavar="KEY=VALUE,...",
        help="a fault as in [[fault]]: kind=frame_lost,message=LDS_Lane,at_s=3,for_s=1; repeatable",
    )
    added.add_argument(
        "--control", metavar="PORT", help="listen for JSON lines on this machine's PORT, or unix:PATH"
    )
    added.add_argument("--quiet", action="store_true", help="no live table, no progress bar")


def add_check(commands: Commands) -> None:
    """Add `vsensor check`."""
    added = command(commands, "check", check, CHECK_HELP)
    added.add_argument("file", help="scenario, profile, map, DBC or log; or a shipped name")
    added.add_argument("--profile", metavar="NAME", help="check with this profile instead of the scenario's")
    dbc_option(added, "the database that the profile maps")
    added.add_argument(
        "--bitrate",
        type=bitrate,
        default="500k",
        metavar="RATE",
        help="of the bus whose load is told (500k)",
    )
    added.add_argument(
        "--data-bitrate", type=bitrate, default="2M", metavar="RATE", help="of CAN FD's data phase (2M)"
    )


def add_score(commands: Commands) -> None:
    """Add `vsensor score`."""
    added = command(commands, "score", score, SCORE_HELP)
    added.add_argument("trace", type=Path, help="trace file: .npz .csv .parquet")


def add_sweep(commands: Commands) -> None:
    """Add `vsensor sweep`."""
    added = command(commands, "sweep", sweep, SWEEP_HELP)
    added.add_argument("scenario", help="scenario file or shipped name, or a bare map (.xodr) or CAN log")
    added.add_argument(
        "--vary",
        action="append",
        required=True,
        metavar="KEY=VALUES",
        help="a scenario key such as camera.width_px and its values: 320,640 or start:stop:step; repeatable",
    )
    added.add_argument("--seeds", type=count, default=1, metavar="N", help="runs of each setting (1)")
    added.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (sweep_NAME)")
    added.add_argument("--duration", type=positive, metavar="S", help="seconds of each run (the scenario's)")
    added.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786")
    added.add_argument("--workers", type=count, metavar="N", help="local processes (all cores)")
    added.add_argument("--quiet", action="store_true", help="no progress bar")

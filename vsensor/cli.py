"""The command line: `vsensor COMMAND`, one thin function per command.

Exit status: 0 done, 1 a check said no, 2 bad input (one line on stderr), 130 ended by Ctrl-C.
"""

import argparse
import math
import os
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeAlias

from vsensor.errors import ConfigError, VsensorError
from vsensor.stop import stop_signals

RUN_HELP = """\
Run a scenario and send its lane frames on a fixed cycle.

  vsensor run                             the shipped highway drive on vcan0, or on a virtual bus
  vsensor run --bus socketcan:can0        the same on real hardware
  vsensor run mine.toml --log out.blf --trace out.npz
  vsensor run town.xodr --fast --duration 60 --trace town.csv     a bare map, as quickly as it goes
  vsensor run drive.log --profile native  a recorded drive: the road is laid along the driven path
"""

CHECK_HELP = """\
Load everything that FILE needs, say which models are on and what they cost, audit the DBC, send nothing.

FILE is a scenario (.toml), a profile (.toml), a map (.xodr), a DBC (.dbc), a CAN log, or the name of a
shipped scenario or profile. Exit 1 if the audit found something that an ECU would stumble over.
"""

DECODE_HELP = """\
Decode the lane signals of a CAN log through a profile: a table on a terminal, CSV with --csv.

  vsensor decode out.log
  vsensor decode out.blf --profile native --csv > lanes.csv
"""

CONVERT_HELP = """\
Write a CAN log in another format, which the suffix of OUT says; .parquet holds decoded signals.

  vsensor convert drive.blf drive.mf4
  vsensor convert drive.log drive.csv --lossy          leaves out what CSV cannot hold, and says what
  vsensor convert frames.log drive.asc --rate 100      text without times: 100 frames per second
  vsensor convert drive.blf drive.parquet --dbc car.dbc         a row per signal of a frame
  vsensor convert drive.blf lanes.parquet --profile native      a row per image

What OUT cannot hold is refused without --lossy. OUT appears when it is whole.
"""

LOG_HELP = """\
Say what is in a CAN log: channels and their load, and of every id cycle time, jitter, gaps, duplicates,
counters (bits that count), and the checksum, found by trying all known ones with their data ids.

  vsensor log drive.blf
  vsensor log drive.mf4 --dbc car.dbc --bitrate 250k --json drive.json
"""

SCORE_HELP = """\
Compare output with truth in a trace that `vsensor run --trace FILE` wrote.

Lateral error at 10, 20, 50, 80 m (mean, std, 95 % of the absolute error), range, availability.
"""

ACCEPT_HELP = """\
Judge a stream of frames as an ECU would that reads it: a recording, or a bus for some time. Sends nothing.

  vsensor accept drive.log                            our own stream, or any sensor's with this profile
  vsensor accept --bus socketcan:can0 --duration 10   what is on the bus now; Ctrl-C ends and judges, too
  vsensor accept car.log --profile mine.toml --limits mine_limits.toml --json verdict.json

Looks for missing and late frames, wrong lengths, CRCs and counters, frozen images, torn or mixed bursts,
jumps, stuck signals, contradictions, values out of range. Each line is one kind of fault in one message: how
often, when first (seconds from the first frame), how bad, what passes, and what a consumer does about it.

A limits file needs schema = "vsensor.accept/1" and only the keys that differ: cycle_tolerance, jitter_ms,
frozen_ms, offset_step_m ..., [receiver] (AUTOSAR's tolerances), [allow] (how many of a kind pass).
Exit 0 accepted, 1 not (with the list), 2 bad input.
"""

REPLAY_HELP = """\
Play a CAN log on its own times: onto one bus or several, a part of it, faster, in a loop.

  vsensor replay drive.log --bus socketcan:can0
  vsensor replay drive.blf --map 1=socketcan:can0 --map 2=socketcan:can1 --loop 0
  vsensor replay drive.mf4 --start 60 --stop 90 --speed 2 --exclude 0x320-0x32F
  vsensor replay drive.asc --dbc car.dbc --include ENGINE,0x123 --log played.blf
  vsensor replay drive.blf --bus socketcan:can0 --loop 0 --repair native --repair honda=honda.dbc
  vsensor replay drive.blf --bus socketcan:can0 --from honda=honda.dbc --as hyundai=hyundai.dbc
  vsensor replay drive.log --overlay drive.toml --log with_lanes.blf    a lane camera that was never there
  vsensor replay drive.log --overlay drive.toml --take-over 30 --bus socketcan:can0   the ECU steers then

On a terminal: space holds and goes on, arrows 5 s back and ahead, s one frame, q ends.
"""

GATEWAY_HELP = """\
Pass a running car's or bench's frames from one bus to another, and replace its lane camera by the sensor.

  vsensor gateway --in can0 --out can1 --overlay bench.toml
  vsensor gateway --in socketcan:can0 --out pcan:PCAN_USBBUS1 --overlay bench.toml --both-ways

The scenario drives on a map; with [ego] control = "motion", "pose" or "steering" the frames that are passed
on (and those heard on --out) move its vehicle. Frames with the ids of its profile are not passed on. The
summary has the latency from the receive time to after sending.
"""

SWEEP_HELP = """\
Run a scenario over a grid of settings and seeds on all cores, and score every run against the truth.

  vsensor sweep highway --vary camera.width_px=320,640,1280 --seeds 5 --duration 20
  vsensor sweep mine.toml --vary camera.pitch_deg=-2:2:0.5 --vary camera.occlusion=none,auto --out pitch

Into a folder: table.csv, table.parquet, plot.png (error and range against each setting), cells/. Stopped by
Ctrl-C or a crash, the same command goes on with what is missing. Exit 1 if a cell failed.
"""


SCAN_HELP = """\
Scan recorded drives into a table of errors: each reported line against a reference, at every range.

  vsensor scan logs/ --out table                          all logs of a folder, profiles native and vehicle
  vsensor scan *.blf --profile mine.toml --profile car.toml --dbc car.dbc --out table --plots pdf
  vsensor scan drive.mf4 --reference map town.xodr --out table       the log holds the pose, too
  vsensor scan drive.mf4 --reference lidar.csv --out table           columns side, x_m, y_m

The reference gta is the sensor's own offset beside the vehicle, placed along the driven path.
Into TABLE one Parquet file for each log; lane changes, resets, low speed and gaps are masked with the reason
in a column. A limits file needs schema = "vsensor.scan/1" and only the keys that differ: low_speed_kmh,
lane_change_s, offset_jump_m, reset_s, reference_quality, reference_gap_m, smooth_m, silence_s,
yaw_rate_offset_degps, speed_factor, image_clock, latency_ms, camera_x_m, [vehicle].

Stopped by Ctrl-C or a crash, the same command goes on with what is missing. A log that cannot be used is
listed at the end, the others are scanned; then exit 1.
"""

TABLE_HELP = """\
Say what is in tables that `vsensor scan` wrote: logs, hours, rows, and what is masked.

  vsensor table monday/ tuesday/

Several folders count as one table, as they do for every command that takes one. A file of another schema is
refused by name.
"""

PROFILE_HELP = """\
Begin a profile for a database: which model quantity each of its signals carries.

  vsensor profile new car.dbc --out car.toml
"""

PROFILE_NEW_HELP = """\
Write a skeleton of a profile, guessed from the names, units, comments and value tables of a database.

  vsensor profile new car.dbc                               to look at
  vsensor profile new car.dbc --out car.toml --node CAM     only what CAM sends; the file then names it
  vsensor check car.toml                                    what is still open
  vsensor run --fast --profile car.toml --duration 10 --log car.log
  vsensor accept car.log --profile car.toml

FILE is .dbc, .arxml, .kcd or .sym. What is written loads and can be sent at once; `#?` marks each guess that
the database does not prove, and each signal that could not be guessed. Answer it, delete the mark. Lanes come
first: where a database has none, the profile is of what the sensor listens to (speed, yaw rate, ...).
All keys of a profile: dbc/README.md, "Writing a profile".
"""

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

DENSITY_HELP = """\
Where the errors of tables lie: shares of sub cubes of range, speed and error, distributions, blind spots.

  vsensor density table --out density
  vsensor density table --candidates more/table --out density --seconds 3600

Into the folder: density.npz, cells.csv, distributions.csv, pictures; thin.csv, the speeds with less driving
than --seconds at some range that is reported there; fill.csv, which drives have most of what is missing, and
when: of --candidates, such as drives that are not learned from yet, otherwise of the tables themselves.
"""

INFLUENCE_HELP = """\
What the error depends on: the share of it that each dimension explains, with its interval.

  vsensor influence table
  vsensor influence table --as-published      P1's table of principal components before it

By rank, so that no unit counts. shared: what a dimension adds to all others, averaged over all orders (these
sum to what all explain together); alone: what it explains without the others.
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


class _Parser(argparse.ArgumentParser):
    """Says what is wrong in one line."""

    def error(self, message: str) -> NoReturn:
        command = self.prog.removeprefix("vsensor").strip()
        print(f"vsensor: {message}; see vsensor {command}{' ' * bool(command)}--help", file=sys.stderr)
        sys.exit(2)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    # One core is enough, and OpenBLAS threads would disturb the cycle; numpy reads it when it is loaded.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    arguments = _parser().parse_args(argv)
    command: Callable[[argparse.Namespace], int] = arguments.command
    try:
        status = command(arguments)
        sys.stdout.flush()
        return status
    except VsensorError as error:
        print(f"vsensor: {' '.join(str(error).split())}", file=sys.stderr)
        return 2
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:  # what writes files has told its own by now: this is standard output
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        where = f"{error.filename}: " if error.filename else "standard output: "
        print(f"vsensor: {where}{error.strerror or error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        return 130


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
    scenario = load_scenario(arguments.scenario, overrides)
    options = RunOptions(
        bus=arguments.bus,
        log=arguments.log,
        trace=arguments.trace,
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
    summary = run_scenario(scenario, options, say=_note, stopped=stopped)
    print(summary.text())
    return 130 if summary.interrupted else 0


def check(arguments: argparse.Namespace) -> int:
    """`vsensor check`: load everything, say what is on, audit the DBC, send nothing."""
    from vsensor.check import BusSpeed, check_file

    bus = BusSpeed(nominal_bps=arguments.bitrate, data_bps=arguments.data_bitrate)
    report = check_file(arguments.file, profile=arguments.profile, dbc=arguments.dbc, bus=bus)
    print("\n".join(report.lines))
    return 1 if report.findings else 0


def decode(arguments: argparse.Namespace) -> int:
    """`vsensor decode`: lane signals of a log as a table or CSV."""
    from vsensor.logs.decode import decode_log
    from vsensor.profile import load_profiles

    profiles = load_profiles(arguments.profile or ["native"], arguments.dbc)
    table = decode_log(arguments.log, profiles)
    width = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    for line in table.csv_lines() if arguments.csv else table.text_lines(width):
        print(line)
    for finding in table.findings:
        _note(finding)
    return 0


def convert(arguments: argparse.Namespace) -> int:
    """`vsensor convert`: a log in another format, or decoded."""
    from vsensor.logs.convert import convert_log
    from vsensor.logs.parquet import decode_to_parquet
    from vsensor.logs.progress import progress_bar

    source, target, rate_hz = arguments.log, arguments.out, arguments.rate
    decoding = target.suffix.lower() == ".parquet"
    if not decoding and (arguments.profile or arguments.dbc):
        raise ConfigError(f"{target}: --dbc and --profile decode signals, into .parquet")
    with progress_bar(source, shown=sys.stderr.isatty() and not arguments.quiet) as progress:
        if decoding:
            by = {"profiles": arguments.profile or [], "dbc": arguments.dbc}
            done = decode_to_parquet(source, target, **by, rate_hz=rate_hz, progress=progress)
        else:
            done = convert_log(source, target, lossy=arguments.lossy, rate_hz=rate_hz, progress=progress)
    print("\n".join(done.lines()))
    for one in done.notes:
        _note(one)
    return 0


def log(arguments: argparse.Namespace) -> int:
    """`vsensor log`: what is in a log."""
    from vsensor.codec import load_database
    from vsensor.logs.inspect import inspect_log, write_json
    from vsensor.logs.inspect_text import text_lines
    from vsensor.logs.progress import progress_bar

    database = None if arguments.dbc is None else load_database(arguments.dbc)
    with progress_bar(arguments.log, shown=sys.stderr.isatty() and not arguments.quiet) as progress:
        summary = inspect_log(
            arguments.log,
            database=database,
            bitrate_bps=arguments.bitrate,
            data_bitrate_bps=arguments.data_bitrate,
            rate_hz=arguments.rate,
            progress=progress,
        )
    if arguments.json is not None:
        write_json(arguments.json, summary)
    for line in text_lines(summary):
        print(line)
    return 0


def score(arguments: argparse.Namespace) -> int:
    """`vsensor score`: output against truth."""
    from vsensor.score import score_trace
    from vsensor.sinks.trace import read_trace

    print(score_trace(read_trace(arguments.trace)).text())
    return 0


def accept(arguments: argparse.Namespace) -> int:
    """`vsensor accept`: a recording or a live bus, judged as a consumer would."""
    with stop_signals() as stopped:
        return _accept(arguments, stopped)


def _accept(arguments: argparse.Namespace, stopped: Callable[[], bool]) -> int:
    from vsensor.accept import accept_bus, accept_log, load_limits, write_report
    from vsensor.profile import load_profiles

    if (arguments.log is None) == (arguments.bus is None):
        raise ConfigError("accept: either a LOG or --bus was expected")
    if arguments.duration is not None and arguments.bus is None:
        raise ConfigError("accept: --duration is for --bus; a recording is judged as a whole")
    profiles = load_profiles(arguments.profile or ["native"], arguments.dbc)
    limits = load_limits(arguments.limits)
    if arguments.bus is None:
        judged = accept_log(arguments.log, profiles, limits)
    else:
        judged = accept_bus(arguments.bus, profiles, limits, duration_s=arguments.duration, stopped=stopped)
    if arguments.json is not None:
        write_report(arguments.json, judged)
    for line in judged.lines():
        print(line)
    return 0 if judged.is_accepted else 1


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
        progress=sys.stderr.isatty() and not arguments.quiet,
    )
    report = sweep_scenario(arguments.scenario, options, say=_note)
    print("\n".join(report.lines))
    for failure in report.failures:
        _note(failure)
    return 130 if report.interrupted else int(bool(report.failures))


def scan(arguments: argparse.Namespace) -> int:
    """`vsensor scan`: recorded drives into a table of errors."""
    from vsensor.field.scan import ScanOptions
    from vsensor.field.scan_many import scan_logs
    from vsensor.field.summary import log_lines, mask_lines

    options = ScanOptions(
        profiles=tuple(arguments.profile or ScanOptions().profiles),
        dbc=None if arguments.dbc is None else str(arguments.dbc),
        reference=_reference(arguments.reference),
        route=tuple(arguments.route.split(",")) if arguments.route else (),
        ranges_m=arguments.ranges,
        all_sides=arguments.sides == "all",
        beyond_range=arguments.beyond_range,
        limits=None if arguments.limits is None else str(arguments.limits),
        plots=arguments.plots,
    )
    report = scan_logs(
        arguments.logs,
        arguments.out,
        options,
        scheduler=arguments.scheduler,
        workers=arguments.workers,
        progress=sys.stderr.isatty() and not arguments.quiet,
    )
    if report.infos:
        print("\n".join([*log_lines(report.infos), "", *mask_lines(report.infos)]))
    for info in report.infos:
        for note in info["notes"]:
            _note(f"{info['log']}: {note}")
    if report.reused:
        _note(f"{report.reused} of {len(report.infos)} logs were scanned before")
    for failure in report.failures:
        _note(f"not scanned: {failure}")
    if report.interrupted:
        _note("stopped; the same command goes on with the rest")
        return 130
    return int(bool(report.failures))


def _reference(words: Sequence[str]) -> str:
    """Return the one reference that `--reference gta`, `map FILE` or `FILE` names."""
    if len(words) == 2 and words[0] == "map":
        if Path(words[1]).suffix.lower() != ".xodr":
            raise ConfigError(f"--reference map {words[1]}: an OpenDRIVE map (.xodr) was expected")
        return words[1]
    if len(words) != 1 or words[0] == "map":
        raise ConfigError(f"--reference {' '.join(words)}: gta, map FILE.xodr or FILE.csv was expected")
    return words[0]


def table(arguments: argparse.Namespace) -> int:
    """`vsensor table`: what is in tables of errors."""
    from vsensor.field.summary import table_lines
    from vsensor.field.table import open_table

    print("\n".join(table_lines(open_table(arguments.tables))))
    return 0


def replay(arguments: argparse.Namespace) -> int:
    """`vsensor replay`: a log on its own times."""
    with stop_signals() as stopped:
        return _replay(arguments, stopped)


def _replay(arguments: argparse.Namespace, stopped: Callable[[], bool]) -> int:
    from vsensor.errors import LogError
    from vsensor.replay import ReplayOptions, replay_log
    from vsensor.replay.keys import terminal_keys

    given: dict[str, Any] = {key: getattr(arguments, key) for key in _SINGLE}
    given |= {key: tuple(getattr(arguments, key) or ()) for key in _REPEATED}
    options = ReplayOptions(**given)
    with terminal_keys(None if not arguments.quiet else -1) as keys:
        report = replay_log(options, say=_note, stopped=stopped, keys=keys)
    print(report.text())
    if report.fault is not None:
        raise LogError(report.fault)
    return 130 if report.interrupted else 0


def profile_new(arguments: argparse.Namespace) -> int:
    """`vsensor profile new`: a skeleton of a profile."""
    from vsensor.profile_new import new_profile, write_profile

    skeleton = new_profile(arguments.file, arguments.out, arguments.node, arguments.role)
    if arguments.out is None:
        print(skeleton.text, end="")
    else:
        write_profile(skeleton, arguments.out, force=arguments.force)
    for line in skeleton.summary():
        _note(line)
    return 0


def tune(arguments: argparse.Namespace) -> int:
    """`vsensor tune`: an error model from tables of recorded drives."""
    from vsensor.error_model import save_library
    from vsensor.field.table import open_table
    from vsensor.field.tune import TuneOptions, tune_table
    from vsensor.field.tune.text import text_lines, write_plots
    from vsensor.field.virtual import FitSetting

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
        setting=FitSetting(seen_from_m=arguments.seen_from),
        seed=arguments.seed or 0,
        scheduler=arguments.scheduler,
        progress=sys.stderr.isatty() and not arguments.quiet,
    )
    tuned = tune_table(open_table(arguments.tables), options)
    save_library(tuned.library, arguments.out)
    print("\n".join(text_lines(tuned)))
    if arguments.plots is not None:
        write_plots(arguments.plots, tuned)
    return 0


def gateway(arguments: argparse.Namespace) -> int:
    """`vsensor gateway`: frames passed on, the camera's replaced."""
    from vsensor.gateway import GatewayOptions, run_gateway

    options = GatewayOptions(
        near=arguments.near,
        far=arguments.far,
        overlay=arguments.overlay,
        both_ways=arguments.both_ways,
        duration_s=arguments.duration,
        realtime=arguments.realtime,
    )
    with stop_signals() as stopped:
        summary = run_gateway(options, _note, stopped)[1]
        print("\n".join(summary))
        return 130 if stopped() else 0


def density(arguments: argparse.Namespace) -> int:
    """`vsensor density`: where the errors of tables lie."""
    from vsensor.field.density import density_of
    from vsensor.field.density_report import text_lines, write_density
    from vsensor.field.table import open_table
    from vsensor.field.thin import filling_drives, thin_cells

    table = open_table(arguments.tables)
    candidates = table if arguments.candidates is None else open_table(arguments.candidates)
    with _rows_bar(table, 2, arguments) as advance:
        found = density_of(table, advance)
    thin = thin_cells(found, arguments.seconds)
    fill = filling_drives(candidates, thin, found.grid.step_mps)
    write_density(arguments.out, found, thin, fill, pictures=not arguments.no_pictures)
    print("\n".join(text_lines(found, thin, fill)))
    return 0


def influence(arguments: argparse.Namespace) -> int:
    """`vsensor influence`: what the error depends on."""
    from vsensor.field.influence import influence_lines, influence_of, published_lines
    from vsensor.field.table import open_table

    table = open_table(arguments.tables)
    with _rows_bar(table, 1, arguments) as advance:
        found = influence_of(table, seed=arguments.seed or 0, progress=advance)
    if arguments.as_published:
        print("\n".join([*published_lines(found), ""]))
    print("\n".join(influence_lines(found)))
    return 0


def validate(arguments: argparse.Namespace) -> int:
    """`vsensor validate`: an error model against held-out drives."""
    from vsensor.field.table import open_table
    from vsensor.field.validate import validate_model
    from vsensor.field.virtual import FitSetting

    table = open_table(arguments.tables)
    with _rows_bar(table, 1, arguments) as advance:
        found = validate_model(
            arguments.model,
            table,
            out=arguments.out,
            limits=arguments.limits,
            setting=FitSetting(seen_from_m=arguments.seen_from),
            seed=arguments.seed or 0,
            progress=advance,
        )
    print("\n".join(found.lines))
    return 0 if found.good else 1


def _rows_bar(table: Any, passes: int, arguments: argparse.Namespace) -> Any:
    from vsensor.field.tune.spread import rows_bar

    return rows_bar(table, passes, shown=sys.stderr.isatty() and not arguments.quiet)


def _note(text: str) -> None:
    print(f"vsensor: {text}", file=sys.stderr)


def _parser() -> argparse.ArgumentParser:
    parser = _Parser(
        prog="vsensor",
        description="A virtual lane-detection sensor: a road scene in, DBC-defined lane frames on CAN out.",
        epilog="Start with `vsensor run`; every command explains itself with --help.",
    )
    parser.add_argument("--version", action="version", version=_version())
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    _add_run(commands)
    _add_check(commands)
    _add_decode(commands)
    _add_convert(commands)
    _add_log(commands)
    _add_score(commands)
    _add_accept(commands)
    _add_sweep(commands)
    _add_replay(commands)
    _add_gateway(commands)
    _add_scan(commands)
    _add_table(commands)
    _add_tune(commands)
    _add_validate(commands)
    _add_density(commands)
    _add_influence(commands)
    _add_profile(commands)
    return parser


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return f"vsensor {version('vsensor')}"
    except PackageNotFoundError:
        return "vsensor (not installed)"


if TYPE_CHECKING:
    Commands: TypeAlias = argparse._SubParsersAction[_Parser]  # argparse has no public name for it


def _command(
    commands: "Commands",
    name: str,
    function: Callable[[argparse.Namespace], int],
    text: str,
) -> argparse.ArgumentParser:
    added = commands.add_parser(
        name,
        help=text.split("\n", 1)[0].replace("%", "%%"),
        description=text,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    added.set_defaults(command=function)
    return added


def _add_run(commands: "Commands") -> None:
    added = _command(commands, "run", run, RUN_HELP)
    added.add_argument(
        "scenario",
        nargs="?",
        help="scenario file or shipped name, or a bare map (.xodr) or CAN log; default: highway",
    )
    added.add_argument(
        "--bus",
        metavar="INTERFACE:CHANNEL",
        help="python-can bus; default auto: vcan0 if it is there, otherwise an in-process virtual bus",
    )
    added.add_argument("--log", type=Path, metavar="FILE", help="write what was sent: .log .asc .blf .mf4")
    added.add_argument("--trace", type=Path, metavar="FILE", help="truth beside output: .npz .csv .parquet")
    added.add_argument("--picture", type=Path, metavar="FILE", help="draw lanes and camera view: .png .svg")
    added.add_argument(
        "--images", type=Path, metavar="DIR", help="draw what the camera sees: PNGs; with --fast"
    )
    added.add_argument(
        "--image-every", type=_ticks, default=25, metavar="N", help="one PNG every N ticks (25: each second)"
    )
    added.add_argument("--video", type=Path, metavar="FILE", help="every tick: .mp4, or .avi without loss")
    added.add_argument("--duration", type=_positive, metavar="S", help="end after S seconds (the scenario's)")
    added.add_argument("--fast", action="store_true", help="simulated clock, as quickly as it goes; no bus")
    added.add_argument(
        "--realtime", action="store_true", help="real-time priority and locked memory, where allowed"
    )
    added.add_argument("--seed", type=_seed, metavar="N", help="seed of all random draws (the scenario's)")
    added.add_argument("--profile", metavar="NAME", help="bus profile, shipped name or file")
    added.add_argument("--dbc", type=Path, metavar="FILE", help="the database that the profile maps")
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


def _add_check(commands: "Commands") -> None:
    added = _command(commands, "check", check, CHECK_HELP)
    added.add_argument("file", help="scenario, profile, map, DBC or log; or a shipped name")
    added.add_argument("--profile", metavar="NAME", help="check with this profile instead of the scenario's")
    added.add_argument("--dbc", type=Path, metavar="FILE", help="the database that the profile maps")
    added.add_argument(
        "--bitrate",
        type=_bitrate,
        default="500k",
        metavar="RATE",
        help="of the bus whose load is told (500k)",
    )
    added.add_argument(
        "--data-bitrate", type=_bitrate, default="2M", metavar="RATE", help="of CAN FD's data phase (2M)"
    )


def _add_decode(commands: "Commands") -> None:
    added = _command(commands, "decode", decode, DECODE_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    added.add_argument(
        "--profile", action="append", metavar="NAME", help="shipped name or file; repeatable (native)"
    )
    added.add_argument("--dbc", type=Path, metavar="FILE", help="the database of the profile that names none")
    added.add_argument("--csv", action="store_true", help="comma-separated values instead of a table")


def _add_convert(commands: "Commands") -> None:
    added = _command(commands, "convert", convert, CONVERT_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    added.add_argument("out", type=Path, help="the same formats, .gz behind those of text; or .parquet")
    added.add_argument("--lossy", action="store_true", help="leave out what OUT cannot hold, and list it")
    added.add_argument("--rate", type=_hertz, metavar="HZ", help="frames per second, for text without times")
    added.add_argument("--dbc", type=Path, metavar="FILE", help="decode into .parquet by this database")
    added.add_argument(
        "--profile", action="append", metavar="NAME", help="decode into .parquet by this profile; repeatable"
    )
    added.add_argument("--quiet", action="store_true", help="no progress bar")


def _add_log(commands: "Commands") -> None:
    added = _command(commands, "log", log, LOG_HELP)
    added.add_argument("log", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    added.add_argument("--dbc", type=Path, metavar="FILE", help="names and data ids of the messages")
    added.add_argument("--json", type=Path, metavar="FILE", help="write it all as JSON too")
    added.add_argument("--rate", type=_hertz, metavar="HZ", help="frames per second, for text without times")
    added.add_argument("--bitrate", type=_bitrate, default="500k", metavar="RATE", help="of the bus (500k)")
    added.add_argument(
        "--data-bitrate", type=_bitrate, default="2M", metavar="RATE", help="of CAN FD's data phase (2M)"
    )
    added.add_argument("--quiet", action="store_true", help="no progress bar")


def _add_score(commands: "Commands") -> None:
    added = _command(commands, "score", score, SCORE_HELP)
    added.add_argument("trace", type=Path, help="trace file: .npz .csv .parquet")


def _add_accept(commands: "Commands") -> None:
    added = _command(commands, "accept", accept, ACCEPT_HELP)
    added.add_argument(
        "log", nargs="?", type=Path, help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped"
    )
    added.add_argument("--bus", metavar="INTERFACE:CHANNEL", help="python-can bus to listen to instead")
    added.add_argument("--duration", type=_positive, metavar="S", help="listen for S seconds (until Ctrl-C)")
    added.add_argument(
        "--profile", action="append", metavar="NAME", help="shipped name or file; repeatable (native)"
    )
    added.add_argument("--dbc", type=Path, metavar="FILE", help="the database of the profile that names none")
    added.add_argument(
        "--limits", type=Path, metavar="FILE", help="limits that differ from the defaults: .toml"
    )
    added.add_argument("--json", type=Path, metavar="FILE", help="write the verdict for programs")


def _add_sweep(commands: "Commands") -> None:
    added = _command(commands, "sweep", sweep, SWEEP_HELP)
    added.add_argument("scenario", help="scenario file or shipped name, or a bare map (.xodr) or CAN log")
    added.add_argument(
        "--vary",
        action="append",
        required=True,
        metavar="KEY=VALUES",
        help="a scenario key such as camera.width_px and its values: 320,640 or start:stop:step; repeatable",
    )
    added.add_argument("--seeds", type=_count, default=1, metavar="N", help="runs of each setting (1)")
    added.add_argument("--out", type=Path, metavar="DIR", help="folder of the results (sweep_NAME)")
    added.add_argument("--duration", type=_positive, metavar="S", help="seconds of each run (the scenario's)")
    added.add_argument("--scheduler", metavar="ADDRESS", help="Dask scheduler, such as tcp://host:8786")
    added.add_argument("--workers", type=_count, metavar="N", help="local processes (all cores)")
    added.add_argument("--quiet", action="store_true", help="no progress bar")


_REPEATED = ("map", "include", "exclude", "rename", "dbc", "profile", "repair")
_SINGLE = (
    *("path", "bus", "speed", "fast", "start", "stop", "loops", "max_gap_s", "smooth", "rate_hz"),
    *("wait_for", "start_at", "skip_unsendable", "overlay", "take_over", "log", "realtime", "keep_wrong"),
    *("source", "target", "camera_x_m", "wheelbase_m"),
)


def _add_replay(commands: "Commands") -> None:
    added = _command(commands, "replay", replay, REPLAY_HELP)
    option = added.add_argument
    option("path", type=Path, metavar="LOG", help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    option(
        "--bus", metavar="INTERFACE:CHANNEL", help="python-can bus of every channel that --map does not name"
    )
    option("--map", action="append", metavar="CHANNEL=BUS", help="bus of a channel of the log; repeatable")
    option("--speed", default="1", metavar="X", help="0.1 to 100 times as fast (1)")
    option(
        "--as-fast-as-possible",
        action="store_true",
        dest="fast",
        help="without waiting; on vcan, virtual or --log",
    )
    option(
        "--start", metavar="TIME", help="s from the log's first frame, or a time: ISO (UTC) or s since 1970"
    )
    option("--stop", metavar="TIME", help="likewise; the first frame that is not sent")
    option(
        "--loop", type=_loops, default=1, dest="loops", metavar="N", help="play it N times, 0 for ever (1)"
    )
    option("--max-gap", type=_positive, dest="max_gap_s", metavar="S", help="cut longer gaps to S seconds")
    option("--smooth", action="store_true", help="spread frames stamped in batches by their cycle times")
    option("--rate", type=_hertz, dest="rate_hz", metavar="HZ", help="frames per s, for a log without times")
    what = "0x123, 0x100-0x1FF, channel:NAME, with --dbc a message or sender; repeatable, or with commas"
    option("--include", action="append", metavar="WHAT", help=f"play only {what}")
    option("--exclude", action="append", metavar="WHAT", help="leave out, said in the same way")
    option("--rename", action="append", metavar="OLD=NEW", help="send an id as another, 0x123=0x456")
    option("--dbc", action="append", type=Path, metavar="FILE", help="names and cycle times; repeatable")
    option("--profile", action="append", metavar="NAME", help="those of a profile's database; repeatable")
    option(
        "--repair",
        action="append",
        metavar="PROFILE[=DBC]",
        help="fresh counters, checksums, image indices and times on this profile's frames; repeatable",
    )
    option("--keep-wrong", action="store_true", help="frames that are wrong in the log stay so in --repair")
    option(
        "--from", dest="source", metavar="PROFILE[=DBC]", help="of the log's lane frames, which --as replaces"
    )
    option("--as", dest="target", metavar="PROFILE[=DBC]", help="send their lanes as this profile's frames")
    option(
        "--camera-x", type=float, dest="camera_x_m", metavar="M", help="camera ahead of the rear axle (1.9)"
    )
    option("--wheelbase", type=_positive, dest="wheelbase_m", metavar="M", help="for --as (2.8)")
    option("--wait-for", metavar="ID", help="begin when a frame 0x123 is heard on the bus")
    option("--start-at", metavar="TIME", help="begin at a wall clock time, ISO (UTC) or s since 1970")
    option("--skip-unsendable", action="store_true", help="leave out and count what its bus cannot carry")
    option("--overlay", metavar="SCENARIO", help="lay this scenario's lane sensor over the log, in its place")
    option("--take-over", metavar="TIME", help="from then on an ECU on the bus steers (with --overlay)")
    option("--log", type=Path, metavar="FILE", help="write what was sent: .log .asc .blf .mf4")
    option("--realtime", action="store_true", help="real-time priority and locked memory, where allowed")
    option("--quiet", action="store_true", help="no keys")


def _add_scan(commands: "Commands") -> None:
    added = _command(commands, "scan", scan, SCAN_HELP)
    option = added.add_argument
    option("logs", nargs="+", type=Path, metavar="LOGS", help="CAN logs, or folders of them")
    option("--out", required=True, type=Path, metavar="TABLE", help="folder of the table")
    option(
        "--profile",
        action="append",
        metavar="NAME",
        help="shipped name or file; repeatable (native, vehicle)",
    )
    option("--dbc", type=Path, metavar="FILE", help="the database of the profile that names none")
    option(
        "--reference",
        nargs="+",
        default=["gta"],
        metavar="KIND",
        help="gta (default), map FILE.xodr, or a line FILE.csv, .parquet (a folder: LOG_ID.csv each)",
    )
    option(
        "--route", metavar="ROADS", help="roads of the map that the drive follows: 12,7,3 (straight ahead)"
    )
    option(
        "--ranges", type=_ranges, default=(1.0, 2.0, 100.0), metavar="A:STEP:B", help="in metres (1:2:100)"
    )
    option(
        "--sides", choices=("own", "all"), default="own", help="the own lane's lines, or the next ones too"
    )
    option(
        "--beyond-range", action="store_true", help="errors beyond the reported range too (they stay masked)"
    )
    option("--limits", type=Path, metavar="FILE", help="thresholds that differ from the defaults: .toml")
    option("--plots", nargs="?", const="png", choices=("png", "pdf", "svg"), help="a page for each log (png)")
    option("--scheduler", metavar="ADDRESS", help="Dask scheduler; its workers must see the same files")
    option("--workers", type=_count, metavar="N", help="local processes (all cores)")
    option("--quiet", action="store_true", help="no progress bar")


def _add_table(commands: "Commands") -> None:
    added = _command(commands, "table", table, TABLE_HELP)
    added.add_argument(
        "tables", nargs="+", type=Path, metavar="TABLE", help="folders that vsensor scan wrote"
    )


def _add_density(commands: "Commands") -> None:
    added = _command(commands, "density", density, DENSITY_HELP)
    _tables(added)
    option = added.add_argument
    option("--out", required=True, type=Path, metavar="DIR", help="folder of arrays, tables and pictures")
    option("--seconds", type=_positive, default=3600.0, metavar="S", help="driving that a speed needs (3600)")
    option("--candidates", nargs="+", type=Path, metavar="TABLE", help="tables of drives that might fill it")
    option("--no-pictures", action="store_true", help="arrays and tables only")
    option("--quiet", action="store_true", help="no progress bar")


def _add_influence(commands: "Commands") -> None:
    added = _command(commands, "influence", influence, INFLUENCE_HELP)
    _tables(added)
    added.add_argument("--as-published", action="store_true", help="P1's principal components too")
    added.add_argument("--seed", type=_seed, metavar="N", help="of the draws of the intervals (0)")
    added.add_argument("--quiet", action="store_true", help="no progress bar")


def _add_validate(commands: "Commands") -> None:
    added = _command(commands, "validate", validate, VALIDATE_HELP)
    added.add_argument("model", type=Path, metavar="MODEL", help="the error model: .npz")
    _tables(added)
    option = added.add_argument
    option("--out", type=Path, metavar="FILE", help="a page of figures and pictures: .html or .pdf")
    option("--limits", type=Path, metavar="FILE", help="limits that differ from the defaults: .toml")
    option(
        "--seen-from", type=_metres, default=0.0, metavar="M", help="where the sensor's points begin (0 m)"
    )
    option("--seed", type=_seed, metavar="N", help="of the virtual drives (0)")
    option("--quiet", action="store_true", help="no progress bar")


def _add_tune(commands: "Commands") -> None:
    added = _command(commands, "tune", tune, TUNE_HELP)
    option = added.add_argument
    _tables(added)
    option("--out", required=True, type=Path, metavar="MODEL", help="the error model: .npz")
    option("--levels", type=_levels, metavar="P,P", help="of the surfaces (0.5,0.8,0.9,0.95,0.97,0.99)")
    option(
        "--by",
        metavar="COLUMN,...",
        help="a model for each: night, rain, or a column with edges: rain:0.2:0.6",
    )
    option("--speed-step", type=_positive, default=0.5, metavar="MPS", help="grid along speed (0.5 m/s)")
    option(
        "--order",
        type=_even,
        default=10,
        metavar="N",
        help="of the low-pass along speed, in steps; 0: none (10)",
    )
    option("--cutoff", type=_positive, default=0.2, metavar="S/M", help="of the low-pass (0.2 s/m)")
    option(
        "--region-level", type=_share, default=0.95, metavar="P", help="quantile of the reported range (0.95)"
    )
    option(
        "--block",
        type=_positive,
        default=60.0,
        metavar="S",
        help="blocks that the intervals come from (60 s)",
    )
    option(
        "--least-seconds",
        type=_positive,
        default=60.0,
        metavar="S",
        help="of driving, or a cell is blind (60)",
    )
    option("--open-loop", action="store_true", help="do not correct for the fit")
    option(
        "--seen-from", type=_metres, default=0.0, metavar="M", help="where the sensor's points begin (0 m)"
    )
    option("--plots", type=Path, metavar="DIR", help="pages of pictures")
    option("--seed", type=_seed, metavar="N", help="of the draws that close the loop (0)")
    option("--scheduler", metavar="ADDRESS", help="Dask scheduler; its workers must see the same table")
    option("--quiet", action="store_true", help="no progress bar")


def _tables(added: argparse.ArgumentParser) -> None:
    added.add_argument(
        "tables",
        nargs="+",
        type=Path,
        metavar="TABLE",
        help="folders that vsensor scan wrote, or files of them",
    )


def _levels(text: str) -> tuple[float, ...]:
    try:
        return tuple(float(word) for word in text.split(","))
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text}: expected levels such as 0.5,0.9,0.95") from None


def _share(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value < 1.0:
        raise argparse.ArgumentTypeError(f"{text}: expected a share between 0 and 1")
    return value


def _even(text: str) -> int:
    value = int(text) if text.isdecimal() else -1
    if not 0 <= value <= 200 or value % 2:
        raise argparse.ArgumentTypeError(f"{text}: expected an even number from 0 to 200")
    return value


def _metres(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 <= value <= 1000.0:
        raise argparse.ArgumentTypeError(f"{text}: expected metres, 0 to 1000")
    return value


def _ranges(text: str) -> tuple[float, float, float]:
    try:
        first, step, last = (float(part) for part in text.split(":"))
    except ValueError:
        first, step, last = math.nan, math.nan, math.nan
    if not (0.0 <= first <= last <= 300.0 and step >= 0.01 and (last - first) / step < 10_000):
        raise argparse.ArgumentTypeError(f"{text}: expected FIRST:STEP:LAST in metres, such as 1:2:100")
    return first, step, last


def _add_profile(commands: "Commands") -> None:
    added = commands.add_parser(
        "profile",
        help=PROFILE_HELP.split("\n", 1)[0],
        description=PROFILE_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    new = _command(added.add_subparsers(required=True, metavar="new"), "new", profile_new, PROFILE_NEW_HELP)
    new.add_argument("file", type=Path, metavar="FILE", help="database: .dbc .arxml .kcd .sym")
    new.add_argument("--out", type=Path, metavar="FILE", help="write it there: .toml (standard output)")
    new.add_argument("--node", metavar="NAME", help="only messages that this node of the database sends")
    new.add_argument(
        "--role",
        choices=("sensor", "vehicle"),
        help="send lanes, or listen to motion (what FILE seems to be of)",
    )
    new.add_argument("--force", action="store_true", help="write over a file that is there")


def _add_gateway(commands: "Commands") -> None:
    added = _command(commands, "gateway", gateway, GATEWAY_HELP)
    option = added.add_argument
    bus = "INTERFACE:CHANNEL, or a SocketCAN interface such as can0"
    option("--in", dest="near", required=True, metavar="BUS", help=f"where car or bench are: {bus}")
    option("--out", dest="far", required=True, metavar="BUS", help=f"where the ECU is: {bus}")
    option("--overlay", required=True, metavar="SCENARIO", help="whose sensor replaces the camera")
    option("--both-ways", action="store_true", help="pass what the ECU's side sends back to --in, too")
    option("--duration", type=_positive, metavar="S", help="end after S seconds; without it Ctrl-C does")
    option("--realtime", action="store_true", help="real-time priority and locked memory, where allowed")


def _loops(text: str) -> int:
    value = int(text) if text.isdecimal() else -1
    if not 0 <= value <= 1_000_000:
        raise argparse.ArgumentTypeError(f"{text}: expected how often, 0 to 1000000; 0 is for ever")
    return value


def _positive(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 0.0 < value <= 31_536_000.0:
        raise argparse.ArgumentTypeError(f"{text} s: expected a time above 0, at most a year")
    return value


def _hertz(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not 1e-3 <= value <= 1e9:
        raise argparse.ArgumentTypeError(f"{text}: expected a rate per second, above 0")
    return value


def _bitrate(text: str) -> float:
    sizes = {"k": 1e3, "M": 1e6}
    size = sizes.get(text[-1:], 1.0)
    try:
        value = float(text.rstrip("kM")) * size
    except ValueError:
        value = math.nan
    if not 1e3 <= value <= 20e6:
        raise argparse.ArgumentTypeError(f"{text}: expected bits per second such as 500k, 2M, 125000")
    return value


def _ticks(text: str) -> int:
    value = int(text) if text.isdecimal() else 0
    if not 0 < value < 2**31:
        raise argparse.ArgumentTypeError(f"{text}: expected a number of ticks, at least 1")
    return value


def _seed(text: str) -> int:
    value = int(text) if text.isdecimal() else -1
    if not 0 <= value < 2**63:
        raise argparse.ArgumentTypeError(f"{text}: expected an integer from 0 to 2^63 - 1")
    return value


def _count(text: str) -> int:
    value = int(text) if text.isdecimal() else 0
    if not 0 < value <= 100_000:
        raise argparse.ArgumentTypeError(f"{text}: expected an integer from 1 to 100000")
    return value


if __name__ == "__main__":
    sys.exit(main())

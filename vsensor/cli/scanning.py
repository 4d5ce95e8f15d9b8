"""`vsensor scan`, `table`: recorded drives into tables of errors."""

import argparse
from collections.abc import Sequence
from pathlib import Path

from vsensor.cli.adding import Commands, command, dbc_option, note, shows_progress
from vsensor.cli.values import count, ranges
from vsensor.errors import ConfigError

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


def scan(arguments: argparse.Namespace) -> int:
    """`vsensor scan`: recorded drives into a table of errors."""
    from vsensor.field.scan import ScanOptions
    from vsensor.field.scan_many import scan_logs
    from vsensor.field.summary import log_lines, mask_lines

    options = ScanOptions(
        profiles=tuple(arguments.profile or ScanOptions().profiles),
        dbc=None if arguments.dbc is None else str(arguments.dbc),
        reference=reference_of(arguments.reference),
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
        progress=shows_progress(arguments),
    )
    if report.infos:
        print("\n".join([*log_lines(report.infos), "", *mask_lines(report.infos)]))
    for info in report.infos:
        for text in info["notes"]:
            note(f"{info['log']}: {text}")
    if report.reused:
        note(f"{report.reused} of {len(report.infos)} logs were scanned before")
    for failure in report.failures:
        note(f"not scanned: {failure}")
    if report.interrupted:
        note("stopped; the same command goes on with the rest")
        return 130
    return int(bool(report.failures))


def reference_of(words: Sequence[str]) -> str:
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


def reading_options(added: argparse.ArgumentParser, references: str) -> None:
    """Add how a recorded drive is read: profiles, reference, route, thresholds."""
    option = added.add_argument
    option(
        "--profile",
        action="append",
        metavar="NAME",
        help="shipped name or file, or NAME=DATABASE; repeatable (native, vehicle)",
    )
    dbc_option(added, "the database of the profile that names none")
    option("--reference", nargs="+", default=["gta"], metavar="KIND", help=references)
    option(
        "--route", metavar="ROADS", help="roads of the map that the drive follows: 12,7,3 (straight ahead)"
    )
    option("--limits", type=Path, metavar="FILE", help="thresholds that differ from the defaults: .toml")


def add_scan(commands: Commands) -> None:
    """Add `vsensor scan`."""
    added = command(commands, "scan", scan, SCAN_HELP)
    option = added.add_argument
    option("logs", nargs="+", type=Path, metavar="LOGS", help="CAN logs, or folders of them")
    option("--out", required=True, type=Path, metavar="TABLE", help="folder of the table")
    reading_options(
        added, "gta (default), map FILE.xodr, or a line FILE.csv, .parquet (a folder: LOG_ID.csv each)"
    )
    option("--ranges", type=ranges, default=(1.0, 2.0, 100.0), metavar="A:STEP:B", help="in metres (1:2:100)")
    option(
        "--sides", choices=("own", "all"), default="own", help="the own lane's lines, or the next ones too"
    )
    option(
        "--beyond-range", action="store_true", help="errors beyond the reported range too (they stay masked)"
    )
    option("--plots", nargs="?", const="png", choices=("png", "pdf", "svg"), help="a page for each log (png)")
    option("--scheduler", metavar="ADDRESS", help="Dask scheduler; its workers must see the same files")
    option("--workers", type=count, metavar="N", help="local processes (all cores)")
    option("--quiet", action="store_true", help="no progress bar")


def add_table(commands: Commands) -> None:
    """Add `vsensor table`."""
    added = command(commands, "table", table, TABLE_HELP)
    added.add_argument(
        "tables", nargs="+", type=Path, metavar="TABLE", help="folders that vsensor scan wrote"
    )

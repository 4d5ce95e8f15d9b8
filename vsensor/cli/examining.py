"""`vsensor density`, `influence`: what tables of errors have, and what the error depends on."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, rows_bar, tables_argument
from vsensor.cli.values import positive, seed

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


def density(arguments: argparse.Namespace) -> int:
    """`vsensor density`: where the errors of tables lie."""
    from vsensor.field.density import density_of
    from vsensor.field.density_report import text_lines, write_density
    from vsensor.field.table import open_table
    from vsensor.field.thin import filling_drives, thin_cells
    from vsensor.pages import require_folder, require_pictures

    if arguments.no_pictures:
        require_folder(arguments.out)
    else:
        require_pictures(arguments.out, "pictures (--no-pictures: arrays and tables only)")
    table = open_table(arguments.tables)
    candidates = table if arguments.candidates is None else open_table(arguments.candidates)
    with rows_bar(table, 2, arguments) as advance:
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
    with rows_bar(table, 1, arguments) as advance:
        found = influence_of(table, seed=arguments.seed or 0, progress=advance)
    if arguments.as_published:
        print("\n".join([*published_lines(found), ""]))
    print("\n".join(influence_lines(found)))
    return 0


def add_density(commands: Commands) -> None:
    """Add `vsensor density`."""
    added = command(commands, "density", density, DENSITY_HELP)
    tables_argument(added)
    option = added.add_argument
    option("--out", required=True, type=Path, metavar="DIR", help="folder of arrays, tables and pictures")
    option("--seconds", type=positive, default=3600.0, metavar="S", help="driving that a speed needs (3600)")
    option("--candidates", nargs="+", type=Path, metavar="TABLE", help="tables of drives that might fill it")
    option("--no-pictures", action="store_true", help="arrays and tables only")
    option("--quiet", action="store_true", help="no progress bar")


def add_influence(commands: Commands) -> None:
    """Add `vsensor influence`."""
    added = command(commands, "influence", influence, INFLUENCE_HELP)
    tables_argument(added)
    added.add_argument("--as-published", action="store_true", help="P1's principal components too")
    added.add_argument("--seed", type=seed, metavar="N", help="of the draws of the intervals (0)")
    added.add_argument("--quiet", action="store_true", help="no progress bar")

"""`vsensor profile new`: profiles begun."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, note

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


def profile_new(arguments: argparse.Namespace) -> int:
    """`vsensor profile new`: a skeleton of a profile."""
    from vsensor.profile_new import new_profile, write_profile

    skeleton = new_profile(arguments.file, arguments.out, arguments.node, arguments.role)
    if arguments.out is None:
        print(skeleton.text, end="")
    else:
        write_profile(skeleton, arguments.out, force=arguments.force)
    for line in skeleton.summary():
        note(line)
    return 0


def add_profile(commands: Commands) -> None:
    """Add `vsensor profile`."""
    added = commands.add_parser(
        "profile",
        help=PROFILE_HELP.split("\n", 1)[0],
        description=PROFILE_HELP,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    new = command(added.add_subparsers(required=True, metavar="new"), "new", profile_new, PROFILE_NEW_HELP)
    new.add_argument("file", type=Path, metavar="FILE", help="database: .dbc .arxml .kcd .sym")
    new.add_argument("--out", type=Path, metavar="FILE", help="write it there: .toml (standard output)")
    new.add_argument("--node", metavar="NAME", help="only messages that this node of the database sends")
    new.add_argument(
        "--role",
        choices=("sensor", "vehicle"),
        help="send lanes, or listen to motion (what FILE seems to be of)",
    )
    new.add_argument("--force", action="store_true", help="write over a file that is there")

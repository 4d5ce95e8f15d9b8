"""What commands share: how one is added, what is said beside its results, and tables as arguments."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

if TYPE_CHECKING:
    Commands: TypeAlias = argparse._SubParsersAction[Any]  # it has no public name
else:
    Commands = Any


def command(
    commands: Commands,
    name: str,
    function: Callable[[argparse.Namespace], int],
    text: str,
) -> argparse.ArgumentParser:
    """Add a command of one name, which `function` runs; the first line of `text` stands in the list."""
    added: argparse.ArgumentParser = commands.add_parser(
        name,
        help=text.split("\n", 1)[0].replace("%", "%%"),
        description=text,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    added.set_defaults(command=function)
    return added


class Once(argparse.Action):
    """An option that is given once: of two, the first would be lost without a word."""

    def __call__(
        self, parser: argparse.ArgumentParser, namespace: argparse.Namespace, values: Any, option: Any = None
    ) -> None:
        """Keep the value; a second one is an error of use."""
        if getattr(namespace, self.dest) is not None:
            parser.error(f"{option} {values}: there is one already, {getattr(namespace, self.dest)}")
        setattr(namespace, self.dest, values)


def dbc_option(added: argparse.ArgumentParser, text: str) -> None:
    """Add the one database that a command takes."""
    added.add_argument("--dbc", type=Path, action=Once, metavar="FILE", help=text)


def note(text: str) -> None:
    """Say something beside the results."""
    print(f"vsensor: {text}", file=sys.stderr)


def shows_progress(arguments: argparse.Namespace) -> bool:
    """Return whether somebody looks who did not ask for --quiet."""
    return sys.stderr.isatty() and not arguments.quiet


def tables_argument(added: argparse.ArgumentParser) -> None:
    """Add the tables that a command reads."""
    added.add_argument(
        "tables",
        nargs="+",
        type=Path,
        metavar="TABLE",
        help="folders that vsensor scan wrote, or files of them",
    )


def rows_bar(table: Any, passes: int, arguments: argparse.Namespace) -> Any:
    """Return a bar of the rows read in so many passes over a table."""
    from vsensor.field.tune.spread import rows_bar as bar

    return bar(table, passes, shown=shows_progress(arguments))

"""The command line: `vsensor COMMAND`. `program` is the whole of it, each other module a family of commands.

A command is a help text, a thin function and what adds its words: a new one goes into `program.COMMANDS`.
"""

from vsensor.cli.program import main

__all__ = ["main"]

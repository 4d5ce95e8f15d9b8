"""`#?` in a profile marks what its maker guessed and nobody has confirmed yet."""

from pathlib import Path

from vsensor.profile_new import MARK, is_marked


def open_marks(path: Path) -> list[str]:
    """Return a line for each marked place of a profile file that is still open; `#?` in quotes marks none."""
    lines = path.read_text(encoding="utf-8").splitlines()
    return [
        f"{path.name} line {number}: open, see `{MARK}`: {_shown(line)}"
        for number, line in enumerate(lines, start=1)
        if is_marked(line)
    ]


def _shown(line: str) -> str:
    said, _, why = line.partition(MARK)
    return " ".join(f"{said.strip()} - {why.strip()}".split()).strip(" -")

"""`#?` on a line of a profile: it is a guess that nobody has confirmed yet."""

MARK = "#?"
_TALKED_OF = f"`{MARK}`"


def is_marked(line: str) -> bool:
    """Return whether a line is open; one that talks of the mark, in backticks, is not."""
    return MARK in line.replace(_TALKED_OF, "")


def unmarked(text: str) -> str:
    """Return text of a database fit for a comment: one line, printable, without the mark."""
    shown = "".join(c if c.isprintable() else " " for c in text)
    return " ".join(shown.split()).replace(MARK, "# ?")

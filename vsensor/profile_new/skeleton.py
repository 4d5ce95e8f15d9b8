"""What `vsensor profile new` gives: the text, what to say of it, and the file."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from vsensor.errors import ConfigError
from vsensor.profile_new.draft import Draft
from vsensor.profile_new.marks import MARK, is_marked


@dataclass(frozen=True, slots=True, kw_only=True)
class Skeleton:
    """A profile that loads; `mapped` signals carry something, `open_marks` places want an answer."""

    text: str
    role: str
    messages: int
    mapped: int
    open_marks: int
    out: Path | None

    def summary(self) -> list[str]:
        """Return what was guessed, and what to do next."""
        name = "profile" if self.out is None else str(self.out)
        of = "lanes" if self.role == "sensor" else "motion of the vehicle, to listen to"
        said = f"{name}: {of}; {self.messages} messages, {self.mapped} signals mapped"
        lines = [f"{said}, {self.open_marks} places open ({MARK})"]
        return lines if self.out is None else [*lines, f"next: vsensor check {self.out}"]


def skeleton_of(text: str, drafts: Sequence[Draft], role: str, out: Path | None) -> Skeleton:
    """Count what stands in a text."""
    return Skeleton(
        text=text,
        role=role,
        messages=len(drafts),
        mapped=sum(entry.said is not None for draft in drafts for entry in draft.entries),
        open_marks=sum(map(is_marked, text.splitlines())),
        out=out,
    )


def write_profile(skeleton: Skeleton, out: Path, *, force: bool = False) -> None:
    """Write it. Raises ConfigError for a file that is there, unless `force`, or cannot be written."""
    if out.suffix != ".toml":
        raise ConfigError(f"{out}: a profile ends in .toml")
    try:
        with out.open("w" if force else "x", encoding="utf-8") as file:
            file.write(skeleton.text)
    except FileExistsError:
        raise ConfigError(f"{out}: is there already; --force writes over it") from None
    except OSError as error:
        raise ConfigError(f"{out}: cannot be written: {error.strerror or error}") from None

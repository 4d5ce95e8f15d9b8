"""Does a model fit logs that it was not learned from? `validate_model` is `vsensor validate`."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from pathlib import Path

from vsensor.error_model import load_library
from vsensor.errors import TableError
from vsensor.field.table import Table
from vsensor.field.tune.reading import Progress
from vsensor.field.validate.held_out import look
from vsensor.field.validate.judge import judge
from vsensor.field.validate.page import require_page, write_json, write_page
from vsensor.field.validate.verdict import Judged, load_limits, summary
from vsensor.field.virtual import FitSetting


@dataclass(frozen=True, slots=True, kw_only=True)
class Validation:
    """The verdicts on a library's models, and the text about them."""

    judged: tuple[Judged, ...]
    lines: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Whether every model is within the limits."""
        return all(one.good for one in self.judged)


def validate_model(
    model: Path,
    table: Table,
    *,
    out: Path | None = None,
    limits: Path | None = None,
    setting: FitSetting | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> Validation:
    """Judge a model file by a table, and write the page `out`. Raises VsensorError subclasses."""
    allowed = load_limits(limits)
    library = load_library(model)
    if out is not None:
        require_page(out)
    held = look(library, table, setting or FitSetting(), seed=seed, progress=progress)
    if not held.rows:
        raise TableError("no row of the table has an error that is used: nothing to validate with")
    judged = judge(held, allowed)
    hours = held.images_ns / 3.6e12
    title = f"{model.name} on {held.logs} held-out logs, {hours:.2f} h, {held.rows} rows"
    if out is not None:
        write_page(out, title, library.source, judged)
    return Validation(judged=tuple(judged), lines=(title, *_unseen(library.models, judged), *summary(judged)))


def _unseen(names: Collection[str], judged: Sequence[Judged]) -> list[str]:
    missing = sorted(set(names) - {one.name for one in judged})
    return [f"no rows of the table are for: {', '.join(missing)}"] if missing else []


__all__ = ["Validation", "validate_model", "write_json"]

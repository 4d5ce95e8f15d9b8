"""What a model may be off, and the verdict on it: for people, and for programs."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec

from vsensor.error_model import ErrorModel
from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.types import Array

SCHEMA, REPORT_SCHEMA = "vsensor.validate/1", "vsensor.validate_report/1"
Part = Annotated[float, msgspec.Meta(gt=0.0, le=1.0)]


class ValidateLimits(Config, frozen=True, kw_only=True):
    """How far a model may be off. A finding fails where it is surely beyond: chance taken off.

    `coverage`: share of errors within a surface less its level. `pit`: largest distance (Kolmogorov) of the
    recorded errors' places in the law from even ones. `wasserstein`: distance of recorded from virtual
    errors over the mean size, in a band of range and speed. `correlation_time`, `lost_time`: relative.
    `outside`: share of rows that the model does not know.
    """

    coverage: Part = 0.01
    pit: Part = 0.03
    wasserstein: Part = 0.10
    correlation_time: Part = 0.15
    lost_time: Part = 0.30
    outside: Part = 0.10


def load_limits(path: Path | None) -> ValidateLimits:
    """Read a limits file (schema vsensor.validate/1); None: the defaults. Raises ConfigError."""
    if path is None:
        return ValidateLimits()
    return convert(check_schema(read_toml(path), SCHEMA, str(path)), ValidateLimits, str(path))


@dataclass(frozen=True, slots=True, kw_only=True)
class Check:
    """One figure: `off` is how far it is off, `chance` what of it chance explains; fails beyond `limit`."""

    what: str
    shown: str
    off: float
    chance: float
    limit: float

    @property
    def good(self) -> bool:
        """Whether the figure is within the limit, or not surely beyond it."""
        return not self.off - self.chance > self.limit


@dataclass(frozen=True, slots=True, kw_only=True)
class Band:
    """A band of range and speed: recorded errors against virtual ones, and virtual ones among each other."""

    range_m: tuple[float, float]
    speed_mps: tuple[float, float]
    rows: int
    mean_m: float
    distance_m: float
    chance_m: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Judged:
    """One model's verdict, and curves for the page.

    `coverage` and `half` (L,), `pit` (S + 1,) densities, `rho` (2, lags) recorded and virtual, `lost_s` and
    `seen_s` (2, Q) likewise.
    """

    name: str
    model: ErrorModel
    rows: int
    effective: float
    checks: tuple[Check, ...]
    bands: tuple[Band, ...]
    coverage: Array
    half: Array
    pit: Array
    lags_s: Array
    rho: Array
    lost_s: Array
    seen_s: Array

    @property
    def good(self) -> bool:
        """Whether all figures are within their limits."""
        return all(check.good for check in self.checks)


def summary(judged: Sequence[Judged]) -> list[str]:
    """Return the verdict for people."""
    lines = []
    for one in judged:
        word = "within limits" if one.good else "beyond limits"
        lines.append(f"model {one.name!r}: {word}; {one.rows} rows, {one.effective:.0f} effective")
        for check in one.checks:
            mark = " " if check.good else "!"
            lines.append(f" {mark} {check.what}: {check.shown}; limit {check.limit:g}")
    return lines


def as_json(judged: Sequence[Judged]) -> dict[str, Any]:
    """Return the verdict for programs."""
    models = [
        {
            "model": one.name,
            "good": one.good,
            "rows": one.rows,
            "effective_rows": one.effective,
            "checks": [
                {
                    "what": check.what,
                    "shown": check.shown,
                    "off": check.off,
                    "chance": check.chance,
                    "limit": check.limit,
                    "good": check.good,
                }
                for check in one.checks
            ],
        }
        for one in judged
    ]
    return {"schema": REPORT_SCHEMA, "good": all(one.good for one in judged), "models": models}

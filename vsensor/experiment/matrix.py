"""MATRIX.toml: which scenarios run with which seeds and settings, what is kept of each, what is judged."""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from vsensor.config import Scenario
from vsensor.errors import ConfigError
from vsensor.schema import Config, check_schema, convert, read_toml, user_path
from vsensor.study.vary import MOST_CELLS, Settings, grid, scenario_with

SCHEMA = "vsensor.experiment/1"
SHIPPED = Path(__file__).parent / "shipped"

Kept = Literal["trace", "truth", "log", "images"]
KEPT: tuple[Kept, ...] = ("trace", "truth", "log", "images")
"""What a run may leave in a folder of its own."""

_Seed = Annotated[int, msgspec.Meta(ge=0, le=2**63 - 1)]


class VariantConfig(Config, frozen=True, kw_only=True):
    """`[[variant]]`: settings that go together, under a name.

    Those of one `axis` (a column of the table) stand for each other; axes are combined.
    """

    name: Annotated[str, msgspec.Meta(min_length=1)]
    axis: Annotated[str, msgspec.Meta(min_length=1)] = "variant"
    settings: dict[str, Any] = msgspec.field(default_factory=dict)


class LimitConfig(Config, frozen=True, kw_only=True):
    """`[[limit]]`: a column of the table that is to stay between two values in every run.

    `scenarios` names those that it is for, all if there is none; `source` where the value comes from, and
    `checked` whether it was compared with the text there. A run in which the column has no value is beyond
    the limit.
    """

    column: str
    at_least: float | None = None
    at_most: float | None = None
    scenarios: tuple[str, ...] = ()
    source: str = ""
    checked: bool = True


class LoopConfig(Config, frozen=True, kw_only=True):
    """`[loop]`: who answers on the bus where a vehicle is steered from it and --bus names none."""

    ecu: str = "reference"


class MatrixConfig(Config, frozen=True, kw_only=True):
    """An experiment: scenarios x variants x settings x seeds.

    `seeds`: a list, or how many from each scenario's own on. `[settings]` holds for each key the list of
    its values, every combination of which is run; a value that is no list is the same for all.
    """

    scenarios: Annotated[tuple[str, ...], msgspec.Meta(min_length=1)]
    name: str = ""
    about: str = ""
    seeds: Annotated[int, msgspec.Meta(ge=1, le=100_000)] | tuple[_Seed, ...] = 1
    duration_s: Annotated[float, msgspec.Meta(gt=0, le=31_536_000)] | None = None
    outputs: tuple[Kept, ...] = ()
    image_every: Annotated[int, msgspec.Meta(ge=1)] = 25
    truth_every: Annotated[int, msgspec.Meta(ge=1)] = 1
    settings: dict[str, Any] = msgspec.field(default_factory=dict)
    variant: tuple[VariantConfig, ...] = ()
    limit: tuple[LimitConfig, ...] = ()
    loop: LoopConfig | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Matrix:
    """A matrix file, loaded; names of scenarios start from `folder`."""

    config: MatrixConfig
    path: Path
    varied: dict[str, list[Any]]

    @property
    def name(self) -> str:
        """The matrix's name, its file's stem if it has none."""
        return self.config.name or self.path.stem

    @property
    def columns(self) -> tuple[str, ...]:
        """What tells the runs apart in the tables, besides scenario and seed."""
        return (*self.axes, *self.varied)

    @property
    def axes(self) -> dict[str, list[VariantConfig]]:
        """The variants by their axis."""
        found: dict[str, list[VariantConfig]] = {}
        for variant in self.config.variant:
            found.setdefault(variant.axis, []).append(variant)
        return found


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One scenario with its settings: `told` are the columns of the table that say which."""

    entry: str
    told: Settings
    scenario: Scenario


def load_matrix(name_or_path: str) -> Matrix:
    """Load a matrix file, or a shipped one by name; raises ConfigError naming file and key."""
    path = _find(name_or_path)
    data = check_schema(read_toml(path), SCHEMA, str(path))
    config = convert(data, MatrixConfig, str(path))
    matrix = Matrix(config=config, path=path, varied=_varied(config, path))
    _check(matrix)
    return matrix


def shipped_matrices() -> list[str]:
    """Return the names of the experiments that come with the package."""
    return sorted(path.stem for path in SHIPPED.glob("*.toml"))


def points_of(matrix: Matrix, duration_s: float | None = None) -> Iterator[Point]:
    """Yield every scenario with every variant and combination of settings, in the order of the file.

    `duration_s` stands in place of the matrix's. Raises ConfigError for settings that are no scenario,
    VsensorErrors for what cannot be loaded.
    """
    config = matrix.config
    seconds = config.duration_s if duration_s is None else duration_s
    fixed = {} if seconds is None else {"duration_s": seconds}
    choices = itertools.product(
        config.scenarios, itertools.product(*matrix.axes.values()), grid(matrix.varied)
    )
    for entry, variants, chosen in choices:
        told = {**{variant.axis: variant.name for variant in variants}, **chosen}
        together = {key: value for variant in variants for key, value in _flat(variant.settings).items()}
        settings = {**fixed, **_fixed(config), **together, **chosen}
        name = _entry(matrix, entry)
        yield Point(entry=entry, told=told, scenario=_scenario(matrix, name, settings))


def _scenario(matrix: Matrix, name: str, settings: Settings) -> Scenario:
    """Load a scenario with settings; a mistake names the matrix, too."""
    try:
        return scenario_with(name, settings, "settings")
    except ConfigError as error:
        raise ConfigError(f"{matrix.path}: {error}") from None


def seeds_of(matrix: Matrix, scenario: Scenario) -> tuple[int, ...]:
    """Return the seeds that a scenario runs with."""
    seeds, first = matrix.config.seeds, scenario.config.seed
    return tuple(range(first, first + seeds)) if isinstance(seeds, int) else seeds


def _find(name_or_path: str) -> Path:
    path = user_path(name_or_path)
    if path.suffix or path.exists():
        return path
    shipped = SHIPPED / f"{name_or_path}.toml"
    if not shipped.exists():
        known = ", ".join(shipped_matrices())
        raise ConfigError(f"{name_or_path}: neither a file nor a shipped experiment ({known})")
    return shipped


def _entry(matrix: Matrix, entry: str) -> str:
    """Return a scenario's file, seen from the matrix's folder; a shipped name stays as it is."""
    beside = matrix.path.parent / user_path(entry)
    return str(beside) if beside.suffix or beside.is_file() else entry


def _check(matrix: Matrix) -> None:
    """Refuse what cannot be meant."""
    config, where = matrix.config, matrix.path
    _require_single(matrix)
    if config.seeds == ():
        raise ConfigError(f"{where}: seeds = []: at least one was expected")
    for key in (*matrix.varied, *_fixed(config), *(k for v in config.variant for k in _flat(v.settings))):
        if key in ("seed", "duration_s", "name"):
            instead = {"seed": "seeds", "duration_s": "duration_s outside of [settings]"}.get(key, "variants")
            raise ConfigError(f"{where}: settings.{key}: use {instead}")
    for axis in matrix.axes:
        if axis in ("scenario", "seed", "run", "side", *matrix.varied):
            raise ConfigError(f"{where}: variant.axis = {axis!r}: a column of the tables has this name")
    for number, limit in enumerate(config.limit):
        if limit.at_least is None and limit.at_most is None:
            raise ConfigError(f"{where}: limit[{number}]: at_least or at_most was expected")
        for name in limit.scenarios:
            if name not in config.scenarios:
                raise ConfigError(f"{where}: limit[{number}].scenarios: {name} is none of the scenarios")
    seeds = config.seeds if isinstance(config.seeds, int) else len(config.seeds)
    count = seeds * len(config.scenarios)
    for choices in (*matrix.varied.values(), *matrix.axes.values()):
        count *= len(choices)
    if count > MOST_CELLS:
        raise ConfigError(f"{where}: {count} runs; at most {MOST_CELLS}")


def _require_single(matrix: Matrix) -> None:
    """Refuse what is there twice."""
    config = matrix.config
    lists: dict[str, tuple[Any, ...]] = {
        "scenarios": config.scenarios,
        "seeds": () if isinstance(config.seeds, int) else config.seeds,
        "outputs": config.outputs,
        "variant": tuple(f"{variant.axis} {variant.name}" for variant in config.variant),
    }
    for key, values in lists.items():
        if (twice := next((v for k, v in enumerate(values) if v in values[:k]), None)) is not None:
            raise ConfigError(f"{matrix.path}: {key}: {twice} is there twice")


def _varied(config: MatrixConfig, path: Path) -> dict[str, list[Any]]:
    """Return {dotted key: its values} of the settings with a list."""
    varied = {key: value for key, value in _flat(config.settings).items() if isinstance(value, list)}
    for key, values in varied.items():
        if not values:
            raise ConfigError(f"{path}: settings.{key}: an empty list; values were expected")
        shown = [msgspec.json.encode(value) for value in values]
        if len(set(shown)) < len(shown):
            raise ConfigError(f"{path}: settings.{key}: a value is there twice")
    return varied


def _fixed(config: MatrixConfig) -> Settings:
    return {key: value for key, value in _flat(config.settings).items() if not isinstance(value, list)}


def _flat(settings: Mapping[str, Any], prefix: str = "") -> Settings:
    """Return tables within tables as dotted keys."""
    found: Settings = {}
    for key, value in settings.items():
        name = f"{prefix}{key}"
        if isinstance(value, Mapping):
            found |= _flat(value, f"{name}.")
        else:
            found[name] = value
    return found

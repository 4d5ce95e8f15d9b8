"""`vsensor road`: a road file checked, described, written as a map, drawn."""

from pathlib import Path

from vsensor.errors import ConfigError
from vsensor.schema import user_path
from vsensor.world.opendrive import parse_map
from vsensor.world.road.load import load_plan, text_of
from vsensor.world.road.text import text_lines

SHIPPED = Path(__file__).parents[2] / "scenarios"


def build_road(name_or_path: str, out: Path | None = None, plot: Path | None = None) -> list[str]:
    """Return the summary's lines; write the map to `out` and the picture to `plot`. Raises ConfigError."""
    if out is not None and out.suffix.lower() != ".xodr":
        raise ConfigError(f"{out}: a map ends in .xodr")
    path = road_path(name_or_path)
    plan = load_plan(path)
    text = text_of(plan)
    road_map = parse_map(text, path)
    if out is not None:
        try:
            out.write_bytes(text)
        except OSError as error:
            raise ConfigError(f"{out}: cannot be written: {error.strerror or error}") from None
    if plot is not None:
        from vsensor.world.road.plot import plot_map

        plot_map(road_map, plot)
    return [*text_lines(plan), *road_map.warnings]


def road_path(name_or_path: str) -> Path:
    """Return the file of a road by its path, or by the name of a shipped one."""
    path = user_path(name_or_path)
    shipped = SHIPPED / f"{name_or_path}.toml"
    return shipped if not path.suffix and not path.exists() and shipped.is_file() else path

"""Road files from disk, and what becomes of them: the text of an OpenDRIVE map."""

from pathlib import Path

from vsensor.errors import ConfigError
from vsensor.schema import check_schema, convert, read_toml
from vsensor.world.opendrive.load import parse_map
from vsensor.world.opendrive.road import RoadMap
from vsensor.world.road.config import SCHEMA, RoadFile
from vsensor.world.road.plan import Plan, plan_of
from vsensor.world.road.write import document


def is_road_file(path: Path) -> bool:
    """Return whether a file is a TOML of the road schema, of whatever version."""
    if path.suffix.lower() != ".toml" or not path.is_file():
        return False
    return str(read_toml(path).get("schema", "")).startswith(SCHEMA.split("/")[0] + "/")


def load_road(path: Path) -> RoadFile:
    """Read a road file; raises ConfigError naming file and key."""
    data = check_schema(read_toml(path), SCHEMA, str(path))
    file = convert(data, RoadFile, str(path))
    return file if file.name else RoadFile(road=file.road, name=path.stem)


def load_plan(path: Path) -> Plan:
    """Read and plan a road file; raises ConfigError naming file and key."""
    file = load_road(path)
    try:
        return plan_of(file)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from None


def opendrive_text(file: RoadFile) -> bytes:
    """Return a road file's OpenDRIVE 1.7 text; raises ConfigError naming the key."""
    return text_of(plan_of(file))


def build_map(file: RoadFile) -> RoadMap:
    """Return the map of a road file made in Python; raises ConfigError naming the key."""
    return parse_map(opendrive_text(file), Path(f"{file.name or 'road'}.xodr"))


def opendrive_of(path: Path) -> bytes:
    """Return the OpenDRIVE 1.7 text of a road file on disk; raises ConfigError naming file and key."""
    return text_of(load_plan(path))


def text_of(plan: Plan) -> bytes:
    """Return the text of a plan."""
    return document(plan.name, plan.roads, plan.junctions)

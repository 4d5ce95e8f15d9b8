"""The files that a storyboard is made of: its catalogs, and its map, looked for where scenarios have it."""

from pathlib import Path

from vsensor.errors import StoryError
from vsensor.world.openscenario import Story

ROAD_FOLDERS = ("xodr", "maps", "opendrive")


def find_road(scenario: Path, name: str) -> tuple[Path, tuple[str, ...]]:
    """Return the map that a scenario names, and a note where it is not where it says.

    It is looked for as written from the scenario's folder, then by its name beside the scenario and in
    folders named xodr, maps or opendrive beside or above it. Raises StoryError.
    """
    folder = scenario.parent
    written = folder / name.replace("\\", "/")
    try:
        if written.is_file():
            return written, ()
    except (OSError, ValueError):
        pass
    file = Path(name.replace("\\", "/")).name
    for place in (folder, *(base / kind for base in (folder, folder.parent) for kind in ROAD_FOLDERS)):
        if file and (place / file).is_file():
            return place / file, (f"map {name} is not there: {place / file} is taken",)
    raise StoryError(f"{scenario}: <LogicFile>: no such map {name}, nor {file} in folders beside it")


def files_of(story: Story) -> tuple[Path, ...]:
    """Return what a drive depends on besides the scenario's own file: map and catalogs. Raises StoryError."""
    road, _ = find_road(Path(story.path), story.road_file)
    return road, *story.catalogs

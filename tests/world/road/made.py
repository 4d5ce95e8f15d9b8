"""Road files for tests: short ones as text, loaded by the map's own reader."""

from vsensor.world.opendrive import load_map

HEAD = 'schema = "vsensor.road/1"\n[[road]]\n'
STRAIGHT = HEAD + 'line = [{ kind = "straight", length_m = 300 }]\n'


def written(folder, text, name="road.toml"):
    """Write a road file and return its path."""
    path = folder / name
    path.write_text(text, encoding="utf-8")
    return path


def built(folder, text):
    """Return the map of a road file."""
    return load_map(written(folder, text))


def line_of(*pieces, more=""):
    """Return a road file of these pieces of line, each the inside of an inline table."""
    return HEAD + "line = [" + ", ".join(f"{{ {piece} }}" for piece in pieces) + "]\n" + more

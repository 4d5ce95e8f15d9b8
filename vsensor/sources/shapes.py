"""Boxes by their size, meshes by their file: each file is read once, its vehicles share the mesh."""

from pathlib import Path

from vsensor.errors import ConfigError, MissingExtraError
from vsensor.raycast import mesh_of
from vsensor.schema import user_path
from vsensor.types import Mesh

Size = tuple[float, float, float]

SUFFIXES = (".obj", ".stl", ".glb")
LARGEST_VEHICLE_M = 60.0
LARGEST_MESH_M = 5000.0


class Shapes:
    """The shapes that a scenario names; paths are meant from `folder`."""

    def __init__(self, folder: Path = Path()) -> None:
        self._folder = folder
        self._known: dict[Path, tuple[Mesh, Size]] = {}

    def of(
        self, mesh: str | None, size_m: Size | None, where: str, largest_m: float = LARGEST_VEHICLE_M
    ) -> tuple[Mesh | None, Size]:
        """Return mesh and bounding box of a shape given by the one or the other.

        Raises ConfigError naming `where`, MissingExtraError without trimesh.
        """
        if (mesh is None) == (size_m is None):
            raise ConfigError(f"{where}: either mesh or size_m was expected")
        if mesh is not None:
            path = self._folder / user_path(mesh)
            if path not in self._known:
                self._known[path] = load_mesh(path, f"{where}.mesh")
            return self._known[path]
        assert size_m is not None
        if min(size_m) <= 0.0 or max(size_m) > largest_m:
            raise ConfigError(
                f"{where}.size_m = {list(size_m)}: length, width, height up to {largest_m:g} m were expected"
            )
        return None, size_m


def load_mesh(path: Path, where: str = "mesh") -> tuple[Mesh, Size]:
    """Read an OBJ, STL or GLB file (metres, x ahead, z up), moved so that its box's centre is the origin.

    Returns it with its size. Raises ConfigError naming `where` and the file, MissingExtraError without
    trimesh.
    """
    if path.suffix.lower() not in SUFFIXES:
        raise ConfigError(f"{where} = {str(path)!r}: a file {' '.join(SUFFIXES)} was expected")
    if not path.is_file():
        raise ConfigError(f"{where} = {str(path)!r}: no such file")
    try:
        import trimesh
    except ImportError:
        raise MissingExtraError("trimesh", "mesh", "a mesh file") from None
    try:
        loaded = trimesh.load_mesh(path, process=False)
        vertices, faces = loaded.vertices, loaded.faces
    except Exception as error:  # each reader of trimesh has errors of its own
        raise ConfigError(
            f"{where} = {str(path)!r}: cannot be read: {error or type(error).__name__}"
        ) from None
    mesh = mesh_of(vertices, faces, f"{where} = {str(path)!r}")
    if not len(mesh.faces):
        raise ConfigError(f"{where} = {str(path)!r}: holds no triangles")
    used = mesh.vertices_m[mesh.faces.ravel()]
    low, high = used.min(axis=0), used.max(axis=0)
    length, width, height = (high - low).tolist()
    if max(length, width, height) > LARGEST_MESH_M:
        raise ConfigError(
            f"{where} = {str(path)!r}: {length:.0f} x {width:.0f} x {height:.0f} m: metres were expected"
        )
    return mesh_of(mesh.vertices_m - 0.5 * (low + high), mesh.faces), (length, width, height)

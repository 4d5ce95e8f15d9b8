"""Who is hidden from the camera: by boxes and meshes, moving or standing, and by the road itself."""

from vsensor.raycast.boxes import Boxes, boxes_in
from vsensor.raycast.meshes import mesh_of
from vsensor.raycast.obstacles import hidden_by_obstacles, hiding_obstacle
from vsensor.raycast.shadow import FAR_LIMIT
from vsensor.raycast.solids import Method, hidden
from vsensor.raycast.surface import hidden_by_surface

__all__ = [
    "FAR_LIMIT",
    "Boxes",
    "Method",
    "boxes_in",
    "hidden",
    "hidden_by_obstacles",
    "hidden_by_surface",
    "hiding_obstacle",
    "mesh_of",
]

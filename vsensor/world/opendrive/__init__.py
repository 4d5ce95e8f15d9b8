"""OpenDRIVE 1.4 to 1.8: a map file into roads that are evaluated where they are asked."""

from vsensor.world.opendrive.load import load_map, parse_map
from vsensor.world.opendrive.network import Place, auto_start, following
from vsensor.world.opendrive.road import Road, RoadMap

__all__ = ["Place", "Road", "RoadMap", "auto_start", "following", "load_map", "parse_map"]

"""The roads of a huge map: packed as their XML, read again where somebody comes near, the last ones kept."""

import zlib
from collections import OrderedDict
from collections.abc import Callable, Iterator, Mapping

from lxml import etree

from vsensor.world.opendrive.road import Road
from vsensor.world.opendrive.xml import Element

ROADS_KEPT = 512


class PackedRoads(Mapping[str, Road]):
    """Roads by id in the order of the file. One takes some 1 kB packed, some 100 kB while it is kept."""

    def __init__(self, read: Callable[[Element], Road]) -> None:
        """`read` makes a road of its element, which was found to be right before."""
        self._read = read
        self._packed: dict[str, bytes] = {}
        self._kept: OrderedDict[str, Road] = OrderedDict()

    def add(self, road_id: str, element: Element) -> None:
        """Take a road."""
        self._packed[road_id] = zlib.compress(etree.tostring(element, with_tail=False), 1)

    def __getitem__(self, road_id: str) -> Road:
        road = self._kept.get(road_id)
        if road is not None:
            self._kept.move_to_end(road_id)
            return road
        road = self._kept[road_id] = self._read(etree.fromstring(zlib.decompress(self._packed[road_id])))
        if len(self._kept) > ROADS_KEPT:
            self._kept.popitem(last=False)
        return road

    def __contains__(self, road_id: object) -> bool:
        return road_id in self._packed

    def __iter__(self) -> Iterator[str]:
        return iter(self._packed)

    def __len__(self) -> int:
        return len(self._packed)

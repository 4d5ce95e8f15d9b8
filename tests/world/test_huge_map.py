"""Maps of any size: the tree is read part by part, the roads of a huge one are packed until one is near."""

import tracemalloc

import numpy as np
import pytest

from tests.maps import REAL_MAPS, document, road
from tests.shared import needs_shared
from vsensor.errors import MapError
from vsensor.world.corridor import Corridor
from vsensor.world.opendrive import load, load_map, packed


@pytest.fixture
def everything_is_huge(monkeypatch):
    monkeypatch.setattr(load, "HUGE_BYTES", 0)
    monkeypatch.setattr(packed, "ROADS_KEPT", 2)


def same(a, b):
    np.testing.assert_array_equal(a.points_world_m, b.points_world_m)
    np.testing.assert_array_equal(a.painted, b.painted)
    assert (a.id, a.group) == (b.id, b.group)


@needs_shared
@pytest.mark.parametrize("name", ["fabriksgatan", "soderleden", "e6mini", "multi_lanesections"])
def test_a_drive_over_packed_roads_is_that_over_plain_ones(name, request):
    path = next(path for path in REAL_MAPS if path.stem == name)
    plain = Corridor(load_map(path))
    request.getfixturevalue("everything_is_huge")
    again = Corridor(load_map(path))
    assert isinstance(again.road_map.roads, packed.PackedRoads)
    assert again.start == plain.start
    assert again.road_map.warnings == plain.road_map.warnings
    for s in (0.0, 150.0, 420.0):
        for a, b in zip(plain.markings_window(s, s + 90), again.markings_window(s, s + 90), strict=True):
            same(a, b)


def many(count):
    """Return the text of a row of roads, one after the other."""
    before = '<predecessor elementType="road" elementId="{}" contactPoint="end"/>'
    after = '<successor elementType="road" elementId="{}" contactPoint="start"/>'
    roads = [
        road(
            number=k,
            link=(before.format(k - 1) if k else "") + (after.format(k + 1) if k < count - 1 else ""),
        )
        for k in range(count)
    ]
    moved = [each.replace('x="0"', f'x="{100 * k}"') for k, each in enumerate(roads)]
    return document(*moved)


def test_of_a_huge_map_only_what_was_near_is_unpacked(tmp_path, everything_is_huge):
    path = tmp_path / "long.xodr"
    path.write_text(many(40))
    road_map = load_map(path)
    assert not road_map.roads._kept
    assert road_map.road(7).id == "7"
    assert [road_map.road(k).length_m for k in (8, 9, 7)] == [100.0] * 3
    assert list(road_map.roads._kept) == ["9", "7"]


def test_memory_of_a_huge_map_is_a_small_part_of_a_plain_ones(tmp_path, everything_is_huge, monkeypatch):
    path = tmp_path / "long.xodr"
    path.write_text(many(300))

    def bytes_of_map():
        tracemalloc.start()
        kept = load_map(path)
        size = tracemalloc.get_traced_memory()[0]
        tracemalloc.stop()
        return size if kept else 0

    small = bytes_of_map()
    monkeypatch.setattr(load, "HUGE_BYTES", 10**9)
    assert bytes_of_map() > 5 * small


def test_parts_may_come_in_any_order(tmp_path):
    text = document(road())
    header = text[text.index("<header") : text.index("/>") + 2]
    path = tmp_path / "map.xodr"
    path.write_text(text.replace(header, "").replace("</OpenDRIVE>", f"{header}</OpenDRIVE>"))
    found = load_map(path)
    assert list(found.roads) == ["1"]
    assert not any("header" in text for text in found.warnings)


def test_what_is_wrong_behind_the_roads_is_found(tmp_path):
    path = tmp_path / "map.xodr"
    path.write_text(document(road()).replace("</OpenDRIVE>", "<junction id='1'></OpenDRIVE>"))
    with pytest.raises(MapError, match="not well-formed"):
        load_map(path)

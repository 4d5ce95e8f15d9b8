"""Lane borders of the shared maps where another reader of OpenDRIVE puts them: opendrive2lanelet 1.2.1.

`opendrive2lanelet.json` was written by `tools/record_opendrive2lanelet.py`, which says how. Both agree to
rounding but on paramPoly3: there the other reader takes p in proportion to s. The standard calls s the
distance along the reference line, so p follows from the curve's length; the curve is the same, places on it
differ by up to 10 mm along it. `p3_track` is what `vsensor road p3_track --out p3_track.xodr` writes.
"""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import quad

from tests.maps import REAL_MAPS, real
from tests.shared import needs_shared
from vsensor.cli import main
from vsensor.world.opendrive import load_map
from vsensor.world.opendrive.planview import ParamPoly3

THEIRS = json.loads((Path(__file__).parent / "opendrive2lanelet.json").read_text(encoding="utf-8"))
OURS = THEIRS.pop("p3_track")
ROUNDING_M = 1e-8


def border(road, section, lane_id, s, at_s=None):
    """Return x, y of a border in the plane, its t at s laid beside the line at `at_s`, and the heading."""
    t, _ = road.sections[section].borders(np.array([s]), (lane_id,))
    x, y, heading, _ = road.plan.at(np.array([s if at_s is None else at_s]))
    return np.array([x - t[lane_id] * np.sin(heading), y + t[lane_id] * np.cos(heading)])[:, 0], heading[0]


def in_proportion(record, s):
    """Return the s at which our curve is where p in proportion to s puts it."""
    curve, ds = record.curve, s - record.s_m
    p = ds / curve.length_m * curve.p_max
    exact = {"epsabs": 1e-11, "epsrel": 1e-12}
    arc = quad(lambda p: float(curve._speed(np.array([p]))[0]), 0.0, p, **exact)[0]
    return record.s_m + arc * (curve.length_m / curve.arc_length_m if curve.stretch else 1.0)


def record_at(road, s):
    return road.plan.records[int(np.searchsorted(road.plan.starts_m, s, side="right")) - 1]


@needs_shared
def test_every_shared_map_was_read_by_the_other_reader():
    assert set(THEIRS) == {path.stem for path in REAL_MAPS}


@needs_shared
@pytest.mark.parametrize("name", THEIRS)
def test_borders_lie_where_another_reader_puts_them(name):
    road_map = real(name)
    for road_id, section, lane_id, s, *theirs in THEIRS[name]:
        road = road_map.road(road_id)
        ours, heading = border(road, section, lane_id, s)
        apart = np.array(theirs) - ours
        along = np.array([np.cos(heading), np.sin(heading)])
        is_parametric = isinstance(record_at(road, s).curve, ParamPoly3)
        if is_parametric:
            apart = apart - (apart @ along) * along  # of places along the curve they have another opinion
        assert np.hypot(*apart) < (1e-5 if is_parametric else ROUNDING_M)


def test_the_other_reader_reads_our_track_and_puts_its_lanes_where_we_do(tmp_path):
    assert main(["road", "p3_track", "--out", str(tmp_path / "p3_track.xodr")]) == 0
    road_map = load_map(tmp_path / "p3_track.xodr")
    assert len(OURS) == 25
    for road_id, section, lane_id, s, *theirs in OURS:
        ours, _ = border(road_map.road(road_id), section, lane_id, s)
        np.testing.assert_allclose(ours, theirs, atol=ROUNDING_M)


@needs_shared
@pytest.mark.parametrize("name", ["e6mini", "e6mini-lht", "fabriksgatan", "jolengatan", "soderleden"])
def test_with_p_in_proportion_to_s_our_curves_are_theirs(name):
    road_map, compared = real(name), 0
    for road_id, section, lane_id, s, *theirs in THEIRS[name]:
        road = road_map.road(road_id)
        record = record_at(road, s)
        if isinstance(record.curve, ParamPoly3):
            ours, _ = border(road, section, lane_id, s, in_proportion(record, s))
            np.testing.assert_allclose(ours, theirs, atol=ROUNDING_M)
            compared += 1
    assert compared

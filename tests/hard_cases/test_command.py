"""A hard drive from the command line, where warnings are errors too: nothing but words on the terminal."""

import subprocess
import sys

import numpy as np

from tests.maps import document, geometry, road
from vsensor.logs import read_log
from vsensor.profile import load_profile

SCENARIO = """schema = "vsensor.scenario/1"
source = "ring.xodr"
duration_s = 20
[ego]
road = "1"
lane = -1
speed_kmh = 25
[[traffic]]
kind = "truck"
ahead_m = 20
[[traffic]]
kind = "van"
ahead_m = [[0, 30], [10, 0.0], [20, -5]]
[motion]
body = true
vibration = "rough"
[fit]
order = 9
[camera]
inverse = "ground_plane"
"""


def test_a_roundabout_of_15_m_with_a_van_that_drives_through_the_camera_runs_without_a_warning(tmp_path):
    plan = geometry(f'<arc curvature="{1 / 15!r}"/>', 400.0)
    rises = '<elevation s="0" a="0" b="0.03" c="0" d="0"/>'  # 2.8 m a round: it does not lie on itself
    (tmp_path / "ring.xodr").write_text(document(road(plan=plan, length=400.0, elevation=rises)))
    (tmp_path / "ring.toml").write_text(SCENARIO)
    words = [
        sys.executable,
        "-W",
        "error",
        "-m",
        "vsensor",
        "run",
        "ring.toml",
        "--fast",
        "--log",
        "ring.blf",
    ]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, timeout=120, check=False)
    said = done.stdout + done.stderr
    assert done.returncode == 0, said
    assert "Warning" not in said
    assert "Traceback" not in said
    table, profile = read_log(tmp_path / "ring.blf"), load_profile("native")
    columns = profile.decode_arrays(table.arbitration_id, table.data, table.length, check=True)
    available = columns["right.available"].values
    assert len(available) == 500
    assert 0.0 < np.mean(available) < 1.0  # the truck hides, the van blinds
    for name in ("right.offset_m", "right.heading", "right.curvature_per_m", "right.curvature_rate_per_m2"):
        np.testing.assert_array_equal(np.isfinite(columns[name].values), available == 1.0)

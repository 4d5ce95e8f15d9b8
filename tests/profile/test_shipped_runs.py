"""What `vsensor run --log` writes through each shipped profile, `vsensor decode` reads back."""

import numpy as np
import pytest

from tests.shared import SHARED_DATA, needs_shared
from vsensor.cli import main
from vsensor.config import load_scenario
from vsensor.logs.decode import decode_log
from vsensor.profile import load_profile
from vsensor.sinks.trace import read_trace
from vsensor.types import SIDE_NAMES

SECONDS = 3
CYCLE_NS = 40_000_000
MAKERS = {
    "honda": "honda_bosch_lane_lines_extract",
    "hyundai": "hyundai_canfd_fr_cmr_03_extract",
    "tesla": "tesla_das_lanes_extract",
}


class Run:
    """A run of the shipped highway through a profile: the trace, and the decoded log at the same images."""

    def __init__(self, folder, name):
        dbc = SHARED_DATA / "dbc" / f"{MAKERS[name]}.dbc" if name in MAKERS else None
        log, trace = folder / "out.log", folder / "out.npz"
        words = ["run", "--fast", "--duration", SECONDS, "--profile", name, "--log", log, "--trace", trace]
        assert main([str(word) for word in (*words, *(["--dbc", dbc] if dbc else []))]) == 0
        self.table = decode_log(log, [load_profile(name, dbc)])
        since_ns = self.table.t_ns - self.table.t_ns[0] + 1000  # a log keeps microseconds
        self.index = since_ns // CYCLE_NS  # of the image that a row shows: the last before it
        self.camera_x_m = load_scenario("highway").config.camera.position_m[0]
        trace = read_trace(trace)
        ticks, sides = np.asarray(trace["tick"]), np.asarray(trace["side"])
        self._rows = {word: (ticks[sides == side], sides == side) for side, word in SIDE_NAMES.items()}
        self._trace = trace

    def told(self, quantity):
        return self.table.columns[quantity]

    def sent(self, side, column):
        """The trace's column at each decoded row."""
        ticks, mask = self._rows[side]
        values = np.asarray(self._trace[column], dtype=float)[mask]
        return values[np.searchsorted(ticks, self.index)]

    def line(self, side, x_m=0.0):
        """c0..c3 of the trace with x = 0 at `x_m` (Taylor), (4, N)."""
        c0, c1, c2, c3 = (np.nan_to_num(self.sent(side, f"c{k}"), nan=np.nan) for k in range(4))
        return np.array(
            [
                c0 + c1 * x_m + c2 * x_m**2 + c3 * x_m**3,
                c1 + 2 * c2 * x_m + 3 * c3 * x_m**2,
                c2 + 3 * c3 * x_m,
                c3,
            ]
        )


@pytest.fixture(scope="module")
def run_of(tmp_path_factory):
    runs = {}

    def run(name):
        if name not in runs:
            runs[name] = Run(tmp_path_factory.mktemp(name), name)
        return runs[name]

    return run


def assert_same(told, sent, step):
    """As many values as were sent, each within half a step and the float's rounding."""
    assert np.isfinite(sent).sum() > len(sent) / 2
    np.testing.assert_array_equal(np.isnan(told), np.isnan(sent))
    np.testing.assert_allclose(told, sent, rtol=0, atol=step * 0.5001, equal_nan=True)


@pytest.mark.parametrize("name", ["native", "native_fd"])
def test_native_lines_come_back_on_classic_can_and_on_can_fd(run_of, name):
    run = run_of(name)
    assert run.told("image.index").tolist() == list(range(25 * SECONDS))
    for side in ("left", "right"):
        c0, c1, c2, c3 = run.line(side)
        assert_same(run.told(f"{side}.offset_m"), c0, 0.001)
        assert_same(run.told(f"{side}.heading"), c1, 2e-5)
        assert_same(run.told(f"{side}.curvature_per_m"), 2 * c2, 4e-7)
        assert_same(run.told(f"{side}.curvature_rate_per_m2"), 6 * c3, 1e-8)
        assert_same(run.told(f"{side}.x_max_m"), run.sent(side, "x_max_m"), 0.25)


def test_classic_can_and_can_fd_tell_the_same(run_of):
    classic, fd = run_of("native").table, run_of("native_fd").table
    assert set(classic.columns) == set(fd.columns)
    for name, values in classic.columns.items():
        np.testing.assert_array_equal(values, fd.columns[name], err_msg=name)


@needs_shared
def test_honda_lines_come_back_as_seen_from_the_camera(run_of):
    run = run_of("honda")
    assert len(run.table) == 25 * SECONDS
    for side in ("left", "right"):
        c0, c1, c2, _ = run.line(side, run.camera_x_m)
        assert_same(run.told(f"{side}.offset_m"), c0, 0.004)
        assert_same(run.told(f"{side}.heading"), np.arctan(c1), 0.0005)
        assert_same(run.told(f"{side}.curvature_per_m"), 2 * c2, 1e-5)
        assert set(run.told(f"{side}.quality")) == set(run.sent(side, "quality"))
    assert run.told("image.index").tolist() == [k % 16 for k in range(25 * SECONDS)]


@needs_shared
def test_hyundai_lines_come_back_as_seen_from_the_camera(run_of):
    run = run_of("hyundai")
    assert len(run.table) == 20 * SECONDS
    for side in ("left", "right"):
        c0, c1, c2, c3 = run.line(side, run.camera_x_m)
        seen = np.isfinite(c0)
        assert_same(run.told(f"{side}.offset_m"), c0, 0.0039625)
        for name, sent, step in (
            ("heading", np.arctan(c1), 0.000976563),
            ("curvature_per_m", 2 * c2, 2e-6),  # the error value's neighbour is a whole step away
            ("curvature_rate_per_m2", 6 * c3, 4e-9),
        ):
            told = run.told(f"{side}.{name}")
            assert_same(told[seen], sent[seen], step)
            assert set(told[~seen]) <= {0.0}


@needs_shared
def test_tesla_tells_the_middle_of_the_lane_as_seen_from_the_camera(run_of):
    run = run_of("tesla")
    assert len(run.table) == 10 * SECONDS
    middle = (run.line("left", run.camera_x_m) + run.line("right", run.camera_x_m)) / 2
    both = np.isfinite(middle[0])
    assert both.sum() > len(both) / 2
    for name, sent, step in zip(
        ("offset_m", "heading", "c2_per_m", "c3_per_m2"), middle, (0.035, 0.0016, 2e-5, 2.4e-7), strict=True
    ):
        assert_same(run.told(f"centre.{name}")[both], sent[both], step)
    assert set(run.told("left.quality")[both]) <= {4.0, 1.0}


def test_p2_tells_offsets_to_the_inner_edge_at_the_front_axle_and_motion(run_of):
    run = run_of("p2")
    assert len(run.table) == 10 * SECONDS
    for side, sign in (("left", 1), ("right", -1)):
        told = run.told(f"{side}.lane_offset_m")
        assert_same(told, run.sent(side, "lane_offset_m"), 0.002)
        assert np.sign(np.nanmean(told)) == sign
    width = run.sent("left", "lane_offset_m") - run.sent("right", "lane_offset_m")
    assert np.nanmax(np.abs(run.told("lane.width_m") - width)) < 0.02
    np.testing.assert_allclose(run.told("ego.speed_mps"), run.sent("left", "speed_mps"), atol=0.0051 / 3.6)
    assert set(run.told("sensor.light")) == {0.0}
    assert set(run.told("left.quality")) <= {0.0, 1.0, 2.0, 3.0, 4.0}

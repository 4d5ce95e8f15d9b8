"""Lines that no polynomial likes, through the whole chain: an answer that holds, or quality 0 and why.

`chain.drive` checks every frame of every image: CRC, finite numbers where a line is available, none where
it is not, and that the truth then has a reason.
"""

from math import pi

import numpy as np
import pytest

from tests.hard_cases import chain
from tests.hard_cases.far_out import EXACT
from tests.maps import geometry, lane, loaded, road, section
from tests.roads import ego, marking, snapshot, straight
from vsensor.lanefit import LaneFitConfig
from vsensor.region import RegionConfig
from vsensor.scene import SceneConfig
from vsensor.sources.map_drive import EgoConfig, MapDrive
from vsensor.types import MarkingKind, Side, Unseen
from vsensor.world.corridor import Corridor

RADIUS_M = 15.0
MODELS = pytest.mark.parametrize("sections", [EXACT, {}], ids=["exact", "all models on"])


def circle(radius, start, number):
    """Return a ring about (0, 15), anticlockwise from an angle, so that its ends lie anywhere on it."""
    angle = start + np.linspace(0.0, 2 * pi, round(20 * pi * radius))
    points = np.column_stack([radius * np.cos(angle), RADIUS_M + radius * np.sin(angle)])
    return marking(points, number)


def ring(start=0.3):
    """Return both borders of a ring lane of 4 m around (0, 15)."""
    return [circle(RADIUS_M - 2.0, start, 0), circle(RADIUS_M + 2.0, start + 2.0, 1)]


# ---- roundabouts and folds -------------------------------------------------------------------------


@MODELS
@pytest.mark.parametrize("start", np.arange(4.6, 8.7, 0.5))  # the ring's ends lie out of view
def test_in_a_roundabout_what_is_reported_runs_along_the_ring_and_is_called_poor(start, sections):
    output, _ = chain.shown(
        snapshot(ring(start), (), ego(speed_mps=8.0, yaw_rate_radps=8 / 15)), 3, **sections
    )
    assert chain.reasons(output)[Side.LEFT] in (Unseen.OUTSIDE_IMAGE, Unseen.BEHIND_CAMERA)
    assert chain.reported(output) == {Side.RIGHT}
    for line in output.estimate.boundaries:
        radius = RADIUS_M + 2.0
        x = np.linspace(line.x_min_m, min(line.x_max_m, radius), 30)
        y = np.polynomial.polynomial.polyval(x, line.coefficients)
        assert np.abs(np.hypot(x, y - RADIUS_M) - radius).max() < 0.5  # across the line; misfit 0.15 m rms
        assert line.quality == 1


@MODELS
@pytest.mark.parametrize("bearing", np.arange(0.0, 2 * pi, 0.5))
def test_a_roundabout_may_be_approached_from_anywhere(bearing, sections):
    away = 35.0
    place = (away * np.cos(bearing), RADIUS_M + away * np.sin(bearing), 0.0)
    for turn in (0.0, 0.3, -0.5, pi / 2, pi):
        vehicle = ego(place, yaw_rad=bearing + pi + turn, speed_mps=8.0)
        chain.shown(snapshot(ring(), (), vehicle), 3, **sections)


@MODELS
def test_a_whole_drive_round_a_map_of_15_m_radius_is_sound(tmp_path, sections):
    around = 2 * pi * RADIUS_M
    plan = geometry(f'<arc curvature="{1 / RADIUS_M!r}"/>', around)
    link = '<predecessor elementType="road" elementId="1" contactPoint="end"/>'
    link += '<successor elementType="road" elementId="1" contactPoint="start"/>'
    lanes = section(right=[lane(-1, links='<predecessor id="-1"/><successor id="-1"/>')])
    ring_map = loaded(tmp_path, road(plan=plan, sections=lanes, length=around, link=link))
    config = EgoConfig(road="1", lane=-1, speed_kmh=25.0)
    source = MapDrive(Corridor(ring_map, config.corridor()), config)
    line = chain.line_of(lambda tick: source.advance(None, tick, ())[1], **sections)
    outputs = [output for output, _ in chain.drive(line, 400)]
    assert len(outputs) == 400
    radius = RADIUS_M + 3.5  # the right border of lane -1, whose middle the vehicle drives on
    found = [output.estimate.on(Side.RIGHT) for output in outputs]
    assert sum(report is not None for report in found) > 300
    for report in (report for report in found if report is not None):
        x = np.linspace(report.x_min_m, report.x_max_m, 9)
        y = np.polynomial.polynomial.polyval(x, report.coefficients)
        assert np.abs(np.hypot(x, y - (RADIUS_M + 1.75)) - radius).max() < 0.5


@MODELS
@pytest.mark.parametrize("gap_m", [3.0, 0.3, 1e-3, 0.0])
def test_a_line_that_folds_back_ends_where_it_turns(gap_m, sections):
    there = np.arange(-10.0, 45.0, 0.1)
    points = np.concatenate(
        [np.column_stack([there, 0 * there]), np.column_stack([there[::-1], 0 * there + gap_m])]
    )
    output, _ = chain.shown(snapshot([marking(points + np.array([0.0, 1.8]))], (), ego()), 3, **sections)
    found = output.estimate.on(Side.LEFT)
    assert found.x_max_m == pytest.approx(44.9, abs=0.5)  # 0.5: the errors of the models move points along x
    assert found.coefficients[0] == pytest.approx(1.8, abs=0.3)


@MODELS
@pytest.mark.parametrize("lean_m", [0.0, 1e-9, 1e-3, 0.1, -0.1, 3.0])
def test_a_line_straight_across_is_no_line_and_takes_none_from_the_others(lean_m, sections):
    y = np.linspace(-10.0, 10.0, 400)
    across = marking(np.column_stack([25.0 + lean_m * y / 10.0, y]), 2)
    alone, _ = chain.shown(snapshot([across]), 3, **sections)
    assert chain.reported(alone) == set()
    beside, _ = chain.shown(snapshot([straight(1.8, 0), straight(-1.7, 1), across]), 3, **sections)
    assert chain.reported(beside) >= chain.OWN
    assert all(found.marking != 2 for found in beside.estimate.boundaries)


def test_points_at_one_x_on_either_side_of_the_vehicle_are_no_line():
    x = np.full(300, 20.0)
    stacks = [
        marking(np.column_stack([x, np.full(300, y), 0.0 * x]), number)
        for number, y in enumerate((1.8, -1.7))
    ]
    output, _ = chain.shown(snapshot(stacks), **EXACT)
    assert chain.reasons(output) == {side: Unseen.TOO_FEW_POINTS for side in chain.OWN}


# ---- few points, short and long lines ----------------------------------------------------------------


@MODELS
@pytest.mark.parametrize("order", range(1, 10))
@pytest.mark.parametrize("more", [-2, -1, 0, 1])
def test_lines_of_about_as_many_points_as_the_order_are_answered_or_too_few(order, more, sections):
    count = max(order + more, 0)
    few = [
        marking(np.column_stack([np.linspace(15.0, 30.0, count), np.full(count, y)]), number)
        for number, y in enumerate((1.8, -1.7))
    ]
    config = LaneFitConfig(order=order, min_points=2)
    output, _ = chain.shown(snapshot(few), 3, fit=config, **sections)
    found = chain.reported(output)
    assert found == (chain.OWN if count >= 2 else set())
    for line in output.estimate.boundaries:
        assert len(line.coefficients) <= min(order + 1, count)
        assert line.quality == 1
    if count == 1:
        assert set(chain.reasons(output).values()) == {Unseen.TOO_FEW_POINTS}


@MODELS
@pytest.mark.parametrize("order", range(1, 10))
@pytest.mark.parametrize(("start", "stop"), [(7.0, 12.0), (55.0, 60.0), (5.0, 200.0)])
def test_every_order_is_reported_as_a_cubic_over_5_m_and_over_200_m(order, start, stop, sections):
    lines = [straight(y, number, start=start, stop=stop) for number, y in enumerate((1.8, -1.7))]
    output, _ = chain.shown(
        snapshot(lines, (), ego(speed_mps=40.0)),
        3,
        fit=LaneFitConfig(order=order),
        region=RegionConfig(enabled=False),
        scene=SceneConfig(range_m=210.0),
        **sections,
    )
    assert chain.reported(output) == chain.OWN
    for side, y in ((Side.LEFT, 1.8), (Side.RIGHT, -1.7)):
        line = output.estimate.on(side)
        middle = (line.x_min_m + line.x_max_m) / 2
        # what the models may move a line of 5 m by, and nothing where there are none
        assert np.polynomial.polynomial.polyval(middle, line.coefficients) == pytest.approx(
            y, abs=1e-9 if sections else 3.0
        )


@MODELS
@pytest.mark.parametrize("off_m", [0.5, 5.0, 1e3, 1e9])
@pytest.mark.parametrize("place", [0, 300, 600, 999])
def test_one_outlier_gives_the_line_without_it_or_a_poorer_one_or_none(place, off_m, sections):
    x = 7.0 + 0.09 * np.arange(1000)
    y = np.full(1000, 1.8)
    y[place] += off_m
    output, _ = chain.shown(snapshot([marking(np.column_stack([x, y])), straight(-1.7, 1)]), 3, **sections)
    assert Side.RIGHT in chain.reported(output)
    left = output.estimate.on(Side.LEFT)
    if left is not None:
        at = np.linspace(left.x_min_m, left.x_max_m, 9)
        wrong = np.abs(np.polynomial.polynomial.polyval(at, left.coefficients) - 1.8).max()
        assert wrong < 1.0 or left.quality == 1


# ---- dashes ------------------------------------------------------------------------------------------


def dashed(y, number, dash_m, gap_m, phase_m):
    x = np.arange(-200, 1200) / 10.0
    painted = np.mod(x - phase_m, dash_m + gap_m) < dash_m
    return marking(np.column_stack([x, np.full(len(x), y)]), number, painted=painted, kind=MarkingKind.DASHED)


@MODELS
def test_where_only_gaps_are_in_view_the_line_is_not_reported_and_the_reason_is_the_paint_beside(sections):
    lines = [dashed(1.8, 0, 3.0, 60.0, 2.0), straight(-1.7, 1)]  # paint up to x = 5 and from 65
    output, values = chain.shown(snapshot(lines, (), ego(speed_mps=8.0)), 3, **sections)
    assert values["left.quality"] == 0.0
    assert chain.reasons(output)[Side.LEFT] in (Unseen.BEYOND_RANGE, Unseen.OUTSIDE_IMAGE)
    assert Side.RIGHT in chain.reported(output)


@MODELS
def test_along_dashes_of_any_phase_a_line_is_there_or_its_reason(sections):
    for dash_m, gap_m in ((3.0, 9.0), (6.0, 12.0), (1.0, 30.0), (0.2, 5.0), (0.1, 0.1)):
        for phase_m in np.arange(0.0, dash_m + gap_m, (dash_m + gap_m) / 7):
            chain.shown(
                snapshot([dashed(1.8, 0, dash_m, gap_m, phase_m)], (), ego(speed_mps=15.0)), 2, **sections
            )


@MODELS
def test_gaps_alone_are_no_line(sections):
    bare = [straight(y, number, painted=np.zeros(1401, bool)) for number, y in enumerate((1.8, -1.7))]
    output, values = chain.shown(snapshot(bare), 3, **sections)
    assert chain.reasons(output) == {}
    assert values["left.quality"] == values["right.quality"] == 0.0
    assert set(output.observation.reason.tolist()) == {Unseen.NO_PAINT}

"""How entities move: shapes in closed form, positions of every kind, lane changes, gaps, trailers, paths."""

from math import atan2, cos, exp, hypot, pi, remainder, sin, sqrt, tan

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp

from tests.stories import (
    BEND,
    BEND_M,
    CAR,
    LANE_M,
    after,
    drive,
    event,
    group,
    lane_change,
    lane_offset,
    lane_position,
    motion,
    played,
    pose,
    private,
    snapshots,
    speed,
    story,
    teleport,
    text,
    trigger,
)
from vsensor.world.openscenario.paths import clothoid, polyline
from vsensor.world.openscenario.rods import Rod
from vsensor.world.openscenario.shapes import Lateral, Speed, share

SHAPES = ("linear", "cubic", "sinusoidal")
HALF_M = LANE_M / 2


@pytest.mark.parametrize("shape", SHAPES)
def test_the_way_of_a_speed_is_its_integral(shape):
    change = Speed(10.0, 25.0, shape, 2.0, 4.0)
    for until in (3.0, 5.5, 6.0, 9.0):
        whole, _ = quad(change.value, 2.0, until, points=[6.0] if until > 6.0 else None)
        assert change.way(until) == pytest.approx(whole, abs=1e-9)


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_goes_from_0_to_1_and_its_slopes_are_its_derivatives(shape):
    h = 1e-5
    assert share(shape, 0.0)[0] == 0.0
    assert share(shape, 1.0)[0] == 1.0
    for p in (0.1, 0.3, 0.5, 0.9):
        below, here, above = (share(shape, p + k * h) for k in (-1, 0, 1))
        assert here[1] == pytest.approx((above[0] - below[0]) / (2 * h), abs=1e-8)
        assert here[2] == pytest.approx((above[1] - below[1]) / (2 * h), abs=1e-6)


@pytest.mark.parametrize(("shape", "peak"), [("linear", 1.0), ("cubic", 1.5), ("sinusoidal", pi / 2)])
def test_a_rate_is_the_largest_slope_on_the_way(tmp_path, shape, peak):
    change = event("e", trigger(after(1)), speed(10, shape, "rate", 4))
    source = drive(tmp_path, text(stories=story(group(change, actors=("Other",)))))
    slopes = [motion(source, 1.01 + k * 0.05, "Other").acceleration_mps2 for k in range(120)]
    assert min(slopes) == pytest.approx(-4.0, rel=2e-3)
    assert motion(source, 1.01 + peak * 10.0 / 4.0 + 0.01, "Other").speed_mps == 10.0


@pytest.mark.parametrize("shape", SHAPES)
def test_a_speed_change_over_a_distance_takes_that_distance(tmp_path, shape):
    change = event("e", trigger(after(1)), speed(10, shape, "distance", 60))
    source = drive(tmp_path, text(stories=story(group(change, actors=("Other",)))))
    begun, ended = motion(source, 1.01, "Other"), motion(source, 1.01 + 60.0 / 15.0, "Other")
    assert ended.driven_m - begun.driven_m == pytest.approx(60.0, abs=1e-9)
    assert ended.speed_mps == 10.0


@pytest.mark.parametrize("shape", SHAPES)
def test_a_lane_change_is_where_its_shape_says(tmp_path, shape):
    change = event("e", trigger(after(1)), lane_change(-2, shape, "time", 3))
    source = drive(tmp_path, text(stories=story(group(change))))
    for seconds in (1.5, 2.5, 3.5):
        _, y, _ = pose(source, seconds)
        done = share(shape, (seconds - 1.01) / 3.0)[0]
        assert y == pytest.approx(-HALF_M - done * LANE_M, abs=1e-9)
    assert pose(source, 5.0)[1] == pytest.approx(-HALF_M - LANE_M, abs=1e-9)


def test_a_vehicle_keeps_its_speed_along_its_path_when_it_changes_lanes(tmp_path):
    change = event("e", trigger(after(1)), lane_change(-2, "cubic", "time", 3))
    source = drive(tmp_path, text(stories=story(group(change))))
    rate = 6.0 * LANE_M / 3.0  # of p (1 - p): the speed across
    expected, _ = quad(lambda t: sqrt(400.0 - (rate * (t / 3) * (1 - t / 3)) ** 2), 0.0, 3.0)
    assert pose(source, 4.01)[0] == pytest.approx(50.0 + 20.2 + expected, abs=1e-4)  # steps of 10 ms


def test_a_lane_change_over_a_distance_takes_that_distance_along_the_lane(tmp_path):
    change = event("e", trigger(after(1)), lane_change(-2, "linear", "distance", 50))
    source = drive(tmp_path, text(stories=story(group(change))))
    x, y, heading = pose(source, 2.0)
    assert y == pytest.approx(-HALF_M - (x - 70.2) / 50.0 * LANE_M, abs=1e-6)
    assert heading == pytest.approx(-atan2(LANE_M, 50.0), abs=1e-9)


def test_lanes_are_counted_to_the_left_of_the_other_and_0_is_none(tmp_path):
    target = '<RelativeTargetLane entityRef="Other" value="1"/>'
    change = event("e", trigger(after(1)), lane_change(target, "step"))
    source = drive(tmp_path, text(stories=story(group(change))))
    assert pose(source, 2.0)[1] == pytest.approx(HALF_M)  # lane 1, over the middle


def test_an_offset_is_to_the_left_of_rising_s_whoever_drives_where(tmp_path):
    init = private("Ego", teleport(lane_position(500, 1)), speed(20))
    change = event("e", trigger(after(1)), lane_offset(0.5))
    source = drive(tmp_path, text(init=init, entities=("Ego",), stories=story(group(change))))
    x, y, heading = pose(source, 6.0)
    assert x < 500.0
    assert y == pytest.approx(HALF_M + 0.5)
    assert abs(remainder(heading - pi, 2 * pi)) < 1e-9


ORIENTED = '<Orientation type="relative" h="3.14159265358979"/>'
HEADS_WEST = '<Orientation type="absolute" h="3.14159265358979"/>'
OTHER_AT = 100.0


@pytest.mark.parametrize(
    ("place", "x_m", "y_m", "heading_rad"),
    [
        (lane_position(60, -2, 0.3), 60.0, -1.5 * LANE_M + 0.3, 0.0),
        (lane_position(60, 1), 60.0, HALF_M, pi),
        (lane_position(60, 1, inner=ORIENTED), 60.0, HALF_M, 0.0),
        (lane_position(60, -1, 0.4, inner=HEADS_WEST), 60.0, -HALF_M + 0.4, pi),
        ('<RoadPosition roadId="1" s="70" t="-1.2"/>', 70.0, -1.2, 0.0),
        ('<WorldPosition x="80" y="-4" z="0" h="0.05"/>', 80.0, -4.0, 0.05),
        ('<WorldPosition x="80" y="4"/>', 80.0, 4.0, pi),
        ('<RelativeWorldPosition entityRef="Other" dx="-20" dy="-3"/>', 80.0, -HALF_M - 3.0, 0.0),
        ('<RelativeObjectPosition entityRef="Other" dx="10" dy="1"/>', 110.0, -HALF_M + 1.0, 0.0),
        ('<RelativeRoadPosition entityRef="Other" ds="-30" dt="-2"/>', 70.0, -HALF_M - 2.0, 0.0),
        (
            '<RelativeLanePosition entityRef="Other" dLane="-1" ds="5" offset="0.2"/>',
            105.0,
            -1.5 * LANE_M + 0.2,
            0.0,
        ),
        ('<RelativeLanePosition entityRef="Other" dLane="1" ds="5"/>', 105.0, HALF_M, 0.0),
        (
            "<RoutePosition><RouteRef><Route name='r' closed='false'>"
            f"<Waypoint routeStrategy='shortest'><Position>{lane_position(20)}</Position></Waypoint>"
            f"<Waypoint routeStrategy='shortest'><Position>{lane_position(400)}</Position></Waypoint>"
            "</Route></RouteRef><InRoutePosition><FromLaneCoordinates pathS='45' laneId='-2'/>"
            "</InRoutePosition></RoutePosition>",
            65.0,
            -1.5 * LANE_M,
            0.0,
        ),
    ],
    ids=lambda value: value.split(" ")[0].strip("<") if isinstance(value, str) else None,
)
def test_a_position_is_where_its_numbers_say(tmp_path, place, x_m, y_m, heading_rad):
    init = private("Other", teleport(lane_position(OTHER_AT))) + private("Ego", teleport(place))
    x, y, heading = pose(drive(tmp_path, text(init=init)), 0.0)
    assert (x, y) == pytest.approx((x_m, y_m), abs=1e-9)
    assert abs(remainder(heading - heading_rad, 2 * pi)) < 1e-9


def test_a_vehicle_beside_the_middle_of_a_bend_drives_as_far_as_its_speed_says(tmp_path):
    init = private("Ego", teleport(lane_position(50, -1, 1.0)), speed(20))
    source = drive(tmp_path, text(init=init, entities=("Ego",)), BEND)
    (x0, y0, _), (x1, y1, _) = pose(source, 0.0), pose(source, 5.0)
    radius = BEND_M + HALF_M - 1.0
    assert hypot(x1 - x0, y1 - y0) == pytest.approx(2 * radius * sin(100.0 / radius / 2), abs=1e-6)


def test_a_relative_speed_that_goes_on_follows_the_other(tmp_path):
    slows = event("slows", trigger(after(2)), speed(10, "linear", "rate", 2))
    twice = (
        '<RelativeTargetSpeed entityRef="Other" value="1.2" speedTargetValueType="factor" continuous="true"/>'
    )
    follows = event("follows", trigger(after(1)), speed(twice))
    source = drive(tmp_path, text(stories=story(group(follows), group(slows, actors=("Other",), name="b"))))
    for seconds in (1.5, 4.0, 12.0):
        theirs = motion(source, seconds, "Other").speed_mps
        assert motion(source, seconds).speed_mps == pytest.approx(1.2 * theirs, abs=0.03)  # within a step


def test_a_gap_in_seconds_is_closed_and_kept_within_the_limits(tmp_path):
    keep = (
        "<PrivateAction><LongitudinalAction>"
        '<LongitudinalDistanceAction entityRef="Other" timeGap="1.5" freespace="true" continuous="true">'
        '<DynamicConstraints maxAcceleration="2" maxDeceleration="3" maxSpeed="40"/>'
        "</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )
    source = drive(tmp_path, text(stories=story(group(event("e", trigger(after(0.5)), keep)))))
    rates = [motion(source, 0.6 + k, "Ego").acceleration_mps2 for k in range(12)]
    assert max(rates) <= 2.0 + 1e-9
    assert min(rates) >= -3.0 - 1e-9
    state = played(source, 40.0)
    work = source.machine.work(state, state.t_ns)
    gap = work.ahead_m(0, work.place(1)) - 5.0
    assert gap == pytest.approx(1.5 * 20.0, abs=0.01)


def trailing(**more):
    trailer = (
        '<TrailerHitch dx="-1"/><Trailer><Trailer name="t"><Vehicle name="t" vehicleCategory="trailer">'
        "<BoundingBox>"
        '<Center x="2" y="0" z="1"/><Dimensions width="2.5" length="8" height="3"/></BoundingBox>'
        '<TrailerCoupler dx="6"/></Vehicle></Trailer></Trailer></Vehicle>'
    )
    return text(bodies={"Other": CAR.replace("</Vehicle>", trailer)}, **more)


def test_a_trailer_hangs_straight_behind_at_its_coupler(tmp_path):
    source = drive(tmp_path, trailing())
    assert pose(source, 0.0, "Other+") == pytest.approx((100.0 - 1.0 - 6.0, -HALF_M, 0.0), abs=1e-9)
    assert pose(source, 3.0, "Other+") == pytest.approx((160.0 - 7.0, -HALF_M, 0.0), abs=1e-9)


def test_a_trailer_runs_in_a_bend_at_the_radius_of_geometry(tmp_path):
    x, y, _ = pose(drive(tmp_path, trailing(), BEND), 15.0, "Other+")
    radius = BEND_M + HALF_M
    axle = sqrt(radius**2 + 1.0**2 - 6.0**2)  # hitch on a circle, the axle tangent to its own
    assert hypot(x, y - BEND_M) == pytest.approx(axle, abs=2e-3)


def test_a_trailer_hides_as_a_box_of_its_own(tmp_path):
    boxes = snapshots(drive(tmp_path, trailing()), 0.0)[0].scene.obstacles
    assert [box.size_m for box in boxes] == [(5.0, 2.0, 1.5), (8.0, 2.5, 3.0)]
    assert boxes[1].centre_world_m == pytest.approx((93.0 + 2.0, -HALF_M, 1.0), abs=1e-9)


def test_a_rod_pulled_straight_is_the_tractrix():
    def rate(way, angle):
        return -np.sin(angle) / 6.0

    exact = solve_ivp(rate, (0.0, 9.0), [1.2], rtol=1e-11, atol=1e-12).y[0, -1]
    assert Rod((0.0, 0.0, 0.0), 1.2).drawn((9.0, 0.0, 0.0), 6.0).heading_rad == pytest.approx(exact, abs=1e-9)
    assert tan(exact / 2) == pytest.approx(tan(0.6) * exp(-1.5), rel=1e-9)


def followed(vertices, timing="<None/>"):
    inner = "".join(
        f'<Vertex time="{t}"><Position><WorldPosition x="{x}" y="{y}" z="0"/></Position></Vertex>'
        for t, x, y in vertices
    )
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="false"><Shape><Polyline>{inner}</Polyline></Shape></Trajectory>'
        "</TrajectoryRef>"
        f'<TimeReference>{timing}</TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


VERTICES = [(0, 72, -1.75), (2, 110, -1.75), (4, 150, -5.25), (6, 190, -5.25)]


def test_a_trajectory_without_times_is_driven_at_the_speed(tmp_path):
    source = drive(tmp_path, text(stories=story(group(event("e", trigger(after(1)), followed(VERTICES))))))
    (x0, y0, _), (x1, y1, _) = pose(source, 3.0), pose(source, 3.01)
    assert hypot(x1 - x0, y1 - y0) == pytest.approx(0.2, rel=1e-3)
    x, y, heading = pose(source, 10.0)
    assert (y, heading) == (pytest.approx(-5.25, abs=1e-3), pytest.approx(0.0, abs=1e-6))
    assert x > 190.0


def test_a_trajectory_with_times_is_at_its_vertices_then(tmp_path):
    timing = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'
    source = drive(
        tmp_path, text(stories=story(group(event("e", trigger(after(1)), followed(VERTICES, timing)))))
    )
    assert pose(source, 1.01 + 2.0)[:2] == pytest.approx((110.0, -1.75), abs=1e-6)
    assert pose(source, 1.01 + 4.0)[:2] == pytest.approx((150.0, -5.25), abs=1e-6)


def test_a_polyline_goes_through_its_vertices_and_turns_steadily():
    path = polyline([(0.0, 0.0, 0.0), (30.0, 0.0, 0.0), (60.0, 8.0, 0.0), (90.0, 8.0, 0.0)], None)
    points = np.array([path.at(way)[0] for way in np.arange(0.0, path.length_m, 0.05)])
    for corner in ((30.0, 0.0), (60.0, 8.0)):
        assert np.hypot(*(points[:, :2] - corner).T).min() < 0.03
    headings = np.array([path.at(way)[1] for way in np.arange(0.0, path.length_m, 0.05)])
    assert np.abs(np.diff(headings)).max() < 0.01


def test_a_clothoid_has_its_curvature_and_its_end():
    path = clothoid((5.0, 2.0, 0.0), 0.3, 0.01, 2e-4, 80.0)

    def heading(way):
        return 0.3 + 0.01 * way + 1e-4 * way * way

    for way in (13.37, 80.0):
        point, at, curvature = path.at(way)
        x, _ = quad(lambda w: cos(heading(w)), 0.0, way, epsabs=1e-12)
        y, _ = quad(lambda w: sin(heading(w)), 0.0, way, epsabs=1e-12)
        assert point[:2] == pytest.approx((5.0 + x, 2.0 + y), abs=1e-7)
        assert at == pytest.approx(heading(way), abs=1e-5)
        assert curvature == pytest.approx(0.01 + 2e-4 * way, abs=1e-9)


def test_a_lateral_way_is_done_at_its_end():
    way = Lateral(1.0, 3.0, "cubic", 10.0, 4.0)
    assert way.at(14.0) == (3.0, 0.0, 0.0)
    assert (way.is_done(13.99, 0.0), way.is_done(14.0, 0.0)) == (False, True)

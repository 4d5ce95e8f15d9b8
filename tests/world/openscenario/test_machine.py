"""The storyboard's machine: edges, delays, groups, priorities, counts, and what each trigger looks at."""

import pytest

from tests.stories import (
    after,
    by_entity,
    by_value,
    drive,
    element,
    event,
    events,
    group,
    lane_change,
    lane_offset,
    lane_position,
    motion,
    private,
    set_parameter,
    speed,
    story,
    teleport,
    text,
    trigger,
)

SET = set_parameter("P", 1)
DECLARED = '<ParameterDeclaration name="P" parameterType="double" value="0"/>'
STEP_S = 0.01


def started(folder, *conditions, action=SET, init=None, more=(), **options):
    """Return when an event with this trigger (one group) starts, None if it does not within 12 s."""
    watched = event("e", trigger("".join(conditions)), action)
    scenario = text(
        init=init,
        stories=story(group(watched, *more, actors=("Other",))),
        parameters=DECLARED,
        stop=trigger(after(12, "none"), tag="StopTrigger"),
        **options,
    )
    return events(drive(folder, scenario), 12.0).get(("e", "starts"))


def approx(seconds):
    return pytest.approx(seconds, abs=1e-9)


def test_a_time_that_is_greater_is_true_one_step_later(tmp_path):
    assert started(tmp_path, after(2)) == approx(2.01)


def test_a_delay_moves_a_trigger_by_its_time(tmp_path):
    assert started(tmp_path, after(2, delay=1.5)) == approx(3.51)


def test_a_rising_edge_needs_a_false_look_before(tmp_path):
    always = '<SimulationTimeCondition value="-1" rule="greaterThan"/>'
    assert started(tmp_path, by_value(always, "none")) == approx(0.0)
    assert started(tmp_path, by_value(always, "rising")) is None


def test_a_falling_edge_fires_when_it_is_no_longer_true(tmp_path):
    early = '<SimulationTimeCondition value="3" rule="lessThan"/>'
    assert started(tmp_path, by_value(early, "falling")) == approx(3.0)
    assert started(tmp_path, by_value(early, "risingOrFalling")) == approx(3.0)


def test_all_conditions_of_a_group_must_be_true_at_once(tmp_path):
    assert started(tmp_path, after(2, "none"), after(5, "none")) == approx(5.01)
    assert started(tmp_path, after(2, "rising"), after(5, "none")) is None


def test_any_group_of_a_trigger_is_enough(tmp_path):
    both = event("e", trigger(after(5), after(3)), SET)
    scenario = text(stories=story(group(both)), parameters=DECLARED)
    assert events(drive(tmp_path, scenario))[("e", "starts")] == approx(3.01)


def test_a_parameter_that_is_set_triggers_at_once(tmp_path):
    asks = by_value('<ParameterCondition parameterRef="P" value="0.5" rule="greaterThan"/>', "none")
    first = event("first", trigger(after(2)), SET)
    assert started(tmp_path, asks, more=(first,)) == approx(2.01)


def test_an_event_may_start_on_the_end_of_another(tmp_path):
    first = event("first", trigger(after(1)), lane_change(-2, "linear", "time", 2))
    assert started(tmp_path, element("event", "first", "endTransition"), more=(first,)) == approx(3.01)
    assert started(tmp_path, element("event", "first", "completeState", delay=1), more=(first,)) == approx(
        4.01
    )
    assert started(tmp_path, element("event", "first", "runningState"), more=(first,)) == approx(1.01)


def chained(folder, priority, runs=1):
    """A lane offset from 1 s on for 6 s or so, and at 2 s an event of some priority."""
    long = event("long", trigger(after(1)), speed(10, "linear", "time", 6))
    second = event(
        "second", trigger(after(2)), lane_change(-2, "linear", "time", 1), priority=priority, runs=runs
    )
    return events(drive(folder, text(stories=story(group(long, second, actors=("Other",))))), 12.0)


def test_overwrite_stops_the_other_events_of_the_maneuver(tmp_path):
    found = chained(tmp_path, "overwrite")
    assert found[("long", "ends")] == approx(2.01)
    assert found[("second", "starts")] == approx(2.01)


def test_parallel_lets_them_go_on(tmp_path):
    found = chained(tmp_path, "parallel")
    assert found[("long", "ends")] == approx(7.01)


def test_skip_does_not_start_beside_others(tmp_path):
    assert ("second", "starts") not in chained(tmp_path, "skip")


def test_a_stopped_speed_change_leaves_the_speed_that_it_had(tmp_path):
    long = event("long", trigger(after(1)), speed(10, "linear", "time", 6))
    second = event("second", trigger(after(4)), lane_change(-2), priority="overwrite")
    source = drive(tmp_path, text(stories=story(group(long, second, actors=("Other",)))))
    assert motion(source, 6.0, "Other").speed_mps == approx(20.0 - 10.0 / 6.0 * 3.0)


def test_an_action_of_the_same_kind_takes_over(tmp_path):
    first = event("first", trigger(after(1)), speed(10, "linear", "time", 6))
    second = event("second", trigger(after(4)), speed(30, "linear", "rate", 5))
    found = events(drive(tmp_path, text(stories=story(group(first, second, actors=("Other",))))), 12.0)
    assert found[("first", "ends")] == approx(4.01)
    assert found[("second", "ends")] == pytest.approx(4.01 + 15.0 / 5.0, abs=STEP_S)


def counted(folder, runs):
    """How often an event runs whose condition comes true each second."""
    blink = event(
        "blink",
        trigger(by_value('<ParameterCondition parameterRef="P" value="1" rule="equalTo"/>')),
        set_parameter("P", 0),
        runs=runs,
    )
    ticks = [event(f"t{k}", trigger(after(k)), SET) for k in range(1, 6)]
    scenario = text(stories=story(group(blink, *ticks)), parameters=DECLARED)
    source = drive(folder, scenario)
    state = source.machine.initial_state()
    for _ in range(700):
        state = source.machine.advance(state)
    return next(
        n for n, node in zip(state.runs, source.machine.story.nodes, strict=True) if node.name == "blink"
    )


@pytest.mark.parametrize(("runs", "expected"), [(1, 1), (3, 3), (50, 5)])
def test_an_event_runs_as_often_as_it_may(tmp_path, runs, expected):
    assert counted(tmp_path, runs) == expected


def test_an_act_waits_for_its_trigger_and_ends_with_its_stop_trigger(tmp_path):
    inside = group(event("e", trigger(after(0, "none")), speed(5, "linear", "time", 50)), actors=("Other",))
    scenario = text(stories=story(inside, start=trigger(after(2)), stop=trigger(after(4), tag="StopTrigger")))
    found = events(drive(tmp_path, scenario), 8.0)
    assert (found[("e", "starts")], found[("e", "ends")]) == (approx(2.01), approx(4.01))


def test_no_stop_trigger_lets_a_scenario_run_to_the_end_of_the_road(tmp_path):
    assert drive(tmp_path, rehearsal_s=100.0).duration_s == pytest.approx(1950.0 / 20.0, abs=0.011)


# What conditions look at: Ego from s = 50 and Other from s = 100, both at 20 m/s, unless said otherwise.


def approaching(closing=5.0):
    return private("Ego", teleport(lane_position(50)), speed(20 + closing)) + private(
        "Other", teleport(lane_position(100)), speed(20)
    )


def relative(kind, value, rule="lessThan", freespace="false", frame="road", **more):
    return by_entity(
        f'<{kind} entityRef="Other" value="{value}" rule="{rule}" freespace="{freespace}" '
        f'coordinateSystem="{frame}" relativeDistanceType="longitudinal"/>',
        **more,
    )


@pytest.mark.parametrize("frame", ["road", "entity", "lane"])
@pytest.mark.parametrize(("freespace", "gap"), [("false", 50.0), ("true", 45.0)])
def test_a_headway_is_the_gap_over_the_speed(tmp_path, frame, freespace, gap):
    condition = relative("TimeHeadwayCondition", 1.0, freespace=freespace, frame=frame)
    expected = (gap - 25.0) / 5.0
    assert started(tmp_path, condition, init=approaching()) == pytest.approx(expected + STEP_S, abs=1e-9)


def test_there_is_no_headway_to_who_is_behind(tmp_path):
    condition = relative("TimeHeadwayCondition", 100.0, edge="none").replace('"Other"', '"X"')
    condition = condition.replace('entityRef="Ego"', 'entityRef="Other"').replace('"X"', '"Ego"')
    assert started(tmp_path, condition) is None


def test_a_time_to_collision_is_the_gap_over_the_closing_speed(tmp_path):
    target = (
        '<TimeToCollisionCondition value="4" freespace="true" coordinateSystem="road" '
        'relativeDistanceType="longitudinal" rule="lessThan"><TimeToCollisionConditionTarget>'
        '<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )
    assert started(tmp_path, by_entity(target), init=approaching()) == approx(45.0 / 5.0 - 4.0 + STEP_S)
    assert started(tmp_path, by_entity(target, edge="none")) is None  # not closing


def test_a_relative_distance_is_measured_between_boxes_or_origins(tmp_path):
    condition = relative("RelativeDistanceCondition", 20.0)
    assert started(tmp_path, condition, init=approaching()) == approx(6.01)
    condition = relative("RelativeDistanceCondition", 20.0, freespace="true")
    assert started(tmp_path, condition, init=approaching()) == approx(5.01)


def test_a_euclidian_distance_between_boxes_side_by_side_is_that_of_their_sides(tmp_path):
    init = private("Ego", teleport(lane_position(50)), speed(25)) + private(
        "Other", teleport(lane_position(100, -2)), speed(20)
    )
    inner = (
        '<RelativeDistanceCondition entityRef="Other" value="1.6" rule="lessThan" freespace="true" '
        'relativeDistanceType="euclidianDistance"/>'
    )
    # 3.5 m between the lanes, boxes 2 m wide: 1.5 m, from when they are beside each other but for 0.557 m
    ahead = (1.6**2 - 1.5**2) ** 0.5
    assert started(tmp_path, by_entity(inner), init=init) == pytest.approx((45 - ahead) / 5, abs=STEP_S)


def test_a_place_is_reached_within_its_tolerance(tmp_path):
    place = f"<Position>{lane_position(150)}</Position>"
    reached = f'<ReachPositionCondition tolerance="2">{place}</ReachPositionCondition>'
    assert started(tmp_path, by_entity(reached)) == approx((150 - 2 - 50) / 20)


def test_speeds_and_accelerations_and_ways_are_looked_at(tmp_path):
    change = event("brake", trigger(after(1)), speed(10, "linear", "rate", 4))
    slow = by_entity('<SpeedCondition value="14" rule="lessOrEqual"/>', ("Other",))
    assert started(tmp_path, slow, more=(change,)) == approx(1.01 + 6.0 / 4.0)
    braking = by_entity('<AccelerationCondition value="-3.9" rule="lessThan"/>', ("Other",))
    assert started(tmp_path, braking, more=(change,)) == approx(1.01)  # seen at once
    slower = by_entity('<RelativeSpeedCondition entityRef="Ego" value="-5" rule="lessThan"/>', ("Other",))
    assert started(tmp_path, slower, more=(change,)) == approx(1.01 + 5.0 / 4.0 + STEP_S)
    driven = by_entity('<TraveledDistanceCondition value="60"/>')
    assert started(tmp_path, driven) == approx(3.0)


def test_what_lasts_must_last(tmp_path):
    halt = event("halt", trigger(after(1)), speed(0))
    still = by_entity('<StandStillCondition duration="2"/>', ("Other",))
    assert started(tmp_path, still, more=(halt,)) == approx(1.01 + 2.0)
    aside = event("aside", trigger(after(1)), lane_offset(-20.0, limit=50.0))
    off = by_entity('<OffroadCondition duration="0"/>', ("Other",))
    left = started(tmp_path, off, more=(aside,))
    assert 1.01 < left < 3.0


def test_the_end_of_the_road_is_seen(tmp_path):
    init = private("Ego", teleport(lane_position(50)), speed(20)) + private(
        "Other", teleport(lane_position(1900)), speed(20)
    )
    end = by_entity('<EndOfRoadCondition duration="1"/>', ("Other",))
    assert started(tmp_path, end, init=init) == pytest.approx(5.0 + 1.0, abs=0.025)


def test_all_triggering_entities_or_any_of_them(tmp_path):
    fast = '<SpeedCondition value="21" rule="greaterThan"/>'
    both = ("Ego", "Other")
    speeds = event("faster", trigger(after(3)), speed(25))
    init = private("Ego", teleport(lane_position(50)), speed(22)) + private(
        "Other", teleport(lane_position(100)), speed(20)
    )
    assert started(tmp_path, by_entity(fast, both, "none"), init=init, more=(speeds,)) == approx(0.0)
    last = started(tmp_path, by_entity(fast, both, "none", rule="all"), init=init, more=(speeds,))
    assert last == approx(3.01)

"""Who keeps in step with others: their speed, or a gap to them; once a step of the storyboard."""

from msgspec.structs import replace

from vsensor.world.openscenario.action_data import GapAction
from vsensor.world.openscenario.shapes import Speed
from vsensor.world.openscenario.state import STEP_NS
from vsensor.world.openscenario.work import Work

GAP_PULL_PER_S2 = 1.0
GAP_DAMPING_PER_S = 2.0
"""A gap is closed as by a critically damped spring of 1 rad/s, within the action's limits."""

GAP_REACHED_M = 0.1
GAP_SPEED_MPS = 0.1


def keep_in_step(work: Work) -> None:
    """Let those who follow another's speed or keep a gap go on for one step."""
    for entity, body in enumerate(work.bodies):
        if body is None or body.follow is None or body.is_ended:
            continue
        t_s, after_s = work.t_ns / 1e9, (work.t_ns + STEP_NS) / 1e9
        if (
            t_s < body.speed.until_s - 1e-9
            and body.follow.gap is None
            and body.speed.seconds > STEP_NS / 1e9 * 1.5
        ):
            continue  # still on its way to the other's speed
        now = body.speed.value(t_s)
        if body.follow.gap is not None:
            wanted = _gap_speed(work, entity, body.follow.gap, now)
        else:
            other = work.bodies[body.follow.ref]
            theirs = 0.0 if other is None or other.is_ended else other.speed.value(after_s)
            wanted = max(body.follow.factor * theirs + body.follow.value_mps, 0.0)
        if wanted == now and body.speed.until_s <= t_s:
            continue
        moved = work.anchored(entity)
        assert moved is not None
        work.put(entity, replace(moved, speed=Speed(now, wanted, "linear", t_s, after_s - t_s)))


def _gap_error(work: Work, entity: int, action: GapAction) -> tuple[float, float] | None:
    """Return how far the gap is too wide, and how fast it grows; None if the other is not on the way."""
    mine, place = work.motion(entity), work.place(action.ref)
    other, spot = work.motion(action.ref), work.spot(action.ref)
    ahead = work.ahead_m(entity, place, spot)
    if mine is None or other is None or ahead is None:
        return None
    sign = 1.0 if action.trails else -1.0
    gap = sign * ahead
    if action.freespace:
        heading = work.pose(entity)
        axis = 0.0 if heading is None else heading[1]
        (low, high), (other_low, other_high) = work.extent(entity, axis), work.extent(action.ref, axis)
        gap += other_low - high if action.trails else low - other_high
    wanted = action.metres if action.metres is not None else (action.seconds or 0.0) * mine.speed_mps
    return sign * (gap - wanted), other.speed_mps - mine.speed_mps


def gap_reached(work: Work, entity: int, action: GapAction) -> bool:
    """Return whether a gap is as wide as wanted and stays so, or is no more."""
    found = _gap_error(work, entity, action)
    return found is None or (abs(found[0]) < GAP_REACHED_M and abs(found[1]) < GAP_SPEED_MPS)


def _gap_speed(work: Work, entity: int, action: GapAction, now: float) -> float:
    found = _gap_error(work, entity, action)
    if found is None:
        return now
    own = work.story.entities[entity]
    most = own.max_acceleration_mps2 if action.max_acceleration_mps2 is None else action.max_acceleration_mps2
    least = (
        own.max_deceleration_mps2 if action.max_deceleration_mps2 is None else action.max_deceleration_mps2
    )
    top = own.max_speed_mps if action.max_speed_mps is None else action.max_speed_mps
    rate = GAP_PULL_PER_S2 * found[0] + GAP_DAMPING_PER_S * found[1]
    after = now + min(max(rate, -least), most) * STEP_NS / 1e9
    return min(max(after, 0.0), max(top, min(now, after)) if now > top else top)

"""What is lost of a reported line, and for how long: loss, view range and quality as they were recorded.

They act on the report, after fit and tracker, as the fault `line_lost` does: so their law is that of the bus.
Each of the four sides has its own

    loss      seen ──► lost ──► seen ...   how long each lasts: a quantile of a fitted table (semi-Markov)
    range     end of the view range = share x operating range, share = Q(Phi(z)), z ~ AR(1) in time
    quality   a Markov chain; a predicted line is at most as good as its prediction

They go on whether or not a line is there. A dwell is measured by the share of it that is over: where the
rule picks another model that share stays, so no line comes or goes because of that.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from math import ceil, exp, sqrt

import numpy as np
from scipy.special import ndtr

from vsensor.draws import Draws, Stage
from vsensor.error_model.chain import below, drawn, once, stationary, stepped, steps_between
from vsensor.error_model.model import ErrorModel
from vsensor.types import Array, BoolArray, Boundary, IntArray, LaneEstimate, Side, Tick, frozen

SIDES = len(Side)
NEVER = 2**62
"""Tick that no run reaches."""
_FINE = 1025
_ROUNDING = 1e-6
"""Images: what a dwell that is taken over may miss its whole number by."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportLaw:
    """One model's: dwells in s at `dwell_levels` (Q,), shares at `share_levels` (W,), `quality_step` (5, 5).

    Empty arrays: not fitted, nothing of it is changed.
    """

    dwell_levels: Array
    dwells_s: tuple[Array, Array]  # while seen, while lost
    share_levels: Array
    share: Array
    share_time_s: float
    quality_step: Array
    quality_below: tuple[list[float], ...]
    quality_start: Array
    quality_period_s: float

    @classmethod
    def of(cls, model: ErrorModel) -> "ReportLaw":
        """Return the law of a model."""
        return cls(
            dwell_levels=model.dwell_levels,
            dwells_s=(model.seen_dwell_s, model.lost_dwell_s),
            share_levels=model.range_share_levels,
            share=model.range_share,
            share_time_s=model.range_time_s,
            quality_step=model.quality_step,
            quality_below=below(model.quality_step),
            quality_start=stationary(model.quality_step),
            quality_period_s=model.quality_period_s,
        )

    @property
    def is_empty(self) -> bool:
        """Whether nothing of it was fitted."""
        return not (len(self.dwell_levels) or len(self.share) or len(self.quality_step))

    def dwell_ticks(self, lost: bool, u: float, tick: Tick) -> int:
        """Return how many images a dwell of quantile `u` lasts, at least one."""
        dwell_s = float(np.interp(u, self.dwell_levels, self.dwells_s[lost]))
        return max(1, round(dwell_s * 1e9 / tick.period_ns))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ReportState:
    """As of `tick`, for each side (4,): whether it is lost, and its dwell's quantile, place and end.

    A dwell of quantile `u` had `over` (0 to 1) of itself behind it at tick `since`, and ends at `until`.
    `z` (4,) is the normal process of the range, `quality` (4,) 0 to 4. `model` holds since the last tick.
    """

    tick: int
    model: str
    lost: BoolArray
    u: Array
    over: Array
    since: IntArray
    until: IntArray
    z: Array
    quality: IntArray


def advance(
    laws: Mapping[str, ReportLaw], model: str, state: ReportState | None, draws: Draws, tick: Tick
) -> ReportState:
    """Return the state at `tick`, where `model` holds; `state` None = before the first image."""
    law = laws[model]
    numbers = draws.at(Stage.REPORT, tick.index)
    noise, uniform = numbers.standard_normal(SIDES), numbers.random(SIDES)
    if state is None:
        return _started(law, model, noise, uniform, draws, tick)
    if state.model != model:
        state = _taken_over(laws[state.model], law, state, draws, tick)
    while min(state.until.tolist()) <= tick.index:
        state = _turned(law, state, draws, tick)
    keep = exp(-(tick.index - state.tick) * tick.period_ns * 1e-9 / law.share_time_s)
    noise *= sqrt(1.0 - keep * keep)
    noise += keep * state.z
    noise.flags.writeable = False
    return ReportState(  # built, not replaced: a third of the time
        tick=tick.index,
        model=model,
        lost=state.lost,
        u=state.u,
        over=state.over,
        since=state.since,
        until=state.until,
        z=noise,
        quality=_rated(law, state, tick, uniform),
    )


def _rated(law: ReportLaw, state: ReportState, tick: Tick, uniform: Array) -> IntArray:
    """Return the chain of the quality at `tick`."""
    if not law.quality_below:
        return state.quality
    steps = steps_between(state.tick, tick, law.quality_period_s)
    if steps != 1:
        return frozen(stepped(law.quality_step, state.quality, steps, uniform), np.int64)
    pairs = zip(state.quality.tolist(), uniform.tolist(), strict=True)
    return frozen([once(law.quality_below, one, part) for one, part in pairs], np.int64)


def _started(
    law: ReportLaw, model: str, noise: Array, uniform: Array, draws: Draws, tick: Tick
) -> ReportState:
    """Return a state of the law in the long run: the longer a dwell, the likelier is it under way."""
    lost, u = np.zeros(SIDES, bool), np.full(SIDES, 0.5)
    over, until = np.zeros(SIDES), np.full(SIDES, NEVER, np.int64)
    if len(law.dwell_levels):
        fine = np.linspace(0.0, 1.0, _FINE)
        dwells = [np.interp(fine, law.dwell_levels, dwell_s) for dwell_s in law.dwells_s]
        means = [float(np.trapezoid(dwell, fine)) for dwell in dwells]
        for side in range(SIDES):
            place = draws.at(Stage.REPORT, tick.index, 1 + side).random(3)
            lost[side] = place[0] * (means[0] + means[1]) < means[1]
            dwell = dwells[int(lost[side])]
            behind = np.concatenate([[0.0], np.cumsum(dwell[1:] + dwell[:-1])])
            u[side] = np.interp(place[1] * behind[-1], behind, fine) if behind[-1] > 0.0 else place[1]
            over[side] = place[2]
            left = (1.0 - over[side]) * law.dwell_ticks(bool(lost[side]), float(u[side]), tick)
            until[side] = tick.index + max(1, ceil(left - _ROUNDING))
    quality = drawn(law.quality_start, uniform) if len(law.quality_step) else np.zeros(SIDES)
    return ReportState(
        tick=tick.index,
        model=model,
        lost=frozen(lost, bool),
        u=frozen(u),
        over=frozen(over),
        since=frozen(np.full(SIDES, tick.index), np.int64),
        until=frozen(until, np.int64),
        z=frozen(noise),
        quality=frozen(quality, np.int64),
    )


def _turned(law: ReportLaw, state: ReportState, draws: Draws, tick: Tick) -> ReportState:
    """Return the state after the next end of a dwell on each side where one has come."""
    lost, u, over = state.lost.copy(), state.u.copy(), state.over.copy()
    since, until = state.since.copy(), state.until.copy()
    for side in np.flatnonzero(state.until <= tick.index).tolist():
        lost[side], over[side], since[side] = not lost[side], 0.0, until[side]
        u[side] = draws.at(Stage.REPORT, int(until[side]), 1 + side).random()
        if len(law.dwell_levels):
            until[side] += law.dwell_ticks(bool(lost[side]), float(u[side]), tick)
        else:
            lost[side], until[side] = False, NEVER
    return replace(
        state,
        lost=frozen(lost, bool),
        u=frozen(u),
        over=frozen(over),
        since=frozen(since, np.int64),
        until=frozen(until, np.int64),
    )


def _taken_over(old: ReportLaw, law: ReportLaw, state: ReportState, draws: Draws, tick: Tick) -> ReportState:
    """Return the state with its dwells as long as another law has them; what is over of them stays over.

    A dwell that the old law never ends begins now; one that the new law does not know ends by the old one.
    """
    u, over, since, until = state.u.copy(), state.over.copy(), state.since.copy(), state.until.copy()
    for side in range(SIDES):
        lost = bool(state.lost[side])
        if not len(law.dwell_levels):
            until[side] = until[side] if lost else NEVER
            continue
        if until[side] == NEVER:
            u[side], over[side] = draws.at(Stage.REPORT, tick.index, 1 + side).random(), 0.0
        else:
            over[side] += (1.0 - over[side]) * (tick.index - since[side]) / (until[side] - since[side])
        since[side] = tick.index
        left = (1.0 - min(over[side], 1.0)) * law.dwell_ticks(lost, float(u[side]), tick)
        until[side] = tick.index + (max(1, ceil(left - _ROUNDING)) if over[side] < 1.0 else 0)
    return replace(
        state,
        u=frozen(u),
        over=frozen(np.minimum(over, 1.0)),
        since=frozen(since, np.int64),
        until=frozen(until, np.int64),
    )


def reported(law: ReportLaw, state: ReportState, estimate: LaneEstimate, range_m: float) -> LaneEstimate:
    """Return what is left of the estimate; `range_m` is the operating range at this speed.

    What follows from the lines (lane offsets, width, centre, "not available") follows from these.
    """
    share = np.interp(ndtr(state.z), law.share_levels, law.share).tolist() if len(law.share) else ()
    rated = state.quality.tolist() if law.quality_below else ()
    is_lost, kept, lost = state.lost.tolist(), [], list(estimate.lost)
    for line in estimate.boundaries:
        side = int(line.side)
        if is_lost[side]:
            lost.append(line.side)
            continue
        end_m, quality = line.x_max_m, line.quality
        if share:
            end_m = max(min(end_m, share[side] * range_m), min(line.x_min_m, end_m))
        if rated:
            quality = max(1, rated[side]) if line.measured else min(max(1, rated[side]), quality)
        kept.append(_ended(line, end_m, quality))
    return LaneEstimate(
        exposed_at_ns=estimate.exposed_at_ns,
        image_index=estimate.image_index,
        boundaries=tuple(kept),
        lane_change=estimate.lane_change,
        degraded=estimate.degraded,
        lost=tuple(lost),
    )


def _ended(line: Boundary, x_max_m: float, quality: int) -> Boundary:
    """Return the line with another end and quality; `replace` takes three times as long."""
    return Boundary(
        side=line.side,
        coefficients=line.coefficients,
        covariance=line.covariance,
        x_min_m=line.x_min_m,
        x_max_m=x_max_m,
        quality=quality,
        kind=line.kind,
        colour=line.colour,
        width_m=line.width_m,
        measured=line.measured,
        marking=line.marking,
        points=line.points,
    )

"""The errors of an image: what each line remembers, advanced by a tick, and its points moved by it.

Each point is moved along the normal of its line (ERRATA, P1 2.2.2), left positive. In mode "volume" each
line carries a normal process z over the range: AR(1) from image to image with the model's correlation time,
along the range a squared-exponential kernel with its correlation length, so that the polynomial fitted
afterwards keeps the law (an exponential kernel of 20 m would lose up to 29 % of it in a cubic). z goes on
where the rule picks another model, so there errors change no faster than either law says.
Every line has its own draws, so what one does never depends on which others are seen. Beyond the grid of the
file the nearest value holds.
"""

from dataclasses import dataclass, field
from math import exp, sqrt

import numpy as np

from vsensor.draws import Draws, Stage
from vsensor.error_model.chain import drawn, once, stepped, steps_between
from vsensor.error_model.law import ErrorLaw, ModelLaw, quantile
from vsensor.error_model.report import ReportState, advance, reported
from vsensor.error_model.rule import Conditions
from vsensor.error_model.shift import shift
from vsensor.types import Array, LaneEstimate, LinePoints, Reach, Tick, frozen

FORGET_AFTER = 5.0
"""Correlation times after which an unseen line is forgotten: exp(-5) = 0.7 % of it would be left."""
WHOLE_DRIVE = 2**64 - 1
"""Number of the stream for what is drawn once per drive; no tick has it."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ErrorState:
    """Per known line its id, the tick it was last drawn at, and its process: z (M, G), or a level (M, 1)."""

    lines: tuple[int, ...] = ()
    ticks: tuple[int, ...] = ()
    process: Array = field(default_factory=lambda: frozen(np.zeros((0, 0))))


def initial_state() -> ErrorState:
    """Return the state before the first image: no line is known."""
    return ErrorState()


def apply(
    law: ErrorLaw | None,
    state: ErrorState,
    draws: Draws,
    tick: Tick,
    conditions: Conditions,
    line_ids: tuple[int, ...],
    lines: LinePoints,
) -> tuple[ErrorState, LinePoints]:
    """Move the points of every line along its normal by the error of this image.

    `line_ids` (K,) name the lines for good (a marking's group), seen or not: lines without points
    advance too. An unknown speed (NaN) takes the highest of the grid. Cost: nothing without a law.
    """
    if law is None:
        return state, lines
    model = law.models[law.name_at(conditions)]
    table = model.at_speed(conditions.speed_mps)
    if law.mode == "extreme":
        return state, shift(lines, law.grid_m, _signs(law.direction, draws, lines)[:, None] * table[0])
    state = _advance(law, model, state, draws, tick, line_ids)
    if not line_ids:
        return state, lines
    process = _of_lines(state, line_ids)
    if law.mode == "volume":
        return state, shift(lines, law.grid_m, quantile(model.knots, table, process))
    level = np.minimum(process[:, 0].astype(int), len(table) - 1)
    return state, shift(lines, law.grid_m, _signs(law.direction, draws, lines)[:, None] * table[level])


def reach(law: ErrorLaw | None, conditions: Conditions) -> Reach | None:
    """Return how far the model that holds reports; None without one, or where its file does not say."""
    if law is None:
        return None
    region = law.models[law.name_at(conditions)].region
    return None if region is None else region.at(conditions.speed_mps)


def report(
    law: ErrorLaw | None,
    state: ReportState | None,
    draws: Draws,
    tick: Tick,
    conditions: Conditions,
    estimate: LaneEstimate,
    range_m: float,
) -> tuple[ReportState | None, LaneEstimate]:
    """Return what is left of the estimate after losses, range and quality of the model that holds."""
    if law is None or not law.reports:
        return state, estimate
    name = law.name_at(conditions)
    state = advance(law.reports, name, state, draws, tick)
    return state, reported(law.reports[name], state, estimate, range_m)


def _advance(
    law: ErrorLaw, model: ModelLaw, state: ErrorState, draws: Draws, tick: Tick, line_ids: tuple[int, ...]
) -> ErrorState:
    """Advance every line from its last tick to this one; a new one starts from the stationary law.

    First in the state come the lines of this image, in its order, then those that may come back.
    """
    here = tuple(dict.fromkeys(line_ids))
    old, ages = _known(state, here, tick)
    step = _next_z if law.mode == "volume" else _next_level
    process = step(model, old, ages, draws, tick, here)
    horizon = tick.index - FORGET_AFTER * model.time_s * 1e9 / tick.period_ns
    away = []
    if state.lines != here:
        away = [
            place
            for place, (line, at) in enumerate(zip(state.lines, state.ticks, strict=True))
            if at >= horizon and line not in here
        ]
    if away:
        process = np.concatenate([process, state.process[away]])
    return ErrorState(
        lines=here + tuple(state.lines[place] for place in away),
        ticks=(tick.index,) * len(here) + tuple(state.ticks[place] for place in away),
        process=frozen(process),
    )


def _of_lines(state: ErrorState, line_ids: tuple[int, ...]) -> Array:
    """Return the process of each line of an image (K, G); two stripes of a border share theirs."""
    if state.lines[: len(line_ids)] == line_ids:
        return state.process[: len(line_ids)]
    places = {line: place for place, line in enumerate(state.lines)}
    return state.process[[places[line] for line in line_ids]]


def _known(state: ErrorState, here: tuple[int, ...], tick: Tick) -> tuple[Array, list[int | None]]:
    """Return what the state knows of these lines (K, G), and how many ticks ago, None of a new line."""
    if state.lines[: len(here)] == here:
        return state.process[: len(here)], [tick.index - at for at in state.ticks[: len(here)]]
    places = {line: place for place, line in enumerate(state.lines)}
    found = [places.get(line) for line in here]
    ages = [None if place is None else tick.index - state.ticks[place] for place in found]
    if not len(state.lines):
        return np.zeros((len(here), 1)), ages
    return state.process[[place or 0 for place in found]], ages


def _next_z(
    model: ModelLaw, old: Array, ages: list[int | None], draws: Draws, tick: Tick, here: tuple[int, ...]
) -> Array:
    size = len(model.factor)
    smooth = np.empty((len(here), size))
    for row, line in enumerate(here):
        noise = draws.at(Stage.ERROR_MODEL, tick.index, line).standard_normal(size)
        # one product per line: a joint one rounds differently with the number of lines, BLAS with the cores
        np.einsum("gh,h", model.factor, noise, out=smooth[row])
    if not here:
        return smooth
    decay = tick.period_ns * 1e-9 / model.time_s
    keep = [0.0 if age is None else exp(-max(age, 0) * decay) for age in ages]
    rest = [sqrt(1.0 - one * one) for one in keep]
    if keep.count(keep[0]) == len(keep):  # all were there in the image before, say
        smooth *= rest[0]
        return smooth + keep[0] * old
    return np.asarray(np.array(rest)[:, None] * smooth + np.array(keep)[:, None] * old)


def _next_level(
    model: ModelLaw, old: Array, ages: list[int | None], draws: Draws, tick: Tick, here: tuple[int, ...]
) -> Array:
    levels = np.empty((len(here), 1))
    for row, (line, age) in enumerate(zip(here, ages, strict=True)):
        uniform = draws.at(Stage.ERROR_MODEL, tick.index, line).random(1)
        if age is None:
            levels[row] = drawn(model.start, uniform)
        elif (steps := steps_between(tick.index - age, tick, model.period_s)) == 1:
            levels[row, 0] = once(model.below, int(old[row, 0]), float(uniform[0]))
        else:
            levels[row] = stepped(model.step, old[row].astype(np.int64), steps, uniform)
    return levels


def _signs(direction: str, draws: Draws, lines: LinePoints) -> Array:
    """Return +1 (to the left) or -1 for each line (K,)."""
    count = len(lines.marking)
    if direction == "random":
        to_left = draws.at(Stage.ERROR_MODEL, WHOLE_DRIVE).random() < 0.5
        return np.full(count, 1.0 if to_left else -1.0)
    if direction in ("left", "right"):
        return np.full(count, 1.0 if direction == "left" else -1.0)
    first = np.minimum(lines.starts[:-1], max(len(lines.points_ego_m) - 1, 0))
    y = lines.points_ego_m[first, 1] if len(lines.points_ego_m) else np.zeros(count)
    return np.where(y >= 0.0, 1.0, -1.0) * (1.0 if direction == "outward" else -1.0)

"""One image of the sensor that is laid over: where the scene stands comes with the wish for it."""

from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Protocol

from vsensor import sensor as sensing
from vsensor.line import Line, LineState
from vsensor.sources import Source
from vsensor.types import EgoState, Frame, Tick


class Wish(NamedTuple):
    """Image `number` of the sensor, wanted for the place `log_ns` of a log (0 where there is none).

    `is_cut`: the scene does not go on from the image before (a seek, a seam); `is_start`: it begins again.
    `heard`: what came since the image before, times from slot 0 on. `is_lost`: the image before was made too
    late and not sent, so alive counters do not count it.
    """

    number: int
    log_ns: int = 0
    is_cut: bool = False
    is_start: bool = False
    heard: tuple[Frame, ...] = ()
    is_lost: bool = False


class Made(NamedTuple):
    """What became of a wish: frames whose `due_ns` count from slot 0, and how the vehicle moves there."""

    number: int
    frames: tuple[Frame, ...]
    ego: EgoState | None = None
    steering_rad: float = 0.0
    is_steered: bool = False


class Placed(Source, Protocol):
    """A source that can be told where its scene stands."""

    def placed(self, state: Any, wish: Wish) -> Any:
        """Return the state from which `advance` shows what the wish asks for."""
        ...

    def steering(self, state: Any) -> float | None:
        """Return the angle of the front wheels after a tick; None while nobody steers the vehicle."""
        ...

    def remarks(self, state: Any) -> tuple[str, ...]:
        """Say what went wrong on the way."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Synth:
    """A line whose source is `Placed`, and its cycle."""

    line: Line
    source: Placed
    period_ns: int

    def initial(self) -> LineState:
        """Return the state before image 0."""
        return self.line.initial_state()

    def compute(self, state: LineState, wish: Wish) -> tuple[LineState, LineState, Made]:
        """Return the state after an image, that if the image is not sent after all, and the image."""
        tick = Tick(index=wish.number, t_ns=wish.number * self.period_ns, period_ns=self.period_ns)
        state = replace(state, source=self.source.placed(state.source, wish))
        if wish.is_cut:
            state = elsewhere(state)
        computed = self.line.compute(state, tick, wish.heard)
        if computed is None:
            return state, state, Made(wish.number, ())
        after = computed.state_if_sent
        steering = self.source.steering(after.source)
        is_steered = steering is not None
        made = Made(
            wish.number,
            computed.output.frames,
            computed.output.snapshot.ego if is_steered else None,
            steering or 0.0,
            is_steered,
        )
        return after, computed.state_if_dropped, made


def elsewhere(state: LineState) -> LineState:
    """Return the state of a sensor that finds itself in another place: it runs on, its lines begin anew.

    Its clock, counters and images go on; lines that it saw are lost, and confirmed anew where it is now.
    """
    images = tuple(replace(image, estimate=replace(image.estimate, boundaries=())) for image in state.images)
    fresh = sensing.initial_state()
    return replace(state, sensor=replace(fresh, motion=state.sensor.motion), images=images)

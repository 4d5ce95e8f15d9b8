"""Stages: what changes frames on their way from the log to the buses, or adds frames of its own."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from vsensor.types import Frame


@dataclass(frozen=True, slots=True)
class Stage:
    """A change of frames on their way: `function(state, frame)` gives the next state and a frame, or several.

    `due_ns` of the frame counts from the beginning of the replay, and goes on over loops and seeks. A frame
    that is not sent after all (a seek) leaves the state as it was.

    Frames of its own: `due(state)` says when the next is due (None: there is none until the log brings
    something), then `wake(state, due_ns)` gives the next state and the frames. It must come to an end by
    itself when the log does. `told(state)`: lines for the report.
    """

    function: Callable[[Any, Frame], tuple[Any, Frame | tuple[Frame, ...]]]
    state: Any = None
    due: Callable[[Any], int | None] | None = None
    wake: Callable[[Any, int], tuple[Any, tuple[Frame, ...]]] | None = None
    told: Callable[[Any], Sequence[str]] | None = None


class Chain:
    """Stages one after another; their states are the caller's. `is_timed`: one has frames of its own."""

    def __init__(self, stages: Sequence[Stage]) -> None:
        self._stages = tuple(stages)
        self._functions = [stage.function for stage in stages]
        self._timed = [(number, stage.due) for number, stage in enumerate(stages) if stage.due is not None]
        self.is_timed = bool(self._timed)

    def through(
        self, states: list[Any], frames: tuple[Frame, ...], first: int = 0
    ) -> tuple[list[Any], tuple[Frame, ...]]:
        """Return the states, and what becomes of frames, after the stages from number `first` on."""
        if first == len(self._functions):
            return states, frames
        states = list(states)
        for number in range(first, len(self._functions)):
            function, state, changed = self._functions[number], states[number], list[Frame]()
            for one in frames:
                state, result = function(state, one)
                changed += result if isinstance(result, tuple) else (result,)
            states[number], frames = state, tuple(changed)
        return states, frames

    def next_wake(self, states: list[Any]) -> tuple[int, int] | None:
        """Return when the next frame of a stage itself is due, and the stage's number; None without one."""
        found = None
        for number, due in self._timed:
            due_ns = due(states[number])
            if due_ns is not None and (found is None or due_ns < found[0]):
                found = due_ns, number
        return found

    def wake(self, states: list[Any], number: int, due_ns: int) -> tuple[list[Any], tuple[Frame, ...]]:
        """Return the states, and a stage's own frames after the stages behind it."""
        wake = self._stages[number].wake
        states, frames = list(states), tuple[Frame, ...]()
        if wake is not None:
            states[number], frames = wake(states[number], due_ns)
        return self.through(states, frames, number + 1)

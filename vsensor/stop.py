"""Ctrl-C and SIGTERM as a question that the loop asks between two ticks."""

import contextlib
import signal
from collections.abc import Callable, Iterator
from types import FrameType


@contextlib.contextmanager
def stop_signals() -> Iterator[Callable[[], bool]]:
    """Turn SIGINT and SIGTERM into a question, so that no tick is cut in two; a second one ends at once.

    Until somebody asks, that is while the run is loaded, the first one ends it at once. Some library may
    swallow that; the question then finds it.
    """
    received: list[int] = []
    asked: list[bool] = []

    def note(number: int, frame: FrameType | None) -> None:
        received.append(number)
        if len(received) > 1 or not asked:
            raise KeyboardInterrupt

    def stopped() -> bool:
        if not asked:
            asked.append(True)
        return bool(received)

    before = {number: signal.signal(number, note) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)

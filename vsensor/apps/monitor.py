"""`vsensor monitor`: listens to a bus and shows it, in place on a terminal, line by line in a pipe."""

import contextlib
import shutil
import time
from collections import deque
from collections.abc import Callable, Sequence
from typing import TextIO

from vsensor.apps.bus_watch import BusWatch
from vsensor.apps.monitor_text import change_text, fitted, one_line, screen
from vsensor.bus import open_bus
from vsensor.profile import Profile
from vsensor.sinks.table_view import InPlace

LISTEN_S = 0.01
"""A busy bus of 1 Mbit/s has 80 frames then; a socket holds some thousand."""
REDRAW_S = 0.1
LINE_S = 1.0
CHANGES_KEPT = 5


def monitor_bus(
    specification: str,
    profiles: Sequence[Profile],
    output: TextIO,
    *,
    duration_s: float | None = None,
    every_s: float | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> BusWatch:
    """Show a bus until `duration_s` is over or `stopped` says so; sends nothing. Raises BusError.

    `every_s`: how often it is drawn (10 times a second), or a line is written (every second).
    """
    is_fd = any(plan.layout.is_fd for profile in profiles for plan in profile.messages)
    names = ", ".join(profile.name for profile in profiles)
    watch = BusWatch(profiles)
    stopped()  # from here on Ctrl-C is a question
    with contextlib.ExitStack() as open_things:
        bus = open_things.enter_context(open_bus(specification, fd=is_fd))
        bus.drain()  # what waited before is not of this time
        start_ns = time.monotonic_ns()
        title = f"{bus.name}   profile {names}"
        show: _Screen | _Lines
        if output.isatty():
            drawn = open_things.enter_context(InPlace(output))
            show = _Screen(watch, title, start_ns, drawn)
        else:
            show = _Lines(watch, title, start_ns, output)
        bus.tell(show.tell)
        period_ns = round((every_s or show.every_s) * 1e9)
        due_ns = start_ns + period_ns
        end_ns = None if duration_s is None else start_ns + round(duration_s * 1e9)
        while not stopped() and (end_ns is None or time.monotonic_ns() < end_ns):
            time.sleep(LISTEN_S)
            watch.take(bus.drain())
            if time.monotonic_ns() >= due_ns:
                show.at(time.monotonic_ns())
                due_ns += period_ns * (1 + (time.monotonic_ns() - due_ns) // period_ns)
        watch.take(bus.drain())
        show.end(time.monotonic_ns(), bus.report())
    return watch


class _Screen:
    """Draws all tables in place, the latest changes below."""

    every_s = REDRAW_S

    def __init__(self, watch: BusWatch, title: str, start_ns: int, drawn: InPlace) -> None:
        self._watch, self._title, self._start_ns, self._drawn = watch, title, start_ns, drawn
        self._said: deque[str] = deque(maxlen=CHANGES_KEPT)

    def tell(self, text: str) -> None:
        """Keep what the bus says of itself."""
        self._said.append(text)

    def at(self, now_ns: int) -> None:
        """Draw what is known now, as much as the terminal has room for."""
        size = shutil.get_terminal_size()
        self._said += [change_text(change, self._start_ns) for change in self._watch.looked(now_ns)]
        text = screen(
            self._watch, self._title, self._start_ns, now_ns, said=tuple(self._said), width=size.columns
        )
        self._drawn.show(fitted(text, size.lines))

    def end(self, now_ns: int, report: Sequence[str]) -> None:
        """Draw for the last time."""
        self._said += report
        self.at(now_ns)


class _Lines:
    """Writes a line every so often, and one for each change between; all tables at the end."""

    every_s = LINE_S

    def __init__(self, watch: BusWatch, title: str, start_ns: int, output: TextIO) -> None:
        self._watch, self._title, self._start_ns, self._output = watch, title, start_ns, output

    def tell(self, text: str) -> None:
        """Write what the bus says of itself."""
        self._write([text])

    def at(self, now_ns: int) -> None:
        """Write what is known now."""
        changes = [change_text(change, self._start_ns) for change in self._watch.looked(now_ns)]
        self._write([*changes, one_line(self._watch, self._start_ns, now_ns)])

    def end(self, now_ns: int, report: Sequence[str]) -> None:
        """Write all there is."""
        self.at(now_ns)
        self._write(["", *screen(self._watch, self._title, self._start_ns, now_ns), *report])

    def _write(self, lines: Sequence[str]) -> None:
        self._output.write("".join(f"{line}\n" for line in lines))
        self._output.flush()

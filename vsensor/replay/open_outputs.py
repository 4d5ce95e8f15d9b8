"""Opens the buses of a replay; what cannot be sent is told before anything is."""

import contextlib
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from vsensor.bus import FrameBus, open_bus
from vsensor.errors import BusError, ConfigError
from vsensor.logs import Columns
from vsensor.logs.table import ERROR, FD
from vsensor.replay.choice import Choice
from vsensor.replay.options import ReplayOptions, mapping
from vsensor.replay.outputs import Outputs
from vsensor.replay.reading import SURVEY, Survey

if TYPE_CHECKING:
    from vsensor.replay.overlay import Overlay


def open_outputs(
    options: ReplayOptions,
    head: Survey,
    chosen: Choice,
    stack: contextlib.ExitStack,
    overlay: "Overlay | None" = None,
    *,
    adds_fd: bool = False,
) -> Outputs:
    """Open the buses, closed with `stack`; raises BusError or ConfigError for what they cannot send.

    `adds_fd`: CAN FD frames are sent that are not in the log.

    Judged by the beginning of the log; what comes later and cannot be sent is left out and counted.
    """
    _require_chosen(options, head, chosen)
    buses = mapping(options.map)
    rest = options.bus if options.bus or buses or options.fast else "auto"
    columns = head.columns.taken(chosen.mask(head.columns, head.channels))
    columns = columns.taken((columns.flags & ERROR) == 0)
    if not options.skip_unsendable:
        _require_channels(options, head, buses, rest, columns)
    wants_fd = _wanting_fd(head.channels, buses, rest, columns)
    if overlay is not None and overlay.synth.line.is_fd:
        name = next(name for name, number in head.channels.items() if number == overlay.lay.channel)
        wants_fd.add(buses.get(name, rest or ""))
    if adds_fd:
        wants_fd |= {name for name in {*buses.values(), rest} if name}
    opened = {name: _open(name, name in wants_fd, options, stack) for name in {*buses.values(), rest} if name}
    return Outputs(
        head.channels,
        by_name={channel: opened[name][0] for channel, name in buses.items()},
        rest=opened[rest][0] if rest else None,
        fd=frozenset(bus.name for bus, is_fd in opened.values() if is_fd),
    )


def _require_chosen(options: ReplayOptions, head: Survey, chosen: Choice) -> None:
    """Refuse a channel that is chosen and that a log, seen whole, has not: it would play all, or nothing."""
    include = chosen.include.channels if chosen.include is not None else frozenset[str]()
    for option, names in (("--include", include), ("--exclude", chosen.exclude.channels)):
        unknown = sorted(names - head.channels.keys())
        if unknown and len(head.columns.t_ns) < SURVEY:
            has = f"{options.path} has the channels {', '.join(head.channels)}"
            raise ConfigError(f"{option} channel:{unknown[0]}: no such channel; {has}")


def _require_channels(
    options: ReplayOptions, head: Survey, buses: Mapping[str, str], rest: str | None, columns: Columns
) -> None:
    there = [name for name, number in head.channels.items() if (columns.channel == number).any()]
    has = f"{options.path} has the channels {', '.join(head.channels)}"
    unknown = [name for name in buses if name not in head.channels]
    if unknown and len(head.columns.t_ns) < SURVEY:
        raise ConfigError(f"--map {unknown[0]}={buses[unknown[0]]}: no such channel; {has}")
    lost = [name for name in there if name not in buses]
    if lost and buses and rest is None:
        raise ConfigError(
            f"{options.path}: channel {lost[0]} has no bus: --map {lost[0]}=INTERFACE:CHANNEL, --bus for all "
            f"others, --exclude channel:{lost[0]}, or --skip-unsendable"
        )


def _wanting_fd(
    channels: Mapping[str, int], buses: Mapping[str, str], rest: str | None, columns: Columns
) -> set[str]:
    """Return the buses that CAN FD frames go to."""
    numbers = set(np.unique(columns.channel[(columns.flags & FD) != 0]).tolist())
    return {buses.get(name, rest or "") for name, number in channels.items() if number in numbers}


def _open(
    name: str, wants_fd: bool, options: ReplayOptions, stack: contextlib.ExitStack
) -> tuple[FrameBus, bool]:
    """Return an open bus and whether it carries CAN FD."""
    try:
        bus = open_bus(name, fd=wants_fd, echo=False)
    except BusError as error:
        if not wants_fd or not options.skip_unsendable:
            more = (
                f"; {options.path} has CAN FD frames: --skip-unsendable leaves them out" if wants_fd else ""
            )
            raise BusError(f"{error}{more}") from None
        wants_fd, bus = False, open_bus(name, echo=False)
    stack.callback(bus.close)
    if options.fast and not bus.is_simulated:
        raise BusError(
            f"bus {name}: --as-fast-as-possible would flood a real bus; use it with vcan or virtual only"
        )
    return bus, wants_fd or bus.name.startswith("virtual:")

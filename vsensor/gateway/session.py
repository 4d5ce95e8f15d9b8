"""`vsensor gateway`: two buses, a scenario's sensor in a process of its own, and the loop between them."""

import contextlib
import os
import select
import time
from collections.abc import Callable
from dataclasses import dataclass

from vsensor.bus import FrameBus, open_bus
from vsensor.clock import MonotonicClock
from vsensor.config import load_scenario
from vsensor.errors import BusError, ConfigError
from vsensor.gateway.loop import Gateway, Sensor, Ways
from vsensor.overlay import Elsewhere, Synth, Wish, camera_keys, heard_keys, synth_of
from vsensor.realtime import calm_collector, real_time_priority

Say = Callable[[str], None]

REST_NS = 20_000_000
"""A longer sleep is cut, so that Ctrl-C is heard."""
POLL_NS = 500_000
"""How long a bus that cannot say when a frame arrives is left alone."""
START_UP_NS = 50_000_000
WARM_IMAGES = 10
STAND_BACK = 5
"""Where there is one processor, frames go before images: beside other load their latency had a p50 of 28 ms,
not 170, on the vcan of user-mode Linux."""


@dataclass(frozen=True, slots=True, kw_only=True)
class GatewayOptions:
    """What the command line says: buses are INTERFACE:CHANNEL, or the name of a SocketCAN interface."""

    near: str
    far: str
    overlay: str
    both_ways: bool = False
    duration_s: float | None = None
    realtime: bool = False


def run_gateway(
    options: GatewayOptions, say: Say, stopped: Callable[[], bool] = lambda: False
) -> tuple[Ways, list[str]]:
    """Pass frames on until `stopped()` or for the duration; returns what was done, and its summary.

    Raises VsensorError subclasses.
    """
    near_name, far_name = _bus_name(options.near), _bus_name(options.far)
    if near_name == far_name:
        raise ConfigError(f"--in {options.near}, --out {options.far}: two different buses were expected")
    synth = synth_of(load_scenario(options.overlay))
    with contextlib.ExitStack() as stack:
        desk = Elsewhere(synth, nice=STAND_BACK if len(os.sched_getaffinity(0)) == 1 else 0)
        stack.callback(desk.close)
        near = _opened(near_name, synth, say, stack)
        far = _opened(far_name, synth, say, stack)
        for text in (*synth.source.notes, *synth.source.findings):
            say(text)
        _warm_up(desk)
        if options.realtime:
            stack.enter_context(real_time_priority(say))
        look_for_garbage = stack.enter_context(calm_collector())
        clock = MonotonicClock(spin_ns=0)
        for bus in (near, far):
            bus.drain()  # what came while we loaded is old
        both = ", and back" if options.both_ways else ""
        say(f"passing {near.name} -> {far.name}{both}, profile {synth.line.profile.name} replaced")
        start_ns = clock.now_ns() + START_UP_NS
        sensor = Sensor(period_ns=synth.period_ns, keys=camera_keys(synth.line), heard=heard_keys(synth))
        gateway = Gateway(
            near, far, desk, sensor, clock, _waiting(near, far, desk),
            start_ns=start_ns, both_ways=options.both_ways,
        )  # fmt: skip
        end_ns = None if options.duration_s is None else start_ns + round(options.duration_s * 1e9)
        images = 0
        while not stopped() and (end_ns is None or clock.now_ns() < end_ns):
            gateway.advance()
            if gateway.ways.images != images:
                images = gateway.ways.images
                look_for_garbage(images)
        remarks = desk.remarks()
    summary = [*gateway.ways.lines((near.name, far.name)), *remarks]
    return gateway.ways, [*summary, *(line for bus in (near, far) for line in bus.report())]


def _bus_name(text: str) -> str:
    """Return INTERFACE:CHANNEL; a name alone is a SocketCAN interface."""
    return text if ":" in text else f"socketcan:{text}"


def _opened(name: str, synth: Synth, say: Say, stack: contextlib.ExitStack) -> FrameBus:
    """Open a bus for CAN FD, or for classic frames where it has no other and none are sent."""
    try:
        bus = open_bus(name, fd=True, echo=False)
    except BusError:
        bus = open_bus(name, fd=synth.line.is_fd, echo=False)
    stack.callback(bus.close)
    bus.tell(say)
    return bus


def _warm_up(desk: Elsewhere) -> None:
    """Let a few images be computed and thrown away: they import what no slot should wait for."""
    for number in range(WARM_IMAGES):
        desk.ask(Wish(number))
        desk.answer()
    desk.rewind(0)


def _waiting(near: FrameBus, far: FrameBus, desk: Elsewhere) -> Callable[[int], tuple[bool, bool]]:
    """Return what sleeps until a time, or until a bus or the desk has something."""

    def wait(until_ns: int) -> tuple[bool, bool]:
        places = (near.fileno(), far.fileno())
        left_ns = max(0, min(until_ns - time.monotonic_ns(), REST_NS))
        if min(places) < 0:  # a virtual bus, or an adapter that can only be asked
            left_ns = min(left_ns, POLL_NS)
        asked = [place for place in (*places, desk.fileno()) if place >= 0]
        readable = select.select(asked, [], [], left_ns * 1e-9)[0]
        return places[0] < 0 or places[0] in readable, places[1] < 0 or places[1] in readable

    return wait

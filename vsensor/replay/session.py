"""`vsensor replay`: a log, buses, a recording, keys and a clock put together."""

import contextlib
import os
import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from vsensor.clock import Clock, MonotonicClock, SimulatedClock, epoch_offset_ns
from vsensor.errors import ConfigError
from vsensor.logs import LogWriter, open_log_writer
from vsensor.realtime import calm_collector, real_time_priority
from vsensor.replay.changes import changes_of
from vsensor.replay.choice import EXTENDED_KEY, choice, key
from vsensor.replay.keys import HELP
from vsensor.replay.open_outputs import open_outputs
from vsensor.replay.options import ReplayOptions, epoch_ns
from vsensor.replay.outputs import Outputs
from vsensor.replay.plan import cut_of, databases_of, loaded, names_of, reel_of, require_sense, rhythm
from vsensor.replay.player import REST_NS, Player, played
from vsensor.replay.reading import Cut, Survey, survey
from vsensor.replay.reel import Reel
from vsensor.replay.report import Report
from vsensor.replay.stages import Stage
from vsensor.types import Frame

if TYPE_CHECKING:  # loaded where they are asked for: a third of the time to the first frame
    from vsensor.replay.overlay import Overlay

Say = Callable[[str], None]
Keys = Callable[[], list[str]]

SPIN_NS = 60_000
"""Of every wait: a wake-up is some 60 us late. More would never sleep on a full bus (125 us a frame), and the
kernel takes the processor away for 50 ms each second from a real-time process that does not."""
START_UP_NS = 20_000_000  # from the end of loading to the first frame
POLL_S = 0.001
JUMP_S = 5.0  # of an arrow key
LONG_WAIT_S, DAY_S = 10.0, 86_400.0
BEHIND_NS = 1_000_000_000


def replay_log(
    options: ReplayOptions,
    say: Say,
    stopped: Callable[[], bool] = lambda: False,
    *,
    stages: Sequence[Stage] = (),
    keys: Keys | None = None,
) -> Report:
    """Play a log to its end or until `stopped()`; raises VsensorError subclasses.

    A log with a fault is played up to it; `fault` of the report tells.
    """
    require_sense(options)
    databases = databases_of(options)
    changes = changes_of(options)
    databases += loaded(profile.database for profile in changes.profiles)
    stages = (*stages, *changes.stages)
    head = survey(options.path, options.rate_hz)
    chosen = choice(options.include, options.exclude, options.rename, names_of(databases))
    with contextlib.ExitStack() as stack:
        cut = cut_of(options, head, databases)
        overlay = _overlay(options, head, cut, say, stack)
        if overlay is None:
            cut = replace(cut, beat=rhythm(changes.profiles, head, chosen))
        outputs = open_outputs(options, head, chosen, stack, overlay, adds_fd=changes.adds_fd)
        sendable = outputs.sendable if overlay is None else overlay.without_camera(outputs.sendable, chosen)
        reel = reel_of(options, head, chosen, cut, sendable)
        sending = outputs if overlay is None else overlay.listening(outputs)
        clock = _clock(options)
        record = _recording(options, head, stack)
        player = Player(
            reel if overlay is None else overlay.laid_over(reel),
            sending,
            clock,
            stages=stages,
            record=record,
            real_time=not options.fast,
            origin_ns=0,
        )
        if overlay is not None:
            overlay.played_by(player)
        _say_start(options, outputs, say, keys)
        if options.realtime:
            stack.enter_context(real_time_priority(say))
        stack.enter_context(calm_collector())
        if _wait(options, outputs, player, clock, stopped, keys):
            _play(player, stopped, keys, say)
        player.report.interrupted = stopped()
        if overlay is not None:
            player.report.notes += overlay.lines()
    report = _judged(options, player, reel, outputs)
    for stage, state in zip(stages, player.states, strict=True):
        report.notes += stage.told(state) if stage.told is not None else ()
    return report


def _clock(options: ReplayOptions) -> Clock:
    """Return the clock; where there is one processor it never spins, which would keep who listens waiting."""
    if options.fast:
        return SimulatedClock()
    return MonotonicClock(spin_ns=SPIN_NS if len(os.sched_getaffinity(0)) > 1 else 0)


def _overlay(
    options: ReplayOptions, head: Survey, cut: Cut, say: Say, stack: contextlib.ExitStack
) -> "Overlay | None":
    if options.overlay is None:
        return None
    from vsensor.replay.overlay import open_overlay

    return open_overlay(options.overlay, options, head, cut, say, stack)


def _recording(
    options: ReplayOptions, head: Survey, stack: contextlib.ExitStack
) -> Callable[..., None] | None:
    """Open the recording; its times are those at which the frames were due, by the wall clock."""
    if options.log is None:
        return None
    channels = head.channels
    writer: LogWriter = stack.enter_context(open_log_writer(options.log, tuple(channels)))
    wall_ns = epoch_offset_ns() + (time.monotonic_ns() if options.fast else 0)
    named = len(channels)

    def record(frame: Frame, origin_ns: int) -> None:
        nonlocal named
        if len(channels) != named:  # one turned up since
            named = len(channels)
            writer.name_channels(tuple(channels))
        writer.write(frame, wall_ns + origin_ns)

    return record


def _say_start(options: ReplayOptions, outputs: Outputs, say: Say, keys: Keys | None) -> None:
    names = ", ".join(bus.name for bus in outputs.buses) or "no bus"
    say(f"playing {options.path} on {names}")
    for bus in outputs.buses:
        bus.tell(say)
        if bus.remark:
            say(bus.remark)
    if keys is not None:
        say(HELP)


def _wait(
    options: ReplayOptions,
    outputs: Outputs,
    player: Player,
    clock: Clock,
    stopped: Callable[[], bool],
    keys: Keys | None,
) -> bool:
    """Wait for the frame that starts the replay, or set the time that does; returns whether to play."""
    player.origin_ns = clock.now_ns() + START_UP_NS
    if options.start_at is not None:
        player.origin_ns = epoch_ns("--start-at", options.start_at) - epoch_offset_ns()
        if player.origin_ns < clock.now_ns():
            raise ConfigError(f"--start-at {options.start_at}: has passed")
    if options.wait_for is None:
        return True
    wanted = key("--wait-for", options.wait_for)
    outputs.drain()
    while not stopped() and (keys is None or "q" not in keys()):
        if any(f.arbitration_id | EXTENDED_KEY * f.is_extended == wanted for f in outputs.drain()):
            player.origin_ns = clock.now_ns()
            return True
        time.sleep(POLL_S)
    return False


def _play(player: Player, stopped: Callable[[], bool], keys: Keys | None, say: Say) -> None:
    began_s = time.monotonic()
    ended: list[bool] = []  # by the key q, which is no interruption
    looked_ns, told_ns, behind_ns = 0, -1, BEHIND_NS
    for _ in played(player, lambda: bool(ended) or stopped()):
        if player.now_ns - looked_ns < REST_NS:
            continue
        looked_ns = player.now_ns
        if player.report.real_time and looked_ns > told_ns and player.wait_s > LONG_WAIT_S:
            told_ns = looked_ns + round(player.wait_s * 1e9)
            say(_silence(player))
        if player.report.last_late_ns > behind_ns:
            behind_ns = 10 * player.report.last_late_ns
            late_s = player.report.last_late_ns / 1e9
            say(f"{late_s:.1f} s behind: frames are due faster than they can be sent here")
        for name in () if keys is None else keys():
            if name == "q":
                ended.append(True)
            _obey(player, name, say)
    player.report.wall_s = time.monotonic() - began_s


def _silence(player: Player) -> str:
    """Say for how long nothing will leave, and why."""
    wait = f"{player.wait_s:.0f} s" if player.wait_s < DAY_S else f"{player.wait_s / DAY_S:.0f} days"
    if not player.report.frames_sent:
        return f"the first frame leaves in {wait}"
    return f"no frame for {wait} from {player.position_s:.3f} s of the log on; --max-gap S cuts such gaps"


def _obey(player: Player, name: str, say: Say) -> None:
    """Do what a key says; others mean nothing."""
    if name == " " and player.paused:
        player.resume()
        say(f"going on at {player.position_s:.3f} s")
        return
    if name == " ":
        player.pause()
    elif name == "s":
        player.step()
    elif name in ("left", "right"):
        player.seek(max(0.0, player.position_s + (JUMP_S if name == "right" else -JUMP_S)))
    else:
        return
    say(f"{'held' if player.paused else 'playing'} at {player.position_s:.3f} s")


def _judged(options: ReplayOptions, player: Player, reel: Reel, outputs: Outputs) -> Report:
    report = player.report
    report.fault = reel.fault
    report.names = dict(reel.channels)
    report.notes += [*reel.findings(), *outputs.report()]
    if options.loops != 1:
        seam = (
            "in the rhythm of the images"
            if reel.is_in_step
            else f"{reel.seam_ns / 1e6:.3f} ms, the log's median interval"
        )
        report.notes.append(f"at each seam {seam}")
    if options.log is not None:
        report.notes.append(f"wrote {options.log}")
    return report

"""`vsensor replay`, `gateway`: frames of a log or of another bus, passed on."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

from vsensor.cli.adding import Commands, command, note
from vsensor.cli.values import hertz, loops, positive
from vsensor.stop import stop_signals

REPLAY_HELP = """\
Play a CAN log on its own times: onto one bus or several, a part of it, faster, in a loop.

  vsensor replay drive.log --bus socketcan:can0
  vsensor replay drive.blf --map 1=socketcan:can0 --map 2=socketcan:can1 --loop 0
  vsensor replay drive.mf4 --start 60 --stop 90 --speed 2 --exclude 0x320-0x32F
  vsensor replay drive.asc --dbc car.dbc --include ENGINE,0x123 --log played.blf
  vsensor replay drive.blf --bus socketcan:can0 --loop 0 --repair native --repair honda=honda.dbc
  vsensor replay drive.blf --bus socketcan:can0 --from honda=honda.dbc --as hyundai=hyundai.dbc
  vsensor replay drive.log --overlay drive.toml --log with_lanes.blf    a lane camera that was never there
  vsensor replay drive.log --overlay drive.toml --take-over 30 --bus socketcan:can0   the ECU steers then

On a terminal: space holds and goes on, arrows 5 s back and ahead, s one frame, q ends.
"""

GATEWAY_HELP = """\
Pass a running car's or bench's frames from one bus to another, and replace its lane camera by the sensor.

  vsensor gateway --in can0 --out can1 --overlay bench.toml
  vsensor gateway --in socketcan:can0 --out pcan:PCAN_USBBUS1 --overlay bench.toml --both-ways

The scenario drives on a map; with [ego] control = "motion", "pose" or "steering" the frames that are passed
on (and those heard on --out) move its vehicle. Frames with the ids of its profile are not passed on. The
summary has the latency from the receive time to after sending.
"""

_REPEATED = ("map", "include", "exclude", "rename", "dbc", "profile", "repair")

_SINGLE = (
    *("path", "bus", "speed", "fast", "start", "stop", "loops", "max_gap_s", "smooth", "rate_hz"),
    *("wait_for", "start_at", "skip_unsendable", "overlay", "take_over", "log", "realtime", "keep_wrong"),
    *("source", "target", "camera_x_m", "wheelbase_m"),
)


def replay(arguments: argparse.Namespace) -> int:
    """`vsensor replay`: a log on its own times."""
    with stop_signals() as stopped:
        return _replay(arguments, stopped)


def _replay(arguments: argparse.Namespace, stopped: Callable[[], bool]) -> int:
    from vsensor.errors import LogError
    from vsensor.replay import ReplayOptions, replay_log
    from vsensor.replay.keys import terminal_keys

    given: dict[str, Any] = {key: getattr(arguments, key) for key in _SINGLE}
    given |= {key: tuple(getattr(arguments, key) or ()) for key in _REPEATED}
    options = ReplayOptions(**given)
    with terminal_keys(None if not arguments.quiet else -1) as keys:
        report = replay_log(options, say=note, stopped=stopped, keys=keys)
    print(report.text())
    if report.fault is not None:
        raise LogError(report.fault)
    return 130 if report.interrupted else 0


def gateway(arguments: argparse.Namespace) -> int:
    """`vsensor gateway`: frames passed on, the camera's replaced."""
    from vsensor.gateway import GatewayOptions, run_gateway

    options = GatewayOptions(
        near=arguments.near,
        far=arguments.far,
        overlay=arguments.overlay,
        both_ways=arguments.both_ways,
        duration_s=arguments.duration,
        realtime=arguments.realtime,
    )
    with stop_signals() as stopped:
        summary = run_gateway(options, note, stopped)[1]
        print("\n".join(summary))
        return 130 if stopped() else 0


def add_replay(commands: Commands) -> None:
    """Add `vsensor replay`."""
    added = command(commands, "replay", replay, REPLAY_HELP)
    option = added.add_argument
    option("path", type=Path, metavar="LOG", help="CAN log: .log .asc .blf .mf4 .trc .csv, also gzipped")
    option(
        "--bus", metavar="INTERFACE:CHANNEL", help="python-can bus of every channel that --map does not name"
    )
    option("--map", action="append", metavar="CHANNEL=BUS", help="bus of a channel of the log; repeatable")
    option("--speed", default="1", metavar="X", help="0.1 to 100 times as fast (1)")
    option(
        "--as-fast-as-possible",
        action="store_true",
        dest="fast",
        help="without waiting; on vcan, virtual or --log",
    )
    option(
        "--start", metavar="TIME", help="s from the log's first frame, or a time: ISO (UTC) or s since 1970"
    )
    option("--stop", metavar="TIME", help="likewise; the first frame that is not sent")
    option("--loop", type=loops, default=1, dest="loops", metavar="N", help="play it N times, 0 for ever (1)")
    option("--max-gap", type=positive, dest="max_gap_s", metavar="S", help="cut longer gaps to S seconds")
    option("--smooth", action="store_true", help="spread frames stamped in batches by their cycle times")
    option("--rate", type=hertz, dest="rate_hz", metavar="HZ", help="frames per s, for a log without times")
    what = "0x123, 0x100-0x1FF, channel:NAME, with --dbc a message or sender; repeatable, or with commas"
    option("--include", action="append", metavar="WHAT", help=f"play only {what}")
    option("--exclude", action="append", metavar="WHAT", help="leave out, said in the same way")
    option("--rename", action="append", metavar="OLD=NEW", help="send an id as another, 0x123=0x456")
    option("--dbc", action="append", type=Path, metavar="FILE", help="names and cycle times; repeatable")
    option("--profile", action="append", metavar="NAME", help="those of a profile's database; repeatable")
    option(
        "--repair",
        action="append",
        metavar="PROFILE[=DBC]",
        help="fresh counters, checksums, image indices and times on this profile's frames; repeatable",
    )
    option("--keep-wrong", action="store_true", help="frames that are wrong in the log stay so in --repair")
    option(
        "--from", dest="source", metavar="PROFILE[=DBC]", help="of the log's lane frames, which --as replaces"
    )
    option("--as", dest="target", metavar="PROFILE[=DBC]", help="send their lanes as this profile's frames")
    option(
        "--camera-x", type=float, dest="camera_x_m", metavar="M", help="camera ahead of the rear axle (1.9)"
    )
    option("--wheelbase", type=positive, dest="wheelbase_m", metavar="M", help="for --as (2.8)")
    option("--wait-for", metavar="ID", help="begin when a frame 0x123 is heard on the bus")
    option("--start-at", metavar="TIME", help="begin at a wall clock time, ISO (UTC) or s since 1970")
    option("--skip-unsendable", action="store_true", help="leave out and count what its bus cannot carry")
    option("--overlay", metavar="SCENARIO", help="lay this scenario's lane sensor over the log, in its place")
    option("--take-over", metavar="TIME", help="from then on an ECU on the bus steers (with --overlay)")
    option("--log", type=Path, metavar="FILE", help="write what was sent: .log .asc .blf .mf4")
    option("--realtime", action="store_true", help="real-time priority and locked memory, where allowed")
    option("--quiet", action="store_true", help="no keys")


def add_gateway(commands: Commands) -> None:
    """Add `vsensor gateway`."""
    added = command(commands, "gateway", gateway, GATEWAY_HELP)
    option = added.add_argument
    bus = "INTERFACE:CHANNEL, or a SocketCAN interface such as can0"
    option("--in", dest="near", required=True, metavar="BUS", help=f"where car or bench are: {bus}")
    option("--out", dest="far", required=True, metavar="BUS", help=f"where the ECU is: {bus}")
    option("--overlay", required=True, metavar="SCENARIO", help="whose sensor replaces the camera")
    option("--both-ways", action="store_true", help="pass what the ECU's side sends back to --in, too")
    option("--duration", type=positive, metavar="S", help="end after S seconds; without it Ctrl-C does")
    option("--realtime", action="store_true", help="real-time priority and locked memory, where allowed")

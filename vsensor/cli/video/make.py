"""`vsensor video make`: made events, with the truth beside."""

import argparse
from pathlib import Path

from vsensor.cli.adding import Commands, command, note, shows_progress
from vsensor.cli.values import count, positive, seed

MAKE_HELP = """\
Make videos of drives with the exact truth and the CAN log of each: something to judge a method by.

  vsensor video make events --kind eor --events 100
  vsensor video make events --kind lytx --events 20 --seed 7

Each event is a folder: video.avi (without loss), can.blf (profile p2, from the vehicle's own lane sensor with
its errors), truth.parquet (a row per frame, columns as of `vsensor video run`), event.toml, camera.toml, and
what it was made from (drive.toml, road).

--kind   eor   356 x 288 grey, 10 Hz, 1.36 m up, 0.19 m to the left: Eyes on Road, P2 tables 2.1 to 2.3
         lytx  620 x 352 colour, 4 Hz, mounted differently in each: P2 tables 2.5, 2.6

Motorways, country roads, towns with crosswalks, the shipped track and motorway, by day, dusk and night, in
turn; rain, worn paint, gaps up to 150 m, borders without paint, old lines, hills, bumps, traffic as the seed
draws them. Halfway through, the vehicle comes near to a marking, as in P2's events.

Confidence 4 in the truth: the video shows paint of the line in the first 20 m ahead of the front axle; 1:
only up to 60 m; 0: none, and then there is no offset either.

An event that is there is kept: after Ctrl-C the same command goes on. 31 s take 6 to 9 s of a core and 15 to
20 MB (lytx up to 55 MB).
"""


def make(arguments: argparse.Namespace) -> int:
    """`vsensor video make`: made events."""
    from vsensor.video.made import MakeOptions, make_events

    report = make_events(
        MakeOptions(
            out=arguments.out,
            kind=arguments.kind,
            events=arguments.events,
            seed=arguments.seed,
            duration_s=arguments.duration,
            workers=arguments.workers,
            scheduler=arguments.scheduler,
            progress=shows_progress(arguments),
        )
    )
    print("\n".join(report.lines))
    for line in report.failures:
        note(line)
    return report.status


def add_make(commands: Commands) -> None:
    """Add `vsensor video make`."""
    added = command(commands, "make", make, MAKE_HELP)
    added.add_argument("out", type=Path, metavar="DIR", help="folder of the events")
    added.add_argument("--kind", default="eor", metavar="KIND", help="eor or lytx (eor)")
    added.add_argument("--events", type=count, default=10, metavar="N", help="how many (10)")
    added.add_argument("--seed", type=seed, default=1, metavar="S", help="of what is drawn (1)")
    added.add_argument("--duration", type=positive, default=31.0, metavar="S", help="of each (31, as P2's)")
    added.add_argument("--workers", type=count, metavar="N", help="processes (all cores)")
    added.add_argument("--scheduler", metavar="ADDRESS", help="a Dask cluster instead: tcp://HOST:8786")
    added.add_argument("--quiet", action="store_true", help="no progress bar")

"""Made events: videos drawn by the image model over roads, exact truth and CAN log of the same drive.

kinds               roads, drives              event                     make
eor, lytx: camera,  one event's road and   ──► a folder: video, CAN  ──► many of them, in parallel,
rate, channels      drive, drawn by seed       log, truth, event.toml    resumable
"""

from vsensor.video.made.kinds import KINDS, Kind
from vsensor.video.made.make import MakeOptions, MakeReport, make_events

__all__ = ["KINDS", "Kind", "MakeOptions", "MakeReport", "make_events"]

"""Repair: fresh counters, checksums, image indices and milliseconds on the frames of a replay."""

from vsensor.replay.repair.stage import Repair, RepairState, repaired

__all__ = ["Repair", "RepairState", "repaired"]

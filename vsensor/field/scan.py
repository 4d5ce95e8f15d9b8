"""`vsensor scan`: recorded drives into a table of errors, one log at a time (P1 2.3, expedition log scanner).

log --decode--> images, motion --reference, masks--> rows --> TABLE/<log id>.parquet
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.errors import LogError
from vsensor.field.config import ScanLimits, load_scan_limits
from vsensor.field.images import Images, images_of, line_profile
from vsensor.field.line_file import FileReference
from vsensor.field.masks import begins_of, image_masks, resets_of, slow_images
from vsensor.field.motion import Motion, motion_of, with_steady_clock
from vsensor.field.on_map import MapReference
from vsensor.field.reference import PathReference, Poses, Reference, need_poses, poses_in_log
from vsensor.field.rows import Work, course_of, lane_width_m, rows_of
from vsensor.field.table import MASKS, Info, Masked, Rows, write_table
from vsensor.logs import read_log
from vsensor.logs.decode import DecodedFrames, decode_frames
from vsensor.profile import Profile, load_profiles
from vsensor.types import NANOSECONDS_PER_SECOND, SIDE_NAMES, Array, BoolArray, IntArray, Side

RANGE_LEVELS = (0.05, 0.5, 0.95)


@dataclass(frozen=True, slots=True, kw_only=True)
class ScanOptions:
    """What the command line says; paths as text, so that a worker anywhere reads the same.

    `reference`: "gta", a map (.xodr) or a line (.csv, .parquet; a folder has one for each log id).
    """

    profiles: tuple[str, ...] = ("native", "vehicle")
    dbc: str | None = None
    reference: str = "gta"
    route: tuple[str, ...] = ()
    ranges_m: tuple[float, float, float] = (1.0, 2.0, 100.0)
    all_sides: bool = False
    beyond_range: bool = False
    limits: str | None = None
    plots: str | None = None

    def ranges(self) -> Array:
        """Return the ranges (R,)."""
        first, step, last = self.ranges_m
        ranges: Array = first + step * np.arange(int((last - first) / step + 1e-9) + 1, dtype=np.float64)
        return ranges

    def sides(self) -> tuple[Side, ...]:
        """Return the sides that are scanned."""
        return tuple(Side) if self.all_sides else (Side.LEFT, Side.RIGHT)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scanned:
    """A log ready to be made into rows, what was decoded of it, and what is known of it so far."""

    work: Work
    frames: DecodedFrames
    profiles: tuple[Profile, ...]
    info: Info
    notes: tuple[str, ...]


def scan_log(log: Path, log_id: str, out: Path, options: ScanOptions) -> Info:
    """Write the table file of one log; returns what its metadata says.

    Raises VsensorError subclasses; then no file is written, and one that was there stays.
    """
    scanned = prepare(log, log_id, options)
    info = scanned.info
    counts = np.zeros(len(MASKS), dtype=np.int64)

    def counted() -> Any:
        for rows in rows_of(scanned.work):
            counts.__iadd__(np.bincount(rows["masked"], minlength=len(MASKS)))
            info["masked"] = _named(counts)
            yield rows
        if not counts[MASKS.index(Masked.USED)]:
            reasons = ", ".join(f"{name} {count}" for name, count in info.get("masked", {}).items())
            info["notes"].append(f"none of its rows can be used: {reasons}")

    if options.plots is not None:
        from vsensor.field.scan_plot import draw_log

        draw_log(out / f"{log_id}.{options.plots}", scanned.work, info)
    write_table(out / f"{log_id}.parquet", log_id, counted(), info)
    return info


def prepare(
    log: Path, log_id: str, options: ScanOptions, progress: Callable[[int], None] | None = None
) -> Scanned:
    """Read a log and lay its reference; raises as scan_log. `progress` is told how many bytes are read."""
    limits = load_scan_limits(None if options.limits is None else Path(options.limits))
    profiles = load_profiles(options.profiles, None if options.dbc is None else Path(options.dbc))
    profile = line_profile(profiles, str(log))
    table, jumps_ns, clock_notes = with_steady_clock(read_log(log, progress))
    frames = decode_frames(table, profiles)
    images = images_of(frames, profile, limits, options.sides(), str(log))
    if len(images) < 2:
        raise LogError(f"{log}: only {len(images)} image in which a line is told; at least 2 are needed")
    motion = motion_of(frames, profiles, images, limits, jumps_ns, str(log))
    work = _work(log, log_id, options, limits, frames, images, motion)
    notes = (*frames.findings[1:], *clock_notes, *images.notes, *motion.notes, *work.reference.notes)
    info = _info(log, log_id, options, profiles, work, notes)
    return Scanned(work=work, frames=frames, profiles=tuple(profiles), info=info, notes=notes)


def _work(
    log: Path,
    log_id: str,
    options: ScanOptions,
    limits: ScanLimits,
    frames: DecodedFrames,
    images: Images,
    motion: Motion,
) -> Work:
    resets = resets_of(images, motion, limits)
    slow = slow_images(images, motion.path.poses(images.t_ns).speed_mps, limits)
    return Work(
        images=images,
        motion=motion,
        reference=_reference(log, log_id, options, limits, frames, images, motion, ~resets & ~slow),
        codes={side: image_masks(images, side, resets, slow, limits) for side in images.lines},
        course=course_of(motion.path),
        width_m=lane_width_m(images),
        ranges_m=options.ranges(),
        beyond_range=options.beyond_range,
    )


def _reference(
    log: Path,
    log_id: str,
    options: ScanOptions,
    limits: ScanLimits,
    frames: DecodedFrames,
    images: Images,
    motion: Motion,
    usable: BoolArray,
) -> Reference:
    if options.reference == "gta":
        return PathReference(images, motion, usable, begins_of(images, motion, limits), limits)
    path = Path(options.reference)
    if path.suffix.lower() == ".xodr":
        poses = need_poses(frames, images.t_ns, limits.silence_s, str(log))
        return MapReference(path, poses, str(log), options.route)
    if path.is_dir():
        names = [path / f"{log_id}{suffix}" for suffix in (".csv", ".parquet")]
        found = next((name for name in names if name.is_file()), None)
        if found is None:
            raise LogError(f"{log}: no reference: neither {names[0]} nor {names[1].name} is there")
        path = found
    given = poses_in_log(frames, images.t_ns, limits.silence_s)
    if given is not None:
        return FileReference(path, given, ())
    here = motion.path.poses(images.t_ns)
    note = "no pose in the log: the reference line is taken from where the motion begins, by dead reckoning"
    return FileReference(path, Poses(x_m=here.x_m, y_m=here.y_m, yaw_rad=here.yaw_rad), (note,))


def _info(
    log: Path,
    log_id: str,
    options: ScanOptions,
    profiles: Sequence[Profile],
    work: Work,
    notes: tuple[str, ...],
) -> Info:
    """Return the metadata: where it comes from, how much it is, road width and ranges."""
    images = work.images
    return {
        "log": log_id,
        "version": _version(),
        "source": str(log),
        "profile": [profile.name for profile in profiles],
        "reference": work.reference.kind if options.reference == "gta" else options.reference,
        "images": len(images),
        "seconds": _seconds(images),
        "metres": float(work.motion.path.s_m[-1]),
        "images_lost": images.lost,
        "values_dropped": work.motion.dropped,
        "width_m": _quantiles(work.width_m),
        "sides": {SIDE_NAMES[side]: _side(images, side) for side in images.lines},
        "notes": list(notes),
    }


def _version() -> str:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return version("vsensor")
    except PackageNotFoundError:
        return "not installed"


def _seconds(images: Images) -> float:
    return int(images.t_ns[-1] - images.t_ns[0]) / NANOSECONDS_PER_SECOND


def _side(images: Images, side: Side) -> dict[str, Any]:
    line = images.lines[side]
    return {
        "reported": float(line.reported.mean()),
        "measured": float(line.measured.mean()),
        "x_max_m": _quantiles(line.x_max_m[line.reported]),
    }


def _quantiles(values: Array) -> list[float] | None:
    """Return the quantiles RANGE_LEVELS of what is known, None if nothing is."""
    known = values[np.isfinite(values)]
    return [round(float(q), 3) for q in np.quantile(known, RANGE_LEVELS)] if len(known) else None


def _named(counts: IntArray) -> dict[str, int]:
    return {str(mask) or "used": int(count) for mask, count in zip(MASKS, counts, strict=True) if count}


__all__ = ["Rows", "ScanOptions", "Scanned", "prepare", "scan_log"]

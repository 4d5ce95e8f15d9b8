"""`vsensor video mount`: a video in; a camera file with the pose that the road shows, a report out."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import islice
from pathlib import Path

import numpy as np

from vsensor.errors import ConfigError, LogError
from vsensor.profile import Profile
from vsensor.types import Array
from vsensor.video.camera_file import VideoCamera, camera_of, write_camera
from vsensor.video.can_motion import read_motions
from vsensor.video.frames import open_pictures
from vsensor.video.ground_speed import height_from_speed, with_height
from vsensor.video.mount import Found, find_mount, spread
from vsensor.video.mount_plot import SHOWN, draw_mount
from vsensor.video.types import Motion, Picture
from vsensor.video.value import Value

FAR_DEG = 4.5
"""What is found so far from what was given lies at the end of where it was looked for."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MountRun:
    """What `vsensor video mount` is asked to do; `begins_s`: when in the log's time the video began."""

    video: str
    camera: str | None
    out: Path
    rate_hz: float | None = None
    limit: int | None = None
    lane_width_m: float | None = None
    motion: Path | None = None
    profiles: Sequence[Profile] = ()
    begins_s: float = 0.0
    picture: Path | None = None
    progress: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class MountReport:
    """What to print, and what to say beside it."""

    lines: list[str]
    notes: list[str] = field(default_factory=list)


def mount_video(run: MountRun) -> MountReport:
    """Find the mount, write it; raises VideoError, ConfigError, LogError."""
    from tqdm import tqdm

    if run.picture is not None and run.picture.suffix not in (".png", ".svg", ".pdf"):
        raise ConfigError(f"{run.picture}: a picture ends in .png, .svg, .pdf")
    with open_pictures(run.video, run.rate_hz) as reader:
        camera, assumed = camera_of(run.camera, reader.size, run.video)
        notes, count = [*reader.notes, *([assumed] if assumed else [])], reader.count

    def pictures() -> Iterator[Picture]:
        with open_pictures(run.video, run.rate_hz) as again:
            yield from islice(again, run.limit)

    motions = None if run.motion is None else _motions(run, run.motion)
    total = min(count or run.limit or 0, run.limit or count or 0) or None
    with tqdm(total=total, unit="picture", leave=False, disable=not run.progress) as bar:
        found = find_mount(
            pictures, camera, run.video, lane_width_m=run.lane_width_m, motions=motions, tick=bar.update
        )
    if found.height_m is None and motions is not None:
        found = _with_height(found, pictures, motions)
    write_camera(run.out, found.camera, _comments(run, found))
    if run.picture is not None:
        draw_mount(run.picture, spread(pictures, SHOWN), camera, found)
    return MountReport(lines=_lines(run, camera, found), notes=[*notes, *_notes(run, camera, found)])


def _motions(run: MountRun, log: Path) -> Callable[[Array], Sequence[Motion]]:
    def at(t_s: Array) -> Sequence[Motion]:
        motions = read_motions(log, run.profiles, t_s + run.begins_s)
        if not any(np.isfinite(motion.speed_mps) for motion in motions):
            raise LogError(f"{log}: says nothing of ego.speed_mps during the video")
        return motions

    return at


def _with_height(
    found: Found, pictures: Callable[[], Iterator[Picture]], motions: Callable[[Array], Sequence[Motion]]
) -> Found:
    """Return the mount with the height that the speed tells, as it was where the road shows none."""
    t_s = np.array([picture.t_ns for picture in pictures()]) / 1e9
    height = height_from_speed(pictures(), found.camera, motions(t_s))
    if height is None:
        return found
    part = height.value / found.camera.config.position_m[2]
    width = Value(value=found.width_m.value * part, std=found.width_m.std * part)
    return replace(found, camera=with_height(found.camera, height.value), height_m=height, width_m=width)


def _comments(run: MountRun, found: Found) -> list[str]:
    told = (
        "as it was" if found.height_m is None else f"{found.height_m.value:.3f} +- {found.height_m.std:.3f} m"
    )
    return [
        f"Pose from {found.lanes} of {found.pictures} pictures of {Path(run.video).name}:",
        f"pitch +- {found.pitch_deg.std:.3f}, yaw +- {found.yaw_deg.std:.3f} deg, height {told}.",
    ]


def _lines(run: MountRun, before: VideoCamera, found: Found) -> list[str]:
    config = before.config
    height = found.height_m
    by = f"a lane {run.lane_width_m:g} m wide" if run.lane_width_m is not None else "the speed on CAN"
    lines = [
        f"{found.lanes} of {found.pictures} pictures show a lane",
        _line("pitch", found.pitch_deg, config.pitch_deg, "deg"),
        _line("yaw", found.yaw_deg, config.yaw_deg, "deg"),
    ]
    if height is not None:
        lines.append(f"{_line('height', height, config.position_m[2], 'm')}, from {by}")
    width = found.width_m
    lines.append(f"lane   {width.value:7.3f} +- {width.std:.3f} m between the centres of its markings")
    return [*lines, f"written: {run.out}"]


def _line(name: str, value: Value, before: float, unit: str) -> str:
    return f"{name:6} {value.value:7.3f} +- {value.std:.3f} {unit} (was {before:g})"


def _notes(run: MountRun, before: VideoCamera, found: Found) -> list[str]:
    notes = []
    if found.height_m is None and run.motion is None:
        notes.append(
            f"height stays {found.camera.config.position_m[2]:g} m: --lane-width M or --motion LOG tells it; "
            "all offsets are in proportion to it"
        )
    elif found.height_m is None:
        notes.append(
            f"height stays {found.camera.config.position_m[2]:g} m: nothing on the road comes nearer"
        )
    turned = (
        abs(found.pitch_deg.value - before.config.pitch_deg),
        abs(found.yaw_deg.value - before.config.yaw_deg),
    )
    if max(turned) > FAR_DEG:
        notes.append(f"far from what was given: run it again with --camera {run.out}")
    if found.lanes < 0.5 * found.pictures:
        notes.append(f"only {found.lanes} of {found.pictures} pictures show a lane")
    return notes

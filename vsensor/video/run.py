"""`vsensor video run`: a video through a method, into rows, CAN frames, a report.

video ─► pictures ─► method ─► estimates ─► rows ─► FILE, report
                       ^                └──► frames through a profile ─► log, bus (once all is seen)
CAN log ─► motion ─────┘
"""

import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from itertools import islice
from pathlib import Path

import msgspec
from tqdm import tqdm

from vsensor.bus import open_bus
from vsensor.camera import Camera
from vsensor.errors import ConfigError
from vsensor.pages import new_figure
from vsensor.profile import Profile, load_profile, load_profiles
from vsensor.run import RunOptions
from vsensor.study.table import replace_file
from vsensor.types import Environment, LaneEstimate
from vsensor.video.camera_file import VideoCamera, camera_of
from vsensor.video.can_motion import CanMotion
from vsensor.video.frames import PictureReader, open_pictures
from vsensor.video.methods import METHODS, Setup, believed, open_method, require_method, rows_by
from vsensor.video.report import report_page, shares
from vsensor.video.rows import Rows, require_place, require_writable, write_rows
from vsensor.video.sending import VideoDrive, send_video, tick_ns, video_line
from vsensor.video.settings import VideoConfig, read_settings
from vsensor.video.spread import Spread
from vsensor.video.steps import StepFolder, show_nothing
from vsensor.video.types import Motion, Picture

DEFAULT_PROFILE = "native"
MOTION_PROFILES = ("vehicle",)

Say = Callable[[str], None]


@dataclass(frozen=True, slots=True, kw_only=True)
class VideoRun:
    """What the command line says; `limit` pictures at most, `every` how many of them show their steps."""

    video: str
    method: str = "ours"
    camera: str | None = None
    settings: Path | None = None
    rate_hz: float | None = None
    limit: int | None = None
    motion: Path | None = None
    motion_profiles: tuple[str, ...] = MOTION_PROFILES
    motion_begins_s: float = 0.0
    fill: bool = False
    out: Path | None = None
    report: Path | None = None
    steps: Path | None = None
    every: int = 1
    log: Path | None = None
    bus: str | None = None
    profile: str | None = None
    dbc: Path | None = None
    progress: bool = False

    @property
    def sends(self) -> bool:
        """Whether CAN frames are wanted."""
        return self.log is not None or self.bus is not None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Looked:
    """What a method made of a video: an estimate and the motion of each picture, and how long it took.

    `setup` as the method had it; `spread` are some of the pictures; `notes` sentences for the user.
    """

    setup: Setup
    name: str
    rate_hz: float
    estimates: Sequence[LaneEstimate]
    motions: Sequence[Motion]
    spread: Sequence[Picture]
    wall_s: float
    notes: tuple[str, ...]


def run_video(options: VideoRun, say: Say, stopped: Callable[[], bool] = lambda: False) -> tuple[str, ...]:
    """Look at a video and write what was asked for; returns the lines for a person at the end.

    Stopped, it writes what it has seen until then. Raises VsensorError subclasses.
    """
    _require(options)
    looked = look_at(options, say, stopped)
    rows = rows_by(looked.name, looked.setup, looked.estimates)
    lines = [_looked_text(looked), *shares(rows), *looked.notes]
    if options.out is not None:
        write_rows(options.out, rows)
        lines.append(f"wrote {options.out}")
    if options.report is not None:
        _write_report(options.report, options, looked, rows)
        lines.append(f"wrote {options.report}")
    if options.sends and not stopped():
        lines += _send(options, looked, rows, say, stopped)
    if options.steps is not None:
        lines.append(f"wrote {options.steps}")
    return tuple(lines)


def _looked_text(looked: Looked) -> str:
    count, config = len(looked.estimates), looked.setup.camera.config
    return (
        f"{count} pictures of {config.width_px} x {config.height_px}, {looked.rate_hz:g} a second; method "
        f"{looked.name}, {count / max(looked.wall_s, 1e-9):.1f} pictures/s"
    )


def look_at(options: VideoRun, say: Say, stopped: Callable[[], bool] = lambda: False) -> Looked:
    """Let the method look at every picture; raises VsensorError subclasses."""
    settings = _settings(options)
    with open_pictures(options.video, options.rate_hz) as reader:
        camera, assumed = camera_of(options.camera, reader.size, options.video)
        if assumed is not None:
            say(assumed)
        setup = _setup(options, settings, camera)
        method = open_method(options.method, setup)
        motion_at, motions = _motion_at(options, reader), list[Motion]()
        state, estimates, spread = method.begin(), list[LaneEstimate](), Spread()
        began = time.perf_counter()
        for picture in _shown(options, reader, stopped, options.method):
            spread.offer(picture)
            motions.append(motion_at(picture.t_ns))
            state, estimate = method.look(state, picture, motions[-1])
            estimates.append(estimate)
        wall_s = time.perf_counter() - began
        return Looked(
            setup=setup,
            name=options.method,
            rate_hz=reader.rate_hz,
            estimates=estimates,
            motions=motions,
            spread=spread.pictures(),
            wall_s=wall_s,
            notes=tuple(reader.notes),
        )


def _settings(options: VideoRun) -> VideoConfig:
    settings = read_settings(options.settings)
    if not options.fill:
        return settings
    return msgspec.structs.replace(settings, lov=msgspec.structs.replace(settings.lov, fill=True))


def _setup(options: VideoRun, settings: VideoConfig, camera: VideoCamera) -> Setup:
    def pictures() -> Iterator[Picture]:
        with open_pictures(options.video, options.rate_hz) as again:
            yield from _shown(options, again, lambda: False, "first look")

    show = show_nothing if options.steps is None else StepFolder(options.steps, options.every)
    return Setup(
        camera=Camera.from_config(camera.config),
        vehicle=camera.vehicle,
        settings=settings,
        pictures=pictures,
        show=show,
    )


def _shown(
    options: VideoRun, reader: PictureReader, stopped: Callable[[], bool], what: str
) -> Iterator[Picture]:
    """Yield the pictures up to the limit, with a bar where somebody looks."""
    counts = [count for count in (reader.count, options.limit) if count is not None]
    total = min(counts, default=None)
    with tqdm(total=total, unit="picture", desc=what, leave=False, disable=not options.progress) as bar:
        for picture in islice(reader, options.limit):
            if stopped():
                return
            yield picture
            bar.update()


def _motion_at(options: VideoRun, reader: PictureReader) -> Callable[[int], Motion]:
    """Return what tells the motion at a time in ns; without a log nothing is known."""
    if options.motion is None:
        return lambda t_ns: Motion()
    lasts_s = 0.0 if reader.count is None else reader.count / reader.rate_hz
    profiles = load_profiles(options.motion_profiles)
    return CanMotion(options.motion, profiles, options.motion_begins_s, lasts_s).at


def _send(options: VideoRun, looked: Looked, rows: Rows, say: Say, stopped: Callable[[], bool]) -> list[str]:
    """Send the lines that the rows believe, at the times of the video; returns the summary's lines."""
    profile = _profile(options)
    drive = VideoDrive(
        believed(rows, looked.estimates), looked.motions, round(1e9 / looked.rate_hz), Environment()
    )
    line = video_line(drive, looked.setup.camera.config, looked.setup.vehicle, profile)
    summary = send_video(
        line,
        drive,
        RunOptions(bus=options.bus, log=options.log, fast=options.bus is None, progress=options.progress),
        say,
        stopped,
        period_ns=tick_ns(profile, round(1e9 / looked.rate_hz)),
    )
    if options.bus is None:  # what takes how long matters in real time
        return [f"frames sent {summary.frames_sent}, values saturated {summary.saturated}", *summary.notes]
    return summary.text().splitlines()


def _write_report(path: Path, options: VideoRun, looked: Looked, rows: Rows) -> None:
    title = f"{Path(options.video).name}: lane offset by the method {looked.name}"
    camera = options.camera or "none given: see the note"
    told = [
        ["video", options.video],
        ["camera", camera],
        ["method", f"{looked.name}: {METHODS[looked.name].about}"],
    ]
    replace_file(path, report_page(title, told, rows, looked.setup, looked.spread, looked.notes).encode())


def _require(options: VideoRun) -> None:
    """Refuse what cannot be written or is no method before anything is looked at."""
    require_method(options.method)
    if options.steps is not None and not METHODS[options.method].has_steps:
        shown = ", ".join(name for name, kind in METHODS.items() if kind.has_steps)
        raise ConfigError(
            f"--steps: the method {options.method} has none to show; --method {shown} was expected"
        )
    if options.out is not None:
        require_writable(options.out)
    for path in filter(None, (options.report, options.log)):
        require_place(path)
    if options.report is not None:
        new_figure(purpose="--report")
    if options.sends:
        profile = _profile(options)
        if options.bus is not None:
            is_fd = any(plan.layout.is_fd for plan in profile.messages)
            open_bus(options.bus, fd=is_fd).close()
    elif options.profile or options.dbc:
        raise ConfigError("--profile, --dbc: of the frames of --log or --bus, neither of which is given")


def _profile(options: VideoRun) -> Profile:
    return load_profile(options.profile or DEFAULT_PROFILE, options.dbc)

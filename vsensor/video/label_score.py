"""Methods against labels: each labelled picture through a method, its errors in pixels and metres, a table.

A video is looked at from its beginning, as it was recorded, so that a method may track; a still once.
"""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import groupby
from math import degrees, nan
from pathlib import Path

import numpy as np

from vsensor.camera import Camera
from vsensor.errors import ConfigError
from vsensor.score import ErrorStats
from vsensor.study.table import aligned
from vsensor.types import SIDE_NAMES, Array, LaneEstimate
from vsensor.video.camera_file import VideoCamera
from vsensor.video.frames import open_pictures
from vsensor.video.labels import LabelConfig, LineErrors, best_pitch_rad, picture_errors, pooled
from vsensor.video.methods import Setup, open_method
from vsensor.video.settings import VideoConfig
from vsensor.video.types import Motion, Picture

RANGES_M: tuple[tuple[float, float], ...] = ((0.0, 10.0), (10.0, 20.0), (20.0, 40.0))
"""Stretches of road ahead of the ego origin for which errors in metres are told."""
_ERRORS = ("centre_px", "centre_m", "inner_m")
COLUMNS = (
    *("method", "pictures", "pitch", "lines", "rows", "mean px", "std px", "median", "95 % px"),
    *(f"{low:g}-{high:g} m" for low, high in RANGES_M),
)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Scored:
    """One picture: the errors of both lines with the mount's pitch, and with the one that fits them best."""

    label: LabelConfig
    pitch_rad: float
    mounted: tuple[LineErrors, ...]
    fitted: tuple[LineErrors, ...]


def score_method(
    name: str,
    labels: Sequence[LabelConfig],
    folder: Path,
    cameras: Sequence[VideoCamera],
    settings: VideoConfig | None = None,
) -> list[Scored]:
    """Return the errors of a method in each labelled picture of `folder`; each size has its camera.

    Raises VsensorError subclasses.
    """
    settings = settings or VideoConfig()
    found = []
    for file, group in groupby(sorted(labels, key=_place), key=lambda label: label.file):
        wanted = list(group)
        camera = _camera_of(wanted[0], cameras)
        setup = Setup(
            camera=Camera.from_config(camera.config),
            vehicle=camera.vehicle,
            settings=settings,
            pictures=partial(_pictures, folder / file),
        )
        for label, estimate in _estimates(name, setup, wanted):
            found.append(scored(label, estimate, setup.camera))
    return found


def scored(label: LabelConfig, estimate: LaneEstimate, camera: Camera) -> Scored:
    """Return the errors of one picture."""
    pitch = best_pitch_rad(label, estimate, camera)
    return Scored(
        label=label,
        pitch_rad=pitch,
        mounted=picture_errors(label, estimate, camera),
        fitted=picture_errors(label, estimate, camera, pitch_rad=pitch),
    )


def _place(label: LabelConfig) -> tuple[str, int]:
    return label.file, label.frame or 0


def _camera_of(label: LabelConfig, cameras: Sequence[VideoCamera]) -> VideoCamera:
    for camera in cameras:
        if camera.size == label.size_px:
            return camera
    width, height = label.size_px
    raise ConfigError(f"{label.file}: is {width} x {height}: a --camera of that size was expected")


def _pictures(path: Path) -> Iterator[Picture]:
    with open_pictures(path) as reader:
        yield from reader


def _estimates(
    name: str, setup: Setup, labels: Sequence[LabelConfig]
) -> Iterator[tuple[LabelConfig, LaneEstimate]]:
    """Yield what a method says of each labelled picture of one file."""
    wanted: Mapping[int, LabelConfig] = {label.frame or 0: label for label in labels}
    method = open_method(name, setup)
    state, left = method.begin(), set(wanted)
    for picture in setup.pictures():
        state, estimate = method.look(state, picture, Motion())
        if picture.index in left:
            left.discard(picture.index)
            yield wanted[picture.index], estimate
        if not left:
            return
    raise ConfigError(f"{labels[0].file}: has no frame {min(left)}, which is labelled")


def score_table(results: Mapping[str, Sequence[Scored]]) -> list[str]:
    """Return the table of methods: a row for the mount's pitch and one for the best, each kind of picture."""
    rows = [
        row
        for kind, of in (("frames", _is_frame), ("stills", lambda one: not _is_frame(one)), ("all", bool))
        for name, every in results.items()
        if (chosen := [one for one in every if of(one)])
        for row in _method_rows(name, kind, chosen)
    ]
    return aligned([COLUMNS, *rows])


def _is_frame(one: Scored) -> bool:
    return one.label.frame is not None


def _method_rows(name: str, kind: str, chosen: Sequence[Scored]) -> Iterable[tuple[str, ...]]:
    spread = degrees(float(np.std([one.pitch_rad for one in chosen])))
    for pitch, lines in (
        ("mount's", [line for one in chosen for line in one.mounted]),
        (f"best, std {spread:.2f} deg", [line for one in chosen for line in one.fitted]),
    ):
        px = pooled(lines, "centre_px")
        reported = sum(bool(np.isfinite(line.centre_px).any()) for line in lines)
        stats = ErrorStats.of(px)
        x_m, inner_m = pooled(lines, "x_m"), pooled(lines, "inner_m")
        yield (
            *(name, f"{len(chosen)} {kind}", pitch, f"{reported} of {len(lines)}"),
            f"{stats.n} of {px.size}",
            *(f"{value:.2f}" for value in (stats.mean_m, stats.std_m, _median(np.abs(px)), stats.abs_95_m)),
            *(_rms_text(inner_m[(low <= x_m) & (x_m < high)]) for low, high in RANGES_M),
        )


def _median(values: Array) -> float:
    known = values[np.isfinite(values)]
    return float(np.median(known)) if known.size else nan


def _rms_text(errors_m: Array) -> str:
    return f"{ErrorStats.of(errors_m).rms_m:.3f}"


def score_rows(results: Mapping[str, Sequence[Scored]]) -> list[dict[str, object]]:
    """Return a row for each labelled row: errors at the pitch that fits best, and at the mount's."""
    return [
        {
            "method": name,
            "picture": one.label.name,
            "side": SIDE_NAMES[fitted.side],
            "pitch_deg": degrees(one.pitch_rad),
            "v_px": float(fitted.v_px[k]),
            "x_m": _known(fitted.x_m[k]),
            **{key: _known(getattr(fitted, key)[k]) for key in _ERRORS},
            **{f"mount_{key}": _known(getattr(mounted, key)[k]) for key in _ERRORS},
        }
        for name, every in results.items()
        for one in every
        for mounted, fitted in zip(one.mounted, one.fitted, strict=True)
        for k in range(len(fitted.v_px))
    ]


def _known(value: float) -> float | None:
    return None if value != value else float(value)

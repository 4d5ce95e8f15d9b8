"""The methods by name, and a video through one of them."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from vsensor.camera import Camera
from vsensor.errors import ConfigError
from vsensor.signals import VehicleConfig
from vsensor.types import LaneEstimate, Side
from vsensor.video import lov
from vsensor.video.rows import Rows, rows_of
from vsensor.video.settings import VideoConfig
from vsensor.video.steps import Show, show_nothing
from vsensor.video.types import Method, Picture


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What a method is made of: camera and vehicle, settings, and the video itself.

    `pictures` opens the video from its beginning, for a method that looks at all of it first; `show` takes
    pictures of its steps.
    """

    camera: Camera
    vehicle: VehicleConfig = field(default_factory=VehicleConfig)
    settings: VideoConfig = field(default_factory=VideoConfig)
    pictures: Callable[[], Iterable[Picture]] = tuple
    show: Show = show_nothing


@dataclass(frozen=True, slots=True, kw_only=True)
class MethodKind:
    """How a method is made of its setup.

    `has_lov`: P2's thresholds and filling follow it; `has_steps`: it shows pictures of its steps.
    """

    maker: Callable[[Setup], Method[Any]]
    has_lov: bool
    has_steps: bool
    about: str


def _published(setup: Setup) -> Method[Any]:
    from vsensor.video.published import Published

    return Published(setup.settings.published, setup.camera, setup.pictures, setup.show)


def _ours(setup: Setup) -> Method[Any]:
    from vsensor.video.ridge import Ridge

    return Ridge(setup.settings.ours, setup.camera, setup.vehicle)


METHODS = {
    "ours": MethodKind(
        maker=_ours,
        has_lov=False,
        has_steps=False,
        about="paint looked for on the road, all lines fitted together, pitch from where they meet",
    ),
    "published": MethodKind(
        maker=_published,
        has_lov=True,
        has_steps=True,
        about="P2's: borders and white zones, Hough lines, every picture for itself",
    ),
}


def open_method(name: str, setup: Setup) -> Method[Any]:
    """Return a method ready to look; raises ConfigError for a name that is none, MissingExtraError."""
    return _kind(name).maker(setup)


def require_method(name: str) -> None:
    """Raise ConfigError for a name that is no method's."""
    _kind(name)


def rows_by(name: str, setup: Setup, estimates: Sequence[LaneEstimate]) -> Rows:
    """Return the rows of what a method found, with what belongs to it afterwards."""
    rows = rows_of(setup.vehicle, estimates)
    if not _kind(name).has_lov:
        return rows
    kept = believed(lov.processed(setup.settings.lov, rows), estimates)  # without the headings of the others
    return lov.processed(setup.settings.lov, rows_of(setup.vehicle, kept))


def believed(rows: Rows, estimates: Sequence[LaneEstimate]) -> list[LaneEstimate]:
    """Return the estimates without those lines of the own lane whose offset the rows do not have as seen."""
    seen = {Side.LEFT: rows.left_confidence.tolist(), Side.RIGHT: rows.right_confidence.tolist()}
    return [
        replace(
            estimate,
            boundaries=tuple(
                line for line in estimate.boundaries if line.side not in seen or seen[line.side][k]
            ),
        )
        for k, estimate in enumerate(estimates)
    ]


def _kind(name: str) -> MethodKind:
    if name not in METHODS:
        raise ConfigError(
            f"--method {name}: {', '.join(METHODS)} {'were' if len(METHODS) > 1 else 'was'} expected"
        )
    return METHODS[name]

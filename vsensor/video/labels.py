"""Lines that a person has marked in real pictures, and how far a method's lines are from them.

              left                right             a row: v, u of the paint's left edge, u of its right edge
      v ------[##]------------------[##]-----
             ^    ^ inner edge                      error: the method's u (or y on the road) minus the label's

The body pitches, nobody tells by how much, and that moves the far road by many pixels, both lines alike. So
each picture is also scored with the one pitch that fits both its lines best: what is left is the lines' own.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import Annotated

import numpy as np
from msgspec import Meta

from vsensor.camera import Camera, camera_from_ego, project
from vsensor.camera.road import on_road
from vsensor.errors import ConfigError
from vsensor.schema import Config, check_schema, convert, read_toml
from vsensor.transforms import invert, transform
from vsensor.types import Array, Boundary, EgoState, LaneEstimate, Side

SCHEMA = "vsensor.lane_labels/1"
NEAREST_M = 1.0
"""Of road ahead of the camera; what is nearer is out of every picture."""
SAMPLES = 600
MOST_PITCH_RAD = radians(2.0)
ROBUST_PX = 10.0
"""A row that is farther off counts as this when the pitch is looked for: another line's does not bend it."""

Row = tuple[float, float, float]


class LabelConfig(Config, frozen=True, kw_only=True):
    """`[[image]]`: an image, or a frame of a video, and the paint of both lines by rows.

    `left`, `right`: [v, u of the left edge, u of the right edge], pixels with centres at integers, of the
    picture as it was taken. `sigma_px`: standard deviation of the middle of two edges.
    """

    file: str
    size_px: tuple[Annotated[int, Meta(ge=16)], Annotated[int, Meta(ge=16)]]
    frame: Annotated[int, Meta(ge=0)] | None = None
    sigma_px: Annotated[float, Meta(gt=0.0, le=100.0)] = 1.0
    left: tuple[Row, ...] = ()
    right: tuple[Row, ...] = ()

    def __post_init__(self) -> None:
        """Refuse rows that are no paint in the picture (ValueError; from a file, a ConfigError)."""
        width, height = self.size_px
        for word, rows in (("left", self.left), ("right", self.right)):
            for v, u_left, u_right in rows:
                if not (0.0 <= v < height and -0.5 <= u_left < u_right < width):
                    raise ValueError(
                        f"{self.name}: {word} row [{v:g}, {u_left:g}, {u_right:g}]: v, left edge, right edge "
                        f"within {width} x {height} were expected"
                    )

    @property
    def name(self) -> str:
        """The file, and the frame if there are many."""
        return self.file if self.frame is None else f"{self.file} frame {self.frame}"

    def rows(self, side: Side) -> Array:
        """Return the rows (N, 3) of a line."""
        return np.array(self.left if side is Side.LEFT else self.right).reshape(-1, 3)


class LabelFile(Config, frozen=True, kw_only=True):
    """A file of labels."""

    image: Annotated[tuple[LabelConfig, ...], Meta(min_length=1)]


def read_labels(path: Path) -> tuple[LabelConfig, ...]:
    """Read a file of labels; raises ConfigError naming file and key."""
    return convert(check_schema(read_toml(path), SCHEMA, str(path)), LabelFile, str(path)).image


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LineErrors:
    """A method's line against a label's rows, (N,) each; NaN where the method has no line, or not so far.

    `centre_px` across the picture, positive to the right; `centre_m`, `inner_m` across the road, positive to
    the left, the latter of the edge towards the vehicle; `x_m` is how far ahead of the ego origin the row is.
    """

    side: Side
    v_px: Array
    x_m: Array
    centre_px: Array
    centre_m: Array
    inner_m: Array


def picture_errors(
    label: LabelConfig, estimate: LaneEstimate, camera: Camera, *, pitch_rad: float = 0.0
) -> tuple[LineErrors, ...]:
    """Return the errors of both lines of a picture, left first; `pitch_rad` is the body's, nose down.

    Raises ConfigError for a camera of another size.
    """
    size = camera.config.width_px, camera.config.height_px
    if size != label.size_px:
        width, height = label.size_px
        raise ConfigError(
            f"{label.name}: is {width} x {height}, the camera {size[0]} x {size[1]}: one size was expected"
        )
    sides = (Side.LEFT, Side.RIGHT)
    return tuple(_line_errors(label, side, estimate.on(side), camera, pitch_rad) for side in sides)


def best_pitch_rad(label: LabelConfig, estimate: LaneEstimate, camera: Camera) -> float:
    """Return the body's pitch that fits both lines of a picture best; 0 where only one is reported."""
    from scipy.optimize import minimize_scalar

    if any(estimate.on(side) is None for side in (Side.LEFT, Side.RIGHT)):
        return 0.0

    def cost(pitch_rad: float) -> float:
        errors = picture_errors(label, estimate, camera, pitch_rad=pitch_rad)
        px = np.concatenate([line.centre_px for line in errors])
        return float(np.minimum(np.nan_to_num(px, nan=ROBUST_PX) ** 2, ROBUST_PX**2).sum())

    grid = np.linspace(-MOST_PITCH_RAD, MOST_PITCH_RAD, 81)
    start = float(grid[int(np.argmin([cost(p) for p in grid.tolist()]))])
    step = float(grid[1] - grid[0])
    found = minimize_scalar(cost, bounds=(start - step, start + step), method="bounded")
    return float(found.x)


def _line_errors(
    label: LabelConfig, side: Side, line: Boundary | None, camera: Camera, pitch_rad: float
) -> LineErrors:
    rows = label.rows(side)
    v, u_left, u_right = rows.T
    inner = u_right if side is Side.LEFT else u_left
    x_m, y_m = _on_road(camera, 0.5 * (u_left + u_right), v, pitch_rad)
    inner_x_m, inner_y_m = _on_road(camera, inner, v, pitch_rad)
    nothing = np.full(len(rows), np.nan)
    if line is None:
        return LineErrors(side=side, v_px=v, x_m=x_m, centre_px=nothing, centre_m=nothing, inner_m=nothing)
    outward = 1.0 if side is Side.LEFT else -1.0
    centre_y_m, _ = _at(line, x_m)
    edge_y_m, slope = _at(line, inner_x_m)
    edge_y_m = edge_y_m - outward * 0.5 * line.width_m * np.hypot(1.0, slope)
    return LineErrors(
        side=side,
        v_px=v,
        x_m=x_m,
        centre_px=_u_at(line, camera, v, pitch_rad) - 0.5 * (u_left + u_right),
        centre_m=centre_y_m - y_m,
        inner_m=edge_y_m - inner_y_m,
    )


def _at(line: Boundary, x_m: Array) -> tuple[Array, Array]:
    """Return y and dy/dx (N,) of a line, NaN beyond its end; before its beginning it is taken to go on."""
    x_m = np.where(x_m <= line.x_max_m, x_m, np.nan)
    y = np.polynomial.polynomial.polyval(x_m, line.coefficients)
    slope = np.polynomial.polynomial.polyval(x_m, np.polynomial.polynomial.polyder(line.coefficients))
    return np.asarray(y), np.asarray(slope)


def _u_at(line: Boundary, camera: Camera, v_px: Array, pitch_rad: float) -> Array:
    """Return u (N,) of a line's centre on rows of the picture, NaN where it is not drawn."""
    from_body = camera_from_ego(camera, _pitched(pitch_rad))
    eye_x_m = float(invert(from_body).translation[0])
    ahead = np.geomspace(NEAREST_M, max(line.x_max_m - eye_x_m, 2.0 * NEAREST_M), SAMPLES)
    x = eye_x_m + ahead
    y, _ = _at(line, x)
    u, v = project(camera, transform(from_body, np.column_stack([x, y, np.zeros_like(x)]))).T
    is_drawn = np.isfinite(u)
    if np.count_nonzero(is_drawn) < 2:
        return np.full(len(v_px), np.nan)
    order = np.argsort(v[is_drawn])
    return np.asarray(np.interp(v_px, v[is_drawn][order], u[is_drawn][order], left=np.nan, right=np.nan))


def _on_road(camera: Camera, u_px: Array, v_px: Array, pitch_rad: float) -> tuple[Array, Array]:
    """Return x and y (N,) of pixels on the flat road, NaN at or above the horizon."""
    points, _, meets = on_road(camera, camera_from_ego(camera, _pitched(pitch_rad)), np.array([u_px, v_px]))
    x, y = np.full((2, len(u_px)), np.nan)
    x[meets], y[meets] = points[:2]
    return x, y


def _pitched(pitch_rad: float) -> EgoState:
    return EgoState(t_ns=0, position_world_m=np.zeros(3), speed_mps=0.0, body_pitch_rad=pitch_rad)


def pooled(errors: Sequence[LineErrors], name: str) -> Array:
    """Return one column of many pictures, (N,)."""
    return np.concatenate([getattr(line, name) for line in errors]) if errors else np.zeros(0)

"""Pictures of a run: the lanes from above, the camera's view, the error over time. Needs matplotlib.

Everything is drawn from an Output: true lines from the exact candidates, what was seen from the reasons
beside them, reported lines from the polynomials. The colours are told apart by the colour-blind
(Okabe and Ito), and what is hidden differs in marker as well.
"""

from array import array
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import Camera, camera_from_ego, project
from vsensor.errors import ConfigError, MissingExtraError
from vsensor.scene import world_from_ego
from vsensor.sinks.trace import rows
from vsensor.sinks.trace_file import COLUMNS, Trace
from vsensor.transforms import Rigid, relative_to, rotation_from_rpy, transform
from vsensor.types import SIDE_NAMES, Array, Boundary, Obstacle, Output, Side, Unseen, frozen

SIDE_COLOURS = {
    Side.LEFT: "#0072B2",
    Side.RIGHT: "#D55E00",
    Side.NEXT_LEFT: "#56B4E9",
    Side.NEXT_RIGHT: "#E69F00",
}
TRUTH, SEEN, HIDDEN, BOX = "#555555", "#009E73", "#CC79A7", "#999999"

_NEAR_M = 0.3  # boxes are cut this far in front of the camera, where the projection runs away
_FACES = ((0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5))
_SHOWN_ERROR_M = (20, 50)
_T_NS, _SIDE = COLUMNS.index("t_ns"), COLUMNS.index("side")
_Y_AND_TRUTH = [(COLUMNS.index(f"y_{x}m"), COLUMNS.index(f"truth_y_{x}m")) for x in _SHOWN_ERROR_M]
_BESIDE_M = 4.0  # about a lane
_MARGIN_PX = 60.0  # of the view above the highest thing drawn, and below the lowest paint


class PictureSink:
    """Draws a run when it ends: the moment with most hidden paint, and the error over time."""

    def __init__(self, path: Path, camera: Camera, *, front_axle_x_m: float) -> None:
        """Refuse a format that cannot be written before the run begins; raises ConfigError."""
        _figure_class()
        if path.suffix not in (".png", ".svg", ".pdf"):
            raise ConfigError(f"{path}: a picture ends in .png, .svg, .pdf")
        if not path.parent.is_dir():
            raise ConfigError(f"{path}: cannot be written: there is no folder {path.parent}")
        self._path, self._camera, self._front_axle_x_m = path, camera, front_axle_x_m
        self._errors = array("d")  # 4 numbers a line and tick: 23 MB for an hour at 40 ms
        self._most_hidden = -1
        self._moment: Output | None = None

    def write(self, output: Output) -> None:
        """Keep the errors of a tick, and the tick itself if it hides more than any before."""
        for row in rows(output, self._front_axle_x_m):
            if row[_SIDE] in (Side.LEFT, Side.RIGHT):
                self._errors.extend(
                    (row[_T_NS] / 1e9, row[_SIDE], *(row[y] - row[t] for y, t in _Y_AND_TRUTH))
                )
        hidden = int(np.count_nonzero(output.observation.reason == Unseen.OCCLUDED))
        if hidden > self._most_hidden:
            self._most_hidden, self._moment = hidden, output

    def close(self) -> None:
        """Draw; a run without a tick leaves no picture."""
        if self._moment is not None:
            errors = np.array(self._errors).reshape(-1, 4)
            plot_output(self._camera, self._moment, self._path, errors)
            self._moment = None


def plot_output(camera: Camera, output: Output, path: Path, errors: Array | None = None) -> None:
    """Write a picture of one moment, and of the errors over time (N, 4) if given; see `errors_over_time`.

    A camera of model "none" has no view. Raises MissingExtraError, and ConfigError where the file
    cannot be written.
    """
    has_view = camera.config.model != "none"
    heights = [1.0, *([1.0] if has_view else []), *([0.75] if errors is not None else [])]
    figure = _figure_class()(figsize=(9.0, 3.2 * sum(heights)), layout="constrained")
    panels = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0].tolist()
    draw_from_above(panels.pop(0), output)
    if has_view:
        draw_camera_view(panels.pop(0), camera, output)
    if errors is not None:
        draw_errors(panels.pop(0), errors, output.tick.t_ns / 1e9)
    try:
        figure.savefig(path, dpi=130, bbox_inches="tight")
    except (OSError, ValueError) as error:
        raise ConfigError(f"{path}: picture cannot be written: {error}") from None


def draw_from_above(axes: Any, output: Output) -> None:
    """Draw true paint, reported polynomials and vehicles in the road-level ego frame."""
    observation = output.observation
    for k, line in enumerate(_lines(output)):
        gap = observation.reason[_slice(output, k)] == Unseen.NO_PAINT
        y = np.where(gap, np.nan, line[:, 1])
        axes.plot(line[:, 0], y, color=TRUTH, lw=3.5, alpha=0.45, label="true paint" if k == 0 else None)
    for boundary in output.estimate.boundaries:
        x = np.linspace(boundary.x_min_m, boundary.x_max_m, 200)
        style = "-" if boundary.measured else "--"
        axes.plot(
            x, _y(boundary, x), style, color=SIDE_COLOURS[boundary.side], lw=1.4, label=_label(boundary)
        )
    frame = world_from_ego(output.snapshot.ego)
    reach_m = max((float(line[-1, 0]) for line in _lines(output) if len(line)), default=100.0)
    for obstacle in output.snapshot.scene.obstacles:
        corners = relative_to(frame, _corners_world(obstacle))[[0, 2, 6, 4], :2]
        if corners[:, 0].max() > -5.0 and corners[:, 0].min() < reach_m:
            axes.fill(*corners.T, facecolor=BOX, edgecolor="black", lw=0.7, alpha=0.8)
    _show_own_carriageway(axes, output)
    axes.set(xlim=(-5.0, reach_m), xlabel="x ahead of the rear axle (m)", ylabel="y to the left (m)")
    axes.set_title(f"Lanes from above, t = {output.tick.t_ns / 1e9:.2f} s (y stretched)", fontsize=10)
    _legend(axes)


def draw_camera_view(axes: Any, camera: Camera, output: Output) -> None:
    """Draw in pixels what paint was seen and hidden, the vehicles' outlines, the reported lines."""
    pose = camera_from_ego(camera, output.seen.ego)
    _draw_boxes(axes, camera, pose, output)
    points = output.observation.candidates.points_ego_m
    lowest = -np.inf
    for reason, colour, marker, label in (
        (Unseen.OCCLUDED, HIDDEN, "x", "paint hidden by a vehicle"),
        (Unseen.SEEN, SEEN, ".", "paint seen"),
    ):
        pixels = project(camera, transform(pose, points[output.observation.reason == reason]))
        if len(pixels):
            axes.plot(*pixels.T, marker, color=colour, ms=3, mew=0.7, label=label, zorder=3)
            lowest = max(lowest, float(np.nanmax(pixels[:, 1], initial=-np.inf)))
    for boundary in output.estimate.boundaries:
        pixels = project(camera, transform(pose, _on_road(output, boundary)))
        axes.plot(*pixels.T, color=SIDE_COLOURS[boundary.side], lw=1.2, label=_label(boundary), zorder=4)
    width, height = camera.config.width_px, camera.config.height_px
    top = max(min(float(axes.dataLim.y0), camera.cy_px) - _MARGIN_PX, -0.5)
    bottom = min(lowest + _MARGIN_PX, height - 0.5) if lowest > top else height - 0.5
    axes.set(xlim=(-0.5, width - 0.5), ylim=(bottom, top), xlabel="u (px)", ylabel="v (px)")
    axes.set_aspect("equal")
    axes.set_title("The camera's view, where there is something in it", fontsize=10)
    _legend(axes)


def errors_over_time(trace: Trace) -> Array:
    """Return time (s), side, lateral error at 20 m and 50 m (N, 4) of the left and right line of a trace."""
    own = np.isin(trace["side"], (Side.LEFT, Side.RIGHT))
    errors = [trace[f"y_{x}m"] - trace[f"truth_y_{x}m"] for x in _SHOWN_ERROR_M]
    return frozen(np.column_stack([trace["t_ns"] / 1e9, trace["side"], *errors])[own])


def draw_errors(axes: Any, errors: Array, moment_s: float) -> None:
    """Draw the lateral errors (N, 4) of `errors_over_time`, and the moment of the picture."""
    for side in (Side.LEFT, Side.RIGHT):
        here = errors[errors[:, 1] == side]
        for column, (x, style) in enumerate(zip(_SHOWN_ERROR_M, ("-", ":"), strict=True), 2):
            name = f"{SIDE_NAMES[side]} at {x} m"
            axes.plot(here[:, 0], here[:, column], style, color=SIDE_COLOURS[side], lw=1.0, label=name)
    axes.axvline(moment_s, color=TRUTH, lw=0.8)
    axes.set(xlabel="time (s)", ylabel="lateral error (m)")
    axes.set_title("Reported minus true place", fontsize=10)
    _legend(axes)


def _show_own_carriageway(axes: Any, output: Output) -> None:
    """Cut y to what was reported and a lane's width beside it, if anything was."""
    ends = [
        _y(boundary, np.array([boundary.x_min_m, boundary.x_max_m]))
        for boundary in output.estimate.boundaries
    ]
    if ends:
        axes.set_ylim(float(np.min(ends)) - _BESIDE_M, float(np.max(ends)) + _BESIDE_M)


def _draw_boxes(axes: Any, camera: Camera, pose: Rigid, output: Output) -> None:
    frame = world_from_ego(output.snapshot.ego)
    boxes = [transform(pose, relative_to(frame, _corners_world(o))) for o in output.snapshot.scene.obstacles]
    for corners in sorted(boxes, key=lambda c: -float(c[:, 2].mean())):
        for face in _FACES:
            polygon = in_front(corners[list(face)])
            if len(polygon):
                pixels = project(camera, polygon)
                axes.fill(*pixels.T, facecolor=BOX, edgecolor="black", lw=0.6, alpha=0.35, clip_on=True)


def in_front(polygon_camera_m: Array) -> Array:
    """Return the part (M, 3) of a polygon (N, 3) at least _NEAR_M in front of the camera, maybe (0, 3)."""
    kept: list[Array] = []
    for here, after in zip(polygon_camera_m, np.roll(polygon_camera_m, -1, axis=0), strict=True):
        if here[2] >= _NEAR_M:
            kept.append(here)
        if (here[2] >= _NEAR_M) != (after[2] >= _NEAR_M):
            kept.append(here + (after - here) * ((_NEAR_M - here[2]) / (after[2] - here[2])))
    return np.array(kept).reshape(-1, 3)


def _corners_world(obstacle: Obstacle) -> Array:
    """Return the corners (8, 3); bit 2 of the place is the front, bit 1 the left, bit 0 the top."""
    signs = np.array([[i >> 2 & 1, i >> 1 & 1, i & 1] for i in range(8)]) - 0.5
    rotation = rotation_from_rpy(obstacle.roll_rad, obstacle.pitch_rad, obstacle.yaw_rad)
    return transform(Rigid(rotation, obstacle.centre_world_m), signs * np.array(obstacle.size_m))


def _slice(output: Output, k: int) -> slice:
    starts = output.observation.candidates.starts
    return slice(int(starts[k]), int(starts[k + 1]))


def _lines(output: Output) -> Sequence[Array]:
    candidates = output.observation.candidates
    return [candidates.points_ego_m[_slice(output, k)] for k in range(len(candidates.marking))]


def _on_road(output: Output, boundary: Boundary) -> Array:
    """Return points (N, 3) of a reported line, at the height of its marking, else of the road plane."""
    x = np.linspace(boundary.x_min_m, boundary.x_max_m, 200)
    z = np.zeros_like(x)
    for k in np.flatnonzero(output.observation.candidates.marking == boundary.marking):
        line = _lines(output)[int(k)]
        z = np.interp(x, line[:, 0], line[:, 2]) if len(line) else z
    return np.column_stack([x, _y(boundary, x), z])


def _y(boundary: Boundary, x: Array) -> Array:
    return frozen(np.polynomial.polynomial.polyval(x, boundary.coefficients))


def _label(boundary: Boundary) -> str:
    name = SIDE_NAMES[boundary.side].replace("_", " ")
    return f"reported {name}" + ("" if boundary.measured else " (predicted)")


def _legend(axes: Any) -> None:
    if axes.get_legend_handles_labels()[0]:
        axes.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), fontsize=8, frameon=False)
    axes.grid(visible=True, lw=0.3)


def _figure_class() -> Any:
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingExtraError("matplotlib", "plots", "a picture") from None
    return Figure

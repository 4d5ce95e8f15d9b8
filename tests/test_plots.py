"""Pictures: what is drawn stands where the numbers say; a file comes out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from tests.outputs import Drawn, circle, ego_at, four_lines, output_of, straight
from vsensor import plots
from vsensor.camera import Camera, CameraConfig
from vsensor.errors import ConfigError
from vsensor.sinks.trace import TraceSink, read_trace
from vsensor.types import MarkingKind, Obstacle, Side, Unseen, frozen

figure = pytest.importorskip("matplotlib.figure")
CAMERA = Camera.from_config(CameraConfig())


def car(x, y=0.0, number=1):
    """Return a car in world coordinates."""
    return Obstacle(id=number, centre_world_m=frozen([x, y, 0.75]), size_m=(4.6, 1.8, 1.5))


def bend(**changes):
    """Return an output of a bend with a hidden stretch behind a car, and a dashed line."""
    lines = [
        Drawn(y=circle(1.8, 700.0), reported=Side.LEFT, unseen=lambda p: p[:, 0] > 60),
        Drawn(
            y=circle(-1.9, 700.0),
            reported=Side.RIGHT,
            kind=MarkingKind.DASHED,
            unpainted=lambda p: p[:, 0] % 18 > 6,
        ),
    ]
    return output_of(lines, obstacles=(car(45.0, 3.5), car(-3.0, 3.5, 2)), **changes)


def labels(axes):
    """Return the words of the legend."""
    return set(axes.get_legend_handles_labels()[1])


def axes_of(draw, *arguments):
    """Return axes on which one drawing was made."""
    axes = figure.Figure().subplots()
    draw(axes, *arguments)
    return axes


def drawn_line(axes, label):
    """Return the data (N, 2) of the line with this label."""
    return next(line for line in axes.get_lines() if line.get_label() == label).get_xydata()


@pytest.mark.parametrize("suffix", [".png", ".svg", ".pdf"])
def test_a_picture_is_written_in_the_format_of_its_suffix(tmp_path, suffix):
    path = tmp_path / f"run{suffix}"
    plots.plot_output(CAMERA, bend(), path)
    head = path.read_bytes()[:400]
    assert {".png": b"\x89PNG", ".svg": b"<svg", ".pdf": b"%PDF"}[suffix] in head


def test_from_above_the_reported_line_is_its_polynomial_on_its_view_range():
    output = bend()
    boundary = output.estimate.on(Side.LEFT)
    data = drawn_line(axes_of(plots.draw_from_above, output), "reported left")
    assert data[[0, -1], 0].tolist() == [boundary.x_min_m, boundary.x_max_m]
    expected = np.polynomial.polynomial.polyval(data[:, 0], boundary.coefficients)
    np.testing.assert_array_equal(data[:, 1], expected)


def test_from_above_the_gaps_of_a_dashed_line_are_open():
    axes = axes_of(plots.draw_from_above, bend())
    dashed = axes.get_lines()[1].get_xydata()
    assert np.isnan(dashed[(dashed[:, 0] % 18) > 6.2, 1]).all()
    assert np.isfinite(dashed[(dashed[:, 0] % 18) < 5.8, 1]).all()


def test_from_above_a_vehicle_stands_where_it_is_and_one_behind_is_left_out():
    ego = ego_at(x=10.0, y=2.0)
    output = output_of(four_lines(), ego=ego, obstacles=(car(55.0, 5.5), car(-20.0)))
    (patch,) = axes_of(plots.draw_from_above, output).patches
    low, high = patch.get_xy().min(axis=0), patch.get_xy().max(axis=0)
    assert [*low, *high] == pytest.approx([45 - 2.3, 3.5 - 0.9, 45 + 2.3, 3.5 + 0.9])


def test_axes_have_units():
    for draw, arguments in ((plots.draw_from_above, ()), (plots.draw_camera_view, (CAMERA,))):
        axes = axes_of(draw, *arguments, bend())
        for label in (axes.get_xlabel(), axes.get_ylabel()):
            assert label.endswith(("(m)", "(px)"))


def test_in_the_view_a_straight_line_points_to_the_horizon_ahead():
    axes = axes_of(plots.draw_camera_view, CAMERA, output_of(four_lines()))
    (u0, v0), (u1, v1) = drawn_line(axes, "reported left")[[40, -1]]
    at_horizon = u0 + (u1 - u0) * (CAMERA.cy_px - v0) / (v1 - v0)
    assert at_horizon == pytest.approx(CAMERA.cx_px, abs=1e-6)


def test_in_the_view_a_left_line_is_left_and_below_the_horizon():
    data = drawn_line(axes_of(plots.draw_camera_view, CAMERA, output_of(four_lines())), "reported left")
    u, v = data[np.isfinite(data[:, 0])].T  # what is behind the camera has no place in its image
    assert len(u) > 190
    assert (u < CAMERA.cx_px).all()
    assert (v > CAMERA.cy_px).all()


def test_in_the_view_a_nose_that_dips_moves_the_road_up():
    level, dipped = (
        output_of(four_lines()),
        output_of(four_lines(), ego=replace(ego_at(), body_pitch_rad=0.02)),
    )
    far = [
        drawn_line(axes_of(plots.draw_camera_view, CAMERA, o), "reported left")[-1] for o in (level, dipped)
    ]
    assert far[0][1] - far[1][1] == pytest.approx(CAMERA.fy_px * 0.02, rel=0.03)  # near the image's centre


def test_in_the_view_seen_and_hidden_paint_are_told_apart():
    assert {"paint seen", "paint hidden by a vehicle"} <= labels(
        axes_of(plots.draw_camera_view, CAMERA, bend())
    )


def test_a_polygon_behind_the_camera_vanishes_and_one_across_it_is_cut():
    behind = np.array([[0, 0, -1], [1, 0, -2], [1, 1, -1.0]])
    assert plots.in_front(behind).shape == (0, 3)
    across = np.array([[-1, 1, 2], [1, 1, 2], [1, 1, -2], [-1, 1, -2.0]])
    cut = plots.in_front(across)
    assert cut[:, 2].min() == pytest.approx(0.3)
    assert len(cut) == 4


def test_a_sink_draws_the_moment_with_most_hidden_paint_and_the_error_over_time(tmp_path, monkeypatch):
    seen = {}
    monkeypatch.setattr(
        plots, "plot_output", lambda camera, output, path, errors: seen.update(o=output, e=errors)
    )
    sink = plots.PictureSink(tmp_path / "run.png", CAMERA, front_axle_x_m=2.8)
    for t in range(3):
        hidden = Drawn(y=straight(1.8), unseen=lambda p, t=t: p[:, 0] > (50, 20, 70)[t], reported=Side.LEFT)
        sink.write(output_of([hidden], tick=t))
    sink.close()
    assert seen["o"].tick.index == 1
    np.testing.assert_allclose(seen["e"][:, 0], [0, 0.04, 0.08])


def test_the_error_over_time_is_reported_minus_true(tmp_path):
    lines = [Drawn(y=straight(1.8), reported=Side.LEFT, error=(0.1 * t, 0.0, 0.0, 0.0)) for t in range(3)]
    outputs = [output_of([line], tick=t) for t, line in enumerate(lines)]
    trace = TraceSink(tmp_path / "trace.npz", front_axle_x_m=2.8)
    picture = plots.PictureSink(tmp_path / "run.png", CAMERA, front_axle_x_m=2.8)
    for sink in (trace, picture):
        for output in outputs:
            sink.write(output)
        sink.close()
    assert (tmp_path / "run.png").stat().st_size > 20_000
    errors = plots.errors_over_time(read_trace(tmp_path / "trace.npz"))
    data = drawn_line(axes_of(plots.draw_errors, errors, 0.0), "left at 20 m")
    np.testing.assert_allclose(data, [[0, 0], [0.04, 0.1], [0.08, 0.2]], atol=1e-9)


def test_the_sink_counts_the_same_errors_as_the_trace(tmp_path, monkeypatch):
    seen = {}
    monkeypatch.setattr(plots, "plot_output", lambda camera, output, path, errors: seen.update(e=errors))
    trace = TraceSink(tmp_path / "trace.npz", front_axle_x_m=2.8)
    picture = plots.PictureSink(tmp_path / "run.png", CAMERA, front_axle_x_m=2.8)
    for sink in (trace, picture):
        for t in range(3):
            sink.write(output_of(four_lines(error=(0.1 * t, 0.0, 0.0, 0.0)), tick=t))
        sink.close()
    np.testing.assert_array_equal(seen["e"], plots.errors_over_time(read_trace(tmp_path / "trace.npz")))


def test_a_bypassed_camera_has_no_view(tmp_path, monkeypatch):
    monkeypatch.setattr(plots, "draw_camera_view", lambda *arguments: pytest.fail("drawn"))
    camera = Camera.from_config(CameraConfig(model="none"))
    plots.plot_output(camera, bend(), tmp_path / "run.png")


def test_a_road_without_any_line_can_be_drawn(tmp_path):
    plots.plot_output(CAMERA, output_of([]), tmp_path / "run.png")


def test_a_predicted_line_is_labelled_as_such():
    output = bend()
    predicted = replace(output.estimate.boundaries[0], measured=False, marking=-1, points=-1)
    output = replace(output, estimate=replace(output.estimate, boundaries=(predicted,)))
    assert "reported left (predicted)" in labels(axes_of(plots.draw_from_above, output))


def test_an_unknown_format_or_folder_is_refused_before_the_run(tmp_path):
    for path in (tmp_path / "run.bmp", tmp_path / "none" / "run.png"):
        with pytest.raises(ConfigError, match="run"):
            plots.PictureSink(path, CAMERA, front_axle_x_m=2.8)
    with pytest.raises(ConfigError, match="cannot be written"):
        plots.plot_output(CAMERA, bend(), tmp_path / "none" / "run.png")


def test_a_run_without_a_tick_leaves_no_picture(tmp_path):
    plots.PictureSink(tmp_path / "run.png", CAMERA, front_axle_x_m=math.nan).close()
    assert not (tmp_path / "run.png").exists()


def test_the_view_ends_below_the_lowest_paint_and_above_the_highest_thing():
    near, out = (lambda p: p[:, 0] < 25), Unseen.OUTSIDE_IMAGE
    line = Drawn(y=circle(1.8, 700.0), reported=Side.LEFT, unseen=near, reason=out)
    axes = axes_of(plots.draw_camera_view, CAMERA, output_of([line]))
    bottom, top = axes.get_ylim()
    paint = drawn_line(axes, "paint seen")
    assert bottom == pytest.approx(paint[:, 1].max() + 60.0)
    assert top < CAMERA.cy_px < bottom

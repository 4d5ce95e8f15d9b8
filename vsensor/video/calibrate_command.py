"""`vsensor video calibrate`: pictures in, a camera file and a report out."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from vsensor.camera import CameraConfig
from vsensor.errors import VideoError
from vsensor.image import import_opencv
from vsensor.pages import require_folder
from vsensor.video.camera_file import VideoCamera, write_camera
from vsensor.video.chessboard import COVERED, Board, Calibration, calibrate
from vsensor.video.frames import image_files, read_image


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrateReport:
    """What to print, and what to say beside it."""

    lines: list[str]
    notes: list[str]


def calibrate_files(
    images: Sequence[str],
    columns: int,
    rows: int,
    *,
    out: Path,
    pictures: Path | None = None,
    progress: bool = False,
) -> CalibrateReport:
    """Find the lens from images, folders, patterns, and write it; raises VideoError, ConfigError."""
    from tqdm import tqdm

    files = [file for name in images for file in _files(name)]
    with tqdm(total=len(files), unit="picture", leave=False, disable=not progress) as bar:
        found = calibrate(files, columns, rows, bar.update)
    write_camera(out, VideoCamera(found.camera), comments(found, columns, rows))
    if pictures is not None:
        draw_boards(found, pictures)
    return CalibrateReport(lines=_lines(found, out), notes=_notes(found))


def _files(name: str) -> list[Path]:
    files = image_files(name)
    if files is None:
        raise VideoError(f"{name}: images, a folder of them or a pattern were expected")
    return files


def comments(found: Calibration, columns: int, rows: int) -> list[str]:
    """Return what the file says of itself."""
    return [
        f"Lens from {len(found.used)} of {len(found.boards)} pictures of a board of {columns} x {rows} inner",
        f"corners, reprojection error {found.rms_px:.3f} px RMS. The pose is not known yet.",
    ]


def _lines(found: Calibration, out: Path) -> list[str]:
    camera, d = found.camera, found.camera.distortion
    width = max(len(board.path.name) for board in found.boards)
    lines = [f"{'picture':{width}}  corners  error px"]
    lines += [_line(board, width) for board in found.boards]
    return [
        *lines,
        "",
        f"fx {camera.fx_px:.2f}, fy {camera.fy_px:.2f} px (+- {found.focal_std_px:.2f}), "
        f"cx {camera.cx_px:.2f}, cy {camera.cy_px:.2f} px (+- {found.centre_std_px:.2f})",
        f"k1 {d.k1:g}, k2 {d.k2:g}, k3 {d.k3:g}, p1 {d.p1:g}, p2 {d.p2:g}",
        f"{len(found.used)} of {len(found.boards)} pictures used, "
        f"reprojection error {found.rms_px:.3f} px RMS",
        f"written: {out}",
    ]


def _line(board: Board, width: int) -> str:
    corners = f"{board.columns} x {board.rows}" if board.columns else "-"
    error = f"{board.error_px:.3f}" if np.isfinite(board.error_px) else "-"
    return f"{board.path.name:{width}}  {corners:>7}  {error:>8}"


def _notes(found: Calibration) -> list[str]:
    notes = [f"{board.path}: {board.problem}" for board in found.boards if board.problem]
    if found.reach < COVERED:
        notes.append(
            f"no corner was seen beyond {100 * found.reach:.0f} % of the way to a corner of the picture: "
            "distortion there is extrapolated; take pictures with the board there"
        )
    return notes


def draw_boards(found: Calibration, folder: Path) -> None:
    """Write each picture with its corners, and as it is without distortion; raises ConfigError."""
    from vsensor.sinks.image import write_png

    cv2 = import_opencv("drawing boards")
    require_folder(folder)
    for board in found.boards:
        picture = read_image(board.path)
        if board.corners_px is not None:
            corners = np.asarray(board.corners_px, np.float32).reshape(-1, 1, 2)
            cv2.drawChessboardCorners(picture, (board.columns, board.rows), corners, True)
        if board.size == (found.camera.width_px, found.camera.height_px):
            picture = np.hstack([picture, _undistorted(cv2, picture, found.camera)])
        write_png(folder / f"{board.path.stem}.png", np.ascontiguousarray(picture[..., ::-1]))


def _undistorted(cv2: Any, picture: Any, camera: CameraConfig) -> Any:
    matrix = np.array([[camera.fx_px, 0, camera.cx_px], [0, camera.fy_px, camera.cy_px], [0, 0, 1]], float)
    d = camera.distortion
    return cv2.undistort(picture, matrix, np.array([d.k1, d.k2, d.p1, d.p2, d.k3]))

"""A camera's lens from pictures of a chessboard: focal lengths, centre, distortion (P2 2.5.1.1).

A board of which only a part shows is used as far as it shows: any rows and columns of it that lie side by
side are a smaller board. Pictures of another size than most are left out, and tell how well the result fits
them. The fit is OpenCV's; whether k3 is needed is asked of the data.
"""

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import hypot, inf
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from vsensor.camera import Camera, CameraConfig
from vsensor.distortion import DistortionConfig, monotone_radius
from vsensor.errors import ConfigError, VideoError
from vsensor.image import import_opencv
from vsensor.types import Array
from vsensor.video.frames import read_image

LEAST_BOARDS = 4
"""Three determine the lens; a fourth can contradict."""
LEAST_SIDE = 4
"""A part of a board has so many corners on each side at least, and half of all."""
MOST_PARTS = 20
"""So many parts of a board are tried, the largest."""
OUTLIER = 4.0
"""A board with an error of so many times the median is left out, and said."""
LEAST_OUTLIER_PX = 1.0
SURE = 3.0
"""k3 is kept where it is so many of its own standard deviations away from 0."""
COVERED = 0.8
"""Corners that reach less far towards the picture's corners leave its rim to extrapolation: it is said."""

Image = NDArray[np.uint8]


@dataclass(frozen=True, slots=True, kw_only=True)
class Board:
    """What one picture shows: `corners_px` (rows * columns, 2) row by row; `error_px` RMS under the result.

    `problem` is a sentence where it was not used; empty = used.
    """

    path: Path
    size: tuple[int, int] = (0, 0)
    columns: int = 0
    rows: int = 0
    corners_px: Array | None = None
    error_px: float = inf
    problem: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Calibration:
    """A lens, with its error and what each picture said of it.

    `rms_px` is the reprojection error over all used corners; `focal_std_px`, `centre_std_px` are standard
    deviations from the fit; `reach` is how far towards the picture's corners board corners were seen, 0 to 1.
    """

    camera: CameraConfig
    boards: tuple[Board, ...]
    rms_px: float
    focal_std_px: float
    centre_std_px: float
    reach: float

    @property
    def used(self) -> list[Board]:
        """Return the boards that the lens is from."""
        return [board for board in self.boards if not board.problem]


class _Fit(NamedTuple):
    rms_px: float
    matrix: Array
    lens: Array  # k1 k2 p1 p2 k3
    deviations: Array  # fx fy cx cy k1 k2 p1 p2 k3
    errors_px: Array  # of each board


def calibrate(
    files: Sequence[Path], columns: int, rows: int, tick: Callable[[], object] = lambda: None
) -> Calibration:
    """Return the lens that fits pictures of a board of `columns` x `rows` inner corners.

    `tick` is called after each picture. Raises VideoError for a file that is no image, and where fewer than
    LEAST_BOARDS boards are left; MissingExtraError.
    """
    cv2 = import_opencv("a calibration")
    if not (3 <= columns <= 60 and 3 <= rows <= 60):
        raise ConfigError(f"a board of {columns} x {rows}: 3 to 60 inner corners on each side were expected")
    boards = []
    for path in files:
        boards.append(find_board(cv2, path, columns, rows))
        tick()
    seen = [board for board in boards if not board.problem]
    if not seen:
        raise VideoError(
            f"no board of {columns} x {rows} inner corners in any of {len(files)} pictures; "
            "corners are counted inside, where four squares meet"
        )
    size = Counter(board.size for board in seen).most_common(1)[0][0]
    fit, used = _fitted(cv2, [board for board in seen if board.size == size], size)
    camera = _config(fit, size)
    judged = [_judged(cv2, board, size, used, fit, camera) for board in boards]
    return Calibration(
        camera=camera,
        boards=tuple(judged),
        rms_px=fit.rms_px,
        focal_std_px=float(fit.deviations[:2].max()),
        centre_std_px=float(fit.deviations[2:4].max()),
        reach=_reach([board for board in judged if not board.problem], size),
    )


def find_board(cv2: Any, path: Path, columns: int, rows: int) -> Board:
    """Return the board of a picture: whole, else its largest part that shows, else the problem."""
    grey = np.asarray(cv2.cvtColor(read_image(path), cv2.COLOR_BGR2GRAY))
    size = grey.shape[1], grey.shape[0]
    for number, (part_columns, part_rows) in enumerate(_parts(columns, rows)):
        flags = cv2.CALIB_CB_ACCURACY | (0 if number else cv2.CALIB_CB_EXHAUSTIVE)
        found, corners = cv2.findChessboardCornersSB(grey, (part_columns, part_rows), flags=flags)
        if found:
            return Board(
                path=path,
                size=size,
                columns=part_columns,
                rows=part_rows,
                corners_px=np.asarray(corners, float).reshape(-1, 2),
            )
    return Board(path=path, size=size, problem=f"no board of {columns} x {rows}, nor half of one")


def _parts(columns: int, rows: int) -> list[tuple[int, int]]:
    """Return the whole board and the parts of it that are tried, the largest first."""
    parts = [
        (c, r)
        for c in range(columns, min(columns, LEAST_SIDE) - 1, -1)
        for r in range(rows, min(rows, LEAST_SIDE) - 1, -1)
        if 2 * c * r >= columns * rows
    ]
    return sorted(parts, key=lambda part: -part[0] * part[1])[:MOST_PARTS]


def _fitted(cv2: Any, boards: list[Board], size: tuple[int, int]) -> tuple[_Fit, list[Board]]:
    """Return the fit to boards of one size, and which of them are in it: one that contradicts is not."""
    while True:
        if len(boards) < LEAST_BOARDS:
            raise VideoError(
                f"boards in {len(boards)} pictures of {size[0]} x {size[1]}: at least {LEAST_BOARDS} were "
                "expected, 10 to 20 from all sides are good"
            )
        fit = _fit(cv2, boards, size)
        limit = max(OUTLIER * float(np.median(fit.errors_px)), LEAST_OUTLIER_PX)
        worst = int(fit.errors_px.argmax())
        if fit.errors_px[worst] <= limit:
            return fit, boards
        boards = boards[:worst] + boards[worst + 1 :]


def _fit(cv2: Any, boards: list[Board], size: tuple[int, int]) -> _Fit:
    """Return the fit with k3, or without it where it is not sure to be there, or would fold the picture."""
    fit = _fit_with(cv2, boards, size, 0)
    if abs(fit.lens[4]) < SURE * fit.deviations[8] or not _unfolded(fit, size):
        fit = _fit_with(cv2, boards, size, cv2.CALIB_FIX_K3)
    if not _unfolded(fit, size):
        fit = _fit_with(cv2, boards, size, cv2.CALIB_FIX_K3 | cv2.CALIB_FIX_K2)
    return fit


def _fit_with(cv2: Any, boards: list[Board], size: tuple[int, int], flags: int) -> _Fit:
    objects = [_object(board).astype(np.float32) for board in boards]
    seen = [np.asarray(board.corners_px, np.float32) for board in boards]
    rms, matrix, lens, _, _, deviations, _, errors = cv2.calibrateCameraExtended(
        objects, seen, size, None, None, flags=flags
    )
    spread = np.asarray(deviations, float).ravel()[:9]
    return _Fit(float(rms), matrix, np.asarray(lens, float).ravel()[:5], spread, np.ravel(errors))


def _object(board: Board) -> Array:
    """Return the corners (N, 3) on the board, in squares."""
    y, x = np.divmod(np.arange(board.columns * board.rows), board.columns)
    return np.array((x, y, np.zeros(len(x)))).T.astype(float)


def _unfolded(fit: _Fit, size: tuple[int, int]) -> bool:
    """Return whether the lens shows something at every corner of the picture."""
    k1, k2, p1, p2, k3 = fit.lens.tolist()
    radius = monotone_radius(DistortionConfig(k1=k1, k2=k2, k3=k3, p1=p1, p2=p2))
    if radius == inf:
        return True
    seen_radius = radius * (1.0 + k1 * radius**2 + k2 * radius**4 + k3 * radius**6)
    return all(hypot(*at) < seen_radius for at in _corner_rays(fit.matrix, size))


def _corner_rays(matrix: Array, size: tuple[int, int]) -> list[tuple[float, float]]:
    """Return the distorted normalised coordinates of the picture's corners."""
    (fx, _, cx), (_, fy, cy) = matrix[:2].tolist()
    return [((u - cx) / fx, (v - cy) / fy) for u in (-0.5, size[0] - 0.5) for v in (-0.5, size[1] - 0.5)]


def _config(fit: _Fit, size: tuple[int, int]) -> CameraConfig:
    """Return the lens as `[camera]`, rounded to what its file shows."""
    (fx, _, cx), (_, fy, cy) = fit.matrix[:2].tolist()
    k1, k2, p1, p2, k3 = (round(value, 6) for value in fit.lens.tolist())
    return CameraConfig(
        width_px=size[0],
        height_px=size[1],
        fx_px=round(fx, 3),
        fy_px=round(fy, 3),
        cx_px=round(cx, 3),
        cy_px=round(cy, 3),
        distortion=DistortionConfig(k1=k1, k2=k2, k3=k3, p1=p1, p2=p2),
    )


def _judged(
    cv2: Any, board: Board, size: tuple[int, int], used: list[Board], fit: _Fit, camera: CameraConfig
) -> Board:
    """Return a board with its error, and the reason where it was not used."""
    if board.corners_px is None:
        return board
    error_px = reprojection_error_px(cv2, board, camera)
    problem = ""
    if board.size != size:
        problem = (
            f"is {board.size[0]} x {board.size[1]}, most are {size[0]} x {size[1]}: left out; "
            f"the lens fits it to {error_px:.2f} px"
        )
    elif board not in used:
        problem = f"contradicts the others by {error_px:.2f} px: left out"
    return Board(
        path=board.path,
        size=board.size,
        columns=board.columns,
        rows=board.rows,
        corners_px=board.corners_px,
        error_px=error_px,
        problem=problem,
    )


def reprojection_error_px(cv2: Any, board: Board, config: CameraConfig) -> float:
    """Return the RMS distance between seen corners and those of the board where it fits best."""
    camera = Camera.from_config(config)
    matrix = np.array([[camera.fx_px, 0.0, camera.cx_px], [0.0, camera.fy_px, camera.cy_px], [0.0, 0.0, 1.0]])
    d = config.distortion
    lens = np.array([d.k1, d.k2, d.p1, d.p2, d.k3])
    points, seen = _object(board), np.asarray(board.corners_px)
    _, turn, shift = cv2.solvePnP(points, seen, matrix, lens)
    again, _ = cv2.projectPoints(points, turn, shift, matrix, lens)
    apart = again.reshape(-1, 2) - seen
    return float(np.sqrt((apart * apart).sum(axis=1).mean()))


def _reach(boards: Sequence[Board], size: tuple[int, int]) -> float:
    """Return how far towards the corners of the picture corners were seen: the least of the four quarters."""
    at = np.concatenate([np.asarray(board.corners_px) for board in boards])
    across = (at - (np.array(size) - 1.0) / 2.0) / (np.array(size) / 2.0)
    far = np.abs(across).min(axis=1)  # on the diagonal both are alike
    quarters = [(across[:, 0] > 0) == right for right in (True, False)]
    halves = [(across[:, 1] > 0) == lower for lower in (True, False)]
    return float(min(far[side & half].max(initial=0.0) for side in quarters for half in halves))

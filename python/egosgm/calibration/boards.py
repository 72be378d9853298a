# SPDX-License-Identifier: Apache-2.0
"""Boards of OpenCV in images: chessboards and ChArUco."""
import collections
from typing import Any, Callable, Dict, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .. import _egosgm

Corners = Dict[int, NDArray[np.float32]]  # (x, y) [px] by the corner's number on the board
_STOP = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 40, 0.001)
_TRIED = 3  # images in which boards of other sizes are looked for


class Board(NamedTuple):
    name: str
    points_m: NDArray[np.float32]  # (N, 3), by number
    find: Callable[[NDArray[np.uint8]], Corners]
    fewest: int  # corners of a view
    is_charuco: bool


def chessboard(columns: int, rows: int, square_m: float) -> Board:
    """columns, rows: inner corners, where four squares meet."""
    y, x = np.mgrid[0:rows, 0:columns]
    points = np.stack([x, y, np.zeros_like(x)], axis=-1).reshape(-1, 3).astype(np.float32) * np.float32(square_m)

    def find(grey: NDArray[np.uint8]) -> Corners:
        is_there, corners = cv2.findChessboardCornersSB(grey, (columns, rows), flags=cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY)
        return dict(enumerate(corners.reshape(-1, 2))) if is_there else {}

    return Board(f"a chessboard of {columns}x{rows} inner corners", points, find, columns * rows, False)


def _half_window(points: NDArray[np.float64], corners: NDArray[np.float32], gap_m: float) -> int:
    """Half of the window [px] that holds a corner and nothing of the markers, which begin gap_m beside it."""
    if len(points) < 3:
        return 2
    fit = np.linalg.lstsq(np.column_stack([points[:, :2], np.ones(len(points))]), corners, rcond=None)[0]
    return int(np.clip(0.8 * gap_m * np.linalg.svd(fit[:2], compute_uv=False)[-1], 2, 8))


def charuco(columns: int, rows: int, square_m: float, marker_m: float, dictionary: str) -> Board:
    """columns, rows: squares, as OpenCV counts for this board."""
    aruco: Any = getattr(cv2, "aruco", None)
    if aruco is None:
        raise _egosgm.InvalidArgument("--marker: this OpenCV has no aruco module: pip install opencv-python-headless, of 4.7 or later")
    number = getattr(aruco, dictionary, None)
    if not dictionary.startswith("DICT_") or number is None:
        there = ", ".join(sorted(name for name in dir(aruco) if name.startswith("DICT_")))
        raise _egosgm.InvalidArgument(f"--dictionary {dictionary}: choose one of {there}")
    words = aruco.getPredefinedDictionary(number) if hasattr(aruco, "getPredefinedDictionary") else aruco.Dictionary_get(number)
    if hasattr(aruco, "CharucoDetector"):
        board = aruco.CharucoBoard((columns, rows), square_m, marker_m, words)
        points, detector = board.getChessboardCorners(), aruco.CharucoDetector(board)
        detect = lambda grey: detector.detectBoard(grey)[:2]  # noqa: E731
    else:  # before 4.7
        board = aruco.CharucoBoard_create(columns, rows, square_m, marker_m, words)
        points = board.chessboardCorners

        def detect(grey: NDArray[np.uint8]) -> Tuple[Any, Any]:
            markers, numbers, _ = aruco.detectMarkers(grey, words)
            return aruco.interpolateCornersCharuco(markers, numbers, grey, board)[1:] if numbers is not None else (None, None)

    def find(grey: NDArray[np.uint8]) -> Corners:
        corners, numbers = detect(grey)
        if numbers is None:
            return {}
        half = _half_window(np.array(points)[numbers.ravel()], corners.reshape(-1, 2), (square_m - marker_m) / 2)
        corners = cv2.cornerSubPix(grey, np.ascontiguousarray(corners, np.float32), (half, half), (-1, -1), _STOP)
        return dict(zip(numbers.ravel().tolist(), corners.reshape(-1, 2)))

    return Board(f"a ChArUco board of {columns}x{rows} squares, {dictionary}", np.array(points, np.float32), find, 8, True)


def other_size(greys: Sequence[NDArray[np.uint8]], columns: int, rows: int) -> Optional[Tuple[int, int]]:
    """The size of a chessboard that is there in place of the one that is not: the one of most images, as a part of a board is found as a board, too."""
    seen: "collections.Counter[Tuple[int, int]]" = collections.Counter()
    for grey in greys[:_TRIED]:
        is_there, _, marks = cv2.findChessboardCornersSBWithMeta(grey, (3, 3), cv2.CALIB_CB_NORMALIZE_IMAGE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_LARGER)
        size = (max(marks.shape), min(marks.shape)) if is_there else (0, 0)
        if is_there and size not in ((columns, rows), (rows, columns)):
            seen[size] += 1
    return max(seen, key=lambda size: (seen[size], size[0] * size[1]), default=None)


def drawn(grey: NDArray[np.uint8], corners: Corners, board: Board, columns: int, rows: int) -> NDArray[np.uint8]:
    picture = cv2.cvtColor(grey, cv2.COLOR_GRAY2BGR)
    if not corners:
        return picture
    places = np.array(list(corners.values()), np.float32).reshape(-1, 1, 2)
    if board.is_charuco:
        for x, y in places.reshape(-1, 2):
            cv2.drawMarker(picture, (round(float(x)), round(float(y))), (0, 0, 255), cv2.MARKER_CROSS, 12, 1)
        return picture
    return cv2.drawChessboardCorners(picture, (columns, rows), places, True)

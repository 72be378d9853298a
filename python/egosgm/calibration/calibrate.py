# SPDX-License-Identifier: Apache-2.0
"""egosgm calibrate: pictures of a board by two cameras in, the calibration that `egosgm rectify` reads out."""
import argparse
import pathlib
import re
import shlex
from typing import Any, Dict, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from ..arguments import counted, decimal, Parser, tell
from .boards import Board, Corners, charuco, chessboard, drawn, other_size
from .raw_pairs import RawPair, add_pairs, pairs_of
from .rectification import StereoRig, projections

_FEWEST_VIEWS, _MANY_VIEWS, _MOST_VIEWS = 5, 15, 40  # the time grows with their cube
_BAD_VIEW = 3.0  # times the median error of all views
_SAME_PLACE = 0.01  # of the width, between a board's corners in two views
_LEAST_BAD_PX = 0.3  # no view with a smaller error is bad
_MOST_LEFT_OUT = 0.3  # of the views; where more are bad, something else is wrong
_CELLS = (8, 6)  # of the image, for its coverage
_LEAST_COVERAGE, _LEAST_TILT_DEG, _MOST_ERROR_PX = 0.5, 15.0, 1.0
_USELESS_ERROR = 0.01  # of the width
_MOST_SQUARE_M, _LEAST_SQUARE_M = 0.5, 0.001
_DICTIONARY = "DICT_4X4_50"
_LEAST_BASELINE_M = 1e-4  # of pictures of one camera next to nothing is found


class _View(NamedTuple):
    number: int
    corners: Tuple[Corners, Corners]

    def common(self) -> List[int]:
        return sorted(set(self.corners[0]) & set(self.corners[1]))


class _Camera(NamedTuple):
    matrix: NDArray[np.float64]
    distortion: NDArray[np.float64]
    error_px: float
    tilts_deg: List[float]


class _Stereo(NamedTuple):
    cameras: Tuple[_Camera, _Camera]
    rotation: NDArray[np.float64]
    translation_m: NDArray[np.float64]
    error_px: float
    errors_px: NDArray[np.float64]  # (views, 2)


def _parser() -> Parser:
    parser = Parser("calibrate", description="Calibrate two cameras by pictures of a board, for `egosgm rectify`",
                    epilog="Hold the board so that it fills much of both images, near and far, tilted to all sides, and into the images' corners; 20 pairs do.\n"
                    "A view is left out whose error in a camera is above 3 times the median of all views, and above 0.3 px.")
    add_pairs(parser)
    add = parser.add_argument
    add("--board", required=True, metavar="CxR", help="9x6: a chessboard's inner corners, where four squares meet; with --marker a ChArUco board's squares")
    add("--square", required=True, type=decimal, metavar="M", help="side of a square, as measured on the board [m]")
    add("--marker", type=decimal, metavar="M", help="the board is a ChArUco board with markers of this side [m]")
    add("--dictionary", metavar="NAME", help=f"of its markers, by OpenCV's name; without: {_DICTIONARY}")
    add("--pictures", metavar="DIR", help="new folder for pictures of all pairs with the corners that were found")
    add("--out", required=True, metavar="FILE.yml", help="the calibration: a new file of OpenCV's (M1, D1, M2, D2, R, T)")
    return parser


def _board_of(given: argparse.Namespace) -> Tuple[Board, int, int]:
    size = re.fullmatch(r"([1-9]\d?)[xX]([1-9]\d?)", given.board)
    if size is None or min(int(size[1]), int(size[2])) < 3:
        raise _egosgm.InvalidArgument(f"--board {given.board}: give columns and rows, such as 9x6, each 3 and more")
    columns, rows = int(size[1]), int(size[2])
    for name, side_m in (("--square", given.square), ("--marker", given.marker)):
        if side_m is not None and not _LEAST_SQUARE_M <= side_m <= _MOST_SQUARE_M:
            hint = f": are these millimetres? Give {side_m / 1000:g}" if _LEAST_SQUARE_M <= side_m / 1000 <= _MOST_SQUARE_M else ""
            raise _egosgm.InvalidArgument(f"{name} {side_m:g}: is in metres, from {_LEAST_SQUARE_M} to {_MOST_SQUARE_M}{hint}")
    if given.marker is None and given.dictionary:
        raise _egosgm.InvalidArgument(f"--dictionary {given.dictionary}: a chessboard has no markers: give --marker, the side of one [m], for a ChArUco board")
    if given.marker is None:
        return chessboard(columns, rows, given.square), columns, rows
    if not given.marker < given.square:
        raise _egosgm.InvalidArgument(f"--marker {given.marker:g}: a marker is smaller than its square, {given.square:g} m")
    return charuco(columns, rows, given.square, given.marker, given.dictionary or _DICTIONARY), columns, rows


def _grey(pair: RawPair) -> Tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    left, right = (image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (pair.left, pair.right))
    return _egosgm._grey_bytes(np.ascontiguousarray(left), np.ascontiguousarray(right))


def _in_one_order(left: Corners, right: Corners) -> Corners:
    """The right image's corners, which a board that looks the same upside down may have in reverse."""
    last = len(left) - 1
    if len(left) != len(right) or set(left) != set(range(last + 1)):
        return right
    return {last - number: place for number, place in right.items()} if (left[last] - left[0]) @ (right[last] - right[0]) < 0 else right


def _places(views: Sequence[_View], most_px: float) -> int:
    """How many of the views show the board elsewhere than all before them."""
    places: List[Corners] = []
    for view in views:
        corners = view.corners[0]
        apart = [max((float(np.abs(corners[number] - other[number]).max()) for number in corners.keys() & other), default=np.inf) for other in places]
        if min(apart, default=np.inf) > most_px:
            places.append(corners)
        if len(places) == _FEWEST_VIEWS:
            break
    return len(places)


class _Views:
    """The pairs, and the board in them."""

    def __init__(self, given: argparse.Namespace, board: Board, columns: int, rows: int) -> None:
        self.views: List[_View] = []
        self.size: Optional[Tuple[int, int]] = None
        self.pairs, self.found = 0, [0, 0]
        without: List[NDArray[np.uint8]] = []
        pairs = pairs_of(given)
        for pair in pairs:
            greys = _grey(pair)
            size = greys[0].shape[1::-1]
            if self.size not in (None, size):
                raise _egosgm.InvalidArgument(f"pair {self.pairs} is {size[0]}x{size[1]}, the pairs before {self.size[0]}x{self.size[1]}: all need one size")
            self.size = size
            corners = [found if len(found) >= board.fewest else {} for found in map(board.find, greys)]
            if not board.is_charuco and corners[0] and corners[1]:
                corners[1] = _in_one_order(*corners)
            self.found = [count + bool(found) for count, found in zip(self.found, corners)]
            view = _View(self.pairs, (corners[0], corners[1]))
            if len(view.common()) >= board.fewest:
                self.views.append(view)
            elif len(without) < 3:
                without.append(greys[0])
            if given.pictures:
                picture = np.hstack([drawn(grey, found, board, columns, rows) for grey, found in zip(greys, corners)])
                _egosgm._write_new_file(pathlib.Path(given.pictures) / f"{self.pairs:06d}.png", cv2.imencode(".png", picture)[1].tobytes())
            self.pairs += 1
        self.note = pairs.note
        places = _places(self.views, _SAME_PLACE * (self.size or (0, 0))[0])
        if places < _FEWEST_VIEWS <= len(self.views):
            raise _egosgm.InvalidArgument(f"the board stands in {counted(places, 'place')} in the {len(self.views)} views of it, which tells nothing of the lenses; {_FEWEST_VIEWS} are needed: "
                                          "move and tilt it between the pictures")
        if len(self.views) < _FEWEST_VIEWS:
            there = other_size(without, columns, rows) if not board.is_charuco and not self.views else None
            hint = f"; one of {there[0]}x{there[1]} is there: inner corners count, where four squares meet" if there else \
                f"; is it {board.name}?" * (board.is_charuco and not any(self.found)) + "; give more pictures of the whole board in both images at once, sharp and evenly lit"
            raise _egosgm.InvalidArgument(f"{board.name} was found in {self.found[0]} left and {self.found[1]} right images of {counted(self.pairs, 'pair')}, in "
                                          f"both at once in {len(self.views)}; {_FEWEST_VIEWS} are needed{hint}" + (f"; {self.note}" if self.note else ""))


def _points(board: Board, numbers: Sequence[int], corners: Corners) -> Tuple[NDArray[np.float32], NDArray[np.float32]]:
    return board.points_m[list(numbers)].reshape(-1, 1, 3), np.array([corners[number] for number in numbers], np.float32).reshape(-1, 1, 2)


def _flags(views: int) -> int:
    """Few views say nothing of the third radial coefficient."""
    return cv2.CALIB_FIX_K3 if views < _MANY_VIEWS else 0


def _calibrate_camera(board: Board, views: Sequence[_View], side: int, size: Tuple[int, int]) -> Tuple[NDArray[np.float64], NDArray[np.float64], List[float]]:
    """Matrix, distortion, and the board's tilts [degrees], by one camera alone."""
    objects, images = zip(*(_points(board, sorted(view.corners[side]), view.corners[side]) for view in views))
    _, matrix, distortion, turns, _ = cv2.calibrateCamera(objects, images, size, None, None, flags=_flags(len(views)))
    return matrix, distortion.ravel()[:5], [float(np.degrees(np.arccos(min(1.0, abs(cv2.Rodrigues(turn)[0][2, 2]))))) for turn in turns]


def _calibrate(board: Board, views: Sequence[_View], size: Tuple[int, int]) -> _Stereo:
    alone = [_calibrate_camera(board, views, side, size) for side in (0, 1)]
    objects, lefts, rights = [], [], []
    for view in views:
        numbers = view.common()
        points, left = _points(board, numbers, view.corners[0])
        objects.append(points)
        lefts.append(left)
        rights.append(_points(board, numbers, view.corners[1])[1])
    # One camera alone may take a lens for a distance, which both together do not.
    given = [part for matrix, distortion, _ in alone for part in (matrix, distortion)]
    found = cv2.stereoCalibrateExtended(objects, lefts, rights, *given, size, np.eye(3), np.zeros((3, 1)),
                                        flags=cv2.CALIB_USE_INTRINSIC_GUESS | _flags(len(views)))
    errors = np.asarray(found[-1])  # what lies before it depends on OpenCV's version
    of_cameras = np.sqrt((errors ** 2).mean(axis=0))
    cameras = [_Camera(found[1 + 2 * side], found[2 + 2 * side].ravel()[:5], float(of_cameras[side]), alone[side][2]) for side in (0, 1)]
    return _Stereo((cameras[0], cameras[1]), found[5], found[6].ravel(), float(found[0]), errors)


def _without_bad(board: Board, views: List[_View], size: Tuple[int, int]) -> Tuple[_Stereo, List[_View], List[Tuple[_View, float]]]:
    """The calibration by the views that agree, these, and those that were left out, with their errors."""
    out: List[Tuple[_View, float]] = []
    most_out = int(_MOST_LEFT_OUT * len(views))
    while True:
        stereo = _calibrate(board, views, size)
        worst = stereo.errors_px.max(axis=1)
        bound = np.maximum(_BAD_VIEW * np.median(stereo.errors_px, axis=0), _LEAST_BAD_PX)
        is_bad = (stereo.errors_px > bound).any(axis=1)
        if not is_bad.any() or len(out) >= most_out or len(views) <= _FEWEST_VIEWS:
            return stereo, views, out
        at = int(np.argmax(np.where(is_bad, worst, 0)))  # one at a time, as it spoils its neighbours' errors
        out.append((views[at], float(worst[at])))
        views = views[:at] + views[at + 1:]


def _thinned(views: List[_View]) -> List[_View]:
    """As many as tell the cameras in good time, evenly chosen: a video has hundreds that are alike."""
    last = len(views) - 1
    return views if last < _MOST_VIEWS else [views[i * last // (_MOST_VIEWS - 1)] for i in range(_MOST_VIEWS)]


def _rows_px(board: Board, views: Sequence[_View], stereo: _Stereo, size: Tuple[int, int]) -> NDArray[np.float64]:
    """How far the rows of corners are apart once both images are rectified."""
    left, right = stereo.cameras
    r1, r2, p1, p2 = projections(StereoRig(left.matrix, left.distortion, right.matrix, right.distortion, stereo.rotation, stereo.translation_m), size, 0.0)
    apart = []
    for view in views:
        numbers = view.common()
        rows = [cv2.undistortPoints(_points(board, numbers, view.corners[side])[1], camera.matrix, camera.distortion, R=r, P=p)[:, 0, 1]
                for side, (camera, r, p) in enumerate(((left, r1, p1), (right, r2, p2)))]
        apart.append(np.abs(rows[0] - rows[1]))
    return np.concatenate(apart)


def _coverage(views: Sequence[_View], side: int, size: Tuple[int, int]) -> float:
    """The share of the image's cells with a corner."""
    places = np.concatenate([np.array(list(view.corners[side].values())) for view in views])
    cells = np.clip((places * _CELLS / size).astype(int), 0, np.array(_CELLS) - 1)
    return len({tuple(cell) for cell in cells.tolist()}) / (_CELLS[0] * _CELLS[1])


def _error_px(stereo: _Stereo) -> float:
    return max(stereo.error_px, *(camera.error_px for camera in stereo.cameras))


def _check_error(stereo: _Stereo, board: Board, width: int) -> None:
    error_px = _error_px(stereo)
    if not error_px <= _USELESS_ERROR * width:
        raise _egosgm.InvalidArgument(f"the error is {error_px:.3g} px, with which nothing can be rectified: is it {board.name}, columns first, and are both images of the same "
                                      "moment?")


def _check_stance(stereo: _Stereo) -> None:
    x, y, z = stereo.translation_m
    if not np.linalg.norm(stereo.translation_m) >= _LEAST_BASELINE_M:
        raise _egosgm.InvalidArgument("both cameras stand in one place: are left and right pictures of one camera?")
    text = f"the right camera stands at ({-x:.4g}, {-y:.4g}, {-z:.4g}) m, seen by the left one: "
    if abs(x) < abs(y) or abs(x) < abs(z):
        raise _egosgm.InvalidArgument(text + "the cameras do not stand side by side; where one stands above the other, turn the images by 90 degrees")
    if x > 0:
        raise _egosgm.InvalidArgument(text + "left and right are swapped: exchange --left and --right")


def _advice(stereo: _Stereo, coverage: Sequence[float], views: int) -> List[str]:
    found = []
    if min(coverage) < _LEAST_COVERAGE:
        found.append(f"corners cover {100 * min(coverage):.0f} % of an image: hold the board into the images' corners and borders, too, where lenses distort most")
    if max(stereo.cameras[0].tilts_deg) < _LEAST_TILT_DEG:
        found.append(f"the board was never tilted by more than {max(stereo.cameras[0].tilts_deg):.0f} degrees, so that focal lengths are uncertain: tilt it to all sides")
    if views < _MANY_VIEWS:
        found.append(f"{counted(views, 'view')} are few: take 20")
    if _error_px(stereo) > _MOST_ERROR_PX:
        found.append("errors are large: is the board flat, are both images of the same moment, are --board and --square right?")
    return found


def _text(stereo: _Stereo, size: Tuple[int, int]) -> str:
    storage = cv2.FileStorage(".yml", cv2.FILE_STORAGE_WRITE | cv2.FILE_STORAGE_MEMORY)
    storage.write("image_width", int(size[0]))
    storage.write("image_height", int(size[1]))
    values: Dict[str, Any] = {"M1": stereo.cameras[0].matrix, "D1": stereo.cameras[0].distortion.reshape(1, -1), "M2": stereo.cameras[1].matrix,
                              "D2": stereo.cameras[1].distortion.reshape(1, -1), "R": stereo.rotation, "T": stereo.translation_m.reshape(3, 1)}
    for name, value in values.items():
        storage.write(name, np.ascontiguousarray(value, dtype=np.float64))
    return storage.releaseAndGetString()


def _tell(found: _Views, stereo: _Stereo, views: Sequence[_View], out: Sequence[Tuple[_View, float]], coverage: Sequence[float],
          rows: NDArray[np.float64]) -> None:
    thinned = f"; {_MOST_VIEWS} of them are taken, evenly chosen" if len(found.views) > _MOST_VIEWS else ""
    tell(f"the board is in both images of {len(found.views)} of {counted(found.pairs, 'pair')} ({found.found[0]} left, {found.found[1]} right){thinned}")
    for view, errors in zip(views, stereo.errors_px):
        tell(f"  pair {view.number:3}: error {errors[0]:.3f} px left, {errors[1]:.3f} px right")
    for view, error in out:
        tell(f"  pair {view.number:3}: left out, {error:.3f} px")
    for name, camera, share in zip(("left", "right"), stereo.cameras, coverage):
        m = camera.matrix
        tell(f"{name + ':':<7}fx {m[0, 0]:.2f}, fy {m[1, 1]:.2f}, cx {m[0, 2]:.2f}, cy {m[1, 2]:.2f} px; error {camera.error_px:.3f} px; corners cover {100 * share:.0f} % "
              "of the image")
    turn = float(np.degrees(np.linalg.norm(cv2.Rodrigues(stereo.rotation)[0])))
    tell(f"pair:  baseline {np.linalg.norm(stereo.translation_m):.4f} m, turned by {turn:.2f} degrees; error {stereo.error_px:.3f} px; rows agree within "
          f"{np.quantile(rows, 0.9):.2f} px after rectification (90 % of the corners)")
    for text in filter(None, [found.note, *_advice(stereo, coverage, len(views))]):
        tell(f"note:  {text}")


def _next_step(given: argparse.Namespace) -> str:
    halves = {"--side-by-side": given.side_by_side, "--top-bottom": given.top_bottom}
    source = next((f"{option} {shlex.quote(pattern)}" for option, pattern in halves.items() if pattern), "--left LEFT --right RIGHT")
    return f"egosgm rectify {source} --calib {shlex.quote(given.out)} --out SEQUENCE"


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    board, columns, rows = _board_of(given)
    out = pathlib.Path(given.out)
    _egosgm._expect_new_file("--out", out)
    if given.pictures:
        _egosgm._expect_new_folder("--pictures", pathlib.Path(given.pictures))
        pathlib.Path(given.pictures).mkdir(parents=True, exist_ok=True)
    found = _Views(given, board, columns, rows)
    assert found.size is not None
    try:
        stereo, views, left_out = _without_bad(board, _thinned(found.views), found.size)
    except cv2.error as error:
        reason = str(error).strip().splitlines()[-1]
        raise _egosgm.InvalidArgument(f"the views do not tell the cameras ({reason}): give pictures of the board tilted to all sides") from None
    _check_error(stereo, board, found.size[0])
    _check_stance(stereo)
    coverage = [_coverage(views, side, found.size) for side in (0, 1)]
    _egosgm._write_new_file(out, _text(stereo, found.size).encode())  # first: the standard output may be full
    _tell(found, stereo, views, left_out, coverage, _rows_px(board, views, stereo, found.size))
    tell(f"{given.out}: {_next_step(given)}")
    return 0

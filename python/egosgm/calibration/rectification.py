# SPDX-License-Identifier: Apache-2.0
"""Raw cameras, and how their images become rectified ones. Needs OpenCV (cv2) once a Rectification is made."""
import dataclasses
import math
from typing import Any, List, Optional, Tuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _egosgm

_Matrix = NDArray[np.float64]
_Rectangle = Tuple[int, int, int, int]
_MOST_BASELINE_M = 10.0
_LEAST_DISTANCE_M = 1e-6
_MOST_ROTATION_ERROR = 1e-2  # files round to a few digits
_MOST_FOCAL_DIFFERENCE, _MOST_ROWS_PX = 1e-3, 1e-2  # of P1 and P2, which round to a few digits, too
_MOST_SIDE = 16384
_MOST_TURN_DEG = 45.0
_LEAST_SCALE, _MOST_SCALE_ERROR = 1.15, 0.1  # of a camera matrix of images of another size: its centre and its focal length are scaled alike


def _matrix_of(numbers: ArrayLike) -> _Matrix:
    try:
        matrix = np.array(numbers, dtype=np.float64)
    except (TypeError, ValueError):
        matrix = np.zeros(0)
    if not 1 <= matrix.ndim <= 2 or not 1 <= matrix.size <= 64:
        raise _egosgm.InvalidArgument("a rig's matrices have 1 or 2 dimensions and at most 64 numbers")
    return matrix


@dataclasses.dataclass(eq=False)
class StereoRig:
    """Two cameras as OpenCV calibrates them: matrices 3x3 [px], distortion of 4, 5, 8, 12 or 14 coefficients (4 of a fisheye); a point of the
    left camera's frame lies at R x + T [m] in the right one's. size: (width, height) of the calibrated images. given: R1, R2, P1 and P2 that are to
    be used."""

    left_matrix: ArrayLike
    left_distortion: ArrayLike
    right_matrix: ArrayLike
    right_distortion: ArrayLike
    R: ArrayLike
    T: ArrayLike
    is_fisheye: bool = False
    size: Optional[Tuple[int, int]] = None
    given: Optional[Tuple[ArrayLike, ArrayLike, ArrayLike, ArrayLike]] = None

    def __post_init__(self) -> None:
        for name in ("left_matrix", "left_distortion", "right_matrix", "right_distortion", "R", "T"):
            setattr(self, name, _matrix_of(getattr(self, name)))
        if self.size is not None:
            width, height = self.size
            self.size = (int(width), int(height))
        if self.given is not None:
            if len(self.given) != 4:
                raise _egosgm.InvalidArgument("R1, R2, P1 and P2 belong together: give all four or none")
            self.given = tuple(_matrix_of(matrix) for matrix in self.given)  # type: ignore[assignment]


def is_transposed(matrix: Any) -> bool:
    """Of a camera matrix, of OpenCV's P and Q, or of a rotation and a translation: what stands in the last column stands in the last row."""
    if matrix.size == 12:
        flat = matrix.ravel()
        return bool(flat[4] and not flat[5])  # fy
    side = {9: 3, 16: 4}.get(matrix.size, 0)
    square = matrix.reshape(side, side) if side else matrix
    return bool(side and square[-1, :2].any() and not square[:2, -1].any())


def _check_shape(name: str, matrix: Any, rows: int, columns: int) -> None:
    if matrix.shape not in ((rows, columns), (rows,) if columns == 1 else ()) or not np.isfinite(matrix).all():
        raise _egosgm.InvalidArgument(f"{name}: needs {rows}x{columns} finite numbers")


def _check_distortion(name: str, matrix: Any, is_fisheye: bool) -> None:
    fits = matrix.size == 4 or (not is_fisheye and matrix.size in (5, 8, 12, 14))
    if not fits or max(matrix.shape) != matrix.size or not np.isfinite(matrix).all():
        raise _egosgm.InvalidArgument(f"{name}: needs 4{'' if is_fisheye else ', 5, 8, 12 or 14'} finite numbers")


def _check_size(left: _Matrix, right: _Matrix) -> None:
    scales = right[(0, 0, 1), (0, 2, 2)] / left[(0, 0, 1), (0, 2, 2)]  # of fx, cx, cy
    scales = 1 / scales if scales[0] < 1 else scales
    if scales.min() >= _LEAST_SCALE and np.ptp(scales) <= _MOST_SCALE_ERROR * scales.max():
        raise _egosgm.InvalidArgument(f"M1 and M2 are of images of two sizes: fx, cx and cy of one are {scales.mean():.3g} times the other's; give both cameras' calibrations of one size")


def _check_rotation(name: str, rotation: Any) -> None:
    if np.abs(rotation @ rotation.T - np.eye(3)).max() > _MOST_ROTATION_ERROR or not np.linalg.det(rotation) > 0:
        raise _egosgm.InvalidArgument(f"{name} is no rotation: its rows are not of length 1 and at right angles; give the calibration as it was computed")


def expect_side_by_side(translation: _Matrix) -> None:
    """translation: of the first camera's points to the second's. Throws InvalidArgument unless the second one stands right of the first."""
    x, y, z = translation
    text = f"T = ({x:.4g}, {y:.4g}, {z:.4g}) m: "
    if not math.hypot(x, y, z) >= _LEAST_DISTANCE_M:
        raise _egosgm.InvalidArgument(text + "the cameras stand in one place; give the calibration of two")
    if abs(x) < abs(y) or abs(x) < abs(z):
        raise _egosgm.InvalidArgument(text + "the cameras do not stand side by side; turn the images by 90 degrees")
    if x > 0:
        raise _egosgm.InvalidArgument(text + "the second camera stands left of the first: is this the inverse of the transformation from the first "
                                      "camera's points to the second's? Else exchange left and right, images and calibration")
    if -x > _MOST_BASELINE_M:
        raise _egosgm.InvalidArgument(f"the baseline is {-x:.4g} m: is T in centimetres or millimetres? give --unit cm (unit_m 0.01) or --unit mm "
                                      "(unit_m 0.001)")


def check_rig(rig: Any) -> None:
    """Throws InvalidArgument where no two cameras that stand side by side have these numbers."""
    for side, name in enumerate(("left", "right"), 1):
        _check_shape(f"M{side}", getattr(rig, f"{name}_matrix"), 3, 3)
        _check_distortion(f"D{side}", getattr(rig, f"{name}_distortion"), rig.is_fisheye)
    _check_shape("R", rig.R, 3, 3)
    _check_shape("T", rig.T, 3, 1)
    _check_rotation("R", rig.R)
    turn_deg = math.degrees(math.acos(min(1.0, max(-1.0, (np.trace(rig.R) - 1) / 2))))
    if turn_deg > _MOST_TURN_DEG:
        raise _egosgm.InvalidArgument(f"R turns by {turn_deg:.0f} degrees, and cameras side by side look the same way: is it a vector in degrees, which OpenCV has in radians? "
                                      "Of a camera that is mounted upside down, turn the images, and calibrate them so")
    with np.errstate(all="ignore"):
        _check_size(rig.left_matrix, rig.right_matrix)
    for name, matrix in zip(("R1", "R2", "P1", "P2"), rig.given or ()):
        _check_shape(name, matrix, 3, 3 if name[0] == "R" else 4)
        if name[0] == "R":
            _check_rotation(name, matrix)
    expect_side_by_side(rig.T.ravel())
    if rig.given is not None:
        apart = np.abs(rig.given[2] - rig.given[3])
        if max(apart[0, 0], apart[1, 1]) > _MOST_FOCAL_DIFFERENCE * abs(rig.given[2][0, 0]) or apart[1, 2] > _MOST_ROWS_PX:
            raise _egosgm.InvalidArgument("P1 and P2 have different focal lengths or rows: they are not of one rectified pair; give both as stereoRectify found them, or neither")
    else:
        for name, matrix in (("M1", rig.left_matrix), ("M2", rig.right_matrix)):
            if not (matrix[0, 0] > 0 and matrix[1, 1] > 0 and matrix[2].tolist() == [0, 0, 1]):
                raise _egosgm.InvalidArgument(f"{name} is no camera matrix: fx and fy are above 0, its last row is 0 0 1"
                                              + ("; it is transposed, as MATLAB writes it" if is_transposed(matrix) else ""))


def projections(rig: Any, size: Tuple[int, int], alpha: float) -> Any:
    """R1, R2, P1, P2. Since OpenCV 5 an array of three numbers is no column."""
    import cv2
    if rig.given is not None:
        return rig.given
    cameras = (rig.left_matrix, rig.left_distortion.reshape(-1, 1), rig.right_matrix, rig.right_distortion.reshape(-1, 1))
    if rig.is_fisheye:
        return cv2.fisheye.stereoRectify(*cameras, size, rig.R, rig.T.reshape(3, 1), cv2.CALIB_ZERO_DISPARITY, newImageSize=size, balance=alpha)[:4]
    return cv2.stereoRectify(*cameras, size, rig.R, rig.T.reshape(3, 1), flags=cv2.CALIB_ZERO_DISPARITY, alpha=alpha, newImageSize=size)[:4]


def _largest_rectangle(valid: NDArray[np.bool_]) -> _Rectangle:
    """x, y, width, height of the largest upright rectangle of valid pixels (one pass over histograms of columns)."""
    best, area = (0, 0, 0, 0), 0
    heights = np.zeros(valid.shape[1] + 1, int)
    for y, row in enumerate(valid):
        heights[:-1] = np.where(row, heights[:-1] + 1, 0)
        if np.all(heights[:-1] == heights[0]):
            spans = [(0, valid.shape[1], int(heights[0]))]
        else:
            spans = []
            waiting: List[int] = []
            for x, height in enumerate(heights.tolist()):
                while waiting and heights[waiting[-1]] >= height:
                    top = int(heights[waiting.pop()])
                    left = waiting[-1] + 1 if waiting else 0
                    spans.append((left, x, top))
                waiting.append(x)
        for left, end, height in spans:
            if height * (end - left) > area:
                best, area = (left, y - height + 1, end - left, height), height * (end - left)
    return best


class Rectification:
    """How raw images of a rig, width x height, become rectified ones of the same size. alpha 0: only pixels that the raw images have, to 1: all
    that they have. Threads may share one."""

    @np.errstate(all="ignore")  # what is no number is refused by its name
    def __init__(self, rig: StereoRig, width: int, height: int, alpha: float = 0.0) -> None:
        import cv2
        if not (1 <= width <= _MOST_SIDE and 1 <= height <= _MOST_SIDE):
            raise _egosgm.InvalidArgument(f"size {width}x{height}: choose sides from 1 to {_MOST_SIDE}")
        if not 0 <= alpha <= 1:
            raise _egosgm.InvalidArgument(f"alpha {alpha:.4g}: choose from 0 to 1")
        if rig.size is not None and rig.size != (width, height):
            raise _egosgm.InvalidArgument(f"the images are {width}x{height}, but {rig.size[0]}x{rig.size[1]} were calibrated: give the calibration of this size")
        check_rig(rig)
        size = (width, height)
        left_r, right_r, left_p, right_p = projections(rig, size, alpha)
        self.calibration = _egosgm.Calibration(left_p[0, 0], left_p[1, 1], left_p[0, 2], left_p[1, 2], -right_p[0, 3] / right_p[0, 0],
                                               right_p[0, 2] - left_p[0, 2])
        make_maps = cv2.fisheye.initUndistortRectifyMap if rig.is_fisheye else cv2.initUndistortRectifyMap
        self._maps, valid = [], []
        for matrix, distortion, r, p in ((rig.left_matrix, rig.left_distortion, left_r, left_p), (rig.right_matrix, rig.right_distortion, right_r, right_p)):
            self._maps.append(make_maps(matrix, np.reshape(distortion, (-1, 1)), r, p, size, cv2.CV_32FC1))
            valid.append(cv2.remap(np.full((height, width), 255, np.uint8), *self._maps[-1], cv2.INTER_LINEAR) == 255)
        self.valid = valid[0].astype(np.uint8) * np.uint8(255)  # where the rectified left pixel lies in the raw image
        self.valid_left, self.valid_right = map(_largest_rectangle, valid)
        for side, rectangle in (("left", self.valid_left), ("right", self.valid_right)):
            if not rectangle[2]:
                raise _egosgm.InvalidArgument(f"after rectification none of the {side} image's pixels are left: give the calibration of these cameras")

    def rectify(self, left: NDArray[Any], right: NDArray[Any]) -> Tuple[NDArray[Any], NDArray[Any]]:
        """Both images rectified, of their types: grey or of three channels, uint8 or uint16; black where the raw image has nothing."""
        import cv2
        results = []
        for name, image, maps in (("left", left, self._maps[0]), ("right", right, self._maps[1])):
            image = np.asarray(image)
            if image.dtype not in (np.uint8, np.uint16) or image.ndim not in (2, 3) or image.shape[2:] not in ((), (3,)):
                raise _egosgm.InvalidArgument(f"{name}: is {image.dtype} of {image.shape}: give an image of H x W or H x W x 3, uint8 or uint16")
            height, width = image.shape[:2]
            if (height, width) != self.valid.shape:
                raise _egosgm.InvalidArgument(f"an image is {width}x{height}, the rectification is of {self.valid.shape[1]}x{self.valid.shape[0]}: "
                                              "all need one size")
            results.append(cv2.remap(np.ascontiguousarray(image), *maps, cv2.INTER_LINEAR))
        return results[0], results[1]

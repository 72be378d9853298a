# SPDX-License-Identifier: Apache-2.0
"""Point clouds of frames, and files of them."""
import os
from typing import Any, Dict, NamedTuple, Optional, Sequence, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _egosgm


class PointCloud(NamedTuple):
    """points: (N, 3) float32 [m], in the left camera's frame: x right, y down, z forward. colors: (N, 3) uint8, RGB.
    left_out: how many pixels with a disparity became no points, by the bound that left them out: far, uncertain, reason, alone."""

    points: NDArray[np.float32]
    colors: NDArray[np.uint8]
    left_out: Dict[str, int]


def _rgb(image: ArrayLike) -> NDArray[np.uint8]:
    image = np.asarray(image)
    if image.ndim not in (2, 3) or image.shape[2:] not in ((), (1,), (3,), (4,)) or image.dtype not in (np.uint8, np.uint16):
        raise _egosgm.InvalidArgument(f"colors is {image.shape} of {image.dtype}: give H x W or H x W x 3 (RGB) of uint8 or uint16")
    if image.dtype == np.uint16:  # as wide as the values are, but those of a few hot pixels
        largest = np.quantile(image, 0.999) if image.size else 0
        image = np.minimum(image * (255 / max(1, largest)), 255).astype(np.uint8)
    image = image[:, :, None] if image.ndim == 2 else image
    return np.repeat(image, 3, axis=2) if image.shape[2] == 1 else image[:, :, :3]


def _numbers_of(reasons: Union[str, Sequence[str], None]) -> Sequence[int]:
    names = [reasons] if isinstance(reasons, str) else list(reasons or [])
    for name in names:
        if name not in _egosgm.REASONS:
            raise _egosgm.InvalidArgument(f'reasons: there is no "{name}": choose from {", ".join(_egosgm.REASONS)}')
    return [_egosgm.REASONS.index(name) for name in names]


def cloud_of_maps(disparity: ArrayLike, variance: ArrayLike, colors: ArrayLike, calibration: _egosgm.Calibration, max_sigma: float,
                  reasons: Union[str, Sequence[str], None], reason: Optional[NDArray[np.uint8]], max_depth_m: float, max_jump_px: float) -> PointCloud:
    numbers, rgb = _numbers_of(reasons), _rgb(colors)
    points, bgr, left_out = _egosgm._point_cloud(disparity, variance, rgb[:, :, ::-1], calibration, max_sigma, max_depth_m, max_jump_px,
                                                 numbers, reason)
    return PointCloud(points, bgr[:, ::-1], left_out)


def point_cloud(frame: Any, max_sigma: float = 0.1, reasons: Union[str, Sequence[str], None] = None, *, colors: Optional[ArrayLike] = None,
                max_depth_m: float = 80, max_jump_px: float = 1) -> PointCloud:
    """The points of a frame of run(), with their colours:

        cloud = egosgm.point_cloud(frame)
        egosgm.write_ply("cloud.ply", cloud.points, cloud.colors)

    A pixel stays where all of this holds: its depth's standard deviation is at most max_sigma of the depth (0.1: 10 %); its reason
    is one of `reasons` (names of egosgm.REASONS, such as "trusted"; None: all; run() needs it among its outputs); it is not farther
    than max_depth_m; and the disparity of one of its four neighbours differs by at most max_jump_px.
    colors: an image to take the colours from, H x W or H x W x 3 (RGB), in place of the frame's left one, which is grey where run() read files.
    """
    if not hasattr(frame, "calibration"):
        raise _egosgm.InvalidArgument(f"point_cloud: frame is a {type(frame).__name__}: give a frame of run(); depth_from_disparity takes a map")
    if frame.calibration is None:
        raise _egosgm.InvalidArgument("point_cloud: a disparity is no depth without a calibration: give it to run()")
    needed = ["disparity", "variance"] + ["reason"] * bool(reasons)
    missing = [name for name in needed if getattr(frame.maps, name) is None]
    if missing:
        raise _egosgm.InvalidArgument(f"point_cloud: the frame has no {missing[0]}: give run() outputs={tuple(needed)}")
    return cloud_of_maps(frame.disparity, frame.variance, frame.left if colors is None else colors, frame.calibration, max_sigma, reasons,
                         frame.maps.reason if reasons else None, max_depth_m, max_jump_px)


def write_ply(file: Union[str, "os.PathLike[str]"], points: ArrayLike, colors: Optional[ArrayLike] = None,
              normals: Optional[ArrayLike] = None) -> None:
    """Writes a binary PLY. points: N x 3 [m]. colors: N x 3 of uint8, RGB. normals: N x 3. A file that is there is replaced."""
    _write(file, points, colors, normals, False)


def write_new_ply(file: Union[str, "os.PathLike[str]"], points: ArrayLike, colors: ArrayLike, normals: Optional[ArrayLike]) -> None:
    """The same. Throws IoError where a file has come there meanwhile."""
    _write(file, points, colors, normals, True)


def _write(file: Union[str, "os.PathLike[str]"], points: ArrayLike, colors: Optional[ArrayLike], normals: Optional[ArrayLike], is_new: bool) -> None:
    bgr = None
    if colors is not None:
        bgr = np.asarray(colors)
        if bgr.dtype != np.uint8 or bgr.ndim != 2:
            raise _egosgm.InvalidArgument(f"colors are {bgr.shape} of {bgr.dtype}: give N x 3 of uint8, from 0 to 255")
        bgr = bgr[..., ::-1]
    _egosgm._write_ply(os.fspath(file), points, bgr, normals, is_new)

# SPDX-License-Identifier: Apache-2.0
"""Disparity maps as another frame sees them, by the camera's motion."""
from typing import Any, Tuple

import numpy as np
from numpy.typing import ArrayLike

from .. import _egosgm
from .maps import disparity_of, is_valid
from .pose_evaluation import motion_of

_BAND_ROWS = 16


def move(disparity: np.ndarray, calibration: Any, motion: np.ndarray) -> Tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Where each pixel comes to lie: (whether in the image, place in the flattened map, disparity there). The place is of the nearest pixel, halves to the
    even one; it is 0 where it is nowhere: at infinity or beyond, behind the camera, outside of the image."""
    height, width = disparity.shape
    inside, place, there = np.empty(disparity.shape, bool), np.empty(disparity.shape, np.intp), np.empty(disparity.shape)
    x = (np.arange(width) - calibration.cx) / calibration.fx
    for top in range(0, height, _BAND_ROWS):  # what a band needs stays in the cache
        rows = slice(top, top + _BAND_ROWS)
        band = disparity[rows]
        y = ((np.arange(height)[rows] - calibration.cy) / calibration.fy)[:, None]
        with np.errstate(all="ignore"):
            shifted = np.where(is_valid(band), band, np.nan) + np.float64(calibration.doffs_px)
            inverse_depth = shifted / (calibration.fx * calibration.baseline_m)
            inverse_depth[~(inverse_depth > 0)] = np.nan
            to_x, to_y, z = (row[0] * x + (row[1] * y + row[2]) + row[3] * inverse_depth for row in motion[:3])
            z[~(z > 0)] = np.nan
            to_x, to_y = np.rint(calibration.fx * to_x / z + calibration.cx), np.rint(calibration.fy * to_y / z + calibration.cy)
            inside[rows] = (to_x >= 0) & (to_x < width) & (to_y >= 0) & (to_y < height)
            place[rows] = np.where(inside[rows], to_y * width + to_x, 0)
            there[rows] = shifted / z - calibration.doffs_px
    return inside, place, there


def move_map(disparity: ArrayLike, calibration: Any, current_from_previous: "_egosgm.Motion | ArrayLike") -> np.ndarray:
    """A disparity map as the next frame sees it, the nearest surface on top; INVALID_DISPARITY where nothing lies. current_from_previous: 4 x 4, or a Motion."""
    before = disparity_of(disparity, "disparity")
    inside, place, there = move(before, calibration, motion_of(current_from_previous, "current_from_previous"))
    with np.errstate(invalid="ignore"):
        inside &= there > _egosgm.INVALID_DISPARITY
    place, value = place[inside], there[inside].astype(np.float32)
    moved = np.full(before.size, _egosgm.INVALID_DISPARITY, np.float32)
    while len(place):  # of those that meet, any is written, and the larger ones go on
        moved[place] = value
        larger = value > moved[place]
        place, value = place[larger], value[larger]
    return moved.reshape(before.shape)

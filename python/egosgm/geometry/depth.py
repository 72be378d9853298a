# SPDX-License-Identifier: Apache-2.0
"""Depth's uncertainty, of disparities and their variance."""
import numpy as np
from numpy.typing import ArrayLike, NDArray

from .. import _egosgm


def depth_sigma_from_disparity(disparity: ArrayLike, variance: ArrayLike, calibration: _egosgm.Calibration) -> NDArray[np.float32]:
    """Standard deviation of the depth Z [m] = Z sqrt(variance) / (disparity + doffs_px); NaN where there is no depth.

    disparity [px] and its variance [px^2]: H x W, as Pipeline and run() give them.
    """
    depth = _egosgm.depth_from_disparity(disparity, calibration)
    p = np.asarray(variance, np.float32)
    if p.shape != depth.shape:
        raise _egosgm.InvalidArgument(f"variance is {p.shape} and disparity {depth.shape}: give maps of one frame")
    with np.errstate(over="ignore", invalid="ignore"):  # infinitely uncertain, where the disparity is next to nothing; NaN where p is no variance
        return depth * (depth / np.float32(calibration.fx * calibration.baseline_m)) * np.sqrt(p)

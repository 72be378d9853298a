# SPDX-License-Identifier: Apache-2.0
"""A matcher of single pairs with the calling form and the values of OpenCV's."""
from typing import Any, Optional, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm


class Matcher:
    """In place of cv2.StereoSGBM: compute(left, right) gives int16, 16 steps a pixel, (min_disparity - 1) * 16 where there is none.

    Each pair is matched alone, with eight paths unless `paths` says otherwise. All else is for Pipeline: device, preset and its options.
    """

    __slots__ = ("_disparities", "_made_for", "_min_disparity", "_options", "_pipeline")  # an option set later would change nothing

    def __init__(self, min_disparity: int = 0, disparities: int = 128, *, device: Union[str, int] = "", preset: str = "default", **options: Any) -> None:
        if options.pop("temporal", False):
            raise _egosgm.InvalidArgument("temporal: a Matcher matches each pair alone: leave it out; Pipeline and run() predict")
        options = {"preset": preset, "paths": 8, **options, "min_disparity": min_disparity, "disparities": disparities, "temporal": False}
        known = _egosgm.pipeline_options(**{name: value for name, value in options.items() if name != "cache"})
        self._min_disparity, self._disparities = known["min_disparity"], known["disparities"]
        end = self.min_disparity + self.disparities
        if not (self.min_disparity > -2047 and end <= 2047):
            raise _egosgm.InvalidArgument(f"disparities {self.min_disparity} to {end - 1} do not fit into 16 bits with 16 steps a pixel; Pipeline gives float")
        self._options = {"device": device, **options}
        self._pipeline: Optional[_egosgm.Pipeline] = None
        self._made_for: Tuple[Any, ...] = ()

    @property
    def min_disparity(self) -> int:
        return self._min_disparity

    @property
    def disparities(self) -> int:
        return self._disparities

    def __repr__(self) -> str:
        return f"<Matcher of {self.disparities} disparities from {self.min_disparity}>"

    def compute(self, left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.int16]:
        """A rectified pair of uint8 or uint16: grey, H x W, or colour as cv2.imread gives it, H x W x 3 or 4, BGR or BGRA."""
        left, right = (image[..., 2::-1] if image.ndim == 3 and image.shape[2] in (3, 4) else image for image in map(np.asanyarray, (left, right)))  # with masks, which are refused
        for name, image in (("left", left), ("right", right)):
            if image.dtype not in (np.uint8, np.uint16):
                raise _egosgm.InvalidArgument(f"{name} is an array of {image.dtype}: give uint8 or uint16, grey, H x W, or colour, H x W x 3 or 4, BGR")
        made_for = left.shape[:2], left.dtype
        if left.ndim == right.ndim == 2 and left.shape != right.shape:
            raise _egosgm.InvalidArgument(f"left is {left.shape[1]}x{left.shape[0]}, right {right.shape[1]}x{right.shape[0]}: give a pair of one size")
        if self._pipeline is None or made_for != self._made_for:
            if len(made_for[0]) != 2:
                raise _egosgm.InvalidArgument(f"left is an array of the shape {made_for[0]}: give an image, H x W or H x W x 3")
            height, width = made_for[0]
            camera = _egosgm.Calibration(1000, 1000, width / 2, height / 2, 1)  # nothing depends on it without prediction
            self._pipeline, self._made_for = _egosgm.Pipeline(camera, width, height, **self._options), made_for
        disparity = self._pipeline.process(left, right, None, "disparity").disparity
        none = np.int16((self.min_disparity - 1) * 16)
        valid = disparity != _egosgm.INVALID_DISPARITY
        return np.where(valid, np.rint(np.where(valid, disparity, 0) * 16), none).astype(np.int16)

# SPDX-License-Identifier: Apache-2.0
"""Maps of a video's frames: what is known of one frame, and what the maps that are given must be."""
import dataclasses
from typing import Any, Optional

import numpy as np

from .. import _egosgm


@dataclasses.dataclass
class Frame:
    """What is known of one frame: arrays of one size, None where there is none. Disparities are in px, masks are of bool."""

    estimate: np.ndarray
    truth: Optional[np.ndarray] = None         # of the pixels that count
    all_truth: Optional[np.ndarray] = None     # of occluded pixels too; without it, `truth`
    against: Optional[np.ndarray] = None       # another method's estimate
    uncertainty: Optional[np.ndarray] = None   # any number that grows with the expected error
    moving: Optional[np.ndarray] = None        # what moves by itself
    image: Optional[np.ndarray] = None         # uint8 or uint16: the left image
    flow_to_next: Optional[np.ndarray] = None  # H x W x 2 [px], NaN where there is none
    next_truth: Optional[np.ndarray] = None    # the next frame's truth at this frame's pixels
    reason: Optional[np.ndarray] = None        # uint8, as Frame.reason
    filled: Optional[np.ndarray] = None        # the estimate after interpolate_background, where there is a truth


def size_text(array: np.ndarray) -> str:
    return f"{array.shape[1]}x{array.shape[0]}"


def expect_indexable(items: Any, name: str) -> None:
    if not hasattr(items, "__len__") or not hasattr(items, "__getitem__"):
        raise _egosgm.InvalidArgument(f"{name} is a {type(items).__name__}: give a list of maps, or anything with a length and []")


def map_of(item: Any, name: str) -> np.ndarray:
    if np.ma.is_masked(item):
        raise _egosgm.InvalidArgument(f"{name}: has a mask, which nobody looks at: give its filled(egosgm.INVALID_DISPARITY)")
    array = np.asarray(item, np.float32)
    if array.ndim != 2 or not array.size:
        raise _egosgm.InvalidArgument(f"{name}: an array of shape {array.shape}: give H x W arrays")
    return np.where(np.isfinite(array), array, np.float32(np.nan))


def disparity_of(item: Any, name: str) -> np.ndarray:
    return map_of(_egosgm._disparity_map(item, name), name)


def flow_of(item: Any, name: str) -> np.ndarray:
    flow = np.asarray(item, np.float32)
    if flow.ndim != 3 or flow.shape[2] != 2 or not flow.size:
        raise _egosgm.InvalidArgument(f"{name}: an array of shape {flow.shape}: give H x W x 2 arrays")
    return flow


def is_valid(disparity: np.ndarray) -> np.ndarray:
    return np.isfinite(disparity) & (disparity > _egosgm.INVALID_DISPARITY)

# SPDX-License-Identifier: Apache-2.0
"""Masks of pixels: regions of the images, and what an estimate is there, beside the truth and beside another method's."""
from typing import Any, Dict, Optional

import numpy as np

from .. import _egosgm
from .maps import Frame, is_valid
from .moved_maps import move
from .pose_evaluation import inverse

BAD_PX = 3.0
SKY_PX = 1 / 256              # a truth from 0 to this says that nothing is there
CHANGED_PX = 1.0              # two methods differ
HIDDEN_PX = 1.0               # something else is in front: it is nearer than expected by more than this
EDGE_PX, EDGE_REACH = 3.0, 3  # a jump between neighbours, and the pixels around it
REGIONS = ("all", "moving", "still", "uncovered", "edges", "near", "far", "sky")


def is_sky(truth: np.ndarray) -> np.ndarray:
    return (truth >= 0) & (truth <= SKY_PX)


def is_bad(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    return np.abs(truth - estimate) > BAD_PX


def is_right(estimate: np.ndarray, truth: np.ndarray) -> np.ndarray:
    """An estimate that is not bad, or none where nothing is."""
    return np.where(is_valid(estimate), ~is_bad(estimate, truth), is_sky(truth))


def _edges(truth: np.ndarray) -> np.ndarray:
    """What lies within EDGE_REACH rows and columns of a pixel beside a jump between two neighbours with truth."""
    beside = np.zeros(truth.shape, bool)
    known = np.where(is_valid(truth), truth, np.nan)
    for axis in (0, 1):
        with np.errstate(invalid="ignore"):
            jump = np.swapaxes(np.abs(np.diff(known, axis=axis)) > EDGE_PX, 0, axis)
        view = np.swapaxes(beside, 0, axis)
        view[:-1] |= jump
        view[1:] |= jump
    for axis in (0, 1):
        source, view = np.swapaxes(beside.copy(), 0, axis), np.swapaxes(beside, 0, axis)
        for reach in range(1, EDGE_REACH + 1):
            view[reach:] |= source[:-reach]
            view[:-reach] |= source[reach:]
    return beside


def region_masks(now: Frame, before: Optional[Frame], calibration: Optional[Any], motion: Optional[np.ndarray], near_px: float) -> Dict[str, np.ndarray]:
    """Masks of pixels that have truth, by the names of the regions; without those that are not known."""
    known = is_valid(now.truth)
    masks = {"all": known, "edges": known & _edges(now.truth if now.all_truth is None else now.all_truth), "near": known & (now.truth >= near_px),
             "sky": known & is_sky(now.truth)}
    masks["far"] = known & ~masks["near"]
    if now.moving is not None:
        masks["moving"], masks["still"] = known & now.moving, known & ~now.moving
    all_before = None if before is None else before.truth if before.all_truth is None else before.all_truth
    if all_before is not None and motion is not None:
        inside, place, then = move(now.truth, calibration, inverse(motion))
        there = all_before.ravel()[place]
        with np.errstate(invalid="ignore"):
            hidden = is_valid(there) & (there > then + HIDDEN_PX)
        masks["uncovered"] = masks.get("still", known) & (~inside | hidden)
    return masks


def comparison_masks(estimate: np.ndarray, against: np.ndarray, truth: np.ndarray) -> Dict[str, np.ndarray]:
    """What another method has there: masks of pixels, as far as they have truth."""
    has, had = is_valid(estimate), is_valid(against)
    right = is_right(estimate, truth)
    both, gained = has & had, has & ~had
    with np.errstate(invalid="ignore"):
        e, a, t = (values.astype(float) for values in (estimate, against, truth))
        changed = both & (np.abs(e - a) > CHANGED_PX)
        difference = np.abs(e - t) - np.abs(a - t)
    return {"both": both, "changed": changed, "worse": changed & (difference > 0), "better": changed & (difference < 0), "beside": np.ones(has.shape, bool),
            "gained": gained, "gained_right": gained & right, "lost_right": had & is_right(against, truth) & ~right}


def trust_masks(estimate: np.ndarray, truth: np.ndarray, reason: np.ndarray) -> Dict[str, np.ndarray]:
    valid, trusted = is_valid(estimate), reason == _egosgm.REASONS.index("trusted")
    bad = valid & is_bad(estimate, truth)
    return {"bad": bad, "trusted": valid & trusted, "trusted_bad": bad & trusted}

# SPDX-License-Identifier: Apache-2.0
"""Scene flow beside the true one, as KITTI 2015's development kit compares it (Menze and Geiger, CVPR 2015)."""
import dataclasses
from typing import Any, Dict, List, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import ArrayLike

from .. import _egosgm
from .maps import disparity_of, expect_indexable, flow_of, is_valid, map_of, size_text
from .regions import BAD_PX, is_sky
from .video_evaluation import percent

MEASURES = ("d1", "d2", "fl", "sf")
BAD_SHARE = 0.05  # an outlier is off by more than BAD_PX, and by more than this share of the truth
MIN_OBJECT_PIXELS = 150  # of a true object; smaller ones are not asked for
MIN_OVERLAP = 0.4  # of an object that was found: intersection over union with the true one
_Counts = Dict[str, np.ndarray]


@dataclasses.dataclass(frozen=True)
class OutlierFigures:
    """Of one measure, in percent of the pixels with truth. NaN where there is none."""

    outliers_percent: float
    density_percent: float
    truth_pixels: int


@dataclasses.dataclass(frozen=True)
class SceneFlowFigures:
    """Of the disparity, that in the next frame, the optical flow, and of any of them."""

    d1: OutlierFigures
    d2: OutlierFigures
    fl: OutlierFigures
    sf: OutlierFigures


@dataclasses.dataclass(frozen=True)
class ObjectCounts:
    """True objects that were found and that were not, and estimated ones that are false."""

    found: int
    lost: int
    false: int


@dataclasses.dataclass(frozen=True)
class SceneFlowEvaluation:
    """Figures by region, of all frames and of each one: `all`, and where the truth says what moves, `moving` and `static`. objects: None without both labels."""

    regions: Dict[str, SceneFlowFigures]
    over_frames: List[Dict[str, SceneFlowFigures]]
    objects: Optional[ObjectCounts] = None


def count_outliers(estimates: Sequence[np.ndarray], truths: Sequence[np.ndarray], moving: Any = None) -> Dict[str, np.ndarray]:
    """For each region a row for each measure: outliers, pixels with truth, pixels with truth and estimate. Of estimates and truths: the disparity, that in the
    next frame and the flow, H x W x 1 or 2, NaN where there is none. moving: what moves by itself; without it, there is the region `all` only."""
    wrong, known, given = [], [], []
    for estimate, truth in zip(estimates, truths):
        known.append(np.isfinite(truth).all(axis=2))
        given.append(np.isfinite(estimate).all(axis=2))
        error, size = np.linalg.norm(estimate - truth, axis=2), np.linalg.norm(truth, axis=2)
        nothing_there = is_sky(truth[..., 0]) if truth.shape[2] == 1 else False
        wrong.append(np.where(given[-1], (error > BAD_PX) & (error > BAD_SHARE * size), ~nothing_there))
    wrong, known, given = [*wrong, np.any(wrong, axis=0)], [*known, np.all(known, axis=0)], [*given, np.all(given, axis=0)]
    regions = {"all": True} if moving is None else {"all": True, "moving": moving, "static": ~moving}
    return {name: np.array([[np.count_nonzero(which & k & region) for which in (w, k, g)] for w, k, g in zip(wrong, known, given)]) for name, region in regions.items()}


def match_objects(estimate: np.ndarray, truth: np.ndarray) -> Tuple[Dict[int, int], List[int], List[int]]:
    """Ids of true objects that were found, each with the estimated one that overlaps most; of those that were not; and of estimated objects that are false.
    Maps of ids, H x W, 0 where nothing moves by itself. An estimated object is false where no true one has it and most of it stands."""
    overlaps: Dict[int, Tuple[float, int]] = {}
    areas = {int(i): np.count_nonzero(estimate == i) for i in np.unique(estimate) if i}
    for true_id in (int(i) for i in np.unique(truth) if i):
        region = truth == true_id
        pixels = np.count_nonzero(region)
        if pixels < MIN_OBJECT_PIXELS:
            continue
        common = {i: np.count_nonzero(region & (estimate == i)) for i in areas}
        overlaps[true_id] = max(((common[i] / (pixels + areas[i] - common[i]), i) for i in areas), default=(0.0, 0))
    found = {true_id: own for true_id, (overlap, own) in overlaps.items() if overlap >= MIN_OVERLAP}
    false = [i for i in areas if i not in found.values() and np.count_nonzero((estimate == i) & (truth > 0)) < MIN_OVERLAP * areas[i]]
    return found, [i for i in overlaps if i not in found], false


def _figures_of(counts: _Counts) -> Dict[str, SceneFlowFigures]:
    return {region: SceneFlowFigures(*(OutlierFigures(percent(wrong, known), percent(given, known), int(known)) for wrong, known, given in rows)) for region, rows in counts.items()}


def evaluation_of(counts: Sequence[_Counts], objects: Optional[ObjectCounts] = None) -> SceneFlowEvaluation:
    """Of what count_outliers gives for each frame; pixels are pooled."""
    total: _Counts = {}
    for frame in counts:
        total = {region: total.get(region, 0) + rows for region, rows in frame.items()}
    return SceneFlowEvaluation(_figures_of(total), [_figures_of(frame) for frame in counts], objects)


def _maps_of(item: Any, name: str) -> List[np.ndarray]:
    if len(item) != 3:
        raise _egosgm.InvalidArgument(f"{name}: {len(item)} maps of a frame: give its disparity, that in the next frame, and its flow")
    disparities = [disparity_of(each, name) for each in item[:2]]
    return [*(np.where(is_valid(each), each, np.float32(np.nan))[..., None] for each in disparities), flow_of(item[2], name)]


def evaluate_scene_flow(estimates: Sequence[Sequence[ArrayLike]], truths: Sequence[Sequence[ArrayLike]], *, labels: Optional[Sequence[ArrayLike]] = None,
                        true_labels: Optional[Sequence[ArrayLike]] = None) -> SceneFlowEvaluation:
    """Compares scene flow with the true one, as `egosgm eval-flow` does. No device is needed.

    estimates, truths: for each frame its disparity, the disparity in the next frame at this frame's pixels, and the optical flow to the next frame: H x W,
    H x W and H x W x 2 arrays in px. INVALID_DISPARITY or not finite: none.
    labels, true_labels: for each frame the id of what moves by itself at each pixel, H x W, 0 elsewhere. With true ones, pixels that move and others count
    apart; with both, objects count as found, lost or false.
    """
    expect_indexable(estimates, "estimates")
    number = len(estimates)
    if not number:
        raise _egosgm.InvalidArgument("evaluate_scene_flow: no frames: give at least one")
    for name, items in (("truths", truths), ("labels", labels), ("true_labels", true_labels)):
        if items is None:
            continue
        expect_indexable(items, name)
        if len(items) != number:
            raise _egosgm.InvalidArgument(f"{name} has {len(items)} of {number} frames: give one for each estimate")
    counts, objects = [], np.zeros(3, int)
    for i in range(number):
        estimate, truth = _maps_of(estimates[i], "estimates"), _maps_of(truths[i], "truths")
        own, true = (None if items is None else map_of(items[i], name) for name, items in (("labels", labels), ("true_labels", true_labels)))
        sizes = {size_text(each) for each in (*estimate, *truth, own, true) if each is not None}
        if len(sizes) > 1:
            raise _egosgm.InvalidArgument(f"frame {i}: its maps differ in size: {', '.join(sorted(sizes))}; give maps of one size")
        counts.append(count_outliers(estimate, truth, None if true is None else true != 0))
        if own is not None and true is not None:
            objects += [len(each) for each in match_objects(own, true)]
    return evaluation_of(counts, None if labels is None or true_labels is None else ObjectCounts(*map(int, objects)))

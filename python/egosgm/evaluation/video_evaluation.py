# SPDX-License-Identifier: Apache-2.0
"""Figures of a video's disparity maps over time; docs/use/evaluation.md has their formulas."""
import dataclasses
import math
from typing import Any, Dict, List, Optional, Sequence

import numpy as np
from numpy.typing import ArrayLike

from .. import _egosgm
from .maps import Frame, disparity_of, expect_indexable, flow_of, map_of, size_text
from .pose_evaluation import inverse, poses_of
from .video_counts import DENSITIES, SHARES, Counts, VideoCounts, count_frames

_Maps = Optional[Sequence[Optional[ArrayLike]]]


@dataclasses.dataclass(frozen=True)
class VideoFigures:
    """Of a video, or of one frame with the frame before. NaN where there is nothing to divide by."""

    flicker_px: float
    tae_vda_percent: float
    tepe_dynamicstereo_px: float
    tepe_dynamicstereo_above_1px_percent: float
    tepe_dynamicstereo_above_3px_percent: float
    tepe_dynamicstereo_filled_px: float
    tepe_dynamicstereo_filled_above_1px_percent: float
    tepe_dynamicstereo_filled_above_3px_percent: float
    tepe_codd_px: float
    tepe_codd_mean_of_pairs_px: float
    tepe_codd_above_3px_percent: float
    tepe_codd_relative: float
    tepe_codd_relative_above_1_percent: float
    opw_nvds_px: float
    opw_nvds_m: float
    rtc_1_01_percent: float
    rtc_1_25_percent: float
    changed_percent: float
    harm_percent: float
    help_percent: float
    gained_percent: float
    gained_right_percent: float
    lost_right_percent: float
    wrong_of_trusted_percent: float
    trusted_of_wrong_percent: float
    ause_px: float
    ause_bad_percent: float


@dataclasses.dataclass(frozen=True)
class RegionFigures:
    """Of one part of the images."""

    truth_pixels: int
    bad_or_missing: float
    bad_of_valid: float
    density: float
    interpolated: float
    mae: float
    bad_1px: float
    mean_error: float
    filled: float
    wrong_of_all: float
    tepe_dynamicstereo_px: float
    tepe_dynamicstereo_above_1px_percent: float
    tepe_dynamicstereo_above_3px_percent: float
    tepe_dynamicstereo_filled_px: float
    changed_percent: float
    harm_percent: float
    help_percent: float
    gained_percent: float
    gained_right_percent: float
    lost_right_percent: float
    wrong_of_trusted_percent: float
    trusted_of_wrong_percent: float


@dataclasses.dataclass(frozen=True)
class DensityFigures:
    """Bad pixels of the most certain ones: at 50 to 100 percent of those with truth, and at 2 to 100 percent of those with truth, estimate
    and uncertainty beside the oracle's order."""

    density_percent: List[float]
    reached_percent: List[float]
    bad_percent: List[float]
    kept_percent: List[float]
    kept_bad_percent: List[float]
    oracle_bad_percent: List[float]
    kept_mae_px: List[float]
    oracle_mae_px: List[float]


@dataclasses.dataclass(frozen=True)
class VideoEvaluation:
    """`frames`: by frame; a pair of frames belongs to the later one. `regions`: those that have pixels, "all" among them."""

    figures: VideoFigures
    frames: List[VideoFigures]
    regions: Dict[str, RegionFigures]
    density: Optional[DensityFigures]


def ratio(part: float, whole: float) -> float:
    """NaN where there is nothing to divide by."""
    return float(part / whole) if whole > 0 else math.nan


def percent(part: float, whole: float) -> float:
    return ratio(100.0 * part, whole)


def _beside_figures(counts: Counts) -> Dict[str, float]:
    return {"changed_percent": percent(counts["changed"], counts["both"]), "harm_percent": percent(counts["worse"], counts["changed"]),
            "help_percent": percent(counts["better"], counts["changed"]), "gained_percent": percent(counts["gained"], counts["beside"]),
            "gained_right_percent": percent(counts["gained_right"], counts["gained"]), "lost_right_percent": percent(counts["lost_right"], counts["beside"]),
            "wrong_of_trusted_percent": percent(counts["trusted_bad"], counts["trusted"]),
            "trusted_of_wrong_percent": percent(counts["trusted_bad"], counts["bad"])}


def _change_figures(counts: Counts, source: str, name: str) -> Dict[str, float]:
    pixels = counts[f"{source}.pixels"]
    return {f"{name}_px": ratio(counts[f"{source}.sum_px"], pixels), f"{name}_above_1px_percent": percent(counts[f"{source}.above_1px"], pixels),
            f"{name}_above_3px_percent": percent(counts[f"{source}.above_3px"], pixels)}


def _area_between(curve: List[float], oracle: List[float]) -> float:
    """Over the share that is kept (0 to 1), by the trapezoidal rule; shares that keep nothing are left out."""
    gap, share = np.subtract(curve, oracle), SHARES / 100
    known = np.isfinite(gap)
    gap, share = gap[known], share[known]
    return float(np.sum((gap[1:] + gap[:-1]) / 2 * np.diff(share))) if known.any() else math.nan


def density_of(counts: VideoCounts) -> Optional[DensityFigures]:
    """None where no frame has truth and uncertainties."""
    sums = counts.sums
    if not sums["density.truth"]:
        return None
    kept, of_truth = sums["density.kept"], sums["density.kept_of_truth"]
    curves = [[of(part, whole) for part, whole in zip(sums[f"density.{name}"], kept)]
              for name, of in (("bad", percent), ("oracle_bad", percent), ("error_px", ratio), ("oracle_error_px", ratio))]
    return DensityFigures([float(d) for d in DENSITIES], [percent(part, sums["density.truth"]) for part in of_truth],
                          [percent(bad, whole) for bad, whole in zip(sums["density.bad_of_kept"], of_truth)], [float(share) for share in SHARES], *curves)


def figures_of(counts: VideoCounts) -> VideoFigures:
    sums, everywhere, density = counts.sums, counts.regions["all"], density_of(counts)
    along = _change_figures(sums, "codd", "tepe_codd")
    del along["tepe_codd_above_1px_percent"]
    means = {name: ratio(sums[f"{source}.sum"], sums[f"{source}.pairs"])
             for source, name in (("tae", "tae_vda_percent"), ("opw_px", "opw_nvds_px"), ("opw_m", "opw_nvds_m"), ("rtc_1_01", "rtc_1_01_percent"),
                                  ("rtc_1_25", "rtc_1_25_percent"))}
    return VideoFigures(
        flicker_px=ratio(sums["flicker.sum_px"], sums["flicker.pixels"]), **means, **_change_figures(everywhere, "tepe", "tepe_dynamicstereo"),
        **_change_figures(everywhere, "filled", "tepe_dynamicstereo_filled"), **along,
        tepe_codd_mean_of_pairs_px=ratio(sums["codd.pair_means_px"], sums["codd.pairs"]),
        tepe_codd_relative=ratio(sums["codd.relative_sum"], sums["codd.pixels"]),
        tepe_codd_relative_above_1_percent=percent(sums["codd.relative_above_1"], sums["codd.pixels"]), **_beside_figures(everywhere),
        ause_px=_area_between(density.kept_mae_px, density.oracle_mae_px) if density else math.nan,
        ause_bad_percent=_area_between(density.kept_bad_percent, density.oracle_bad_percent) if density else math.nan)


def _region_of(counts: Counts) -> RegionFigures:
    errors = counts["errors"]
    metrics = errors.metrics
    return RegionFigures(
        truth_pixels=errors.truth, mae=metrics.mae_px, mean_error=metrics.mean_error_px,
        **{name: getattr(metrics, name) for name in ("bad_or_missing", "bad_of_valid", "bad_1px", "density", "interpolated", "filled", "wrong_of_all")},
        **_change_figures(counts, "tepe", "tepe_dynamicstereo"),
        tepe_dynamicstereo_filled_px=ratio(counts["filled.sum_px"], counts["filled.pixels"]), **_beside_figures(counts))


def regions_of(counts: VideoCounts) -> Dict[str, RegionFigures]:
    """Those that have pixels."""
    return {name: _region_of(region) for name, region in counts.regions.items() if region}


def _grey_of(item: Any, name: str) -> np.ndarray:
    grey = np.asarray(item)
    if grey.ndim != 2 or grey.dtype not in (np.uint8, np.uint16):
        raise _egosgm.InvalidArgument(f"{name}: an array of {grey.dtype} of shape {grey.shape}: give H x W arrays of uint8 or uint16")
    return grey


def _mask_of(item: Any, name: str) -> np.ndarray:
    return map_of(item, name) != 0


def evaluate_video(estimates: Sequence[ArrayLike], truths: _Maps = None, *, calibration: Optional[Any] = None,
                   world_from_camera: Optional[ArrayLike] = None, all_truths: _Maps = None, against: _Maps = None, uncertainties: _Maps = None,
                   moving: _Maps = None, images: _Maps = None, flows: _Maps = None, next_truths: _Maps = None, reasons: _Maps = None,
                   near_px: float = 32.0) -> VideoEvaluation:
    """Evaluates disparity maps over time. No device is needed.

    Each of these is a sequence with an H x W array for each frame, or None for a frame that has none; anything with a length and [] does,
    so that maps can be read when they are needed. Disparities are in px, INVALID_DISPARITY or not finite where there is none.

    estimates: the maps to evaluate.
    truths: of the pixels that count. all_truths: of occluded pixels too; tells edges and what is uncovered.
    against: another method's maps. reasons: those of the estimates, uint8. uncertainties: what grows with the expected error, a variance for instance.
    moving: masks of what moves by itself. images: left images, uint8 or uint16, for the mask of OPW and RTC.
    flows: true flow to the next frame, H x W x 2, NaN where there is none. next_truths: the next frame's truth at this frame's pixels.
    calibration, world_from_camera: the camera and its (N, 4, 4) poses; without them nothing that needs a motion is measured.
    near_px: the region "near" begins at this true disparity.
    """
    expect_indexable(estimates, "estimates")
    number = len(estimates)
    if not number:
        raise _egosgm.InvalidArgument("evaluate_video: no frames: give at least one")
    poses = None if world_from_camera is None else poses_of(world_from_camera, "world_from_camera")
    if poses is not None and (calibration is None or len(poses) != number):
        raise _egosgm.InvalidArgument(f"world_from_camera has {len(poses)} poses of {number} frames{'' if calibration else ' and no calibration'}: "
                                      "give one for each frame, with the calibration")
    sources = {"truth": (truths, "truths", disparity_of), "all_truth": (all_truths, "all_truths", disparity_of), "against": (against, "against", disparity_of),
               "uncertainty": (uncertainties, "uncertainties", map_of), "next_truth": (next_truths, "next_truths", disparity_of),
               "moving": (moving, "moving", _mask_of), "image": (images, "images", _grey_of), "reason": (reasons, "reasons", _grey_of),
               "flow_to_next": (flows, "flows", flow_of)}
    for items, name, _ in sources.values():
        if items is None:
            continue
        expect_indexable(items, name)
        if len(items) != number:
            raise _egosgm.InvalidArgument(f"{name} has {len(items)} of {number} frames: give one for each estimate, None where there is none")

    def frame(i: int) -> Frame:
        now = Frame(disparity_of(estimates[i], "estimates"))
        for field, (items, name, convert) in sources.items():
            item = None if items is None else items[i]
            if item is None:
                continue
            array = convert(item, name)
            if array.shape[:2] != now.estimate.shape:
                raise _egosgm.InvalidArgument(f"frame {i}: the estimate is {size_text(now.estimate)}, {name} {size_text(array)}; give maps of one size")
            setattr(now, field, array)
        return now

    def motion(i: int) -> Optional[np.ndarray]:
        return None if poses is None else inverse(poses[i]) @ poses[i - 1]

    total, figures = VideoCounts(), []
    for counts in count_frames(map(frame, range(number)), calibration, motion, near_px=near_px):
        total.add(counts)
        figures.append(figures_of(counts))
    return VideoEvaluation(figures_of(total), figures, regions_of(total), density_of(total))

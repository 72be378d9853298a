# SPDX-License-Identifier: Apache-2.0
"""Figures of a video's disparity maps over time; docs/evaluation.md has their formulas."""
import dataclasses
from typing import Any, Dict, List, Optional, Sequence

from numpy.typing import ArrayLike

from . import _egosgm

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


def evaluate_video(estimates: Sequence[ArrayLike], truths: _Maps = None, *, calibration: Optional[Any] = None,
                   world_from_camera: Optional[ArrayLike] = None, all_truths: _Maps = None, against: _Maps = None, uncertainties: _Maps = None,
                   moving: _Maps = None, images: _Maps = None, flows: _Maps = None, next_truths: _Maps = None, reasons: _Maps = None,
                   near_px: float = 32.0, threads: int = 0) -> VideoEvaluation:
    """Evaluates disparity maps over time. No device is needed.

    Each of these is a sequence with an H x W array for each frame, or None for a frame that has none; anything with a length and [] does,
    so that maps can be read when they are needed. Disparities are in px, INVALID_DISPARITY or not finite where there is none.

    estimates: the maps to evaluate.
    truths: of the pixels that count. all_truths: of occluded pixels too; tells edges and what is uncovered.
    against: another method's maps. reasons: those of the estimates, uint8. uncertainties: what grows with the expected error, a variance for instance.
    moving: masks of what moves by itself. images: left images, uint8 or uint16, for the mask of OPW and RTC.
    flows: true flow to the next frame, H x W x 2, NaN where there is none. next_truths: the next frame's truth at this frame's pixels.
    calibration, world_from_camera: the camera and its (N, 4, 4) poses; without them nothing that needs a motion is measured.
    near_px: the region "near" begins at this true disparity. threads: 0 is as many as the machine runs at once.
    """
    result = _egosgm._evaluate_video(estimates, truths, all_truths, against, uncertainties, moving, images, flows, next_truths, reasons,
                                     calibration, world_from_camera, near_px, threads)
    return VideoEvaluation(figures=VideoFigures(**result["figures"]), frames=[VideoFigures(**frame) for frame in result["frames"]],
                           regions={name: RegionFigures(**region) for name, region in result["regions"].items()},
                           density=DensityFigures(**result["density"]) if result["density"] else None)

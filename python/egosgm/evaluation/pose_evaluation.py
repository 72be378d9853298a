# SPDX-License-Identifier: Apache-2.0
"""Poses beside the true ones, as KITTI's odometry kit compares them (Geiger, Lenz and Urtasun, CVPR 2012)."""
import dataclasses
import math
from typing import Any, List

import numpy as np
from numpy.typing import ArrayLike

from .. import _egosgm

LENGTHS_M, FRAME_STEP = range(100, 801, 100), 10
SHORT_LENGTHS_M, SHORT_FRAME_STEP = range(5, 51, 5), 1
_MOST_ROTATION_ERROR = 1e-2  # of R R^T: products of many float32 poses drift


@dataclasses.dataclass(frozen=True)
class MotionError:
    """Of one motion, from one frame to the next."""

    translation_m: float
    rotation_rad: float


@dataclasses.dataclass(frozen=True)
class SegmentError:
    """KITTI odometry's figure: the error of the motion over all segments of one length."""

    length_m: float
    segments: int
    translation_percent: float
    rotation_deg_per_m: float


@dataclasses.dataclass(frozen=True)
class PoseEvaluation:
    """The end drift is taken with the first poses laid on each other. `short_segments`: of 5 to 50 m, for a path of less than 100 m; they are not
    comparable with KITTI's of 100 to 800 m. NaN where there is nothing to divide by."""

    translation_mean_m: float
    rotation_mean_rad: float
    translation_rmse_m: float
    rotation_rmse_rad: float
    path_length_m: float
    end_drift_m: float
    end_drift_percent: float
    rotation_end_drift_deg: float
    segments: List[SegmentError]
    short_segments: bool
    segment_translation_percent: float
    segment_rotation_deg_per_m: float
    motions: List[MotionError]


def poses_of(matrices: ArrayLike, name: str) -> np.ndarray:
    """An (N, 4, 4) array. Throws InvalidArgument, naming it."""
    try:
        poses = np.asarray(matrices, float)
    except (TypeError, ValueError):
        raise _egosgm.InvalidArgument(f"{name}: is no array of numbers: give poses as an (N, 4, 4) array") from None
    if poses.ndim != 3 or poses.shape[1:] != (4, 4):
        raise _egosgm.InvalidArgument(f"{name}: an array of shape {poses.shape}: give poses as an (N, 4, 4) array")
    if not np.isfinite(poses).all():
        raise _egosgm.InvalidArgument(f"{name} holds a value that is not finite")
    with np.errstate(over="ignore", invalid="ignore"):
        turned = poses[:, :3, :3] @ np.swapaxes(poses[:, :3, :3], 1, 2) - np.eye(3)
        is_rigid = (np.abs(turned) <= _MOST_ROTATION_ERROR).all(axis=(1, 2)) & (np.linalg.det(poses[:, :3, :3]) > 0) & (poses[:, 3] == [0, 0, 0, 1]).all(axis=1)
    if not is_rigid.all():
        raise _egosgm.InvalidArgument(f"{name}: matrix {int(np.argmin(is_rigid))} is no rotation with a translation, [R t; 0 1]: give poses as they were found")
    return poses


def motion_of(motion: Any, name: str) -> np.ndarray:
    """The (4, 4) array of a Motion, or of one given as such. Throws InvalidArgument, naming it."""
    matrix = motion.current_from_previous if isinstance(motion, _egosgm.Motion) else motion
    shape = np.shape(matrix)
    if shape != (4, 4):
        raise _egosgm.InvalidArgument(f"{name}: is {f'an array of shape {shape}' if shape else f'a {type(motion).__name__}'}: give one motion, a Motion or a 4 x 4 array")
    return poses_of([matrix], name)[0]


def inverse(poses: np.ndarray) -> np.ndarray:
    """Of one rigid 4x4 matrix or of many."""
    result = np.zeros_like(poses)
    rotation = np.swapaxes(poses[..., :3, :3], -1, -2)
    result[..., :3, :3] = rotation
    result[..., :3, 3:] = -rotation @ poses[..., :3, 3:]
    result[..., 3, 3] = 1
    return result


def _motion_errors(estimate: np.ndarray, truth: np.ndarray, begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """What is left of the true motions between frames after undoing the estimated ones: metres and radians, two rows."""
    estimated, true = inverse(estimate[begin]) @ estimate[end], inverse(truth[begin]) @ truth[end]
    error = inverse(estimated) @ true
    turn = error[:, [2, 0, 1], [1, 2, 0]] - error[:, [1, 2, 0], [2, 0, 1]]
    angle = np.arctan2(np.linalg.norm(turn, axis=1), np.trace(error[:, :3, :3], axis1=1, axis2=2) - 1)
    return np.stack([np.linalg.norm(error[:, :3, 3], axis=1), angle])


def _segments(estimate: np.ndarray, truth: np.ndarray, travelled_m: np.ndarray, lengths_m: range, frame_step: int) -> List[SegmentError]:
    segments = []
    for length in lengths_m:
        begin = np.arange(0, len(truth), frame_step)
        end = np.searchsorted(travelled_m, travelled_m[begin] + length, side="right")  # the first frame beyond
        begin, end = begin[end < len(truth)], end[end < len(truth)]
        if len(begin):
            metres, radians = _motion_errors(estimate, truth, begin, end).mean(axis=1) / length
            segments.append(SegmentError(float(length), len(begin), 100 * float(metres), math.degrees(radians)))
    return segments


def evaluate_poses(estimate: ArrayLike, truth: ArrayLike) -> PoseEvaluation:
    """Compares camera-to-world poses, (N, 4, 4), as KITTI's odometry kit does. Throws InvalidArgument unless both have as many, at least two."""
    estimate, truth = poses_of(estimate, "estimate"), poses_of(truth, "truth")
    if len(estimate) != len(truth) or len(truth) < 2:
        raise _egosgm.InvalidArgument(f"poses: {len(estimate)} estimated and {len(truth)} true ones; give as many of both, at least two")
    last = len(truth) - 1
    travelled = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(truth[:, :3, 3], axis=0), axis=1))])
    length = float(travelled[-1])
    metres, radians = _motion_errors(estimate, truth, np.arange(last), np.arange(1, last + 1))
    (drift,), (turned,) = _motion_errors(estimate, truth, np.array([0]), np.array([last]))
    short = length < LENGTHS_M[0]
    segments = _segments(estimate, truth, travelled, *((SHORT_LENGTHS_M, SHORT_FRAME_STEP) if short else (LENGTHS_M, FRAME_STEP)))
    counts = [segment.segments for segment in segments]
    means = [float(np.average([getattr(segment, name) for segment in segments], weights=counts)) if segments else math.nan
             for name in ("translation_percent", "rotation_deg_per_m")]
    return PoseEvaluation(
        translation_mean_m=float(metres.mean()), rotation_mean_rad=float(radians.mean()), translation_rmse_m=math.sqrt(np.mean(metres**2)),
        rotation_rmse_rad=math.sqrt(np.mean(radians**2)), path_length_m=length, end_drift_m=float(drift),
        end_drift_percent=100 * float(drift) / length if length > 0 else math.nan, rotation_end_drift_deg=math.degrees(turned), segments=segments,
        short_segments=short, segment_translation_percent=means[0], segment_rotation_deg_per_m=means[1],
        motions=[MotionError(float(m), float(r)) for m, r in zip(metres, radians)])

# SPDX-License-Identifier: Apache-2.0
"""Counts of a video's frames, each alone and with the frame before: errors, changes, regions, uncertainty. docs/use/evaluation.md has the formulas."""
import collections
import concurrent.futures
import math
import os
from typing import Any, Callable, Deque, Dict, Iterable, Iterator, Optional, Tuple

import numpy as np

from .. import _egosgm
from .maps import Frame, is_valid, size_text
from .moved_maps import move, move_map
from .pose_evaluation import inverse
from .regions import BAD_PX, HIDDEN_PX, REGIONS, comparison_masks, region_masks, trust_masks

TINY_CHANGE_PX = 1e-3         # CODD's, against division by zero
LARGEST_FLOW_PX = 250.0
SHARES = np.arange(2, 101, 2)       # percent of the pixels with truth, estimate and uncertainty
DENSITIES = np.arange(50, 101, 5)   # percent of the pixels with truth


class Counts(Dict[str, Any]):
    """Sums by name, numbers or arrays; those of several frames add up. What was never counted is 0."""

    def __missing__(self, name: str) -> int:
        return 0

    def add(self, other: Dict[str, Any]) -> None:
        for name, value in other.items():
            self[name] = self[name] + value if name in self else value


class VideoCounts:
    """Of one frame and of the pair that it makes with the frame before, or of several."""

    def __init__(self) -> None:
        self.sums = Counts()
        self.regions = {name: Counts() for name in REGIONS}

    def add(self, other: "VideoCounts") -> None:
        self.sums.add(other.sums)
        for name, counts in other.regions.items():
            self.regions[name].add(counts)


def _changes(name: str, error: np.ndarray) -> Counts:
    """Sizes of the errors of a change from one frame to the next; a pair's own mean among them."""
    total = float(error.sum())
    return Counts({f"{name}.pixels": error.size, f"{name}.sum_px": total, f"{name}.above_1px": np.count_nonzero(error > 1),
                   f"{name}.above_3px": np.count_nonzero(error > 3), f"{name}.pair_means_px": total / error.size if error.size else 0.0,
                   f"{name}.pairs": int(error.size > 0)})


def _pair_mean(name: str, values: np.ndarray, scale: float = 1.0) -> Counts:
    return Counts({f"{name}.sum": scale * float(values.mean()), f"{name}.pairs": 1}) if values.size else Counts()


def _flicker(estimate: np.ndarray, moved: np.ndarray) -> Counts:
    both = is_valid(estimate) & is_valid(moved)
    return _changes("flicker", np.abs(estimate[both] - moved[both].astype(float)))


def _alignment_error(estimate: np.ndarray, moved: np.ndarray, doffs_px: float) -> Counts:
    """Video Depth Anything's, one direction: |depth - moved depth| / depth, of depths f b / (disparity + doffs), in which f b cancels."""
    both = is_valid(estimate) & is_valid(moved)
    here, there = estimate[both] + np.float64(doffs_px), moved[both] + np.float64(doffs_px)
    return _pair_mean("tae", np.abs(1 - here / there)[here > 0], 100.0)


def _along_motion(before: Frame, now: Frame, counted: np.ndarray, place: np.ndarray, next_truth: np.ndarray) -> Counts:
    """CODD's TEPE of the pixels that count and have both estimates: each goes from its place to another."""
    estimate = now.estimate.ravel()[place]
    counted = counted & is_valid(before.estimate) & is_valid(estimate)
    change = next_truth[counted].astype(float) - before.truth[counted]
    error = np.abs(estimate[counted].astype(float) - before.estimate[counted] - change)
    relative = error / (np.abs(change) + TINY_CHANGE_PX)
    counts = _changes("codd", error)
    counts.add({"codd.relative_sum": float(relative.sum()), "codd.relative_above_1": np.count_nonzero(relative > 1)})
    return counts


def _along_poses(before: Frame, now: Frame, calibration: Any, motion: np.ndarray) -> Counts:
    """Of what stands still and is not hidden: the truth that the motion leads to is near the truth moved."""
    inside, place, expected = move(before.truth, calibration, motion)
    truth = now.truth.ravel()[place]
    counted = inside & is_valid(truth)
    for moving in ([] if before.moving is None else [before.moving]) + ([] if now.moving is None else [now.moving.ravel()[place]]):
        counted &= ~moving
    with np.errstate(invalid="ignore"):
        counted &= np.abs(truth - expected) <= HIDDEN_PX
    return _along_motion(before, now, counted, place, truth)


def _along_flow(before: Frame, now: Frame) -> Counts:
    height, width = before.truth.shape
    to_x, to_y = np.rint(np.arange(width) + before.flow_to_next[..., 0].astype(float)), np.rint(np.arange(height)[:, None] + before.flow_to_next[..., 1].astype(float))
    with np.errstate(invalid="ignore"):
        inside = is_valid(before.truth) & (to_x >= 0) & (to_x < width) & (to_y >= 0) & (to_y < height)
    place = np.where(inside, to_y * width + to_x, 0).astype(np.intp)
    if before.next_truth is not None:
        truth = before.next_truth
    elif now.truth is not None:
        truth = now.truth.ravel()[place]
    else:
        return Counts()
    return _along_motion(before, now, inside & is_valid(truth), place, truth)


class _Samples:
    """Places between pixels, and what lies there by the four pixels around. A pixel without weight is not asked."""

    def __init__(self, x: np.ndarray, y: np.ndarray, shape: Tuple[int, int]) -> None:
        height, width = shape
        column, row = np.minimum(x.astype(np.intp), max(width - 2, 0)), np.minimum(y.astype(np.intp), max(height - 2, 0))
        right, down = x - column, y - row
        self.parts = [(np.minimum(row + j, height - 1), np.minimum(column + i, width - 1), (right if i else 1 - right) * (down if j else 1 - down))
                      for j in (0, 1) for i in (0, 1)]

    def of(self, values: np.ndarray) -> np.ndarray:
        return sum(np.where(weight == 0, 0, weight * values[row, column]) for row, column, weight in self.parts)


def _flow_figures(before: Frame, now: Frame, calibration: Optional[Any]) -> Counts:
    """OPW (NVDS) and RTC (Li et al.): along the flow, estimates between four pixels."""
    height, width = before.estimate.shape
    flow = before.flow_to_next
    with np.errstate(invalid="ignore"):
        x, y = np.arange(width) + flow[..., 0].astype(float), np.arange(height)[:, None] + flow[..., 1].astype(float)
        inside = (np.abs(flow) <= LARGEST_FLOW_PX).all(axis=2) & (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    samples = _Samples(x[inside], y[inside], before.estimate.shape)
    alike = np.ones(np.count_nonzero(inside), bool)
    if before.image is not None and now.image is not None:  # NVDS' mask, of grey as three equal channels of colour
        images = [image / np.float64(np.iinfo(image.dtype).max) for image in (before.image, now.image)]
        alike = np.exp(-50.0 * (math.sqrt(3.0) * np.abs(samples.of(images[1]) - images[0][inside]))) > 0.01

    def pairs_of(quantity: Callable[[np.ndarray], np.ndarray]) -> Tuple[np.ndarray, np.ndarray]:
        here, there = (np.where(is_valid(frame.estimate), quantity(frame.estimate.astype(float)), np.nan) for frame in (before, now))
        here, there = (np.where(np.isfinite(values) & (values > 0), values, np.nan) for values in (here, there))
        a, b = here[inside], samples.of(there)
        known = alike & np.isfinite(a) & np.isfinite(b)
        return a[known], b[known]

    with np.errstate(all="ignore"):
        a, b = pairs_of(lambda disparity: disparity)
        counts = _pair_mean("opw_px", np.abs(a - b))
        if calibration is not None:
            a, b = pairs_of(lambda disparity: calibration.fx * calibration.baseline_m / (disparity + calibration.doffs_px))
            counts.add(_pair_mean("opw_m", np.abs(a - b)))
        larger = np.maximum(a / b, b / a)
    counts.add(_pair_mean("rtc_1_01", larger < 1.01, 100.0))
    counts.add(_pair_mean("rtc_1_25", larger < 1.25, 100.0))
    return counts


def _order(values: np.ndarray) -> np.ndarray:
    """np.argsort(values, kind="stable") of float32, by its bits: NumPy sorts numbers of 16 bits much faster."""
    bits = (values + np.float32(0)).view(np.uint32)  # without -0
    bits = np.where(bits >> 31, ~bits, bits | np.uint32(1 << 31))
    order = np.argsort(bits.astype(np.uint16), kind="stable")
    return order[np.argsort((bits >> 16).astype(np.uint16)[order], kind="stable")]


def _percent_of(whole: int, percents: np.ndarray) -> np.ndarray:
    return (whole * percents + 50) // 100


def _density(frame: Frame) -> Counts:
    """Bad pixels and |error| in the order of the uncertainty, beside the oracle's order (Ilg et al., Poggi et al.)."""
    known = is_valid(frame.truth)
    counted = known & is_valid(frame.estimate) & np.isfinite(frame.uncertainty)
    error = np.abs(frame.truth[counted] - frame.estimate[counted])
    error = error[_order(frame.uncertainty[counted])]
    kept, truth = _percent_of(len(error), SHARES), np.count_nonzero(known)
    counts = Counts({"density.truth": truth, "density.kept": kept})
    bad = np.zeros(len(error) + 1, np.int64)
    for order, values in (("oracle_", np.sort(error)), ("", error)):
        np.cumsum(values > BAD_PX, out=bad[1:])
        counts[f"density.{order}bad"] = bad[kept]
        counts[f"density.{order}error_px"] = np.concatenate([[0.0], np.cumsum(values, dtype=float)])[kept]
    kept = np.minimum(_percent_of(truth, DENSITIES), len(error))
    counts.add({"density.kept_of_truth": kept, "density.bad_of_kept": bad[kept]})
    return counts


def _same_pixel(before: Frame, now: Frame, name: str, which: str) -> Callable[[np.ndarray], Counts]:
    """DynamicStereo's TEPE of the pixels of a region."""
    known = is_valid(before.truth) & is_valid(now.truth)
    maps = [getattr(frame, which) for frame in (before, now)]
    known &= is_valid(maps[0]) & is_valid(maps[1])
    error = np.abs((maps[0].astype(float) - maps[1]) - (before.truth.astype(float) - now.truth))
    return lambda region: _changes(name, error[region & known])


def _count_regions(now: Frame, before: Optional[Frame], masks: Dict[str, np.ndarray], counts: VideoCounts) -> None:
    marked: Dict[str, np.ndarray] = {}
    if now.against is not None:
        marked.update(comparison_masks(now.estimate, now.against, now.truth))
    if now.reason is not None:
        marked.update(trust_masks(now.estimate, now.truth, now.reason))
    changes = []
    if before is not None and before.truth is not None:
        changes = [_same_pixel(before, now, "tepe", "estimate"), _same_pixel(before, now, "filled", "filled")]
    for name, mask in masks.items():
        if not mask.any():
            continue
        region = counts.regions[name]
        region.add({"errors": _egosgm.compare_disparity(now.estimate, np.where(mask, now.truth, np.float32(_egosgm.INVALID_DISPARITY)))})
        region.add({what: np.count_nonzero(where & mask) for what, where in marked.items()})
        for change in changes:
            region.add(change(mask))


def _count(now: Frame, before: Optional[Frame], calibration: Optional[Any], motion: Optional[np.ndarray], near_px: float) -> VideoCounts:
    """Of a frame, and of the pair with the one before."""
    counts = VideoCounts()
    if now.truth is not None:
        _count_regions(now, before, region_masks(now, before, calibration, motion, near_px), counts)
        if now.uncertainty is not None:
            counts.sums.add(_density(now))
    if before is None:
        return counts
    if motion is not None:
        moved, moved_back = move_map(before.estimate, calibration, motion), move_map(now.estimate, calibration, inverse(motion))
        counts.sums.add(_flicker(now.estimate, moved))
        counts.sums.add(_alignment_error(now.estimate, moved, calibration.doffs_px))
        counts.sums.add(_alignment_error(before.estimate, moved_back, calibration.doffs_px))
        if before.flow_to_next is None and before.truth is not None and now.truth is not None:
            counts.sums.add(_along_poses(before, now, calibration, motion))
    if before.flow_to_next is not None:
        if before.truth is not None:
            counts.sums.add(_along_flow(before, now))
        counts.sums.add(_flow_figures(before, now, calibration))
    return counts


def count_frames(frames: Iterable[Frame], calibration: Optional[Any] = None, motions: Callable[[int], Optional[np.ndarray]] = lambda i: None,
                 follows: Callable[[int], bool] = lambda i: True, near_px: float = 32.0) -> Iterator[VideoCounts]:
    """Counts of each frame, and of the pair that it makes with the one before where frame i follows it. Takes them one after the other and counts
    a few at once, so that memory does not grow with their number. motions: current_from_previous of frame i, 4x4; asked with a calibration only."""
    if not near_px > 0:
        raise _egosgm.InvalidArgument(f"near {near_px:g} px: the region `near` begins at a disparity above 0")
    at_once = os.cpu_count() or 1
    before: Optional[Frame] = None
    with concurrent.futures.ThreadPoolExecutor(at_once) as pool:
        started: Deque[Any] = collections.deque()
        for i, now in enumerate(frames):
            if now.truth is not None:
                now.filled = _egosgm.interpolate_background(now.estimate)
            pair = before if i and follows(i) else None
            if pair is not None and pair.estimate.shape != now.estimate.shape:
                raise _egosgm.InvalidArgument(f"frame {i}: the estimate is {size_text(now.estimate)}, that of the frame before {size_text(pair.estimate)}; "
                                              "give maps of one size")
            motion = motions(i) if pair is not None and calibration is not None else None
            started.append(pool.submit(_count, now, pair, calibration, motion, near_px))
            before = now
            if len(started) > at_once:
                yield started.popleft().result()
        for counts in started:
            yield counts.result()

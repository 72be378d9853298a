# SPDX-License-Identifier: Apache-2.0
"""What is wrong with rectified pairs before they are matched: their images, calibration, rows, sides and range. Needs OpenCV (cv2)."""
from typing import Any, Callable, Dict, List, NamedTuple, Optional, Tuple

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from ..arguments import counted

_FEATURES, _FAST_THRESHOLD = 3000, 12
_MARGIN_PX, _LEAST_PLACE_PX = 31, 10  # of an image, in which no points are looked for; and what is left then
_MOST_DESCRIPTOR_DISTANCE = 50  # of 256 bits
_FEWEST_FOR_EPIPOLAR = 16  # below this a fundamental matrix says nothing
_EPIPOLAR_PX, _RETURN_PX = 1.5, 0.3

FEWEST_MATCHES, _FEWEST_SURE = 30, 8  # the latter beside a coarse map that is sure of much
_MOST_OFFSET_PX = 0.6  # KITTI's own pairs reach that
_MOST_SPREAD_PX = 1.0  # of the rest, 90 % of the matches that agree
_MOST_OF_COPY_PX = 0.5  # between disparities; scenes have more
_AGREEMENT_PX = 1.0  # of a match with what most of them say
_FEWEST_AGREEING = 0.4  # of the matches; below, they are mistaken for each other
_CLIPPED_SHARE = 0.01  # of the points
_BEHIND_SHARE, _BEHIND_PX = 0.02, 1.0  # points whose disparity none before the cameras has
_MOST_BRIGHTNESS = 1.25  # of one image by the other's
_LEAST_CONTRAST, _USUAL_CONTRAST = 16, 64  # grey levels of 256 between which nearly all pixels lie
_MOST_SATURATED = 0.25  # of the pixels
_LEAST_COMB = 1.5  # how much more neighbouring rows differ than those two apart
_FEWEST_COARSE = 0.03  # of the pixels of the coarse map; below, it says nothing
_FEWEST_LEVELS = 9  # grey levels of an image
_USUAL_COARSE = 0.25  # of the pixels of the coarse map of most pairs; below, it may be of images that do not belong together as they are
_SURE_OF_CHANGE = 0.15  # of the same pixels
_TURN_BACK = "turn them as the left ones are: a camera that is mounted upside down turns its images by 180 degrees where its driver is told to; then calibrate them so"
_CHANGES: "Dict[str, Tuple[Callable[[NDArray[Any]], NDArray[Any]], str]]" = {  # what undoes it, and the remedy
    "": (np.array, ""), "turned by 180 degrees": (lambda image: image[::-1, ::-1], _TURN_BACK), "mirrored": (np.fliplr, _TURN_BACK),
    "upside down, as in a mirror": (np.flipud, _TURN_BACK), "negatives": (np.invert, "invert them: 255 less each value of 8 bits, 65535 less each of 16")}


class Finding(NamedTuple):
    """What a check says. verdict: ok, note or problem."""

    verdict: str
    check: str
    text: str
    remedy: str = ""


def _comparable(left: NDArray[Any], right: NDArray[Any]) -> Tuple[NDArray[np.uint8], NDArray[np.uint8]]:
    """The pair as bytes, over all grey levels, whose steps tell what is a point: where both are dark, by one factor; of another exposure or gamma, each by itself."""
    import cv2
    greys = _egosgm._grey_bytes(left, right)
    low, high = np.quantile(greys, (0.001, 0.999))
    contrasts, means = [float(np.ptp(np.quantile(image, (0.01, 0.99)))) for image in greys], [float(image.mean()) for image in greys]
    if min(contrasts) > 0 and any(max(values) > _MOST_BRIGHTNESS * min(values) for values in (contrasts, means)):
        return cv2.equalizeHist(greys[0]), cv2.equalizeHist(greys[1])
    if not 0 < high - low < _USUAL_CONTRAST:
        return greys
    dark, dark_right = (np.clip((image - low) * (255 / (high - low)), 0, 255).astype(np.uint8) for image in greys)
    return dark, dark_right


def match_pair(left: NDArray[Any], right: NDArray[Any]) -> NDArray[np.float32]:
    """Points found in both images, wherever they lie: (N, 4) of x_left, y_left, x_right, y_right [px]. Rectified images have them in equal rows;
    nothing is assumed of rows, sides or range here. Matched by ORB, outliers dropped by a fundamental matrix, refined to a part of a pixel."""
    import cv2
    left, right = np.asarray(left), np.asarray(right)
    if left.ndim != 2 or left.shape != right.shape or left.dtype != right.dtype or left.dtype not in (np.uint8, np.uint16):
        raise _egosgm.InvalidArgument("the pair: give grey images of 8 or 16 bits, both of one size and depth")
    left, right = _comparable(left, right)
    none = np.empty((0, 4), np.float32)
    detector = cv2.ORB_create(_FEATURES, 1.2, 4, _MARGIN_PX, 0, 2, cv2.ORB_HARRIS_SCORE, 31, _FAST_THRESHOLD)
    (left_points, left_words), (right_points, right_words) = (detector.detectAndCompute(image, None) for image in (left, right))
    if not left_points or not right_points:
        return none
    found = [match for match in cv2.BFMatcher(cv2.NORM_HAMMING, crossCheck=True).match(left_words, right_words)
             if match.distance <= _MOST_DESCRIPTOR_DISTANCE]
    points = np.array([(*left_points[match.queryIdx].pt, *right_points[match.trainIdx].pt) for match in found], np.float32).reshape(-1, 4)
    if len(points) < _FEWEST_FOR_EPIPOLAR:
        return none
    cv2.setRNGSeed(0)
    inliers = cv2.findFundamentalMat(points[:, :2], points[:, 2:], cv2.FM_RANSAC, _EPIPOLAR_PX, 0.999)[1]
    points = points[inliers.ravel() != 0] if inliers is not None else none
    if len(points) < _FEWEST_FOR_EPIPOLAR:
        return none
    how = dict(winSize=(15, 15), maxLevel=0, criteria=(cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 30, 0.005), flags=cv2.OPTFLOW_USE_INITIAL_FLOW)
    start = np.ascontiguousarray(points[:, :2])
    there, is_there, _ = cv2.calcOpticalFlowPyrLK(left, right, start, np.ascontiguousarray(points[:, 2:]), **how)
    back, is_back, _ = cv2.calcOpticalFlowPyrLK(right, left, there, start.copy(), **how)
    kept = (is_there.ravel() != 0) & (is_back.ravel() != 0) & (np.linalg.norm(back - start, axis=1) <= _RETURN_PX)
    return np.hstack([start, there])[kept]


def _row_terms(matches: NDArray[np.float32], width: int, height: int) -> NDArray[np.float64]:
    """What rows of both images differ by is a smooth function of these, of the place and of the disparity, in a pair that is not rectified."""
    x, y = matches[:, 0] / width - 0.5, matches[:, 1] / height - 0.5
    return np.stack([np.ones(len(x)), x, y, x * y, x * x, y * y, (matches[:, 0] - matches[:, 2]) / width], axis=1)


def _agreeing(matches: NDArray[np.float32], width: int, height: int) -> NDArray[np.bool_]:
    """Which matches agree on how far rows are apart: those that the best of many functions through seven of them explains."""
    tries, most_looked_at = 1000, 1500
    terms, errors = _row_terms(matches, width, height), (matches[:, 3] - matches[:, 1]).astype(float)
    chosen = np.random.default_rng(1).integers(0, len(matches), (tries, terms.shape[1]))
    systems = terms[chosen]
    solvable = np.abs(np.linalg.det(systems)) > 1e-14
    if not solvable.any():
        return np.zeros(len(matches), bool)
    candidates = np.linalg.solve(systems[solvable], errors[chosen[solvable]][:, :, None])[:, :, 0]
    step = 1 + len(matches) // most_looked_at
    counts = (np.abs(candidates @ terms[::step].T - errors[::step]) <= _AGREEMENT_PX).sum(axis=1)
    return np.abs(terms @ candidates[counts.argmax()] - errors) <= _AGREEMENT_PX


def _comb(image: NDArray[Any]) -> float:
    """How much more rows that are neighbours differ than those two apart."""
    rows = image - image.mean(axis=1, keepdims=True, dtype=np.float32)  # some sensors have rows that are brighter
    near, far = (float(np.abs(np.diff(part, axis=0)).mean()) for part in (rows, rows[::2]))
    return near / far if far else 0.0


def spread(values: NDArray[np.float32]) -> float:
    """How far 90 % of the values lie from the median at most."""
    return float(np.quantile(np.abs(values - np.median(values)), 0.9))


def _has_level_rows(matches: NDArray[np.float32]) -> bool:
    """Whether the rows of a pair are one distance apart, as they are of one moment."""
    return len(matches) >= FEWEST_MATCHES and spread(matches[:, 3] - matches[:, 1]) <= _MOST_SPREAD_PX


def _slopes(places: NDArray[np.float64], errors: NDArray[np.float64]) -> str:
    """How the misalignment changes from left to right and from top to bottom, by least squares."""
    fit = np.linalg.lstsq(places, errors, rcond=None)[0]
    return f", {fit[1]:+.2f} px from left to right, {fit[2]:+.2f} px from top to bottom"


def _copied_by(left: NDArray[Any], right: NDArray[Any], matches: NDArray[np.float32]) -> Optional[int]:
    """By how many columns the right image is the left one, moved; None where it is an image of its own."""
    if np.array_equal(left, right):
        return 0
    shift = round(float(np.median(matches[:, 0] - matches[:, 2]))) if len(matches) else 0
    width = left.shape[1] - abs(shift)
    of_left, of_right = (image[:, start:start + width] for image, start in ((left, max(shift, 0)), (right, max(-shift, 0))))
    return shift if shift and 2 * width > left.shape[1] and np.array_equal(of_left, of_right) else None


class Examination:
    """It looks at a few pairs, however they came: add() them, then ask for findings()."""

    def __init__(self, calibration: Optional[_egosgm.Calibration], least: int, end: int) -> None:
        """calibration: None where the pairs have none. The range of disparities that is to be searched: [least, end)."""
        self._calibration, self._least, self._end = calibration, least, end
        self._pairs = self._narrow = 0
        self._copies: List[int] = []
        self._width = self._height = self._bits = 0
        self._brightness = np.zeros(2)
        self._contrasts: List[float] = []
        self._levels = 0
        self._saturated, self._interlaced, self._mosaics, self._swapped = np.zeros(2), 0, 0, 0
        self._matches: List[NDArray[np.float32]] = []
        self._coarse: List[NDArray[np.float32]] = []
        self._coarse_pixels = 0

    def add(self, left: NDArray[Any], right: NDArray[Any]) -> None:
        """Throws InvalidArgument unless both are grey, of 8 or 16 bits, and of one size and depth."""
        matches = match_pair(left, right)
        self._height, self._width = left.shape
        self._bits = 8 * left.dtype.itemsize
        self._pairs += 1
        self._narrow += int(left.dtype == np.uint16 and max(int(left.max()), int(right.max())) < 256)
        copied_by = _copied_by(left, right, matches)
        self._copies += [] if copied_by is None else [copied_by]
        greys = _egosgm._grey_bytes(left, right)
        self._contrasts.append(min(float(np.ptp(np.quantile(image, (0.01, 0.99)))) for image in greys))
        self._levels = max(self._levels, *(np.count_nonzero(np.bincount(image.ravel())) for image in greys))
        self._mosaics += int(any(_egosgm._holds_mosaic(image) for image in greys))
        self._swapped += int(any(_egosgm._holds_swapped_bytes(image) for image in (left, right)))
        for side, image in enumerate((left, right)):
            self._brightness[side] += image.mean()
            largest = image.max()
            self._saturated[side] += np.mean(image == largest) if largest in (255, 1023, 4095, 16383, 65535) else 0
        if self._height > 2:
            self._interlaced += int(max(map(_comb, (left, right))) > _LEAST_COMB)
        self._matches.append(matches)
        row_offset = float(np.median(matches[:, 3] - matches[:, 1])) if len(matches) else 0.0
        self._last = _comparable(left, right)
        coarse = _egosgm._coarse_map(*self._last, row_offset, self._least, self._end)
        self._coarse_pixels += coarse.size
        self._coarse.append(coarse[np.isfinite(coarse)])

    def findings(self, pairs: int) -> List[Finding]:
        """pairs: how many there are in all. REQUIRES: add() was called."""
        found = [self._images(pairs), self._of_calibration()]
        matches = np.concatenate(self._matches)
        if self.is_too_small() or not self._has_contrast() or self._levels < _FEWEST_LEVELS or 2 * self._swapped > self._pairs:  # nothing else can be told
            return found
        if len(self._copies) == self._pairs:
            what = f"the right images are the left ones, moved by {self._copies[0]} px" if any(self._copies) else "the left and the right images are the same"
            return [*found, Finding("problem", "matches", what, "give the images of both cameras")]
        coarse = np.concatenate(self._coarse)
        is_sure = len(coarse) >= _FEWEST_COARSE * self._coarse_pixels
        change = self._change() if len(coarse) < _USUAL_COARSE * self._coarse_pixels else ""
        if change:
            return [*found, Finding("problem", "matches", f"the right images are {change}: only so do they show what the left ones do", _CHANGES[change][1])]
        are_related = len(matches) >= _FEWEST_SURE and len(coarse) >= _FEWEST_COARSE / 2 * self._coarse_pixels
        if len(matches) < FEWEST_MATCHES and not are_related:
            remedy = "give them sharper, brighter or with less noise: coarsely, left and right agree" if is_sure else \
                "give the left and right images of the same moments, sharp, and overlapping"
            return [*found, Finding("problem", "matches", f"only {counted(len(matches), 'point')} found in both images", remedy)]
        columns_px, rows_px = (spread(matches[:, i + 2] - matches[:, i]) if len(matches) >= FEWEST_MATCHES else 0.0 for i in (0, 1))
        if columns_px <= _MOST_SPREAD_PX < rows_px / 2:
            return [*found, Finding("problem", "rows", f"the views agree in columns (90 % of the points within {columns_px:.2f} px), and not in rows ({rows_px:.1f} px)",
                                    "the images are turned by 90 degrees: turn them back; or one camera stands above the other: turn the images of both, and calibrate them so")]
        agreeing = matches[_agreeing(matches, self._width, self._height)] if len(matches) >= FEWEST_MATCHES else matches[:0]
        is_agreed = len(agreeing) >= max(FEWEST_MATCHES, _FEWEST_AGREEING * len(matches))
        found += [self._rows(len(matches), agreeing), *self._depths(matches)]
        points = agreeing[:, 0] - agreeing[:, 2] if is_agreed else None
        if not is_sure:
            return [*found, *self._without_texture(points)]
        swapped = sum(len(part) > 0 and np.mean(part < -self._doffs() - _BEHIND_PX) > 0.5 and _has_level_rows(own) for part, own in zip(self._coarse, self._matches))
        if 0 < swapped < self._pairs:
            return [*found, Finding("problem", "sides", f"in {swapped} of {self._pairs} pairs that were looked at, most points lie behind the cameras", "left and right are swapped in these: "
                                    "exchange their images; a recorder that takes both cameras from one stream, and loses an image, swaps all that follow")]
        is_swapped, sides = self._sides(coarse, points)
        return [*found, sides] if is_swapped else [*found, sides, self._range(coarse, points)]

    def _change(self) -> str:
        """How the right images are changed, where only then a coarse match finds much in the last pair."""
        left, right = self._last
        shares = {name: float(np.isfinite(_egosgm._coarse_map(left, np.ascontiguousarray(undo(right)), 0.0, self._least, self._end)).mean())
                  for name, (undo, _) in _CHANGES.items()}
        second, best = sorted(shares, key=lambda name: shares[name])[-2:]
        return best if shares[best] >= max(_SURE_OF_CHANGE, 2 * shares[second]) else ""

    def is_too_small(self) -> bool:
        """Whether the images have hardly a place where points are looked for. REQUIRES: add() was called."""
        return min(self._width, self._height) <= 2 * _MARGIN_PX + _LEAST_PLACE_PX

    def _has_contrast(self) -> bool:
        return float(np.median(self._contrasts)) >= _LEAST_CONTRAST

    def _doffs(self) -> float:
        """A point before the cameras has disparity + doffs > 0."""
        return self._calibration.doffs_px if self._calibration else 0.0

    @staticmethod
    def _share_below(coarse: NDArray[np.float32], points: Optional[NDArray[np.float32]], bound: float) -> float:
        """Of both sources the one that accuses less: each has its own mistakes."""
        share = float(np.mean(coarse < bound))
        return share if points is None else min(share, float(np.mean(points < bound)))

    def _images(self, pairs: int) -> Finding:
        text = f"{counted(pairs, 'pair')} of {self._width}x{self._height}, {self._bits} bit"
        if self.is_too_small():
            return Finding("note", "images", f"{text}: they are too small to find points in, which lie {_MARGIN_PX} px from the borders or more: rows, sides, range and motion "
                           "were not looked at", "give larger images where there are some; the poses (run --poses) where odometry finds no motion")
        if self._narrow == self._pairs:
            return Finding("problem", "images", f"{text}, but no value above 255: the upper 8 bits, which tell edges, are empty",
                           "save them with 8 bits, or multiply the values by 257")
        if not self._has_contrast():
            return Finding("problem", "images", f"{text}, of nearly one tone: they hold {np.median(self._contrasts):.0f} of 256 grey levels",
                           "expose longer, or give more light: noise has as many")
        if self._levels < _FEWEST_LEVELS:
            return Finding("problem", "images", f"{text}, of {self._levels} grey levels in all: what tells one place from another is gone",
                           "save them with 8 bits; pictures of 1 or 2 bits are not matched well")
        if 2 * self._swapped > self._pairs:
            return Finding("problem", "images", f"{text}, both bytes of each pixel exchanged: as they stand they are noise", "swap them (NumPy: image.byteswap()): PNG has the "
                           "high byte first, and the pixels were written with the low one first")
        if 2 * self._mosaics > self._pairs:
            return Finding("problem", "images", f"{text}, the mosaics of colour sensors (Bayer): neighbouring pixels saw other colours",
                           "convert both images to grey first, as cv2.cvtColor(image, cv2.COLOR_BayerBG2GRAY) does for one order of the colours")
        if 2 * self._interlaced > self._pairs:
            return Finding("problem", "images", f"{text}, interlaced: every other row is of another moment", "take every other row of both images, or deinterlace the videos")
        dull = sum(contrast < _LEAST_CONTRAST for contrast in self._contrasts)
        if dull:
            return Finding("note", "images", f"{text}; in {dull} of {self._pairs} pairs that were looked at, an image is of nearly one tone", "leave these out: a camera was covered, dark or off")
        left, right = self._brightness / self._pairs
        ratio = (left + 1) / (right + 1)
        if max(ratio, 1 / ratio) > _MOST_BRIGHTNESS:
            return Finding("note", "images", f"{text}; the left ones are {ratio:.2f} times as bright as the right ones",
                           "expose both cameras alike; the census cost bears it, sad3x3 does not")
        saturated = float((self._saturated / self._pairs).max())
        if saturated > _MOST_SATURATED:
            return Finding("note", "images", f"{text}; {100 * saturated:.0f} % of the pixels hold the largest value",
                           "expose shorter: where all is white there is nothing to match")
        return Finding("ok", "images", text)

    def _of_calibration(self) -> Finding:
        c = self._calibration
        if c is None:
            return Finding("note", "calibration", "none was given: there is no depth and no odometry", "give --calib FILE; `egosgm calibrate` finds one by pictures of a board")
        text = f"fx {c.fx:.1f}, fy {c.fy:.1f}, cx {c.cx:.1f}, cy {c.cy:.1f} px, baseline {c.baseline_m:.4g} m"
        suspicion = _egosgm._suspect_calibration(c, self._width, self._height)
        if not suspicion:
            return Finding("ok", "calibration", text)
        return Finding("problem" if suspicion.is_certain else "note", "calibration", f"{text}: {suspicion.what}", suspicion.remedy)

    def _rows(self, matches: int, agreeing: NDArray[np.float32]) -> Finding:
        """The rows of the two views: a constant offset, and what is left beside it."""
        of = f"{counted(matches, 'point')} in {counted(self._pairs, 'frame')}"
        if matches < FEWEST_MATCHES:
            return Finding("note", "rows", f"only {of}, too few to measure rows by", "look at frames of things that are not alike")
        offsets = [np.median(own[:, 3] - own[:, 1]) for own in self._matches if _has_level_rows(own)]
        if len(offsets) > self._pairs / 2 and np.ptp(offsets) > _MOST_OFFSET_PX + _MOST_SPREAD_PX:
            return Finding("problem", "rows", f"rows are apart by another distance in each frame, from {min(offsets):.1f} to {max(offsets):.1f} px in the median ({of})",
                           "fix the cameras to each other, and turn off what steadies their images, electronic or in the lens: no calibration holds else")
        if len(agreeing) < _FEWEST_AGREEING * matches:
            return Finding("note", "rows", f"only {len(agreeing)} of {of} agree on how far rows are apart",
                           "textures that repeat are mistaken for each other, or left and right are of other moments: look at frames of other things")
        errors = (agreeing[:, 3] - agreeing[:, 1]).astype(float)
        places = np.stack([np.ones(len(agreeing)), agreeing[:, 0] / self._width, agreeing[:, 1] / self._height], axis=1)
        offset = round(float(np.median(errors)), 2) + 0.0  # no -0.00
        spread = float(np.quantile(np.abs(errors - offset), 0.9))
        text = f"vertical misalignment {offset:.2f} px in the median, 90 % within {spread:.2f} px of it ({of}){_slopes(places, errors)}"
        if abs(offset) <= _MOST_OFFSET_PX and spread <= _MOST_SPREAD_PX:
            return Finding("ok", "rows", text)
        remedy = "rectify again (egosgm rectify, from the raw images and a new calibration)" if self._calibration else \
            "these images are not rectified: `egosgm calibrate` finds the cameras, and `egosgm rectify` makes images of equal rows"
        return Finding("problem", "rows", text, f"{max(abs(offset), spread):.1f} px: {remedy}")

    def _depths(self, matches: NDArray[np.float32]) -> List[Finding]:
        """Copies of one image, with noise, or moved by a part of a pixel, have one disparity."""
        disparities = matches[:, 0] - matches[:, 2]
        if len(matches) < FEWEST_MATCHES or spread(disparities) > _MOST_OF_COPY_PX:
            return []
        middle = float(np.median(disparities))
        is_far = abs(middle + self._doffs()) <= _MOST_OF_COPY_PX
        return [Finding("problem" if is_far else "note", "depths", f"the points have one disparity, {middle + 0.0:.2f} px, 90 % within {spread(disparities):.2f} px of it",
                        "both images come from one camera, or show nothing but " + ("what is too far for these cameras" if is_far else "a wall") + ": give the images of both cameras")]

    def _without_texture(self, points: Optional[NDArray[np.float32]]) -> List[Finding]:
        found = []
        if points is not None:
            found.append(self._sides(points, points)[1])
        share = 100 * sum(map(len, self._coarse)) / max(1, self._coarse_pixels)
        return [*found, Finding("note", "texture", f"a coarse match is sure of {share:.1f} % of the image, too little to tell a range by",
                                "much will stay empty: give images with more light, sharper, or of what has texture")]

    def _sides(self, coarse: NDArray[np.float32], points: Optional[NDArray[np.float32]]) -> Tuple[bool, Finding]:
        """Whether left and right are swapped, and what is said: then nearly all points lie behind the cameras; of views that are shifted, the far ones do."""
        doffs = self._doffs()
        behind = self._share_below(coarse, points, -doffs - _BEHIND_PX)
        text = f"{100 * behind:.1f} % of the points lie behind the cameras"
        if behind <= _BEHIND_SHARE:
            return False, Finding("ok", "sides", text)
        if doffs < 0 and self._share_below(coarse, points, doffs - _BEHIND_PX) <= _BEHIND_SHARE:
            return False, Finding("problem", "sides", f"{text} with doffs_px {doffs:g}, and none with {-doffs:g}", "give doffs_px as the right image's cx less the left one's: its sign "
                                  "may be wrong")
        if behind > 0.5 and self._share_below(-coarse, None if points is None else -points, min(0.0, doffs) - _BEHIND_PX) <= _BEHIND_SHARE:
            return True, Finding("problem", "sides", text, "left and right are swapped, or both images are mirrored or upside down: "
                                 "exchange the images (and their calibrations), or turn them")
        return False, Finding("problem", "sides", text, "the principal points differ by more than doffs_px says, or the cameras converge: rectify again, or give "
                              "--min-disparity and doffs_px")

    def _range(self, coarse: NDArray[np.float32], points: Optional[NDArray[np.float32]]) -> Finding:
        low, high, farthest = (float(value) for value in np.quantile(coarse, (0.005, 0.995, 0.999)))
        least, end = self._least, self._end
        text = f"disparities from {low:.1f} to {high:.1f} px (99 % of the points), the range is [{least}, {end})"
        above, below = float(np.mean(coarse > end - 1)), self._share_below(coarse, points, least - _BEHIND_PX)
        if above > _CLIPPED_SHARE:
            return Finding("problem", "range", f"{text}: it clips {100 * above:.1f} % of them, the near ones",
                           f"give --disparities {_rounded_up(1.1 * high - least + 1)}")
        if below > _CLIPPED_SHARE:
            return Finding("problem", "range", f"{text}: it clips {100 * below:.1f} % of them, the far ones", f"give --min-disparity {int(np.floor(low)) - 2}")
        if 2 * (farthest - least + 1) < end - least:
            return Finding("note", "range", f"{text}: half of it is never needed",
                           f"--disparities {max(16, _rounded_up(1.25 * farthest - least + 1))} is faster")
        return Finding("ok", "range", text)


def _rounded_up(value: float) -> int:
    return 16 * int(np.ceil(value / 16))

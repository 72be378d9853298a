# SPDX-License-Identifier: Apache-2.0
"""Figures of a video that need its maps pixel by pixel: flicker, mistakes of the motion, uncovered and thin things, variances.

Runs the pipeline through the Python module (PYTHONPATH=build/python); bench/accuracy makes rows of what this returns.
Disparities and errors in px; shares in percent.
"""
import functools
import pathlib

import numpy as np

import egosgm
from egosgm.evaluation.pose_evaluation import inverse
from egosgm.evaluation.video_evaluation import BAD_PX, is_valid, move

SINGLE_FRAME = {"temporal": False}


class Street:
    """A folder of `egosgm synth`, with its true motions."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        self.sequence = egosgm.open_folder(self.folder)
        self.calibration, self.size = self.sequence.calibration, self.sequence.size
        self.numbers = range(len(self.sequence))
        self.world_from_camera = egosgm.read_poses(self.folder / "poses.txt")

    def images(self, k):
        return self.sequence.frames[k].read()

    def motion(self, k, since):
        return np.linalg.inv(self.world_from_camera[k]) @ self.world_from_camera[since]

    def file(self, kind, k):
        return self.folder / "truth" / kind / f"{self.sequence.frames[k].name}.png"

    def truth(self, k):
        return egosgm.read_disparity(self.file("left_disp_noc", k))

    def all_truth(self, k):
        """Of occluded pixels too."""
        return egosgm.read_disparity(self.file("left_disp_occ", k))

    def moving(self, k):
        return egosgm.read_grey(self.file("left_moving", k)) > 0


class Recorded:
    """A sequence on disk with odometry's motions. `numbers`: its frames in the order in which they are played."""

    def __init__(self, sequence, numbers=None):
        by_number = {frame.number: frame for frame in sequence.frames}
        self.numbers = list(numbers or by_number)
        self.calibration, self.size = sequence.calibration, sequence.size
        self.images = lambda k: by_number[k].read()
        self.truth = lambda k: egosgm.read_disparity(by_number[k].truth_noc)

    @functools.cached_property
    def motions(self):
        odometry = egosgm.StereoOdometry(self.calibration)
        return {k: odometry.process(*self.images(k)).motion for k in self.numbers}

    def motion(self, k, since):
        if self.numbers.index(k) - self.numbers.index(since) != 1:
            raise ValueError(f"frame {since} is not the one before {k}")
        return self.motions[k]


def matrix_of(motion):
    return motion if isinstance(motion, np.ndarray) else motion.current_from_previous


def play(video, numbers=None, wrong=None, outputs=("disparity", "variance"), **options):
    """Yields (k, Frame). `numbers` may leave out frames. `wrong`: matrices by number that displace a frame's motion."""
    pipeline = egosgm.Pipeline(video.calibration, *video.size, **options)
    since = None
    for k in video.numbers if numbers is None else numbers:
        motion = None if since is None else video.motion(k, since)
        if k in (wrong or {}):
            motion = wrong[k] @ matrix_of(motion)
        yield k, pipeline.process(*video.images(k), motion, outputs)
        since = k


def bad_or_missing(disparity, truth, where=None):
    """(bad or missing, all) pixels that have truth."""
    counts = egosgm.compare_disparity(disparity, truth if where is None else np.where(where, truth, egosgm.INVALID_DISPARITY))
    return counts.bad + (counts.truth - counts.sky) - (counts.valid - counts.sky_valid), counts.truth


def share(counts):
    """Percent, of a list of (part, all)."""
    parts = np.sum(np.reshape(counts, (-1, 2)), axis=0)
    return float(100 * parts[0] / parts[1]) if parts[1] else float("nan")


def flicker(video, first, **options):
    """Mean |d_k - d_(k-1) moved| over the pixels that have both, from frame number `first` on."""
    maps, poses = [], [np.eye(4)]
    for k, frame in play(video, **options):
        if k >= first - 1:
            maps.append(frame.disparity.copy())
        if len(maps) > 1:
            poses.append(poses[-1] @ np.linalg.inv(matrix_of(video.motion(k, k - 1))))
    return egosgm.evaluate_video(maps, calibration=video.calibration, world_from_camera=np.stack(poses)).figures.flicker_px


def turned(axis, degrees):
    """A rotation about the camera's axis 0 (pitch), 1 (yaw) or 2 (roll)."""
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(4)
    matrix[[i, j], [i, j]] = np.cos(np.radians(degrees))
    matrix[i, j], matrix[j, i] = -np.sin(np.radians(degrees)), np.sin(np.radians(degrees))
    return matrix


DISTURBANCES = ("a gap of 5 frames", "yaw wrong by 1 degree", "pitch wrong by 1 degree")


def recovery(video, at, frames=4):
    """bad_or_missing of frames at, at + 1, ...: of a single frame, undisturbed, and with a disturbance at frame `at`."""
    lead = list(range(at - 4, at + frames))
    runs = {"single frame": dict(numbers=lead[4:], **SINGLE_FRAME), "undisturbed": dict(numbers=lead),
            "a gap of 5 frames": dict(numbers=list(range(at - 9, at - 5)) + lead[4:]),
            "yaw wrong by 1 degree": dict(numbers=lead, wrong={at: turned(1, 1)}),
            "pitch wrong by 1 degree": dict(numbers=lead, wrong={at: turned(0, 1)})}
    return {name: [share([bad_or_missing(frame.disparity, video.truth(k))]) for k, frame in play(video, **run) if k >= at]
            for name, run in runs.items()}


def there_and_back(frames, last):
    """Numbers of `frames` frames that drive from 0 to `last`, back, there again: frame i and i + 2 last are the same image, reached
    by the same motion, so that only the filter's past can tell them apart."""
    return [last - abs(last - i % (2 * last)) for i in range(frames)]


def long_run(video, numbers, restart, **options):
    """bad_or_missing frame by frame: of one run over `numbers`, and of one that starts at place `restart`. And the later resets."""
    def errors(numbers):
        frames = [(share([bad_or_missing(frame.disparity, video.truth(k))]), frame.report.search_fraction >= 1)
                  for k, frame in play(video, numbers, **options)]
        return [error for error, _ in frames], sum(full for _, full in frames[1:])
    through, resets = errors(numbers)
    return through, errors(numbers[restart:])[0], resets


def uncovered_ages(video, oldest):
    """Yields (k, for how many frames each pixel's surface has been in sight since a moving object covered it; -1: was not)."""
    previous = None
    for k in video.numbers:
        ages = np.full(video.all_truth(k).shape, -1, np.int32)
        if previous is not None:
            static = np.where(video.moving(k), egosgm.INVALID_DISPARITY, video.all_truth(k))
            inside, place, then = move(static, video.calibration, inverse(video.motion(k, k - 1)))
            behind = inside & video.moving(k - 1).ravel()[place] & (video.all_truth(k - 1).ravel()[place] > then + 1)
            before = np.where(inside, previous.ravel()[place], -1)
            ages = np.where(behind, 0, np.where(before >= 0, before + 1, -1))
            ages[ages > oldest] = -1
        previous = ages
        yield k, ages


def uncovered(video, first, oldest=2, **options):
    """bad_or_missing of pixels that a moving object uncovered 0, 1, ... frames ago."""
    ages, counts = dict(uncovered_ages(video, oldest)), {age: [] for age in range(oldest + 1)}
    for k, frame in play(video, **options):
        for age in counts if k >= first else ():
            counts[age].append(bad_or_missing(frame.disparity, video.truth(k), ages[k] == age))
    return [share(counts[age]) for age in counts]


def thin(disparity, width=7, step_px=3.0):
    """What is narrower than `width` pixels and stands out from both sides by more than the step: poles."""
    def slide(values, reduce):
        padded = np.pad(values, ((0, 0), (width // 2, width // 2)), mode="edge")
        return reduce(np.lib.stride_tricks.sliding_window_view(padded, width, axis=1), axis=2)
    return disparity - slide(slide(disparity, np.min), np.max) > step_px


def of_thin_things(video, first, **options):
    counts = [bad_or_missing(frame.disparity, video.truth(k), thin(video.all_truth(k))) for k, frame in play(video, **options)
              if k >= first]
    return share(counts), sum(pixels for _, pixels in counts)


def errors_of(disparity, truth):
    """disparity - truth of the pixels that have both, and their rows and columns."""
    y, x = np.nonzero(is_valid(truth) & is_valid(disparity))
    return (disparity - truth)[y, x].astype(float), y, x


def errors_and_variances(video, frames, **options):
    """Of each of the frames numbered `frames`: errors, variances, rows and columns of all pixels with truth and a disparity."""
    pairs = []
    for k, frame in play(video, **options):
        if k in frames:
            errors, y, x = errors_of(frame.disparity, video.truth(k))
            pairs.append((errors, frame.variance[y, x].astype(float), y, x))
    return pairs


def interpolated(video, number, max_variances, **options):
    """Percent bad after background interpolation of one frame, of the pixels whose variance is at most each of the bounds [px^2]."""
    figures = []
    for k, frame in play(video, **options):
        for bound in max_variances if k == number else ():
            certain = np.where(frame.variance > bound, egosgm.INVALID_DISPARITY, frame.disparity).astype(np.float32)
            figures.append(share([bad_or_missing(egosgm.interpolate_background(certain), video.truth(k))]))
    return figures


def median_error(pairs):
    return float(np.median(np.concatenate([errors for errors, *_ in pairs])))


def without_offset(pairs):
    """The errors less each frame's median one: a step between cameras and truth that all matchers share is no pixel's uncertainty."""
    return [(errors - np.median(errors), *others) for errors, *others in pairs]


def blocks_of(y, x, side):
    return y // side * 1000 + x // side


def medians_by_block(errors, y, x, side=64, least=500):
    """The median error of each block of side x side pixels that has `least` of them, by the block's number."""
    blocks = blocks_of(y, x, side)
    return {block: float(np.median(errors[blocks == block])) for block, pixels in zip(*np.unique(blocks, return_counts=True)) if pixels >= least}


def median_size(values):
    return float(np.median(np.abs(values)))


def field(errors, y, x):
    """What lies under a matcher's errors as a quadratic of the place, a function of (y, x): where different matchers have the same, it is
    what cameras and truth are off by. Least squares in which what is further from it than half a pixel weighs little (Geman and McClure
    1985)."""
    def terms(y, x):
        v, u = y / 1000, x / 1000
        return np.stack([np.ones_like(u), u, v, u * v, u * u, v * v], axis=-1)
    a, weights = terms(y, x), np.ones(len(errors))
    for _ in range(20):
        fitted = np.linalg.lstsq(a * weights[:, None], errors * weights, rcond=None)[0]
        weights = 1 / (1 + ((errors - a @ fitted) / 0.5)**2)
    return lambda y, x: terms(y, x) @ fitted


def without_field(pairs, fields):
    return [(errors - off(y, x), variances, y, x) for (errors, variances, y, x), off in zip(pairs, fields)]


def calibration_of_variance(pairs, bins=10):
    """What the variances are worth. `ratio`: mean of error^2 / variance, errors cut at 3 px, since a few mismatches would decide it.
    `flatness`: the largest such ratio of the `bins` parts of the pixels in order of their variance, by the smallest. `removed`: percent
    of the bad pixels among the tenth of each frame with the largest variances. `bins`: predicted and actual deviation of those parts."""
    pairs = [(np.abs(errors), variances) for errors, variances, *_ in pairs]
    errors, variances = (np.concatenate(values) for values in zip(*pairs))
    cut = np.minimum(errors, BAD_PX)**2
    removed = []
    for error, variance in pairs:
        worst = np.argsort(variance, kind="stable")[int(0.9 * len(variance)):]
        removed.append((np.sum(error[worst] > BAD_PX), np.sum(error > BAD_PX)))
    parts = np.array_split(np.argsort(variances, kind="stable"), bins)
    ratios = [cut[part].mean() / variances[part].mean() for part in parts]
    return {"ratio": float(np.mean(cut / variances)), "ratio_not_bad": float(np.mean((errors**2 / variances)[errors <= BAD_PX])),
            "flatness": float(max(ratios) / min(ratios)), "removed": share(removed),
            "bins": [{"predicted_px": float(np.sqrt(variances[part].mean())), "actual_px": float(np.sqrt(cut[part].mean()))} for part in parts]}


def parts_in_order(variances, bins):
    """For each pixel, which of the `bins` parts in order of the variance it belongs to."""
    part = np.empty(len(variances), int)
    for n, pixels in enumerate(np.array_split(np.argsort(variances, kind="stable"), bins)):
        part[pixels] = n
    return part


def likeness(pairs, lag, bins=10):
    """Correlation of pixels `lag` columns apart, in what their error^2 is off by from the mean of their part in order of the variance."""
    products, squares = [], []
    for errors, variances, y, x in pairs:
        part, cut = parts_in_order(variances, bins), np.minimum(np.abs(errors), BAD_PX)**2
        residual = np.full((y.max() + 1, x.max() + lag + 1), np.nan)
        residual[y, x] = cut / (np.bincount(part, cut) / np.bincount(part))[part] - 1
        both = residual[y, x] * residual[y, x + lag]
        products.append(both[np.isfinite(both)])
        squares.append(residual[y, x]**2)
    return float(np.mean(np.concatenate(products)) / np.mean(np.concatenate(squares)))


def flatness_by_chance(pairs, bins=10, rounds=1000, percentile=95, side=64):
    """What `flatness` would stay below 95 of 100 times if the variances were flat: of frames whose blocks of side x side pixels are drawn
    anew, as errors of neighbours are alike, with each part's ratio divided by that of all blocks."""
    errors, variances = (np.concatenate(values) for values in list(zip(*pairs))[:2])
    blocks = np.unique(np.concatenate([blocks_of(y, x, side) + 10**6 * n for n, (_, _, y, x) in enumerate(pairs)]), return_inverse=True)[1]
    cells = blocks * bins + parts_in_order(variances, bins)
    sums = [np.bincount(cells, values, (blocks.max() + 1) * bins).reshape(-1, bins) for values in (np.minimum(np.abs(errors), BAD_PX)**2, variances)]
    drawn = np.random.default_rng(1).multinomial(len(sums[0]), np.full(len(sums[0]), 1 / len(sums[0])), rounds)
    ratios = (drawn @ sums[0]) / (drawn @ sums[1]) / (sums[0].sum(axis=0) / sums[1].sum(axis=0))
    return float(np.percentile(ratios.max(axis=1) / ratios.min(axis=1), percentile))


def least_flatness(scenes, bins=10, levels=200):
    """The least that the largest `flatness` of the scenes (lists as `errors_and_variances` gives them) can become by a function of the
    variance that keeps its order: no scale, floor or curve does better. The function has `levels` steps; for a flatness F, whether there is
    one is a linear programme: part i of scene s holds f(variances)_si <= h_s errors^2_si <= F f(variances)_si on average."""
    from scipy.optimize import linprog
    scenes = [[np.concatenate(values) for values in list(zip(*pairs))[:2]] for pairs in scenes]
    edges = np.quantile(np.concatenate([variances for _, variances in scenes]), np.linspace(0, 1, levels + 1)[1:-1])
    parts = [(n, part, errors, variances) for n, (errors, variances) in enumerate(scenes)
             for part in np.array_split(np.argsort(variances, kind="stable"), bins)]
    means = np.array([np.bincount(np.searchsorted(edges, variances[part]), minlength=levels) / len(part) for _, part, _, variances in parts])
    actual = np.zeros((len(parts), len(scenes)))
    for row, (n, part, errors, _) in enumerate(parts):
        actual[row, n] = np.mean(np.minimum(np.abs(errors[part]), BAD_PX)**2)
    falls = np.hstack([np.eye(levels - 1, levels) - np.eye(levels - 1, levels, 1), np.zeros((levels - 1, len(scenes)))])
    bounds = [(1e-6, None)] * levels + [(1, 1)] + [(1e-6, None)] * (len(scenes) - 1)  # the scale is free

    def is_possible(flatness):
        rows = np.vstack([np.hstack([means, -actual]), np.hstack([-flatness * means, actual]), falls])
        return linprog(np.zeros(rows.shape[1]), rows, np.zeros(len(rows)), bounds=bounds, method="highs").status == 0
    low, high = 1.0, 1.0
    while not is_possible(high):
        low, high = high, 2 * high
    while high - low > 0.005:
        middle = (low + high) / 2
        low, high = (low, middle) if is_possible(middle) else (middle, high)
    return high


def dynamic_map(video, first, **options):
    """(percent of the moving objects' pixels that are marked, percent of the marked pixels that lie on or near one)."""
    found, right = [], []
    for k, frame in play(video, outputs=("disparity", "dynamic"), **options):
        if k >= first:
            marked, moving = frame.dynamic > 0, video.moving(k)
            found.append((np.sum(marked & moving), moving.sum()))
            right.append((np.sum(marked & grown(moving, 8)), marked.sum()))
    return share(found), share(right)


def grown(mask, radius):
    padded = np.pad(mask, radius)
    rows = np.lib.stride_tricks.sliding_window_view(padded, 2 * radius + 1, axis=0).any(axis=2)
    return np.lib.stride_tricks.sliding_window_view(rows, 2 * radius + 1, axis=1).any(axis=2)

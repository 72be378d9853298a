# SPDX-License-Identifier: Apache-2.0
"""Figures of a video that need its maps pixel by pixel: flicker, mistakes of the motion, uncovered and thin things, variances.

Runs the pipeline through the Python module (PYTHONPATH=build/python); bench/accuracy makes rows of what this returns.
Disparities and errors in px; shares in percent.
"""
import functools
import pathlib

import numpy as np

import egosgm
from egosgm.evaluation.maps import is_valid
from egosgm.evaluation.moved_maps import move
from egosgm.evaluation.pose_evaluation import inverse
from egosgm.evaluation.regions import BAD_PX

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
    """Of each of the frames numbered `frames`: errors and variances of all pixels with truth and a disparity."""
    pairs = []
    for k, frame in play(video, **options):
        if k in frames:
            errors, y, x = errors_of(frame.disparity, video.truth(k))
            pairs.append((errors, frame.variance[y, x].astype(float)))
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
    return float(np.median(np.concatenate([errors for errors, _ in pairs])))


def calibration_of_variance(pairs, bins=10):
    """What the variances are worth. `ratio`: mean of error^2 / variance, errors cut at 3 px, since a few mismatches would decide it.
    `flatness`: the largest such ratio of the `bins` parts of the pixels in order of their variance, by the smallest. `removed`: percent
    of the bad pixels among the tenth of each frame with the largest variances."""
    pairs = [(np.abs(errors), variances) for errors, variances in pairs]
    errors, variances = (np.concatenate(values) for values in zip(*pairs))
    cut = np.minimum(errors, BAD_PX)**2
    removed = []
    for error, variance in pairs:
        worst = np.argsort(variance, kind="stable")[int(0.9 * len(variance)):]
        removed.append((np.sum(error[worst] > BAD_PX), np.sum(error > BAD_PX)))
    parts = np.array_split(np.argsort(variances, kind="stable"), bins)
    ratios = [cut[part].mean() / variances[part].mean() for part in parts]
    return {"ratio": float(np.mean(cut / variances)), "ratio_not_bad": float(np.mean((errors**2 / variances)[errors <= BAD_PX])),
            "flatness": float(max(ratios) / min(ratios)), "removed": share(removed)}


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

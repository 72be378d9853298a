#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Learns the comparisons of MatchingCost::kLearned7x7 and prints them as kernels/method.h has them.

  bench/learn_census.py [--data DIR] [--egosgm FILE]
Learns from the videos `rendered` and the planes `evidence` of ../shared/data, both CC0, and from streets that `egosgm synth` renders: no
other data may go into the table, as its licence would go with it. FOLDER arguments in their place are for experiments: image_0, image_1
(or left, right) with truth/left_disp_noc (16-bit PNG, disparity x 256) or truth.npz. The same input gives the same table.

A sample is a pixel with its true match and eight wrong ones. A comparison is a bit: whether the sum of 3x3 grey values at one place of the
7x7 window is less than that at another one plus a threshold. To the 24 bits of a census of 5x5 come, one after the other, the comparisons
that most lower the mean of log(1 + sum exp(-STEEPNESS (distance of a wrong match - distance of the true one))).
Needs NumPy and OpenCV's Python module (Debian: python3-opencv).
"""
import argparse
import heapq
import os
import pathlib
import subprocess
import sys
import tempfile

import cv2
import numpy as np

PROJECT = pathlib.Path(__file__).resolve().parents[1]
BITS = 40
RADIUS, MARGIN = 3, 5  # of the window; of the image's border, where no samples are
THRESHOLDS = (0, 5, 9, 18, 36, -5, -9, -18, -36)  # in ninths of a grey level, as sums of nine differ
CANDIDATES = 3000
STEEPNESS = 0.15
FRAMES, SAMPLES = 4, 1200  # of a video, and of a frame: half of them beside a jump of the disparity
DISPARITIES = 128
OWN = ("rendered/warehouse", "rendered/forest", "rendered/kitchen", "evidence/sky", "evidence/corridor", "evidence/fence", "evidence/poles")
STREETS = ((), ("--seed", "2"), ("--seed", "3", "--moving-object"), ("--seed", "4"))


def frames_of(folder):
    """Yields left image, right image and left disparity (0: unknown) of some frames all along a video."""
    left, right = (folder / names[(folder / names[0]).is_dir() is False] for names in (("image_0", "left"), ("image_1", "right")))
    planes, files = folder / "truth.npz", sorted((folder / "truth/left_disp_noc").glob("*.png"))
    images = [sorted(side.glob("*.png")) for side in (left, right)]
    if not images[0] or not (planes.exists() or files):
        sys.exit(f"learn_census: {folder} has no images or no truth")
    truths = list(np.load(planes).values()) if planes.exists() else files
    count = min(len(images[0]), len(truths))
    for k in sorted({round(i * (count - 1) / (FRAMES - 1)) for i in range(FRAMES)}):
        truth = truths[k] if planes.exists() else cv2.imread(str(truths[k]), cv2.IMREAD_UNCHANGED) / 256
        yield *(cv2.imread(str(side[k]), cv2.IMREAD_GRAYSCALE) for side in images), np.nan_to_num(truth.astype(np.float32))


def disturbed(random, images):
    """The pair as a worse or better camera would see it: contrast, exposure, sharpness and noise, which differ a little between views."""
    gain, offset, sharpness, noise = random.uniform(0.5, 1.3), random.uniform(-20, 20), random.choice((-0.8, 0, 0, 0.6, 1)), random.choice((0, 0, 1, 2, 4))
    for image in images:
        grey = image.astype(np.float32)
        soft = cv2.GaussianBlur(grey, (0, 0), max(abs(sharpness), 0.1))
        grey = soft if sharpness > 0 else grey + sharpness * (soft - grey)
        grey = (grey - 128) * gain * random.uniform(0.95, 1.05) + 128 + offset + random.uniform(-4, 4)
        yield np.clip(np.rint(grey + random.normal(0, noise + 1e-6, grey.shape)), 0, 255).astype(np.uint8)


def moved(image, dx, dy):
    """The image whose pixel x, y is x + dx, y + dy of the one given; samples stay away from its border."""
    return np.roll(image, (-dy, -dx), (0, 1))


def census(image, radius_x, radius_y):
    places = [(dx, dy) for dy in range(-radius_y, radius_y + 1) for dx in range(-radius_x, radius_x + 1) if dx or dy]
    code = np.zeros(image.shape, np.uint64)
    for dx, dy in places:
        code = code << np.uint64(1) | (moved(image, dx, dy) < image)
    return code


POPCOUNT = np.array([bin(i).count("1") for i in range(1 << 16)], np.uint8)


def distance(a, b):
    differing = (a ^ b)[..., None] >> np.arange(0, 64, 16, dtype=np.uint64) & np.uint64(0xffff)
    return POPCOUNT[differing.astype(np.int64)].sum(-1, dtype=np.int32)


def samples_of(random, images, truth):
    """Distances by a census of 5x5 and sums around the pixels: of the left view, and of the right one at the true match and the wrong ones."""
    height, width = truth.shape
    d = np.rint(truth).astype(int)
    y, x = np.mgrid[:height, :width]
    nearest = np.zeros((height, width), int)
    np.maximum.at(nearest, (y, np.maximum(x - d, 0)), d)
    seen = (d > 0) & (d < DISPARITIES) & (x - d >= MARGIN) & (x < width - MARGIN) & (y >= MARGIN) & (y < height - MARGIN)
    seen &= nearest[y, np.maximum(x - d, 0)] == d
    known = np.where(truth > 0, truth, np.nan)
    sides = [moved(known, dx, 0) for dx in (-6, 6)]
    jumps = np.fmax(np.abs(sides[0] - known), np.abs(sides[1] - known)) > 2
    chosen = []
    for where in (seen & jumps, seen):
        pixels = np.flatnonzero(where)
        chosen.append(random.choice(pixels, min(SAMPLES // 2, len(pixels)), replace=False))
    y, x = np.divmod(np.concatenate(chosen), width)
    d = d[y, x]

    every = np.arange(DISPARITIES)
    places = x[:, None] - every
    fine = [census(image, 4, 3) for image in images]
    costs = distance(fine[0][y, x][:, None], fine[1][y[:, None], np.maximum(places, 0)])
    costs[(places < MARGIN) | (np.abs(every - d[:, None]) < 2)] = 99
    wrong = list(np.argsort(costs, axis=1, kind="stable")[:, :3].T)
    wrong += [np.where(np.isnan(side[y, x]), d + 3, np.rint(np.nan_to_num(side[y, x]))).astype(int) for side in sides]
    wrong += [d - random.integers(2, 5, len(d)), d + random.integers(2, 5, len(d)), random.integers(0, DISPARITIES, len(d))]
    wrong = [np.where(np.abs(w - d) < 2, d + 2, w) for w in wrong]
    matches = x - np.stack([d] + wrong)
    kept = ((matches >= MARGIN) & (matches < width - MARGIN)).all(0)
    y, x, matches = y[kept], x[kept], matches[:, kept]

    coarse = [census(image, 2, 2) for image in images]
    sums = [cv2.boxFilter(image, cv2.CV_32F, (3, 3), normalize=False).astype(np.int16) for image in images]
    window = range(-RADIUS, RADIUS + 1)
    around = [np.stack([view[rows + dy, columns + dx] for dy in window for dx in window]) for view, rows, columns in ((sums[0], y, x), (sums[1], y + 0 * matches, matches))]
    return distance(coarse[0][y, x], coarse[1][y + 0 * matches, matches]), *around


class Learner:
    """Distances of all samples' matches as the table grows."""

    def __init__(self, distances, left, right):
        self.left, self.right = left, right
        true, wrong = distances[0], distances[1:]
        self.weights = np.exp(-STEEPNESS * (wrong - true)).astype(np.float32)

    def differing(self, first, second, threshold):
        """Which matches' bits differ from the pixel's, the true match first."""
        threshold = np.int16(threshold)
        return (self.left[first] < self.left[second] + threshold) ^ (self.right[first] < self.right[second] + threshold)

    def weights_with(self, comparison):
        bits = self.differing(*comparison)
        of_wrong = self.weights - np.float32(1 - np.exp(-STEEPNESS)) * (self.weights * bits[1:])
        return of_wrong * np.where(bits[0], np.float32(np.exp(STEEPNESS)), np.float32(1))

    def loss(self, weights):
        return float(np.log1p(weights.sum(0)).mean(dtype=np.float64))

    def table(self, candidates):
        """The comparisons one after the other. What one is worth hardly grows as others come: only the best are asked anew."""
        queue = [(self.loss(self.weights_with(c)), 0, i) for i, c in enumerate(candidates)]
        queue = [(loss - self.loss(self.weights), age, i) for loss, age, i in queue]
        heapq.heapify(queue)
        for step in range(BITS):
            while True:
                gain, age, i = heapq.heappop(queue)
                if age == step:
                    break
                heapq.heappush(queue, (self.loss(self.weights_with(candidates[i])) - self.loss(self.weights), step, i))
            self.weights = self.weights_with(candidates[i])
            yield candidates[i], self.loss(self.weights)


def place(index):
    return index % (2 * RADIUS + 1) - RADIUS, index // (2 * RADIUS + 1) - RADIUS


def learn(folders, seed):
    random = np.random.default_rng(seed)
    parts = []
    for folder in folders:
        for *images, truth in frames_of(folder):
            parts += [samples_of(random, images, truth), samples_of(random, list(disturbed(random, images)), truth)]
    learner = Learner(*(np.concatenate(part, axis=-1) for part in zip(*parts)))
    print(f"{learner.left.shape[1]} samples of {len(folders)} videos, loss {learner.loss(learner.weights):.4f}", file=sys.stderr)
    places = (2 * RADIUS + 1) ** 2
    candidates = set()
    while len(candidates) < CANDIDATES:
        first, second = random.choice(places, 2, replace=False)
        candidates.add((int(first), int(second), int(random.choice(THRESHOLDS))))
    rows = []
    for (first, second, threshold), loss in learner.table(sorted(candidates)):
        rows.append((*place(first), *place(second), threshold))
        print(len(rows), rows[-1], f"loss {loss:.4f}", file=sys.stderr)
    return rows


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folders", metavar="FOLDER", nargs="*", type=pathlib.Path)
    parser.add_argument("--data", metavar="DIR", type=pathlib.Path, default=os.environ.get("EGOSGM_DATA") or PROJECT / "../shared/data")
    parser.add_argument("--egosgm", metavar="FILE", type=pathlib.Path, default=PROJECT / "build/apps/egosgm")
    parser.add_argument("--seed", type=int, default=1)
    chosen = parser.parse_args()
    with tempfile.TemporaryDirectory(prefix="learn-census-") as name:
        folders = chosen.folders
        if not folders:
            folders = [pathlib.Path(chosen.data) / folder for folder in OWN]
            for i, arguments in enumerate(STREETS):
                folders.append(pathlib.Path(name) / f"street{i}")
                subprocess.run([chosen.egosgm, "synth", "--quiet", "--frames", "8", "--out", folders[-1], *arguments], check=True)
        rows = learn(folders, chosen.seed)
    print(",\n".join(f"    {{{', '.join(map(str, row))}}}" for row in rows))


if __name__ == "__main__":
    main()

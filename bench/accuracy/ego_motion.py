# SPDX-License-Identifier: Apache-2.0
"""The table of stereo odometry alone."""
import json
import re
import shutil
import statistics

from inputs import SINGLE_FRAME, Input, Missing, expect
from tables import Table


# Poses as rows of 3x4 matrices, without a fourth row.
def read_poses(path):
    rows = [[float(value) for value in line.split()] for line in path.read_text().splitlines() if line.strip()]
    return [[row[0:4], row[4:8], row[8:12]] for row in rows]


def write_poses(path, poses):
    path.write_text("".join(" ".join(f"{value:.17g}" for row in pose for value in row) + "\n" for pose in poses))


def product(a, b):
    return [[sum(a[i][k] * b[k][j] for k in range(3)) + (a[i][3] if j == 3 else 0) for j in range(4)] for i in range(3)]


def inverse(a):
    turned = [[a[j][i] for j in range(3)] for i in range(3)]
    return [row + [-sum(row[k] * a[k][3] for k in range(3))] for row in turned]


IDENTITY = [[1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]]


def scaled(motion, factor):
    return [row[:3] + [factor * row[3]] for row in motion]


# What could take the place of odometry's motions (current from previous), from frame to frame.
OTHER_MOTIONS = [
    ("2 % more translation", lambda motions: [scaled(motion, 1.02) for motion in motions]),
    ("2 % less translation", lambda motions: [scaled(motion, 0.98) for motion in motions]),
    ("its translation, no rotation", lambda motions: [[one[:3] + [row[3]] for one, row in zip(IDENTITY, motion)] for motion in motions]),
    ("the last motion", lambda motions: motions[:1] + motions[:-1]),
    ("no motion at all", lambda motions: [IDENTITY for _ in motions]),
]


def with_motions(bench, source, name, motions):
    """The same input with motions of its own."""
    poses = [IDENTITY]
    for motion in motions:
        poses.append(product(poses[-1], inverse(motion)))
    path = bench.work / f"poses_{re.sub(r'[^a-z0-9]+', '_', name)}.txt"
    write_poses(path, poses)
    return Input(f"{source.title}, {name}", source.run_arguments + ("--poses", str(path)), source.left, source.right, source.truth,
                 source.scored)


def worth_of_motion(bench, table):
    source = bench.multiview(2012, "000151", "7:10")
    estimated = bench.work / "poses_000151.txt"
    bench.egosgm("odometry", *source.run_arguments, "--out", estimated, "--quiet")
    poses = read_poses(estimated)
    motions = [product(inverse(current), previous) for previous, current in zip(poses, poses[1:])]
    others = [with_motions(bench, source, name, change(motions)) for name, change in OTHER_MOTIONS]
    alone = with_motions(bench, source, "odometry, covariance zero", motions)
    frames = {other.title: bench.run(other)["frames"][source.scored] for other in (alone, *others)}
    own, single = (bench.run(source, a)["frames"][source.scored] for a in ((), SINGLE_FRAME))
    best = min(frames[other.title]["bad_or_missing"] for other in others)
    table.add(source.title + ", odometry", "bad_or_missing", own["bad_or_missing"], at_most=best, single=single["bad_or_missing"])
    table.add(source.title + ", odometry", "search", own["search"])
    for title, frame in frames.items():
        table.add(title, "bad_or_missing", frame["bad_or_missing"], single=single["bad_or_missing"])
        table.add(title, "search", frame["search"])


def ego_motion_a(bench, table):
    folder = expect(bench.data / "odometry/sequences/A")
    poses = bench.work / "poses_a.txt"
    bench.egosgm("odometry", folder, "--out", poses, "--quiet")
    result = bench.evaluate_poses(poses, folder / "poses.txt", "--plot", bench.work / "path_a.svg", "--plot", bench.work / "path_a.png")
    name = f"odometry A, {result['frames']} frames, {result['path_length_m']:.1f} m"
    table.add(name, "end drift", result["end_drift_percent"], limit="ego-motion, A, drift")
    table.add(name, "mean error a frame [cm]", 100 * result["translation_mean_m"], "", limit="ego-motion, A, cm")
    table.add(name, "mean error a frame [deg]", result["rotation_mean_deg"], "", limit="ego-motion, A, deg")
    table.add(name, "segments of 5 to 50 m", result["segment_translation_percent"])
    # The truth turns by one constant rotation up to here: it was interpolated, and the images say otherwise.
    later = [motion["rotation_deg"] for motion in result["motions"][11:]]
    table.add(name, "mean error a frame from frame 12 on [deg]", statistics.mean(later), "")


def ego_motion_synthetic(bench, table, size):
    width, height = size
    folder, poses = bench.work / f"ego_motion_{width}x{height}", bench.work / f"poses_{width}x{height}.txt"
    shutil.rmtree(folder, ignore_errors=True)  # one of an earlier run of this bench
    bench.egosgm("synth", "--out", folder, "--frames", 100, "--width", width, "--height", height, "--quiet")
    bench.egosgm("odometry", folder, "--out", poses, "--quiet")
    result = bench.evaluate_poses(poses, folder / "poses.txt")
    name = f"synthetic, {width}x{height}, 100 frames with turns"
    table.add(name, "end drift", result["end_drift_percent"], limit="ego-motion, synthetic, drift")
    table.add(name, "mean error a frame [cm]", 100 * result["translation_mean_m"], "")
    table.add(name, "mean error a frame [deg]", result["rotation_mean_deg"], "")


def ego_motion_time(bench, table):
    if not bench.odometry:
        raise Missing("no program egosgm_odometry: build with EGOSGM_BENCH=ON")
    measured = bench.work / "odometry.json"
    bench.odometry("--rounds=5", f"--json={measured}")
    row = json.loads(measured.read_text())["rows"][0]
    name = f"time a frame, {row['width']}x{row['height']}, one thread"
    table.add(name, "all [ms]", row["median_ms"], "", limit="ego-motion, ms")
    for step in ("features", "rough_motion", "matching", "motion", "learning"):
        table.add(name, f"{step} [ms]", row[f"{step}_ms"], "")


def ego_motion_table(bench, arguments):
    table = Table(arguments.only)
    table.fill("odometry A", lambda: ego_motion_a(bench, table))
    for size in ((640, 240), (1226, 370)):
        table.fill("synthetic", lambda: ego_motion_synthetic(bench, table, size))
    if not arguments.no_speed:
        table.fill("time", lambda: ego_motion_time(bench, table))
    table.fill("2012 / 000151", lambda: worth_of_motion(bench, table))
    return table

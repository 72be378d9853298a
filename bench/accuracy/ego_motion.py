# SPDX-License-Identifier: Apache-2.0
"""The table of stereo odometry alone."""
import json
import re
import shutil
import statistics

from inputs import SINGLE_FRAME, Input, Missing, expect
from tables import Table


def other_motions(np, motions):
    """What could take the place of odometry's motions (current from previous), from frame to frame, by name."""
    def with_translation(motion, factor, rotation):
        changed = np.eye(4)
        changed[:3, :3], changed[:3, 3] = rotation, factor * motion[:3, 3]
        return changed
    return {"2 % more translation": [with_translation(motion, 1.02, motion[:3, :3]) for motion in motions],
            "2 % less translation": [with_translation(motion, 0.98, motion[:3, :3]) for motion in motions],
            "its translation, no rotation": [with_translation(motion, 1, np.eye(3)) for motion in motions],
            "the last motion": motions[:1] + motions[:-1],
            "no motion at all": [np.eye(4) for _ in motions]}


def with_motions(bench, source, name, motions):
    """The same input with motions of its own."""
    figures = bench.video_figures()
    poses = [figures.np.eye(4)]
    for motion in motions:
        poses.append(poses[-1] @ figures.np.linalg.inv(motion))
    path = bench.work / f"poses_{re.sub(r'[^a-z0-9]+', '_', name)}.txt"
    figures.egosgm.write_poses(path, figures.np.stack(poses))
    return Input(f"{source.title}, {name}", source.run_arguments + ("--poses", str(path)), source.truth, source.scored)


def worth_of_motion(bench, table):
    source = bench.multiview(2012, "000151", "7:10")
    estimated = bench.work / "poses_000151.txt"
    bench.egosgm("odometry", *source.run_arguments, "--out", estimated, "--quiet")
    figures = bench.video_figures()
    poses = figures.egosgm.read_poses(estimated)
    motions = [figures.np.linalg.inv(current) @ previous for previous, current in zip(poses, poses[1:])]
    others = [with_motions(bench, source, name, changed) for name, changed in other_motions(figures.np, motions).items()]
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

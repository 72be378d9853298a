# SPDX-License-Identifier: Apache-2.0
"""The rows of the main table."""
import json
import pathlib
import statistics

from inputs import PAPER, SINGLE_FRAME, STEADY_FROM, Missing, expect, scored_frames
from tables import Table

CERTAIN_VARIANCE_PX2 = 6.0  # as --write interpolated_certain


def kitti2012(bench, table):
    source = bench.multiview(2012, "000151", "7:10")
    name = source.title

    def method():
        frame, alone = bench.run(source)["frames"][10], bench.run(source, SINGLE_FRAME)["frames"][10]
        table.add(name, "search", frame["search"], limit="kitti2012 search")
        table.add(name, "bad_or_missing", frame["bad_or_missing"], limit="kitti2012 bad_or_missing", single=alone["bad_or_missing"])
        table.add(name, "interpolated", frame["interpolated"], limit="kitti2012 interpolated", single=alone["interpolated"])
        table.add(name, "density", frame["density"])

    def single():
        frame = bench.run(source, SINGLE_FRAME)["frames"][10]
        table.add(name + ", single frame", "bad_or_missing", frame["bad_or_missing"], limit="kitti2012 single frame bad_or_missing")
        table.add(name + ", single frame", "interpolated", frame["interpolated"], limit="kitti2012 single frame interpolated")

    def paper():
        frame = bench.run(source, PAPER)["frames"][10]
        own = bench.run(source, PAPER + SINGLE_FRAME)["frames"][10]
        table.add(name + ", paper", "search", frame["search"], limit="paper, search")
        table.add(name + ", paper", "bad_or_missing", frame["bad_or_missing"], single=own["bad_or_missing"])
        table.add(name + ", paper", "bad_or_missing / its single frame's", frame["bad_or_missing"] / own["bad_or_missing"], "", limit="paper, bad or missing")
        default = bench.run(source, SINGLE_FRAME)["frames"][10]
        table.add(name + ", paper", "bad_or_missing / default single frame's", frame["bad_or_missing"] / default["bad_or_missing"], "")

    for measure in (method, single, paper):
        table.fill(name, measure)


def odometry_a(bench, table):
    source = bench.odometry_a()
    result = bench.run(source)
    numbers = sorted(result["frames"])
    search = [result["frames"][number]["search"] for number in numbers[STEADY_FROM:]]
    density = [result["frames"][number]["density"] for number in numbers]
    name = f"{source.title}, {len(numbers)} frames"
    table.add(name, "search, worst frame from 3 on", max(search), limit="odometry search, worst frame")
    table.add(name, "search, mean from 3 on", statistics.mean(search), limit="odometry search")
    table.add(name, "density, worst frame", min(density), limit="odometry density, worst frame")
    table.add(name, "density, mean", statistics.mean(density), limit="odometry density")
    table.add(name, "end drift", result["drift"], limit="odometry drift")


def pair_of_frames(bench, table, year, scene):
    source = bench.multiview(year, scene, "10:11")
    suffix = "d1" if year == 2015 else "bad_or_missing"
    filled = "d1_interpolated" if year == 2015 else "interpolated"
    single = bench.run(source, SINGLE_FRAME)["frames"][10]
    table.add(source.title + ", single frame", filled, single[filled], limit=f"{year} / {scene}, single frame")
    result = bench.run(source)
    for figure in ("bad_or_missing", "interpolated", "d1", "d1_interpolated", "density"):
        table.add(source.title, f"{figure}, frame 10", result["frames"][10][figure], single=single[figure])
    for figure in ("search", "density"):
        table.add(source.title, f"{figure}, frame 11", result["frames"][11][figure])
    back = bench.backwards(year, scene)
    result = bench.run(back)["frames"][back.scored]
    for figure in ("search", suffix, filled):
        table.add(back.title, f"{figure}, frame 10", result[figure], single=None if figure == "search" else single[figure])


def scored(source, result):
    return [result["frames"][number] for number in scored_frames(source, result)]


def pooled(frames, figure):
    """Over all pixels that have truth."""
    return sum(frame[figure] * frame["truth_pixels"] for frame in frames) / sum(frame["truth_pixels"] for frame in frames)


def synthetic(bench, table):
    for true_poses, moving, seed in ((True, False, 1), (True, False, 2), (True, False, 3), (False, False, 1), (False, True, 1)):
        source = bench.synthetic(true_poses, moving, seed=seed)
        frames, alone = (scored(source, bench.run(source, a)) for a in ((), SINGLE_FRAME))
        limit = "synthetic, true poses" if true_poses and not moving else None
        for figure in ("bad_or_missing", "interpolated", "bad_of_valid", "mae"):
            table.add(source.title, f"{figure}, pixels from frame 3 on", pooled(frames, figure), "px" if figure == "mae" else "%",
                      limit=limit if figure == "bad_or_missing" else None, single=pooled(alone, figure))
        table.add(source.title, "bad_or_missing, worst frame from 3 on", max(f["bad_or_missing"] for f in frames),
                  single=max(f["bad_or_missing"] for f in alone))
        table.add(source.title, "search, mean from 3 on", statistics.mean(frame["search"] for frame in frames))


def moving_objects(bench, table):
    for seed in (1, 2, 3):
        source = bench.synthetic(True, True, frames=14, seed=seed)
        masks = source.truth.parent / "left_moving"

        def of_vehicles(arguments):
            pairs = bench.evaluate(bench.folder_of(source, arguments), source.truth, masks)["pairs"][STEADY_FROM:]
            return pooled([pair for pair in pairs if pair["truth_pixels"]], "bad_or_missing")
        table.add(source.title, "bad_or_missing of the vehicles", of_vehicles(()), limit="moving objects", single=of_vehicles(SINGLE_FRAME))


def flicker(bench, table):
    figures = bench.video_figures()
    videos = [(f"synthetic, seed {seed}", figures.Street(bench.synthetic_folder(seed=seed))) for seed in (1, 2, 3)]
    recorded = figures.egosgm.open_folder(expect(bench.data / "odometry/sequences/A"))
    for title, video in (*videos, ("odometry A", figures.Recorded(recorded))):
        own = figures.flicker(video, STEADY_FROM + 1)
        single = figures.flicker(video, STEADY_FROM + 1, **figures.SINGLE_FRAME)
        table.add(title, "flicker: mean |d_k - warped d_k-1| [px]", own, "")
        table.add(title, "flicker / single frame's", own / single, "", limit="flicker")


def recovery(bench, table):
    """A gap in time, or a motion that is wrong by a degree: the frames after."""
    figures = bench.video_figures()
    for seed in (1, 2, 3):
        errors = figures.recovery(figures.Street(bench.synthetic_folder(seed=seed)), at=9)
        for name in figures.DISTURBANCES:
            title = f"synthetic, seed {seed}, {name}"
            table.add(title, "bad_or_missing, that frame", errors[name][0], single=errors["single frame"][0])
            table.add(title, "on the frame after / single frame's", errors[name][1] / errors["single frame"][1], "", limit="recovery, the frame after")
            table.add(title, "two frames after / undisturbed", errors[name][2] / errors["undisturbed"][2], "", limit="recovery, two frames after")
    video = bench.scene(2012, "000151", (7, 8, 9, 10))
    truth = video.truth(10)

    def error(**run):
        return [figures.share([figures.bad_or_missing(frame.disparity, truth)]) for k, frame in figures.play(video, **run) if k == 10][0]
    single = error(**figures.SINGLE_FRAME)
    for axis, name in ((1, "yaw"), (0, "pitch")):
        for at, when in ((10, "that frame"), (9, "the frame after")):
            table.add(f"2012 / 000151, {name} wrong by 1 degree", f"bad_or_missing, {when}", error(wrong={at: figures.turned(axis, 1)}),
                      limit="recovery, KITTI", single=single)


def long_run(bench, table):
    """Half a thousand frames, there and back, so that the world is the same early and late: does the filter age?"""
    figures = bench.video_figures()
    last, early, late = 195, slice(10, 110), slice(400, 500)
    folder = bench.street("synthetic_long", "--frames", last + 1, "--width", 320, "--height", 120)
    video, options, restart = figures.Street(folder), {"disparities": 64}, 396
    numbers = figures.there_and_back(500, last)
    through, fresh, resets = figures.long_run(video, numbers, restart, **options)
    single, _, _ = figures.long_run(video, numbers, restart, **options, **figures.SINGLE_FRAME)
    title = "synthetic, 500 frames of 320x120"
    for when, frames in (("10-109", early), ("400-499", late)):
        table.add(title, f"bad_or_missing, frames {when}", statistics.mean(through[frames]), single=statistics.mean(single[frames]))
    late_mean = statistics.mean(through[late])
    table.add(title, "frames 400-499 / 10-109, the same images", late_mean / statistics.mean(through[early]), "", limit="long run, late / early")
    table.add(title, f"frames 400-499 / those of a run from {restart}", late_mean / statistics.mean(fresh[late.start - restart:]), "", limit="long run, late / fresh")
    table.add(title, "resets", resets, "", limit="long run, resets")


def uncovered(bench, table):
    figures = bench.video_figures()
    for seed in (1, 2, 3):
        video = figures.Street(bench.synthetic_folder(moving=True, frames=14, seed=seed))
        title = f"synthetic, moving objects, seed {seed}"
        own, single = figures.uncovered(video, STEADY_FROM), figures.uncovered(video, STEADY_FROM, **figures.SINGLE_FRAME)
        for age, when in ((0, "just now"), (1, "a frame ago"), (2, "two frames ago")):
            table.add(title, f"bad_or_missing, uncovered {when}", own[age], limit="uncovered" if age == 2 else None, single=single[age])
        found, right = figures.dynamic_map(video, STEADY_FROM)
        table.add(title, "of the vehicles' pixels, marked dynamic", found)
        table.add(title, "of the pixels marked, within 8 px of one", right)


def poles(bench, table):
    figures = bench.video_figures()
    for width in (2, 3, 4):
        folder = bench.street(f"synthetic_poles_{width}", "--frames", 12, "--pole-width", width, "--pole-spacing", 3)
        video = figures.Street(folder)
        own, pixels = figures.of_thin_things(video, STEADY_FROM)
        single, _ = figures.of_thin_things(video, STEADY_FROM, **figures.SINGLE_FRAME)
        title = f"synthetic, poles of {width} px"
        table.add(title, f"bad_or_missing of {pixels} thin pixels", own, limit="poles", single=single)


def uncertainty(bench, table):
    """What the variances are worth."""
    figures = bench.video_figures()

    def add(title, pairs, limit):
        worth = figures.calibration_of_variance(pairs)
        table.add(title, "error^2 / variance, errors cut at 3 px", worth["ratio"], "", limit=limit)
        table.add(title, "the same by tenths, largest / smallest", worth["flatness"], "")
        table.add(title, "error^2 / variance of what is not bad", worth["ratio_not_bad"], "")
        table.add(title, "of the bad, in the worst 10 % by variance", worth["removed"], limit="uncertainty, removed" if limit else None, goal=50)
    streets = [figures.Street(bench.synthetic_folder(seed=seed)) for seed in (1, 2, 3)]
    add("synthetic, seeds 1, 2, 3", [pair for street in streets for pair in figures.errors_and_variances(street, range(STEADY_FROM, 20))],
        "uncertainty, ratio")
    for year, scene, numbers in ((2012, "000151", (7, 8, 9, 10)), (2012, "000138", (11, 10)), (2015, "000002", (11, 10))):
        video = bench.scene(year, scene, numbers)
        pairs, alone = (figures.errors_and_variances(video, [10], **options) for options in ({}, figures.SINGLE_FRAME))
        add(f"{year} / {scene}", pairs, None)
        table.add(f"{year} / {scene}", "median error", figures.median_error(pairs), "px")
        table.add(f"{year} / {scene}, single frame", "error^2 / variance, errors cut at 3 px", figures.calibration_of_variance(alone)["ratio"], "")
        every, certain = figures.interpolated(video, 10, [float("inf"), CERTAIN_VARIANCE_PX2])
        every_alone = figures.interpolated(video, 10, [float("inf")], **figures.SINGLE_FRAME)[0]
        table.add(f"{year} / {scene}", "bad after interpolation", every, single=every_alone)
        table.add(f"{year} / {scene}", f"the same, variances above {CERTAIN_VARIANCE_PX2} px^2 left out before", certain, goal=every)


def speed(bench, table, compare_json):
    if compare_json is None:
        if not bench.compare:
            raise Missing("no program egosgm_compare: build with EGOSGM_BENCH=ON, or give --compare-json FILE")
        compare_json = bench.work / "compare.json"
        bench.compare("--size=1242x375", "--disparities=128", "--rounds=11", f"--json={compare_json}")
    compared = json.loads(pathlib.Path(compare_json).read_text())
    ms = {row["name"]: row["median_ms"] for row in compared["rows"]
          if (row["width"], row["height"], row["disparities"]) == (1242, 375, 128)}
    name = f"speed, 1242x375, D = 128, up to {compared['threads']} threads"
    for ours, theirs in (("full_left", "hh"), ("full_both", "hh"), ("banded_frame", "hh"), ("banded_frame", "3way"), ("video_frame", "hh")):
        limit = f"speed, {ours} / {theirs}"
        for suffix, threads in (("", name), ("_1t", "speed, 1242x375, D = 128, one thread")):
            pair = f"egosgm_{ours}{suffix}", f"opencv_{theirs}{suffix}"
            if all(one in ms for one in pair):
                table.add(threads, " / ".join(pair), ms[pair[0]] / ms[pair[1]], "", limit=limit)


def main_table(bench, arguments):
    table = Table(arguments.only)
    table.fill("2012 / 000151", lambda: kitti2012(bench, table))
    table.fill("odometry A", lambda: odometry_a(bench, table))
    table.fill("2012 / 000138", lambda: pair_of_frames(bench, table, 2012, "000138"))
    table.fill("2015 / 000002", lambda: pair_of_frames(bench, table, 2015, "000002"))
    table.fill("synthetic", lambda: synthetic(bench, table))
    table.fill("moving objects", lambda: moving_objects(bench, table))
    if not arguments.no_maps:
        table.fill("uncovered pixels", lambda: uncovered(bench, table))
        table.fill("poles", lambda: poles(bench, table))
        table.fill("flicker", lambda: flicker(bench, table))
        table.fill("wrong motion", lambda: recovery(bench, table))
        table.fill("500 frames", lambda: long_run(bench, table))
        table.fill("uncertainty", lambda: uncertainty(bench, table))
    if not arguments.no_speed:
        table.fill("speed", lambda: speed(bench, table, arguments.compare_json))
    return table

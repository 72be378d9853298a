# SPDX-License-Identifier: Apache-2.0
"""Every addition on and off, and the paper's own table."""
import pathlib
import re

from inputs import PAPER, SINGLE_FRAME, Failed, Missing, mean_figures, settings

OPENCV_MODES = ("opencv_hh", "opencv_hh4", "opencv_3way")

# What is switched, and why it is there.
ABLATION = [
    ("default", (), "The method with everything on."),
    ("single frame", SINGLE_FRAME, "What the same matcher gives without the frames before: the whole range, every time."),
    ("paper", PAPER, "The choices of the paper: unpredicted pixels search everything, three sigma with no least half-width, constant q."),
    ("paper, single frame", PAPER + SINGLE_FRAME, "The paper's own baseline: its matcher alone."),
    ("temporal, full range", settings("constants.search=full"), "Fusion without the band: what the narrow search costs or gains."),
    ("no band from neighbours", settings("constants.search_band.from_neighbours=false"),
     "A pixel without a prediction then searches everything, not the range that its neighbours span."),
    ("no least half-width", settings("min_half_width_px=0"),
     "The least half-width is for motion errors that three sigma of a confident pixel would not cover."),
    ("no gate", settings("gate_px=0"), "Prediction and measurement are then averaged even where they contradict each other, as on moving objects."),
    ("neighbours not asked", settings("constants.kalman_update.ask_neighbours=false"),
     "The measurement then counts wherever it contradicts the prediction, though all around speaks against it, and what moves by itself is averaged "
     "with where it was."),
    ("no prediction kept", settings("keep_predicted=false"),
     "What is not measured in this frame is forgotten: holes stay holes."),
    ("no edge rejection", settings("constants.edge_rejection.max_jump_px=0"),
     "Predictions beside a jump may lie on the wrong surface, and a narrow search cannot get back."),
    ("no hole fill", settings("constants.hole_fill.max_difference_px=0"), "Gaps that forward motion tears open stay unpredicted."),
    ("motion's covariance unused", settings("constants.forward_warp.motion_noise=0"), "Then the constant q alone stands for the motion's error."),
    ("process noise x 4", settings("process_noise_px2=0.04"), "More trust in the measurement, wider bands."),
    ("left-right within 1 px", settings("left_right_px=1", "constants.consistency.read_off_px=1"),
     "The paper's strict check: it drops slanted surfaces with the errors."),
    ("both views tracked", settings("track_right=true"),
     "The right view is then predicted, searched and filtered as the left one is, instead of following from it, which takes longer."),
    ("no vertical alignment", settings("vertical_alignment=false"),
     "Half a pixel between the rows of the views costs matches; the estimate takes it out."),
    ("no coarse match", settings("coarse_match=false"),
     "What moves by itself, or lies where a wrong motion does not point, is then outside of the band."),
    ("no ridges", settings("thin_objects=false"),
     "Poles that were lost hide behind their background's narrow bands: less is searched, and more of them lost."),
    ("no median", settings("constants.median_filter.enabled=false"), "Single outliers survive to the left-right check."),
    ("no speckle removal", settings("max_speckle_px=0"), "Small wrong regions agree in both views by chance."),
    ("with SAD check", settings("constants.sad_check.max_difference=20"), "The paper's check of the grey values; off by default."),
    ("four paths", ("--paths", "4"), "Half the aggregation, in about half the time."),
    ("census 9x7", settings("cost=census9x7"), "All 62 comparisons of the usual window: twice the code bytes."),
    ("census 5x5", settings("cost=census5x5"), "A smaller window: cheaper codes that tell less."),
    ("SAD 3x3", settings("cost=sad3x3"), "The cost that the paper may have used; brightness differences between the cameras spoil it."),
    ("P2 = 80", settings("p2=80"), "Half the penalty of a jump."),
]
# Least half-widths for the plot of error against search fraction.
HALF_WIDTHS_PX = (0.5, 1, 2, 4, 8, 16, 32)


def ablation_inputs(bench, pattern):
    openers = [lambda: bench.multiview(2012, "000151", "7:10"), lambda: bench.backwards(2012, "000138"),
               lambda: bench.backwards(2015, "000002"), bench.odometry_a]
    openers += [lambda p=p, m=m: bench.synthetic(p, m) for p in (True, False) for m in (False, True)]
    inputs = []
    for opener in openers:
        try:
            source = opener()
        except Missing as reason:
            print(f"skipped: {reason}")
            continue
        if re.search(pattern, source.title):
            inputs.append(source)
    return inputs


def ablation(bench, inputs):
    rows = []
    configurations = [(name, why, lambda source, a=a: bench.run(source, a)) for name, a, why in ABLATION]
    configurations += [(mode, "OpenCV's StereoSGBM, left view, padded on the left by D.", lambda source, m=mode: bench.run_opencv(source, m))
                       for mode in OPENCV_MODES]
    for name, why, run in configurations:
        row = {"name": name, "why": why, "inputs": {}}
        for source in inputs:
            if name.startswith("opencv") and not source.truth:
                continue
            try:
                result = run(source)
                row["inputs"][source.title] = {**mean_figures(source, result), "drift": result["drift"]}
            except (Missing, Failed) as reason:
                row["inputs"][source.title] = {"skipped": str(reason)}
        rows.append(row)
        print_ablation_row(row)
    return rows


def print_ablation_row(row):
    print(f"\n{row['name']}: {row['why']}")
    for title, figures in row["inputs"].items():
        if "skipped" in figures:
            print(f"  {title:<40} {figures['skipped']}")
            continue
        print(f"  {title:<40} " + "  ".join(f"{name} {figures[name]:.2f}" for name in ("bad_or_missing", "interpolated", "d1_interpolated",
                                                                                      "search", "density") if name in figures))


def curves(bench, inputs):
    """What plot.py draws: error against search fraction, and error over frames."""
    against_search = []
    for source in inputs:
        if not source.truth:
            continue
        for half_width in HALF_WIDTHS_PX:
            figures = mean_figures(source, bench.run(source, settings(f"min_half_width_px={half_width}")))
            against_search.append({"input": source.title, "half_width_px": half_width, **figures})
    over_frames = []
    for source in inputs:
        if not source.title.startswith("synthetic"):
            continue
        for name, a in (("default", ()), ("single frame", SINGLE_FRAME), ("paper", PAPER)):
            frames = bench.run(source, a)["frames"]
            over_frames.append({"input": source.title, "name": name, "frames": sorted(frames),
                                "bad_or_missing": [frames[number].get("bad_or_missing") for number in sorted(frames)]})
    return {"error_against_search": against_search, "error_over_frames": over_frames}


def scenes_of(text):
    return [f"{int(scene):06d}" for scene in text.split(",")]


def paper_table(bench, arguments):
    """The paper's own table: single frame, this method, this method interpolated, search fraction."""
    folder = pathlib.Path(arguments.kitti2015)
    folder = folder / "training" if (folder / "training").is_dir() else folder
    rows = []
    print(f"{'scene':<8} {'preset':<8} {'search':>8} {'single frame':>14} {'method':>10} {'interpolated':>14} {'D1':>8} {'D1 interp.':>12}")
    for scene in scenes_of(arguments.scenes):
        for preset in ("paper", "default"):
            try:
                source = bench.multiview(2015, scene, arguments.frames, folder)
                single = bench.run(source, ("--preset", preset, *SINGLE_FRAME))["frames"][source.scored]
                method = bench.run(source, ("--preset", preset))["frames"][source.scored]
            except (Missing, Failed) as reason:
                rows.append({"scene": scene, "preset": preset, "skipped": str(reason)})
                print(f"{scene:<8} {preset:<8} skipped: {reason}")
                continue
            rows.append({"scene": scene, "preset": preset, "single_frame": single, "method": method})
            print(f"{scene:<8} {preset:<8} {method['search']:>6.1f} % {single['bad_or_missing']:>12.2f} % {method['bad_or_missing']:>8.2f} % "
                  f"{method['interpolated']:>12.2f} % {method['d1']:>6.2f} % {method['d1_interpolated']:>10.2f} %")
    return rows

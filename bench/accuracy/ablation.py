# SPDX-License-Identifier: Apache-2.0
"""Every correction on and off, on four kinds of input apart, with bootstrap intervals."""
import re

from inputs import STEADY_FROM, Failed, expect, told

# What is switched, and why it is there.
ABLATION = [
    ("default", {}, "The method with everything on."),
    ("single frame", {"temporal": False}, "What the same matcher gives without the frames before."),
    ("left view tracked", {"track_right": False}, "The right view is matched by the left one's path sums, neither predicted nor filtered."),
    ("full range", {"constants.search": "full"}, "Fusion without the band: what the narrow search costs or gains."),
    ("half-width 4", {"min_half_width_px": 4}, "A wider least band."),
    ("eight paths", {"paths": 8}, "Twice the aggregation."),
    ("census 5x5", {"cost": "census5x5"}, "A smaller window."),
    ("no band from neighbours", {"constants.search_band.from_neighbours": False}, "A pixel without a prediction then searches everything."),
    ("no gate", {"gate_px": 0}, "Prediction and measurement are averaged even where they contradict each other."),
    ("neighbours not asked", {"constants.kalman_update.ask_neighbours": False}, "Nothing around a pixel moves its prediction."),
    ("no prediction kept", {"keep_predicted": False}, "What is not measured in this frame is forgotten."),
    ("edge rejection", {"constants.edge_rejection.max_jump_px": 5}, "Predictions beside a jump go (the paper's)."),
    ("predictions of both views compared", {"constants.consistency.checks_prediction": True}, "A prediction goes where the other view's says something else (the paper's)."),
    ("no hole fill", {"constants.hole_fill.max_difference_px": 0}, "Gaps that forward motion tears open stay unpredicted (the paper's)."),
    ("motion's covariance unused", {"constants.forward_warp.motion_noise": 0}, "The constant q alone stands for the motion's error."),
    ("no vertical alignment", {"vertical_alignment": False}, "The rows of the views are off by what rectification leaves."),
    ("no coarse match", {"coarse_match": False}, "What moves by itself, or lies where a wrong motion does not point, is outside of the band."),
    ("no median", {"constants.median_filter.enabled": False}, "Single outliers survive to the left-right check."),
    ("no speckle removal", {"max_speckle_px": 0}, "Small wrong regions agree in both views by chance."),
]
FIGURES = ("bad_or_missing", "bad_of_valid", "interpolated")
BLOCK_PX, ROUNDS = 64, 1000
DARKER = 0.6  # the grey values after an exposure step


class Case:
    """A video, how it is played and the frames that count."""

    def __init__(self, kind, title, video, numbers, scored, **disturbance):
        self.kind, self.title, self.video, self.numbers, self.scored, self.disturbance = kind, title, video, numbers, scored, disturbance


class Darkened:
    """A video whose exposure is less from frame number `at` on."""

    def __init__(self, video, at):
        self.video, self.at = video, at

    def __getattr__(self, name):
        return getattr(self.video, name)

    def images(self, k):
        images = self.video.images(k)
        return images if k < self.at else [(DARKER * image).round().astype(image.dtype) for image in images]


def cases(bench, pattern):
    """The inputs at hand whose title matches, and why others are not at hand."""
    figures = bench.video_figures()
    last = 9

    def rendered(name):
        folder = expect(bench.data / "rendered" / name)
        video = figures.Recorded(figures.egosgm.open_folder(folder))
        video.truth = figures.Street(folder).truth
        return video

    def street(seed, moving):
        return figures.Street(bench.synthetic_folder(moving, frames=14, seed=seed))
    openers = [("KITTI", f"{year} / {scene}", lambda y=year, s=scene, n=numbers: (bench.scene(y, s, n), n, [10]))
               for year, scene, numbers in ((2012, "000151", (7, 8, 9, 10)), (2012, "000138", (11, 10)), (2015, "000002", (11, 10)))]
    openers += [("rendered", name, lambda n=name: (rendered(n), range(last), range(STEADY_FROM, last))) for name in ("warehouse", "forest", "kitchen")]
    openers += [("streets", f"street {seed}{', moving' if moving else ''}",
                 lambda s=seed, m=moving: (street(s, m), range(last), range(STEADY_FROM, last)))
                for moving, seeds in ((False, range(1, 10)), (True, (1, 2, 3))) for seed in seeds]
    found, skipped = [], []

    def skip(title, reason):
        if (line := f"{title}: {told(reason)}") not in skipped:
            skipped.append(line)
            print(line)
    for kind, title, opener in openers:
        if not re.search(pattern, title):
            continue
        try:
            found.append(Case(kind, title, *opener()))
        except Exception as reason:
            skip(title, reason)
    for title, opener in [(name, lambda n=name: figures.Street(expect(bench.data / "rendered" / n))) for name in ("warehouse", "kitchen")] + \
            [(f"street {seed}{', moving' if moving else ''}", lambda s=seed, m=moving: street(s, m)) for seed, moving in ((1, False), (2, False), (1, True))]:
        if not re.search(pattern, title):
            continue
        try:
            video = opener()
        except Exception as reason:
            skip(title, reason)
            continue
        found += [Case("disturbances", f"{title}, yaw wrong by 1 degree", video, range(7), (4, 5, 6), wrong={4: figures.turned(1, 1)}),
                  Case("disturbances", f"{title}, a gap of 3 frames", video, (0, 1, 2, 6, 7, 8), (6, 7, 8)),
                  Case("disturbances", f"{title}, an exposure step", Darkened(video, 4), range(7), (4, 5, 6))]
    return found, skipped


def counts_by_block(figures, case, options):
    """Sums of a block's pixels over the scored frames, a row each: truth, valid, bad, bad or missing, bad interpolated."""
    np, egosgm = figures.np, figures.egosgm
    sums = 0
    for k, frame in figures.play(case.video, case.numbers, **case.disturbance, **options):
        if k not in case.scored:
            continue
        truth = case.video.truth(k)
        known = figures.is_valid(truth)

        def is_bad(disparity):
            return known & ~(figures.is_valid(disparity) & (np.abs(disparity - truth) <= figures.BAD_PX))
        valid, bad = known & figures.is_valid(frame.disparity), is_bad(frame.disparity)
        y, x = np.nonzero(known)
        block = y // BLOCK_PX * -(-truth.shape[1] // BLOCK_PX) + x // BLOCK_PX
        blocks = -(-truth.shape[0] // BLOCK_PX) * -(-truth.shape[1] // BLOCK_PX)
        maps = (known, valid, bad & valid, bad, is_bad(egosgm.interpolate_background(frame.disparity)))
        sums = sums + np.stack([np.bincount(block, values[y, x], blocks) for values in maps])
    return sums


def percentages(counts):
    """Of FIGURES, along the first axis."""
    truth, valid, bad_valid, bad, bad_interpolated = counts
    return [100 * bad / truth, 100 * bad_valid / valid, 100 * bad_interpolated / truth]


def ablation(bench, pattern):
    """Rows, and why inputs were skipped. A row: a configuration's figures, the mean over the inputs of a kind, and what they are above the default's, with a 95 % interval by
    drawing each input's blocks anew, the same ones for both."""
    figures = bench.video_figures()
    np, device = figures.np, figures.egosgm.devices()[0]
    bench.device = {"name": device.name, "driver": device.driver}
    inputs, skipped = cases(bench, pattern)
    kinds = list(dict.fromkeys(case.kind for case in inputs))
    random, draws, of_default, rows = np.random.default_rng(1), {}, {}, []

    def of_kind(kind, options):
        found, drawn = [], []
        for case in inputs:
            if case.kind != kind:
                continue
            counts = counts_by_block(figures, case, options)
            blocks = counts.shape[1]
            if case.title not in draws:
                draws[case.title] = random.multinomial(blocks, np.full(blocks, 1 / blocks), ROUNDS).T
            found.append(percentages(counts.sum(axis=1)))
            drawn.append(percentages(counts @ draws[case.title]))
        mean, rounds = np.mean(found, axis=0), np.mean(drawn, axis=0)
        if not options:
            of_default[kind] = mean, rounds
        if kind not in of_default:
            raise Failed("the default, which all others are compared with")
        base, base_rounds = of_default[kind]
        low, high = np.percentile(rounds - base_rounds, [2.5, 97.5], axis=1)
        return {figure: {"value": float(mean[i]), "above": float(mean[i] - base[i]), "low": float(low[i]), "high": float(high[i])}
                for i, figure in enumerate(FIGURES)}
    for name, options, why in ABLATION:
        row = {"name": name, "why": why, "kinds": {}}
        for kind in kinds:
            try:
                row["kinds"][kind] = of_kind(kind, options)
            except Exception as reason:
                row["kinds"][kind] = {"skipped": told(reason)}
                skipped.append(f"{name}, {kind}: {told(reason)}")
        rows.append(row)
        print_ablation_row(row)
    return rows if inputs else [], skipped


def print_ablation_row(row):
    """A star: the interval does not hold 0."""
    print(f"\n{row['name']}: {row['why']}")
    for kind, by_figure in row["kinds"].items():
        cells = [by_figure["skipped"]] if "skipped" in by_figure else [
            f"{figure} {at['value']:.2f} ({at['above']:+.2f}, {at['low']:+.2f} to {at['high']:+.2f}){'*' if at['low'] * at['high'] > 0 else ''}"
            for figure, at in by_figure.items()]
        print(f"  {kind:<14} " + "  ".join(cells), flush=True)

# SPDX-License-Identifier: Apache-2.0
"""EgoSGM over time beside the single frame, OpenCV, and OpenCV with the temporal filters that cameras ship, by `egosgm eval-video`; and what a wrong
motion or missing frames cost. All maps stay in the work folder, for other evaluators.

The filters are those of RealSense cameras with their defaults: where a pixel's disparity differs by less than a step of 20 from what it was, it
becomes 0.4 of the new and 0.6 of the old one; else the new one is taken. Holes stay holes. The cameras' unit is 1/32 px; a step of 20 px stands
beside it. One filter takes the same pixel, the other the pixel that the motion leads to (the nearest surface on top; the motion is EgoSGM's odometry).
"""
import functools
import json
import pathlib
import shutil

from evidence import print_table, ratios_of
from inputs import SINGLE_FRAME, STEADY_FROM, Missing, expect, measured, told

ALPHA = 0.4
OURS, SINGLE = "EgoSGM", "EgoSGM, single frame"
OPENCV = {"OpenCV HH": "HH", "OpenCV 3WAY": "SGBM_3WAY"}  # modes
# Whether along the motion, and the step [px].
FILTERS = {"OpenCV HH, averaged at the same pixel, step 20/32 px": (False, 20 / 32), "OpenCV HH, averaged along the motion, step 20/32 px": (True, 20 / 32),
           "OpenCV HH, averaged at the same pixel, step 20 px": (False, 20), "OpenCV HH, averaged along the motion, step 20 px": (True, 20)}
METHODS = (OURS, SINGLE, *OPENCV, *FILTERS)
HEADINGS = ["video", "method", "bad or missing", "bad of valid", "density", "interpolated", "mean error [px]", "TEPE, same pixel [px]", "above 1 px",
            "above 3 px", "TEPE, filled [px]", "TEPE, along the motion [px]", "flicker [px]", "TAE", "uncovered: bad or missing",
            "moving: bad or missing", "harm", "help", "bad at the single frame's density", "error² / variance", "wrong of all", "gained", "gained, right",
            "lost, right"]
FIGURES = ("tepe_dynamicstereo_px", "tepe_dynamicstereo_above_1px_percent", "tepe_dynamicstereo_above_3px_percent", "tepe_dynamicstereo_filled_px",
           "tepe_codd_px", "flicker_px", "tae_vda_percent")
NOISE = [(0, 0), (0.1, 0), (0.2, 0), (0.5, 0), (1, 0), (0, 0.01), (0, 0.02), (0, 0.05), (0, 0.1)]  # degrees, metres
DROPPED = (0, 1, 2, 3, 5, 10)
OPENCV_DISPARITIES = 128


class Video:
    """A sequence and what `egosgm run` and `egosgm eval-video` are told of it."""

    def __init__(self, title, folder, scene=None, frames=None, truth=None, first_scored=STEADY_FROM, odometry_judges=False):
        self.title, self.folder, self.scene, self.frames, self.truth = title, folder, scene, frames, truth
        self.first_scored, self.odometry_judges = first_scored, odometry_judges
        self.name = "".join(c if c.isalnum() else "_" for c in title)

    def run_arguments(self):
        if self.scene:
            return ["--kitti", self.folder, "--scene", self.scene, "--frames", self.frames]
        return ["--odometry", self.folder]

    def open(self, egosgm):
        return egosgm.open_kitti_multiview(self.folder, self.scene, self.frames) if self.scene else egosgm.open_folder(self.folder)

    def truth_of(self, frame):
        """The file, or None."""
        file = pathlib.Path(self.folder, "truth/left_disp_noc", f"{frame.name}.png")
        known = pathlib.Path(frame.truth_noc)
        return known if known.is_file() else file if file.is_file() else None

    def eval_arguments(self, ours):
        arguments = ["--sequence", self.folder, *(["--scene", self.scene] if self.scene else []), "--frames", f"{self.first_scored}:"]
        arguments += ["--truth", self.truth] if self.truth else []
        return arguments + (["--poses", ours / "poses.txt"] if self.odometry_judges else [])


def videos_of(bench):
    """Openers by title: what is missing is told row by row."""
    rendered = bench.data / "rendered"
    openers = {f"rendered {name}": lambda n=name: Video(f"rendered {n}", expect(rendered / n)) for name in ("warehouse", "forest", "kitchen")}
    for seed in (1, 2, 3):
        openers[f"street, seed {seed}"] = lambda s=seed: Video(f"street, seed {s}", bench.synthetic_folder(seed=s))
    openers["street, moving objects"] = lambda: Video("street, moving objects", bench.synthetic_folder(moving=True, frames=14))

    def kitti():
        folder = expect(bench.data / "kitti2012/training")
        return Video("KITTI 2012 / 000151, frames 7 to 10", folder, "000151", "7:10", expect(folder / "disp_noc/000151_10.png"), first_scored=7)
    openers["KITTI 2012 / 000151"] = kitti
    openers["KITTI odometry A"] = lambda: Video("KITTI odometry A", expect(bench.data / "odometry/sequences/A"), odometry_judges=True)
    return openers


class Maps:
    """Makes each method's maps of a video, once."""

    def __init__(self, bench, video):
        self.bench, self.video = bench, video
        self.figures = bench.video_figures()
        self.egosgm = self.figures.egosgm
        self.folder = bench.work / "video" / video.name
        self.sequence = video.open(self.egosgm)

    def of(self, method):
        folder = self.folder / "".join(c if c.isalnum() else "_" for c in method)
        if (folder / "done").exists():
            return folder
        shutil.rmtree(folder, ignore_errors=True)
        folder.mkdir(parents=True)
        if method in (OURS, SINGLE):
            self.run(folder, SINGLE_FRAME if method == SINGLE else ())
        elif method in OPENCV:
            self.match_opencv(folder, OPENCV[method])
        else:
            self.average(folder, self.of("OpenCV HH"), *FILTERS[method])
        (folder / "done").touch()
        return folder

    @functools.cached_property
    def single(self):
        """The row of the single frame."""
        return row_of(self.bench, self, SINGLE)

    def run(self, folder, arguments):
        shutil.rmtree(folder)
        self.bench.egosgm("run", *self.video.run_arguments(), *arguments, "--out", folder, "--write", "variance", "--quiet")

    def match_opencv(self, folder, mode):
        """With the settings of bench/contenders.cpp. StereoSGBM gives nothing in as many columns as there are disparities: images are padded."""
        try:
            import cv2
        except ImportError as reason:
            raise Missing(f"{reason}: needs OpenCV's Python module") from None
        np, count, block = self.figures.np, OPENCV_DISPARITIES, 5
        matcher = cv2.StereoSGBM_create(minDisparity=0, numDisparities=count, blockSize=block, P1=8 * block**2, P2=32 * block**2, disp12MaxDiff=1,
                                        preFilterCap=63, uniquenessRatio=10, mode=getattr(cv2, f"StereoSGBM_MODE_{mode}"))
        for frame in self.sequence.frames:
            steps = matcher.compute(*(np.pad(image, ((0, 0), (count, 0)), "edge") for image in frame.read()))[:, count:]
            disparity = np.where(steps < 0, self.egosgm.INVALID_DISPARITY, steps / np.float32(16))
            self.egosgm.write_disparity(folder / f"{frame.name}.png", disparity.astype(np.float32))

    def average(self, folder, source, along_motion, step_px):
        world_from_camera = self.egosgm.read_poses(self.of(OURS) / "poses.txt")
        before = None
        for k, frame in enumerate(self.sequence.frames):
            now = self.egosgm.read_disparity(source / f"{frame.name}.png")
            if before is not None and along_motion:
                motion = self.figures.np.linalg.inv(world_from_camera[k]) @ world_from_camera[k - 1]
                before = self.egosgm.move_map(before, self.sequence.calibration, motion)
            before = now if before is None else averaged(self.figures, before, now, along_motion, step_px)
            self.egosgm.write_pfm(folder / f"{frame.name}.pfm", self.shown(before, now))

    def shown(self, state, now):
        """What is remembered behind a hole is not shown."""
        return self.figures.np.where(self.figures.is_valid(now), state, self.egosgm.INVALID_DISPARITY).astype(self.figures.np.float32)


def averaged(figures, before, now, along_motion, step_px):
    """The filter's new state. A hole keeps what was there, at the same pixel; what moves has no place to keep it."""
    np = figures.np
    both = figures.is_valid(before) & figures.is_valid(now) & (np.abs(now - before) < step_px)
    state = np.where(both, ALPHA * now + (1 - ALPHA) * before, now)
    if not along_motion:
        state = np.where(figures.is_valid(now), state, before)
    return state.astype(np.float32)


def row_of(bench, maps, method):
    ours, single = maps.of(OURS), maps.of(SINGLE)
    bench.device = json.loads((ours / "report.json").read_text())["device"]
    video = json.loads(bench.egosgm("eval-video", "--estimate", maps.of(method), *maps.video.eval_arguments(ours), "--against", single, "--json"))
    regions, figures = video["regions"], video["figures"]
    pooled = regions.get("all", {})  # none without truth
    bad = [regions.get(region, {}).get("bad_or_missing") for region in ("uncovered", "moving")]
    harm, gain = [None] * 2, [None] * 3
    if method != SINGLE:
        harm, gain = ([figures[f"{name}_percent"] for name in names] for names in (("harm", "help"), ("gained", "gained_right", "lost_right")))
    return [maps.video.title, method, *(pooled.get(name) for name in ("bad_or_missing", "bad_of_valid", "density", "interpolated", "mae")),
            *(figures[name] for name in FIGURES), *bad, *harm, *(certainty(maps, method) if method in (OURS, SINGLE) else [None, None]),
            pooled.get("wrong_of_all"), *gain]


def certainty(maps, method):
    """(percent bad of each frame's surest pixels, of as many as the single frame has; mean of error^2 / variance of errors up to 3 px)."""
    np, figures, egosgm = maps.figures.np, maps.figures, maps.egosgm
    kept_bad, kept, ratios = 0, 0, []
    for frame in maps.sequence.frames:
        truth = maps.video.truth_of(frame)
        if frame.number < maps.video.first_scored or not truth:
            continue
        single, disparity = (egosgm.read_disparity(maps.of(m) / f"disparity/{frame.name}.png") for m in (SINGLE, method))
        truth, variance = egosgm.read_disparity(truth), egosgm.read_disparity(maps.of(method) / f"variance/{frame.name}.pfm")
        errors, y, x = figures.errors_of(disparity, truth)
        surest = np.argsort(variance[y, x], kind="stable")[:len(figures.errors_of(single, truth)[0])]
        kept_bad, kept = kept_bad + np.sum(np.abs(errors[surest]) > figures.BAD_PX), kept + len(surest)
        ratios.append((errors**2 / variance[y, x])[np.abs(errors) <= figures.BAD_PX])
    return [float(100 * kept_bad / kept), float(np.mean(np.concatenate(ratios)))] if kept else [None, None]


def rows_of(bench, openers, steps, row_of_step):
    """The row of each video and each of `steps`, values by name; None is no row."""
    rows = []

    def add(row):
        if row:
            rows.append(row)
            print_row(row)
    for title, opener in openers.items():
        try:
            maps = Maps(bench, opener())
        except Exception as reason:
            add([title, told(reason)])
            continue
        for name, step in steps.items():
            add(measured(title, lambda: row_of_step(bench, maps, step), name))
    return rows


def compared(bench, only):
    openers = {title: opener for title, opener in videos_of(bench).items() if only.search(title)}
    return {"headings": HEADINGS, "rows": rows_of(bench, openers, {method: method for method in METHODS}, row_of)}


def print_row(row):
    print(f"{row[0]:<36} {row[1]:<52} " + " ".join(f"{'-' if value is None else f'{value:.3g}':>7}" for value in row[2:]), flush=True)


def disturbed(np, world_from_camera, degrees, metres, seed=1):
    """Poses whose every motion is off by a rotation of so many degrees about any axis and a shift of so many metres in any direction."""
    random = np.random.default_rng(seed)

    def direction():
        vector = random.normal(size=3)
        return vector / np.linalg.norm(vector)
    poses = [world_from_camera[0]]
    for before, now in zip(world_from_camera, world_from_camera[1:]):
        x, y, z = direction()
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        angle = np.radians(degrees)
        wrong = np.eye(4)
        wrong[:3, :3] += np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
        wrong[:3, 3] = metres * direction()
        poses.append(poses[-1] @ np.linalg.inv(wrong @ np.linalg.inv(now) @ before))
    return np.stack(poses)


def curve(bench, only, steps, row_of_step):
    openers = {title: opener for title, opener in videos_of(bench).items() if title.startswith(("rendered", "street, seed 1")) and only.search(title)}
    return rows_of(bench, openers, steps, row_of_step)


def noise_name(degrees, metres):
    return f"{degrees} degrees, {100 * metres:.0f} cm"


def noise_row(bench, maps, noise):
    out = maps.folder / "noise_{}_degrees_{}_m".format(*noise)
    if not (out / "report.json").exists():
        poses = maps.folder / f"{out.name}.txt"
        maps.egosgm.write_poses(poses, disturbed(maps.figures.np, maps.egosgm.read_poses(maps.video.folder / "poses.txt"), *noise))
        bench.egosgm("run", *maps.video.run_arguments(), "--poses", poses, "--out", out, "--quiet")
    result = json.loads(bench.egosgm("eval-video", "--estimate", out, *maps.video.eval_arguments(out), "--json"))
    figures, single = result["figures"], maps.single
    return [maps.video.title, noise_name(*noise), result["regions"]["all"]["bad_or_missing"], figures["tepe_dynamicstereo_px"], figures["flicker_px"],
            single[2], single[7], single[12]]


def pose_noise(bench, only):
    """True poses, each motion off by so much; the covariance is zero, so that the filter believes them."""
    rows = curve(bench, only, {noise_name(*noise): noise for noise in NOISE}, noise_row)
    return {"headings": ["video", "each motion is off by", "bad or missing", "TEPE, same pixel [px]", "flicker [px]", "single frame: bad or missing",
                         "single frame: TEPE [px]", "single frame: flicker [px]"], "rows": rows}


def dropped_row(bench, maps, dropped):
    frames = maps.sequence.frames
    last = frames[-1]
    if dropped + 1 >= len(frames):
        return None

    def error(folder):
        truth = maps.video.folder / "truth/left_disp_noc" / f"{last.name}.png"
        return json.loads(bench.egosgm("eval", folder / f"disparity/{last.name}.png", truth, "--json"))["pooled"]["bad_or_missing"]
    played, out = maps.folder / f"without_{dropped}", maps.folder / f"out_without_{dropped}"
    if not (out / "report.json").exists():
        link_frames(played, [*frames[:len(frames) - 1 - dropped], last], maps.video.folder)
        bench.egosgm("run", "--odometry", played, "--out", out, "--quiet")
    return [maps.video.title, str(dropped), error(out), error(maps.of(SINGLE))]


def dropped_frames(bench, only):
    """The last frame, when so many frames before it are missing; odometry finds the motion over the gap, or does not."""
    rows = curve(bench, only, {str(dropped): dropped for dropped in DROPPED}, dropped_row)
    return {"headings": ["video", "frames dropped before the last one", "bad or missing", "single frame"], "rows": rows}


def link_frames(folder, frames, source):
    shutil.rmtree(folder, ignore_errors=True)
    for side in ("image_0", "image_1"):
        (folder / side).mkdir(parents=True)
        for frame in frames:
            (folder / side / f"{frame.name}.png").symlink_to((source / side / f"{frame.name}.png").resolve())
    shutil.copy(source / "calib.txt", folder)


def video_tables(bench, only):
    """`only`: a compiled pattern of the videos' titles."""
    shutil.rmtree(bench.work / "video", ignore_errors=True)  # figures are of this build's maps
    print(f"{'':<89} " + " ".join(f"{heading[:7]:>7}" for heading in HEADINGS[2:]))
    methods = compared(bench, only)
    ratios = ratios_of(methods["rows"], OURS, SINGLE, HEADINGS.index("bad of valid"))
    print_table(ratios)
    return {"methods": methods, "ratios": ratios, "pose_noise": pose_noise(bench, only), "dropped_frames": dropped_frames(bench, only)}

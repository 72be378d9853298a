# SPDX-License-Identifier: Apache-2.0
"""What is measured on, and the programs that measure it."""
import json
import os
import pathlib
import re
import shutil
import subprocess
import sys

PROJECT = pathlib.Path(__file__).resolve().parents[2]
STEADY_FROM = 3  # frames of a sequence before this one only lead there
FIGURES = ("bad_or_missing", "bad_of_valid", "interpolated", "d1", "d1_interpolated", "mae")

CAMERAS = {2012: ("image_0", "image_1"), 2015: ("image_2", "image_3")}

SINGLE_FRAME = ("--temporal", "off")
PAPER = ("--preset", "paper")


def settings(*values):
    return tuple(part for value in values for part in ("--set", value))


class Missing(Exception):
    """What a row needs is not on this machine."""


class Failed(Exception):
    """The program refused or crashed."""


def told(reason):
    """What stands in a row in place of its figures."""
    if isinstance(reason, Missing):
        return f"skipped: {reason}"
    return f"failed: {reason}" if isinstance(reason, Failed) else f"failed: {type(reason).__name__}: {reason}"


def measured(title, measure, *parts):
    """The row that `measure` returns, or one that says why there is none: whatever a row raises, the others are written."""
    try:
        return measure()
    except Exception as reason:
        return [title, ": ".join((*parts, told(reason)))]


def expect(path):
    if not path.exists():
        raise Missing(f"{path} is not there: --data DIR or EGOSGM_DATA tell where the sequences are")
    return path


class Program:
    def __init__(self, path):
        self.path = path

    def __call__(self, *arguments):
        done = subprocess.run([self.path, *map(str, arguments)], capture_output=True, text=True)
        if done.returncode != 0:
            lines = done.stderr.strip().splitlines() or [f"exit code {done.returncode}"]
            raise Failed(f"{pathlib.Path(self.path).name} {arguments[0]}: {lines[-1]}")
        return done.stdout


def program_at(path):
    return Program(str(path)) if os.access(path, os.X_OK) else None


def newest_build():
    """The program in build*/apps that was built last."""
    built = sorted(PROJECT.glob("build*/apps/egosgm"), key=lambda path: path.stat().st_mtime)
    return built[-1] if built else PROJECT / "build/apps/egosgm"


class Input:
    """A sequence, the truth of some of its frames, and the frames that count."""

    def __init__(self, title, run_arguments, truth=None, scored=None, poses=None):
        self.title, self.run_arguments = title, tuple(map(str, run_arguments))
        self.truth = truth    # a file (then `scored` is its frame) or a folder of files named like the frames
        self.scored = scored  # a frame's number, or None: all from STEADY_FROM on
        self.poses = poses    # true poses, to compare with


class Bench:
    def __init__(self, arguments):
        chosen = pathlib.Path(arguments.egosgm).resolve() if arguments.egosgm else newest_build()
        self.build = build = chosen.parent.parent
        self.egosgm = program_at(chosen)
        if not self.egosgm:
            sys.exit(f"accuracy: no program {chosen}: run scripts/build, or give --egosgm FILE")
        self.compare = program_at(build / "bench/egosgm_compare")
        self.odometry = program_at(build / "bench/egosgm_odometry")
        self.data = pathlib.Path(arguments.data or os.environ.get("EGOSGM_DATA") or PROJECT / "../shared/data")
        self.work = pathlib.Path(arguments.work)
        self.work.mkdir(parents=True, exist_ok=True)
        self.device = {}
        self.results = {}

    def multiview(self, year, scene, frames, folder=None):
        """KITTI's multi-view scenes, with truth at frame 10."""
        folder = folder or self.data / f"kitti{year}" / "training"
        truth = expect(folder / ("disp_noc" if year == 2012 else "disp_noc_0") / f"{scene}_10.png")
        return Input(f"{year} / {scene}, frames {frames}", ("--kitti", folder, "--scene", scene, "--frames", frames), truth, 10)

    def backwards(self, year, scene):
        """Frames 11 and 10 in this order: two frames whose second one has truth."""
        folder = self.data / f"kitti{year}" / "training"
        truth = expect(folder / ("disp_noc" if year == 2012 else "disp_noc_0") / f"{scene}_10.png")
        played = self.work / f"backwards_{year}_{scene}"
        for side in CAMERAS[year]:
            (played / side).mkdir(parents=True, exist_ok=True)
            for number, original in enumerate((11, 10)):
                link = played / side / f"{number:06d}.png"
                link.unlink(missing_ok=True)
                link.symlink_to(expect(folder / side / f"{scene}_{original}.png").resolve())
        calibration = folder / ("calib" if year == 2012 else "calib_cam_to_cam") / f"{scene}.txt"
        left, right = (played / side for side in CAMERAS[year])
        return Input(f"{year} / {scene}, frames 11, 10",
                     ("--left", left / "%06d.png", "--right", right / "%06d.png", "--calib", calibration), truth, 1)

    def odometry_layout(self, title, folder, motion=(), truth=None):
        return Input(title, ("--odometry", folder, *motion), truth, poses=folder / "poses.txt")

    def odometry_a(self):
        return self.odometry_layout("odometry A", expect(self.data / "odometry/sequences/A"))

    def street(self, name, *arguments):
        """A folder of `egosgm synth`."""
        folder = self.work / name
        if name not in self.results:
            shutil.rmtree(folder, ignore_errors=True)  # one of an earlier run of this bench
            self.egosgm("synth", "--out", folder, "--quiet", *arguments)
            self.results[name] = True
        return folder

    def synthetic_folder(self, moving=False, frames=20, seed=1):
        name = f"synthetic{'_moving' if moving else ''}_{frames}_{seed}"
        return self.street(name, "--frames", frames, "--seed", seed, *(["--moving-object"] if moving else []))

    def synthetic(self, true_poses=True, moving=False, frames=20, seed=1):
        folder = self.synthetic_folder(moving, frames, seed)
        motion = ("--poses", folder / "poses.txt") if true_poses else ()
        title = f"synthetic{', moving objects' if moving else ''}, {'true poses' if true_poses else 'odometry'}, seed {seed}"
        return self.odometry_layout(title, folder, motion, folder / "truth/left_disp_noc")

    def run(self, source, arguments=()):
        """Figures of a run: `frames` (search, density, metrics of those with truth) by number, `drift` in percent."""
        key = (source.title, source.run_arguments, tuple(arguments))
        if key not in self.results:
            self.results[key] = self.measure(source, tuple(arguments))
        return self.results[key]

    def folder_of(self, source, arguments=()):
        """Where `run` has written its maps."""
        self.run(source, arguments)
        return self.out_of(source, arguments)

    def out_of(self, source, arguments):
        return self.work / re.sub(r"[^a-z0-9]+", "_", " ".join((source.title, *arguments)).lower())

    def measure(self, source, arguments):
        out = self.out_of(source, arguments)
        shutil.rmtree(out, ignore_errors=True)
        self.egosgm("run", *source.run_arguments, *arguments, "--out", out, "--quiet")
        report = json.loads((out / "report.json").read_text())
        self.device = report["device"]
        frames = {frame["frame"]: {"search": 100 * frame["search_fraction"],
                                   "density": 100 * frame["density"]} for frame in report["frames"]}
        if source.scored is not None:
            frames[source.scored].update(self.evaluate(out / f"disparity/{source.scored:06d}.png", source.truth)["pooled"])
        elif source.truth:
            for pair in self.evaluate(out, source.truth)["pairs"]:
                frames[int(pair["name"])].update({figure: pair[figure] for figure in (*FIGURES, "truth_pixels")})
        drift = None
        if source.poses:
            drift = self.evaluate_poses(out / "poses.txt", source.poses)["end_drift_percent"]
        return {"frames": frames, "drift": drift}

    def video_figures(self):
        """The module that looks at maps pixel by pixel, with the Python module of the same build."""
        sys.path[:0] = [str(self.build / "python"), str(PROJECT / "bench")]
        try:
            import video_figures
        except ImportError as reason:
            raise Missing(f"{reason}: needs NumPy and build/python (pybind11), and the python3 that it was built for") from None
        return video_figures

    def scene(self, year, scene, numbers):
        """A multi-view scene as the Python module plays it: frames in the order of `numbers`."""
        figures = self.video_figures()
        folder = expect(self.data / f"kitti{year}" / "training")
        return figures.Recorded(figures.egosgm.open_kitti_multiview(folder, scene, f"{min(numbers)}:{max(numbers)}"), numbers)

    def evaluate(self, estimate, truth, mask=None):
        only = ("--mask", mask) if mask else ()
        return json.loads(self.egosgm("eval", "--estimate", estimate, "--truth", truth, *only, "--json"))

    def evaluate_poses(self, estimate, truth, *arguments):
        return json.loads(self.egosgm("eval-poses", "--estimate", estimate, "--truth", truth, "--json", *arguments))


def scored_frames(source, result):
    if source.scored is not None:
        return [source.scored]
    return sorted(result["frames"])[STEADY_FROM:]

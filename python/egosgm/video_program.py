# SPDX-License-Identifier: Apache-2.0
"""Compare disparity maps of a video with each other over time, with another method's, and part by part with their truth."""
import argparse
import dataclasses
import math
import pathlib
import re
import struct
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

import numpy as np

from . import _egosgm
from .evaluation import plots
from .arguments import comparison_parser, counted, decimal, json_text, Parser, resolve_comparison, tell, text_argument
from .evaluation.maps import Frame
from .evaluation.pose_evaluation import inverse
from .evaluation.video_counts import VideoCounts, count_frames
from .evaluation.video_evaluation import VideoFigures, density_of, figures_of, regions_of

_Path = pathlib.Path
_MOST_FLOW_BYTES = 1 << 31
_PLOTTED = {"flicker": "flicker_px", "TEPE same pixel": "tepe_dynamicstereo_px", "TEPE along motion": "tepe_codd_px"}


@dataclasses.dataclass
class Files:
    """Of one frame; None where there is none."""

    name: str
    estimate: _Path
    truth: Optional[_Path] = None
    all_truth: Optional[_Path] = None
    mask: Optional[_Path] = None
    against: Optional[_Path] = None
    uncertainty: Optional[_Path] = None
    moving: Optional[_Path] = None
    image: Optional[_Path] = None
    flow: Optional[_Path] = None
    next_truth: Optional[_Path] = None
    reason: Optional[_Path] = None


def in_order(name: str) -> Any:
    """A key of names that takes numbers in them by their value."""
    parts = re.split("([0-9]+)", name)
    return [int(part) if i % 2 else part for i, part in enumerate(parts)], len(name), name


def find_successors(names: Sequence[str]) -> List[bool]:
    """Whether each file name is of the frame after the one before it: only the last number in them differs, by no more than one and a half times
    the median of such differences (a larger one is a gap)."""
    def distance(before: str, name: str) -> int:
        a, b = (list(map(int, re.findall("[0-9]+", text))) for text in (before, name))
        return b[-1] - a[-1] if a and len(a) == len(b) and a[:-1] == b[:-1] else 0
    distances = [0] + [distance(*pair) for pair in zip(names, names[1:])]
    ahead = sorted(d for d in distances if d > 0)
    return [bool(ahead) and 0 < d and 2 * d <= 3 * ahead[(len(ahead) - 1) // 2] for d in distances][:len(names)]


def read_flow(file: _Path) -> np.ndarray:
    """KITTI's PNG or .flo: H x W x 2 [px], NaN where there is none. Throws InvalidArgument."""
    content = _egosgm._read_file(file, _MOST_FLOW_BYTES)
    if content[:4] == b"PIEH":
        width, height = struct.unpack("<ii", content[4:12].ljust(8, b"\0"))
        if width < 1 or height < 1 or len(content) - 12 != 8 * width * height:
            raise _egosgm.InvalidArgument(f"{file}: not a readable .flo (truncated?): {width}x{height} pixels do not fit its {len(content)} bytes")
        flow = np.frombuffer(content, "<f4", offset=12).reshape(height, width, 2)
        with np.errstate(invalid="ignore"):
            return np.where((np.abs(flow) < 1e9).all(axis=2, keepdims=True), flow, np.nan).astype(np.float32)
    if content[:4] != b"\x89PNG":
        raise _egosgm.InvalidArgument(f"{file}: not optical flow that is read: KITTI's PNG of 16 bits and .flo are")
    stored = _egosgm._read_stored_image(file)
    if stored.ndim != 3 or stored.shape[2] != 3 or stored.dtype != np.uint16:
        raise _egosgm.InvalidArgument(f"{file}: not optical flow: KITTI's is 16-bit RGB PNG, this one has {1 if stored.ndim == 2 else stored.shape[2]} channel(s) "
                                      f"of {8 * stored.itemsize} bit")
    if stored[..., 0].max() <= 1 < stored[..., 2].max():
        raise _egosgm.InvalidArgument(f"{file}: not optical flow: KITTI's PNG says in its third channel what is there, and here the first one does: OpenCV writes BGR; exchange both")
    flow = (stored[..., :2].astype(np.float32) - 32768) / 64
    return np.where(stored[..., 2:] == 0, np.float32(np.nan), flow)


class Odometry:
    """The motions of a sequence by odometry, found as far as they are asked for."""

    def __init__(self, sequence: Any, first: int) -> None:
        self._sequence, self._first, self._odometry = sequence, first, _egosgm.StereoOdometry(sequence.calibration)
        self._motions: List[Optional[np.ndarray]] = []

    def between(self, before: int, now: int) -> Optional[np.ndarray]:
        """None where odometry found none."""
        while self._first + len(self._motions) <= now:
            motion = self._odometry.process(*self._sequence.frames[self._first + len(self._motions)].read()).motion
            self._motions.append(None if motion is None else motion.current_from_previous)
        result = np.eye(4)
        for motion in self._motions[before + 1 - self._first:now + 1 - self._first]:
            if motion is None:
                return None
            result = motion @ result
        return result


class VideoInput:
    """Estimates with everything that belongs to them. Pairs the files when it is made; images and maps are read later."""

    def __init__(self, given: argparse.Namespace) -> None:
        if given.variance and given.confidence:
            raise _egosgm.InvalidArgument("--variance and --confidence: give one of them")
        if not given.sequence and (given.poses or given.scene):
            raise _egosgm.InvalidArgument("--poses and --scene belong to a sequence: give --sequence DIR with them")
        self.given, self.sequence, self.places, self.motion_source = given, None, [], ""
        self.reader = _egosgm._EstimateReader()
        self._poses: Optional[np.ndarray] = None
        self._odometry: Optional[Odometry] = None
        self._list_frames()
        self.follows = find_successors([frame.name for frame in self.frames])
        self.successors = sum(self.follows)
        for frame in self.frames:  # what `egosgm run` wrote beside its maps
            run = frame.estimate.parent / ".."
            reason = run / "reason" / f"{frame.estimate.stem}.png"
            frame.reason = reason if (run / "report.json").is_file() and reason.is_file() else None
        self._pair("against", given.against, "disparity")
        if given.against and all(frame.against and frame.against.samefile(frame.estimate) for frame in self.frames):
            self.notes.append("the estimates are those of --against: is a run compared with itself?")
        self._pair("uncertainty", given.variance, "variance")
        self._pair("uncertainty", given.confidence)
        self._pair("flow", given.flow)
        self._pair("next_truth", given.next_truth)
        if given.sequence:
            self._open_sequence()
        masks = [place for place in (_Path(given.sequence, "truth", name) for name in ("left_moving", "moving")) if given.sequence and place.is_dir()]
        self._pair("moving", given.moving or (str(masks[0]) if masks else ""))
        for frame in self.frames:
            _egosgm._expect_scaled("--scale", given.scale, frame.estimate)
            if frame.truth:
                _egosgm._expect_scaled("--truth-scale", given.truth_scale, frame.truth)

    def _pairs_with(self, estimate: _Path, truth: _Path) -> Tuple[List[Any], List[_Path], List[_Path]]:
        return _egosgm._pair_with_truth(estimate, truth, text_argument(self.given.frames))

    def _list_frames(self) -> None:
        """Every estimate, with its truth where it has one."""
        given, pairs, self.notes = self.given, [], []
        if not given.truth:
            alone = _egosgm._list_maps(given.estimate, text_argument(given.frames))
        else:
            pairs, without_estimate, alone = self._pairs_with(_Path(given.estimate), _Path(given.truth))
            if given.sequence and not _Path(given.truth).is_dir():
                # One truth file: the frames around it are measured over time all the same.
                alone = [file for file in _egosgm._list_maps(given.estimate, text_argument(given.frames)) if file != pairs[0].estimate]
            self.notes += [f"{pair.estimate.name} is compared with {pair.truth}: only the number is the same" for pair in pairs if not pair.same_name]
            if without_estimate:
                self.notes.append(f"{counted(len(without_estimate), 'truth file')} without an estimate, the first is {without_estimate[0]}")
        self.frames = [Files(pair.name, pair.estimate, pair.truth) for pair in pairs] + [Files(file.stem, file) for file in alone]
        self.frames.sort(key=lambda frame: in_order(frame.name))
        if given.mask:
            mask = _Path(given.mask)
            for frame in self.frames:
                if frame.truth:
                    frame.mask = mask / frame.truth.with_suffix(".png").name if mask.is_dir() else mask

    def _pair(self, field: str, folder: str, inside: str = "") -> None:
        if not folder:
            return
        place = _Path(folder, inside) if inside and _Path(folder, inside).is_dir() else _Path(folder)
        estimates = self.frames[0].estimate if len(self.frames) == 1 else self.frames[0].estimate.parent
        files = {pair.name: pair.truth for pair in self._pairs_with(estimates, place)[0]}
        if field in ("against", "uncertainty") and place.is_dir() and any(file.parent != place for file in files.values()):
            raise _egosgm.InvalidArgument(f"{folder}: has no maps but the truth of a sequence: give a folder of a method's maps")
        is_of_pairs = field in ("flow", "next_truth")  # which the last frame of a video has none of
        alone = [frame.name for i, frame in enumerate(self.frames) if frame.name not in files and (not is_of_pairs or any(self.follows[i + 1:i + 2]))]
        if alone:
            self.notes.append(f"{folder} has nothing for {counted(len(alone), 'frame')}, the first is {alone[0]}: its figures are of the others")
        for frame in self.frames:
            setattr(frame, field, files.get(frame.name, getattr(frame, field)))

    def _open_sequence(self) -> None:
        given = self.given
        self.sequence = _egosgm.open_kitti_multiview(given.sequence, text_argument(given.scene)) if given.scene else _egosgm.open_folder(given.sequence)
        place = {frame.number: i for i, frame in enumerate(self.sequence.frames)}
        for frame in self.frames:
            numbers = re.findall("[0-9]+", frame.name)
            found = place.get(int(numbers[-1])) if numbers else None
            if found is None:
                raise _egosgm.InvalidArgument(f"{frame.estimate}: {given.sequence} has no frame of this number; it has {self.sequence.frames[0].number} to "
                                              f"{self.sequence.frames[-1].number}")
            self.places.append(found)
            stereo = self.sequence.frames[found]
            frame.image = _Path(stereo.left) if frame.flow else None
            frame.all_truth = _Path(stereo.truth_occ) if frame.truth and stereo.truth_occ != _Path() else None
        if not self.successors:
            return
        file = given.poses or ("" if self.sequence.poses_file == _Path() else str(self.sequence.poses_file))
        if file:
            self._poses = _egosgm._poses_of_frames(self.sequence, file)
        else:
            self._odometry = Odometry(self.sequence, min(self.places))
        self.motion_source = f"poses {file}" if file else "odometry"

    def motion(self, i: int) -> Optional[np.ndarray]:
        """current_from_previous of frame i."""
        before, now = self.places[i - 1], self.places[i]
        if self._odometry is not None:
            return self._odometry.between(before, now)
        return None if self._poses is None else inverse(self._poses[now]) @ self._poses[before]

    def _read(self, files: Files) -> Frame:
        given = self.given
        frame = Frame(self.reader.read(files.estimate, given.scale))

        def read(file: Optional[_Path], reader: Any, *arguments: Any) -> Optional[np.ndarray]:
            if file is None:
                return None
            array = reader(file, *arguments)
            (height, width), (its_height, its_width) = frame.estimate.shape, array.shape[:2]
            if (height, width) != (its_height, its_width):
                raise _egosgm.InvalidArgument(f"{files.estimate} is {width}x{height}, {file} is {its_width}x{its_height}: give maps of one size")
            return array
        frame.truth = read(files.truth, _egosgm._read_scaled, given.truth_scale)
        if frame.truth is not None:
            self.reader.compare(frame.estimate, frame.truth)
        frame.all_truth = read(files.all_truth, _egosgm.read_disparity)
        frame.against = read(files.against, self.reader.read, given.scale)
        frame.next_truth = read(files.next_truth, _egosgm._read_scaled, given.truth_scale)
        frame.reason = read(files.reason, _egosgm.read_grey)
        frame.uncertainty = read(files.uncertainty, _egosgm._read_values)
        if given.confidence and frame.uncertainty is not None:
            frame.uncertainty = -frame.uncertainty
        moving = read(files.moving, _egosgm.read_grey)
        frame.moving = None if moving is None else moving != 0
        frame.image = read(files.image, _egosgm.read_grey)
        frame.flow_to_next = read(files.flow, read_flow)
        kept = read(files.mask, _egosgm.read_grey)
        if kept is not None:
            frame.truth = np.where(kept == 0, np.float32(_egosgm.INVALID_DISPARITY), frame.truth)
        return frame

    def counts(self, near_px: float) -> Iterator[VideoCounts]:
        calibration = self.sequence.calibration if self.sequence else None
        return count_frames(map(self._read, self.frames), calibration, self.motion, lambda i: self.follows[i], near_px)


def _parser() -> Parser:
    parser = comparison_parser("eval-video", __doc__, "disparity map (KITTI PNG, 16-bit PNG with --scale, PFM, .npy), a folder of them, or a folder of `run`",
                                "true disparity, or a folder of files with equal names; not needed with --sequence")
    parser.epilog = "docs/use/evaluation.md has the formula, the source and the pixels of every figure. `egosgm eval` compares maps with their truth frame by frame."
    add = parser.add_argument
    add("--mask", default="", metavar="FILE|DIR", help="compare only where this grey PNG, or the one of the truth's name in this folder, is not 0")
    add("--scale", type=decimal, default=256.0, metavar="STEPS", help="steps a pixel of 16-bit PNG in --estimate and --against [256, KITTI's]")
    add("--truth-scale", type=decimal, default=256.0, metavar="STEPS", help="the same of the truth [256]")
    add("--sequence", default="", metavar="DIR", help="the stereo sequence that the maps are of (KITTI odometry or raw, egosgm synth, with --scene KITTI "
        "multi-view): calibration, poses, images, and truth where --truth is not given")
    add("--scene", default="", metavar="NUMBER", help="scene of --sequence, for example 000151")
    add("--poses", default="", metavar="FILE", help="KITTI poses of --sequence, in place of its own; without any: stereo odometry")
    add("--against", default="", metavar="DIR", help="another method's maps: what was changed for the worse and for the better, what was gained and what was lost")
    add("--variance", default="", metavar="DIR", help="a map per frame that grows with the expected error (PFM, .npy, grey PNG)")
    add("--confidence", default="", metavar="DIR", help="a map per frame that falls with the expected error")
    add("--moving", default="", metavar="DIR", help="masks of what moves by itself, not 0; without: those in --sequence")
    add("--flow", default="", metavar="DIR", help="true optical flow from each frame to the next (KITTI PNG, .flo)")
    add("--next-truth", default="", metavar="DIR", help="the next frame's true disparity at each frame's pixels (KITTI 2015: disp_occ_1)")
    add("--near", type=decimal, default=32.0, metavar="PX", help="the region `near` begins at this true disparity, the rest is `far` [32]")
    add("--plot-frames", default="", metavar="FILE", help="draw the figures over the frames: a new .png or .svg file")
    add("--plot-density", default="", metavar="FILE", help="draw the bad pixels against the share of pixels kept: a new .png or .svg file; with --variance or "
        "--confidence")
    add("--json", action="store_true", help="print JSON")
    return parser


def _density_json(density: Any) -> Dict[str, Any]:
    at = zip(density.density_percent, density.reached_percent, density.bad_percent)
    kept = zip(density.kept_percent, density.kept_bad_percent, density.oracle_bad_percent, density.kept_mae_px, density.oracle_mae_px)
    return {"at_density": [dict(zip(("density_percent", "reached_percent", "bad_percent"), point)) for point in at],
            "sparsification": [dict(zip(("kept_percent", "bad_percent", "oracle_bad_percent", "mae", "oracle_mae"), point)) for point in kept]}


def _json_of(found: VideoInput, over_frames: List[VideoFigures], total: VideoCounts) -> Dict[str, Any]:
    density = density_of(total)
    return {"frames": len(found.frames), "pairs": found.successors, "motion": found.motion_source, "figures": vars(figures_of(total)),
            "regions": {name: vars(region) for name, region in regions_of(total).items()},
            "over_frames": [{"name": files.name, **vars(figures)} for files, figures in zip(found.frames, over_frames)],
            **({"density": _density_json(density)} if density else {}), **({"notes": found.notes} if found.notes else {}), **({"warnings": warnings} if (warnings := found.reader.warnings(found.given.scale, found.given.truth_scale)) else {})}


def _cell(value: float, width: int, unit: str) -> str:
    return f"{'-':>{width}}" if math.isnan(value) else f"{value:>{width - 2}.3f}{unit}"


def _text_of(found: VideoInput, total: VideoCounts) -> str:
    known = {name: value for name, value in vars(figures_of(total)).items() if not math.isnan(value)}
    source = f", {found.motion_source}" if found.motion_source else ""
    lines = [f"{counted(len(found.frames), 'frame')}, {counted(found.successors, 'pair')} of frames{source}"]
    lines += [f"  {name:<46}{value:>12.4f}" for name, value in known.items()]
    columns = {"wrong_of_all": (13, " %"), "bad_of_valid": (14, " %"), "filled": (11, " %"), "density": (11, " %"), "bad_or_missing": (16, " %"),
               "interpolated": (14, " %"), "bad_1px": (11, " %"), "mae": (12, "px"), "mean_error": (12, "px"), "tepe_dynamicstereo_px": (12, "px")}
    regions = regions_of(total)
    if regions:
        names = [name if name != "tepe_dynamicstereo_px" else "tepe" for name in columns]
        lines += ["", f"{'region':<12}{'truth':>12}" + "".join(f"{name:>{width}}" for name, (width, _) in zip(names, columns.values()))]
        lines += [f"{name:<12}{region.truth_pixels:>12}" + "".join(_cell(getattr(region, figure), *cell) for figure, cell in columns.items())
                  for name, region in regions.items()]
    density = density_of(total)
    if density:
        lines += ["", f"{'density':<12}{'reached':>12}{'bad':>12}"]
        lines += [f"{f'{share:.0f} %':<12}{_cell(reached, 12, ' %')}{_cell(bad, 12, ' %')}"
                  for share, reached, bad in zip(density.density_percent, density.reached_percent, density.bad_percent)]
    return "\n".join(lines + found.notes + found.reader.warnings(found.given.scale, found.given.truth_scale))


def _expect_partners(given: argparse.Namespace) -> None:
    """That no option is passed over for want of another one. REQUIRES: the truth is resolved."""
    for name, partners in (("mask", ["truth"]), ("next_truth", ["flow"]), ("plot_density", ["variance", "confidence"])):
        if getattr(given, name) and not any(getattr(given, partner) for partner in partners):
            raise _egosgm.InvalidArgument(f"--{name.replace('_', '-')} {getattr(given, name)}: belongs to --{' or --'.join(partners)}: give that, too, or leave it out")


def _work(arguments: Sequence[str]) -> str:
    given = _parser().parse(arguments)
    for option, file in (("--plot-frames", given.plot_frames), ("--plot-density", given.plot_density)):
        if file:
            plots.expect_plot(option, file)
    if given.plot_frames and given.plot_density and _Path(given.plot_frames).resolve() == _Path(given.plot_density).resolve():
        raise _egosgm.InvalidArgument(f"--plot-frames and --plot-density {given.plot_density}: are one file: give each plot a name of its own")
    resolve_comparison(given, truth_is_needed=not given.sequence)
    if not given.truth and (given.scene or _Path(given.sequence, "truth").is_dir()):
        given.truth = given.sequence  # its own
    _expect_partners(given)
    found = VideoInput(given)
    total, over_frames, errors = VideoCounts(), [], []
    for counts in found.counts(given.near):
        total.add(counts)
        over_frames.append(figures_of(counts))
        everywhere = regions_of(counts).get("all")
        errors.append(everywhere.mae if everywhere else math.nan)
    if given.plot_frames:
        curves = [(name, [getattr(figures, figure) for figures in over_frames]) for name, figure in _PLOTTED.items()]
        plots.write_plot(given.plot_frames, plots.over_frames([*curves, ("absolute error", errors)]))
    if given.plot_density:
        plots.write_plot(given.plot_density, plots.against_density(density_of(total)))
    return json_text(_json_of(found, over_frames, total)) if given.json else _text_of(found, total)


def main(arguments: Sequence[str]) -> int:
    tell(_work(arguments))
    return 0

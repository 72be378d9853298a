# SPDX-License-Identifier: Apache-2.0
"""egosgm rectify: raw pairs in, a rectified sequence out, in the layout that all other commands read."""
import itertools
import os
import pathlib
import shlex
import sys
from typing import Any, List, Optional, Sequence, Tuple

from .. import _egosgm
from ..arguments import Parser, counted, decimal, on_interrupt, say
from .reader import find, read_euroc_rig
from .raw_pairs import RawPair, add_pairs, pairs_of
from .rectification import Rectification, StereoRig

import cv2

_UNITS = {None: None, "m": 1.0, "cm": 0.01, "mm": 0.001}


def unit_m(unit: Optional[str]) -> Optional[float]:
    if unit in _UNITS:
        return _UNITS[unit]
    try:
        metres = decimal(unit or "")
    except ValueError:
        metres = 0.0
    if not metres > 0:
        raise _egosgm.InvalidArgument(f"--unit {unit}: choose m, cm or mm, or give the metres of one unit, above 0")
    return metres


def add_calibration(parser: Parser) -> None:
    parser.add_argument("--calib", metavar="FILE", nargs="+", help="the calibration of the raw cameras, as egosgm.read_calibration reads it: OpenCV's (M1, D1, M2, D2, R, T; "
        "YAML, XML or JSON), a folder with intrinsics.yml and extrinsics.yml, ROS's, Kalibr's; the left and the right camera's file, where each has one; or, for "
        "images that are rectified already, what `run --calib` reads")
    parser.add_argument("--fisheye", action="store_true", help="OpenCV's calibration is one of cv::fisheye: D1 and D2 hold four coefficients of the angle")
    parser.add_argument("--unit", metavar="m|cm|mm|METRES", help="unit of T in OpenCV's calibration; where it counts a board's squares, the side of a square [m]; without: m")


def _parser() -> Parser:
    parser = Parser("rectify", description="Make a rectified sequence of raw pairs, side-by-side images or videos, EuRoC folders, lists")
    add = add_pairs(parser)
    add("--list", metavar="FILE", help="a text file with rows LEFT RIGHT or LEFT RIGHT SECONDS")
    add("--euroc", metavar="DIR", help="an EuRoC sequence (mav0 or its parent), with its own calibration")
    add = parser.add_argument
    add_calibration(parser)
    add("--alpha", type=decimal, default=0.0, metavar="A", help="0: only pixels that the raw images have; 1: all of theirs, with black borders; without: 0")
    add("--out", required=True, metavar="DIR", help="new folder: image_0 and image_1 (colour: image_2, image_3), calib.txt, times.txt, valid.png")
    add("--quiet", action="store_true", help="no progress, only errors")
    return parser


class Rectifier:
    """What a pair goes through: rectification, or nothing where the images are rectified already."""

    def __init__(self, calib: Optional[Sequence[str]], size: Optional[Tuple[int, int]], unit_m: Optional[float] = None, fisheye: bool = False,
                 alpha: float = 0.0, euroc: Optional[str] = None) -> None:
        self._alpha, self.rectification = alpha, None
        self.rig: Optional[StereoRig] = None
        if euroc:
            if calib or unit_m is not None or fisheye:
                raise _egosgm.InvalidArgument("--euroc has its own calibration: leave --calib, --unit and --fisheye out, or give --left and --right")
            self.rig = read_euroc_rig(euroc)
            return
        if not calib:
            raise _egosgm.InvalidArgument("no calibration: give --calib FILE; `egosgm calibrate` finds one by pictures of a board, and rectified pictures need "
                                          "none: `egosgm run LEFT RIGHT`")
        found = find(calib, unit_m, fisheye, size)
        if isinstance(found, StereoRig):
            self.rig = found
        elif alpha:
            raise _egosgm.InvalidArgument(f"--alpha {alpha:g}: {' '.join(calib)} is of rectified images, which stay as they are: leave it out")
        else:
            self.calibration = found

    def __call__(self, pair: RawPair) -> None:
        if self.rig is None:
            return
        if self.rectification is None:
            height, width = pair.left.shape[:2]
            self.rectification = Rectification(self.rig, width, height, self._alpha)
            self.calibration = self.rectification.calibration
        pair.left, pair.right = self.rectification.rectify(pair.left, pair.right)


class SequenceFolder:
    """KITTI odometry's layout, in a new or empty folder; colour goes to image_2 and image_3."""

    def __init__(self, folder: pathlib.Path) -> None:
        self._folder, self.frames, self._times = folder, 0, []  # type: ignore[var-annotated]
        self._is_timed = True

    def expect_size(self, pair: RawPair) -> None:
        size = pair.left.shape[1::-1]
        if self.frames > 0 and size != self.size:
            raise _egosgm.InvalidArgument("pair {} is {}x{}, the pairs before {}x{}: all need one size".format(self.frames + 1, *size, *self.size))

    def add(self, pair: RawPair) -> None:
        self.expect_size(pair)
        if self.frames == 0:
            self.size, self._is_colour = pair.left.shape[1::-1], pair.left.ndim == 3
            self._sides = ("image_2", "image_3") if self._is_colour else ("image_0", "image_1")
            for side in self._sides:
                (self._folder / side).mkdir(parents=True, exist_ok=True)
        for side, image in zip(self._sides, (pair.left, pair.right)):
            self._write(f"{side}/{self.frames:06}.png", self._writable(image))
        self._is_timed = self._is_timed and pair.time_s is not None
        self._times.append(pair.time_s)
        self.frames += 1

    def finish(self, rectifier: Rectifier) -> None:
        if self.frames == 0:
            raise _egosgm.InvalidArgument("the input has no pair: is it empty?")
        _egosgm._write_new_calibration(self._folder / "calib.txt", rectifier.calibration)
        if self._is_timed:
            _egosgm._write_new_file(self._folder / "times.txt", "".join(f"{time:.9f}\n" for time in self._times).encode())
        if rectifier.rectification is not None:
            self._write("valid.png", rectifier.rectification.valid)

    def _write(self, name: str, image: Any) -> None:
        _egosgm._write_new_file(self._folder / name, cv2.imencode(".png", image)[1].tobytes())

    def _writable(self, image: Any) -> Any:
        """Grey, or all in colour as the first one."""
        if not self._is_colour:
            return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
        return cv2.cvtColor(image, cv2.COLOR_GRAY2BGR if image.ndim == 2 else cv2.COLOR_RGB2BGR)


class _Lines:
    """Lines on the standard output. Who stops reading ends the printing, not the work; other failures are told at the end."""

    def __init__(self, quiet: bool) -> None:
        self._quiet, self.error = quiet, None

    def __call__(self, line: str) -> None:
        if self._quiet or sys.stdout is None:
            return
        try:
            print(line, flush=True)
        except OSError as error:
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
            if not isinstance(error, BrokenPipeError):
                self.error = error


def _rectangle_text(rectangle: Sequence[int]) -> str:
    return "{2}x{3} from ({0}, {1})".format(*rectangle)


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    if not 0 <= given.alpha <= 1:
        raise _egosgm.InvalidArgument(f"--alpha {given.alpha:g}: choose from 0 to 1")
    given.unit = unit_m(given.unit)
    if given.euroc and os.path.isdir(os.path.join(given.euroc, "mav0")):
        given.euroc = os.path.join(given.euroc, "mav0")
    pairs = pairs_of(given)
    stream = iter(pairs)
    first = next(stream, None)
    rectifier = Rectifier(given.calib, first.left.shape[1::-1] if first else None, given.unit, given.fisheye, given.alpha, given.euroc)
    _egosgm._expect_new_folder("--out", pathlib.Path(given.out))
    folder = SequenceFolder(pathlib.Path(given.out))
    stops: List[int] = []
    on_interrupt(lambda: stops.append(1))  # a pair that was begun is written whole
    say_line, note = _Lines(given.quiet), pairs.note
    if note:
        say_line(note)
    try:
        for pair in itertools.chain([first] if first else [], stream):
            if stops:
                break
            folder.expect_size(pair)  # raw and rectified pairs have one size
            rectifier(pair)
            folder.add(pair)
            say_line(f"pair {folder.frames}")
    except Exception:  # what was written until then is a sequence of its own
        if folder.frames > 0:
            folder.finish(rectifier)
        raise
    if pairs.note != note:
        say_line(pairs.note)
    if stops and folder.frames == 0:
        say("interrupted before the first pair")
        return 130
    folder.finish(rectifier)
    calibration = rectifier.calibration
    say_line(f"{counted(folder.frames, 'pair')} in {given.out}: fx {calibration.fx:.2f} px, baseline {calibration.baseline_m:.4f} m"
             + ("; they were rectified already" if rectifier.rig is None else ""))
    suspicion = _egosgm._suspect_calibration(calibration, *folder.size)
    if suspicion:
        say_line(f"doubtful: {suspicion.what}: {suspicion.remedy}")
    if rectifier.rectification is not None:
        say_line(f"valid: left {_rectangle_text(rectifier.rectification.valid_left)}, right {_rectangle_text(rectifier.rectification.valid_right)} "
                 "(valid.png has the left one's pixels)")
    say_line(f"egosgm doctor {shlex.quote(given.out)}; egosgm run --odometry {shlex.quote(given.out)} --out OUT")
    if stops:
        say(f"interrupted after {counted(folder.frames, 'pair')}: what is in {given.out} is whole")
        return 130
    if say_line.error is not None:
        say(f"error: the standard output cannot be written: {say_line.error.strerror}")
        return 1
    return 0

# SPDX-License-Identifier: Apache-2.0
"""Sequences as `egosgm run` takes them, opened by the same arguments: folders of all layouts, patterns, two pictures; and when their frames were taken."""
import argparse
import datetime
import math
import os
import pathlib
import re
from typing import Any, List, NamedTuple, Optional, Tuple

from . import _egosgm, calibrations
from .arguments import text_argument
from .rectification import StereoRig

_MOST_TIMES_BYTES = 1 << 28


class Opened(NamedTuple):
    """A sequence, and its calibration, which may be of raw images; None where there is none."""

    sequence: _egosgm.StereoSequence
    calibration: "_egosgm.Calibration | StereoRig | None"


def add_input(parser: argparse.ArgumentParser) -> None:
    add = parser.add_argument_group("input (one of)").add_argument
    add("folder", metavar="DATASET", nargs="?", help="folder in the layout of KITTI odometry, KITTI raw or Middlebury, whichever it is, or with left, right "
        "and calib.txt; --dataset names it, too")
    add("other_picture", metavar="RIGHT", nargs="?", help="where DATASET is the left picture of a pair, the right one")
    add("--dataset", metavar="DIR", help=argparse.SUPPRESS)
    add("--odometry", metavar="DIR", help="KITTI odometry sequence: image_0, image_1 (or image_2, image_3), calib.txt")
    add("--kitti", metavar="DIR", help="KITTI 2012 or 2015 multi-view: `training`, `testing` or their parent; with --scene")
    add("--scene", metavar="NUMBER", help="scene of --kitti, for example 000151")
    add("--left", metavar="PATTERN", help="left images: one PNG or JPEG, or a pattern (in quotes) such as 'left/%%06d.png' or 'left/*.jpg'")
    add("--right", metavar="PATTERN", help="right images, likewise; rectified, or raw where --calib is of raw images")
    add("--calib", metavar="FILE", nargs="+", help="calibration of --left and --right, of whichever program, as egosgm.read_calibration reads it; the left and the "
        "right camera's file, where each has one")
    add("--pair-by", metavar="name|order", help="what tells which --left and --right images belong together: equal texts in their names (what * or %%d "
        "stands for), or their order")
    add("--frames", metavar="FIRST:LAST", help="frame numbers, both ends included: 7:10, 7:, :10 or 7; without: all")


def _refuse(text: str) -> _egosgm.InvalidArgument:
    return _egosgm.InvalidArgument(text)


def _is_file(path: Optional[str]) -> bool:
    return bool(path) and bool(pathlib.Path(path or "").suffix) and os.path.isfile(path or "")


def _take_two_pictures(given: argparse.Namespace) -> None:
    if given.dataset:
        if given.folder:
            raise _refuse(f"more than one input: {given.dataset} and {given.folder}: give one of them")
        given.folder = given.dataset
    if not given.other_picture:
        return
    if not _is_file(given.folder) or given.left or given.right:
        hint = "; did the shell expand a pattern? quote it: '*.png'" if _is_file(given.folder) else ""
        raise _refuse(f"more than one input: {given.folder} and {given.other_picture}: give one folder, or the left and the right picture of a pair{hint}")
    given.left, given.right, given.folder = given.folder, given.other_picture, None


def _check(given: argparse.Namespace) -> None:
    patterns = bool(given.left or given.right or given.calib)
    sources = [text for text in (f"--kitti {given.kitti}" if given.kitti else "", f"--odometry {given.odometry}" if given.odometry else "",
                                 given.folder or "", f"--left {given.left or ''} --right {given.right or ''}" if patterns else "") if text]
    if not sources:
        raise _refuse("no input: give one of --odometry DIR, --kitti DIR --scene NUMBER, --left PATTERN --right PATTERN --calib FILE, or a data set's folder")
    if len(sources) > 1:
        hint = "; did the shell expand a pattern? quote it: '*.png'" if patterns and _is_file(given.folder) else ""
        raise _refuse(f"more than one input: {sources[0]} and {sources[1]}: give one of them{hint}")
    if given.scene and not given.kitti:
        raise _refuse(f"--scene {given.scene}: give --kitti DIR with it")
    if given.kitti and not given.scene:
        raise _refuse(f"--kitti {given.kitti}: give --scene NUMBER with it")
    if patterns and not (given.left and given.right):
        raise _refuse("--left, --right and --calib belong together: give all three")
    if given.pair_by not in (None, "name", "order"):
        raise _refuse(f"--pair-by {given.pair_by}: choose name or order")
    if given.pair_by and not patterns:
        raise _refuse(f"--pair-by {given.pair_by}: is for --left and --right; in a folder names tell")


def open_input(given: argparse.Namespace) -> Opened:
    """What the arguments of add_input name. Throws InvalidArgument, and _NegativeBaseline where that is what is wrong with the calibration."""
    _take_two_pictures(given)
    _check(given)
    frames = text_argument(given.frames or "")
    if given.kitti:
        sequence = _egosgm.open_kitti_multiview(given.kitti, text_argument(given.scene or ""), frames)
    elif given.odometry:
        sequence = _egosgm._open_kitti_odometry(given.odometry, frames)
    elif given.folder:
        sequence = _egosgm.open_folder(given.folder, frames)
    else:
        return _of_patterns(given)
    return Opened(sequence, sequence.calibration)


def open_without_calibration(given: argparse.Namespace) -> _egosgm.StereoSequence:
    return _egosgm.open_patterns(given.left, given.right, "", text_argument(given.frames or ""), given.pair_by == "order")


def _of_patterns(given: argparse.Namespace) -> Opened:
    if not given.calib:
        return Opened(open_without_calibration(given), None)
    try:
        if len(given.calib) == 1:
            frames = text_argument(given.frames or "")
            sequence = _egosgm.open_patterns(given.left, given.right, given.calib[0], frames, given.pair_by == "order")
            return Opened(sequence, sequence.calibration)
    except _egosgm._NegativeBaseline:
        raise
    except _egosgm.InvalidArgument:
        pass  # of another program, or the error is told below
    sequence = open_without_calibration(given)
    return Opened(sequence, calibrations.find(given.calib, size=sequence.size))


def _seconds(row: str) -> Optional[float]:
    """Of a number, or of a date and a time (KITTI raw)."""
    date = re.fullmatch(r"(\d+)-(\d+)-(\d+)[ T](\d+):(\d+):([\d.]+).*", row)
    try:
        if date is None:
            value = float(row)
            return value if math.isfinite(value) and "_" not in row else None
        year, month, day, hour, minute = (int(part) for part in date.groups()[:5])
        days = (datetime.date(year, month, day) - datetime.date(1970, 1, 1)).days
        return 86400.0 * days + 3600 * hour + 60 * minute + float(date[6])
    except ValueError:
        return None


def _times_of_names(sequence: _egosgm.StereoSequence) -> List[float]:
    """Names that are times: nanoseconds (EuRoC) or microseconds since 1970, or seconds with decimals (TUM)."""
    names = [frame.name for frame in sequence.frames]
    for pattern, second in ((r"1\d{18}", 1e9), (r"1\d{15}", 1e6), (r"1\d{9}\.\d+", 1.0)):
        if all(re.fullmatch(pattern, name) for name in names):
            first = names[0]
            return [(int(name) - int(first)) / second if second > 1 else float(name) - float(first) for name in names]
    return []


def frame_times(sequence: _egosgm.StereoSequence) -> Tuple[List[float], str]:
    """Seconds of the sequence's frames, and where they stand; none where nothing says when frames were taken. Throws InvalidArgument with the row."""
    file = os.fspath(sequence.times_file)
    if file in ("", "."):
        times = _times_of_names(sequence)
        return times, "names of the files" if times else ""
    rows = []
    for number, line in enumerate(_egosgm._read_file(file, _MOST_TIMES_BYTES).decode("utf-8-sig", errors="replace").splitlines(), 1):
        row = line.strip()
        if not row or row.startswith("#"):
            continue
        seconds = _seconds(row)
        if seconds is None:
            shown = "".join(c if " " <= c <= "~" else "?" for c in row[:40])
            raise _refuse(f"{file}:{number}: '{shown}' is no time: give seconds, or YYYY-MM-DD HH:MM:SS")
        rows.append(seconds)
    places: List[Any] = _egosgm._rows_of_frames([frame.number for frame in sequence.frames], sequence.numbers, len(rows), file, "times")
    return [rows[place] for place in places], file

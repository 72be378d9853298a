# SPDX-License-Identifier: Apache-2.0
"""Sequences as `egosgm run` takes them, opened by the same arguments: folders of all layouts, patterns, two pictures; and when their frames were taken."""
import argparse
import datetime
import math
import os
import pathlib
import re
from typing import Any, List, NamedTuple, Optional, Tuple

from . import _egosgm
from .arguments import text_argument
from .calibration.reader import Found, find

_MOST_TIMES_BYTES = 1 << 28


class Opened(NamedTuple):
    """A sequence, and its calibration, which may be of raw images; None where there is none."""

    sequence: _egosgm.StereoSequence
    calibration: Optional[Found]


def add_input(parser: argparse.ArgumentParser) -> None:
    """The arguments of `egosgm run`; here a calibration may be of two files, and of raw images."""
    add = parser.add_argument_group("input (one of)").add_argument
    for names, kind, text in _egosgm._input_options():
        for name in names:
            text = text.replace("%", "%%") if name == names[0] else argparse.SUPPRESS
            if name.startswith("--"):
                add(name, metavar=kind, nargs="+" if name == "--calib" else None, help=text)  # type: ignore[arg-type]
            else:
                add(name, nargs="?", help=text)


def words_of_input(given: argparse.Namespace) -> List[str]:
    """What was given of these arguments; a calibration is one word."""
    words = []
    for name in (name for names, _, _ in _egosgm._input_options() for name in names):
        value = getattr(given, name.lstrip("-").replace("-", "_"))
        text = " ".join(value) if isinstance(value, list) else value
        if text:
            words.append(f"{name}={text}" if name.startswith("--") else text)
    return words


def videos_of_input(given: argparse.Namespace) -> Optional[Tuple[str, str]]:
    """Two videos, or one of both views and an empty text, as `egosgm run` takes them; None where the input is another one. Throws InvalidArgument
    where more is given."""
    first = given.DATASET or given.dataset
    left, right = (first, given.RIGHT) if first else (given.left, given.right)
    if not left or not _egosgm._is_video(left):
        return None
    if len([word for word in words_of_input(given) if not word.startswith("--calib=")]) > 1 + bool(right):
        raise _egosgm.InvalidArgument(f"{left}: is a video, and an input of its own: give one input, and no --frames")
    return left, right or ""


def open_input(given: argparse.Namespace) -> Opened:
    """What the arguments of add_input name. Throws InvalidArgument, and _NegativeBaseline where that is what is wrong with the calibration."""
    found: List[Found] = []

    def read(_: pathlib.Path, size: Tuple[int, int]) -> Optional[_egosgm.Calibration]:
        found.append(find(given.calib, size=size))
        return found[0] if isinstance(found[0], _egosgm.Calibration) else None

    first = argparse.Namespace(**{**vars(given), "calib": given.calib[:1]}) if given.calib else given
    sequence = _egosgm._open_input([text_argument(word) for word in words_of_input(first)], read)
    if given.calib and not found and given.calib[1:]:  # the first is EgoSGM's own
        find(given.calib)
    return Opened(sequence, found[0] if found else sequence.calibration)


def open_without_calibration(given: argparse.Namespace) -> _egosgm.StereoSequence:
    return open_input(argparse.Namespace(**{**vars(given), "calib": None})).sequence


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
    """Names that are times: nanoseconds (EuRoC), microseconds or milliseconds since 1970, or seconds with decimals (TUM)."""
    names = [frame.name for frame in sequence.frames]
    for pattern, second in ((r"1\d{18}", 1e9), (r"1\d{15}", 1e6), (r"1\d{12}", 1e3), (r"1\d{9}\.\d+", 1.0)):
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
            raise _egosgm.InvalidArgument(f"{file}:{number}: '{shown}' is no time: give seconds, or YYYY-MM-DD HH:MM:SS")
        rows.append(seconds)
    places: List[Any] = _egosgm._rows_of_frames([frame.number for frame in sequence.frames], sequence.numbers, len(rows), file, "times")
    return [rows[place] for place in places], file

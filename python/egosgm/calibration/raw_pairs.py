# SPDX-License-Identifier: Apache-2.0
"""Left and right images of one moment, of files, side-by-side images, videos, lists or an EuRoC folder; colour as RGB."""
import argparse
import bisect
import dataclasses
import math
import os
import pathlib
import re
import struct
import time
from typing import Any, Callable, Dict, Iterator, List, Optional, Sequence, Tuple

from .. import _egosgm
from ..arguments import Parser, counted

os.environ.setdefault("OPENCV_LOG_LEVEL", "SILENT")  # what OpenCV would say of a broken file stands in our message
os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")
import cv2
import numpy as np

_FOREIGN = (".bmp", ".tif", ".tiff", ".pgm", ".ppm", ".webp")  # that only OpenCV reads
_MOST_SKEW_NS = 2_000_000  # of cameras that are triggered together
_MOST_LIST_BYTES = 1 << 28
_MOST_PICTURE_BYTES = 1 << 28
_MOST_HEIGHT = 2  # of a view, in its widths
_MOST_OTHER_RATE = 1.02  # of the rates of two cameras, which some videos only estimate
_LEAST_OF_VIDEO = 0.9  # of the images that it says it has, which many videos only estimate


@dataclasses.dataclass
class RawPair:
    left: Any
    right: Any
    time_s: Optional[float] = None


def _refuse(text: str) -> _egosgm.InvalidArgument:
    return _egosgm.InvalidArgument(text)


def _expect_file(file: str) -> None:
    """For OpenCV, which would wait for a pipe without an end, and crash on a name that is no text."""
    if "://" in file:
        raise _refuse(f"{file}: is an address, and nothing here uses the network: in Python, egosgm.run takes pairs, as cv2.VideoCapture gives them")
    if not os.path.exists(file):
        raise _refuse(f"{file}: no such file")
    if not os.path.isfile(file):
        raise _refuse(f"{file}: is no file; give an image or a video")
    if any("\udc80" <= letter <= "\udcff" for letter in file):
        raise _refuse(f"{file}: its name is no UTF-8, which OpenCV needs to read it: rename it, or give a link to it")


def _read_image(file: pathlib.Path) -> Any:
    if file.suffix.lower() not in _FOREIGN:
        return _egosgm._read_stored_image(file)
    _expect_file(os.fspath(file))
    _, pages = cv2.imreadmulti(os.fspath(file), flags=cv2.IMREAD_ANYDEPTH | cv2.IMREAD_ANYCOLOR)
    count = sum(page.shape == pages[0].shape for page in pages)  # another one is a thumbnail
    if count > 1:
        raise _refuse(f"{file}: holds {count} pictures: save each in a file of its own, as ImageMagick's `convert FILE %06d.png` does")
    image = pages[0] if pages else None
    if image is None or image.dtype.name not in ("uint8", "uint16"):
        raise _refuse(f"{file}: cannot be read as an image of 8 or 16 bits" + ("" if image is None else f", as its pixels are {image.dtype}: save them as whole numbers"))
    return image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB)


def _read_mpo(file: pathlib.Path) -> Any:
    """Both pictures of a 3D camera's file, which are two JPEG one behind the other, side by side."""
    content = _egosgm._read_file(file, _MOST_PICTURE_BYTES)
    end = _end_of_jpeg(content)
    parts = content[:end], content[max(end, content.find(b"\xff\xd8\xff", end)):]
    images = [cv2.imdecode(np.frombuffer(part, np.uint8), cv2.IMREAD_ANYCOLOR | cv2.IMREAD_IGNORE_ORIENTATION) if part else None for part in parts]
    if any(image is None for image in images):
        raise _refuse(f"{file}: does not hold two pictures, left and right, as an MPO does")
    left, right = (image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB) for image in images)
    pair = _same_size(RawPair(left, right), f"{file}")
    return np.hstack([pair.left, pair.right])


def _end_of_jpeg(content: bytes) -> int:
    """Behind the end of the first picture: a small one may lie within its header, whose parts have lengths."""
    at = 2
    while content[at:at + 1] == b"\xff" and content[at + 1:at + 2] != b"\xda":
        at += 2 + int.from_bytes(content[at + 2:at + 4], "big")
    end = content.find(b"\xff\xd9", at)  # what is compressed holds no such marker
    return end + 2 if end >= 0 else len(content)


def _names_files(pattern: str) -> bool:
    """Whether it names images, by a pattern or an image's extension; else it is a video."""
    path = pathlib.Path(pattern)
    return any(mark in path.name for mark in "*%") or path.suffix.lower() in (".png", ".jpg", ".jpeg", ".mpo", *_FOREIGN)


class _Source:
    """Images of one camera, with the seconds since the first one where they are known. count: None where it is not known."""

    note = ""
    count: Optional[int] = None
    rate_hz = 0.0  # of a video that says it

    def grab(self) -> None:
        """Of a camera, takes the next image, which is decoded later: the other camera's is taken before."""


class _Files(_Source):
    def __init__(self, pattern: str) -> None:
        self._files = _egosgm._find_images(pattern)
        self.count = len(self._files)
        if not self._files:
            raise _refuse(f"{pattern}: no file matches")

    def __iter__(self) -> Iterator[Tuple[Any, Optional[float]]]:
        return (((_read_mpo if file.suffix.lower() == ".mpo" else _read_image)(file), None) for file in self._files)


def _is_bottom_up(file: str) -> bool:
    """Whether it is an AVI of pixels that are not compressed, the last row first."""
    with open(file, "rb") as stream:
        start = stream.read(4096)
    at = start.find(b"strf") + 8  # a BITMAPINFOHEADER
    if not start.startswith(b"RIFF") or at < 8 or len(start) < at + 20:
        return False
    height, compression = struct.unpack("<8xi4xI", start[at:at + 20])
    return height > 0 and compression == 0


class _Video(_Source):
    def __init__(self, file: str) -> None:
        _expect_file(file)
        if int(cv2.__version__.split(".")[0]) >= 5 and _is_bottom_up(file):  # its FFmpeg writes beyond such a picture's end
            raise _refuse(f"{file}: is an AVI of pixels that are not compressed, the last row first, on which OpenCV {cv2.__version__} would crash: "
                          f"`ffmpeg -i {file} -c:v ffv1 {pathlib.Path(file).stem}.mkv` makes one that loses nothing, and opencv-python-headless<5 reads this one")
        kind = "" if _egosgm._is_video(file) else _egosgm._foreign_kind(file)
        if kind:  # some of which OpenCV opens as videos, and converts without a word
            raise _refuse(f"{file}: {kind}")
        self._file = file
        # By FFmpeg alone where OpenCV has it: other readers, which it would try next, print.
        has_ffmpeg = cv2.CAP_FFMPEG in cv2.videoio_registry.getStreamBackends()
        self._video = cv2.VideoCapture(file, cv2.CAP_FFMPEG if has_ffmpeg else cv2.CAP_ANY)
        if not self._video.isOpened():
            raise _refuse(f"{file}: " + ("begins as a video, and OpenCV cannot read it: is it damaged or cut, or is its codec unknown here?" if _egosgm._is_video(file) else
                                         "neither an image nor a video that OpenCV can read"))
        count = int(self._video.get(cv2.CAP_PROP_FRAME_COUNT))
        self.count = count if count >= 0 else None
        self.rate_hz = self._video.get(cv2.CAP_PROP_FPS)

    def __iter__(self) -> Iterator[Tuple[Any, Optional[float]]]:
        number = 0
        while True:
            rate = self._video.get(cv2.CAP_PROP_FPS)
            is_there, image = self._video.read()
            if not is_there:
                break
            yield image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB), number / rate if rate > 0 else None
            number += 1
        if self.count and number < _LEAST_OF_VIDEO * self.count:
            self.note = f"{self._file} has {self.count} images, and only the first {number} can be read: is it cut or damaged?"


def _device(source: str) -> str:
    """The device that a camera's number or link names."""
    return f"/dev/video{int(source)}" if re.fullmatch(r"[0-9]{1,3}", source) else os.path.realpath(source)


def is_camera(source: str) -> bool:
    """A number or a device: no video, which would keep its own time."""
    return bool(re.match(r"/dev/(video[0-9]|v4l/)", _device(source))) and not os.path.isfile(source)


class _Camera(_Source):
    def __init__(self, name: str) -> None:
        self._name = name
        self._begin_s: Optional[float] = None
        self._is_there: Optional[bool] = None  # None: the next image is to be grabbed
        number = re.fullmatch(r"/dev/video([0-9]{1,3})", _device(name))
        camera = cv2.VideoCapture(int(number[1])) if number else None
        if not (camera and camera.isOpened()):
            raise _refuse(f"{name}: no camera that OpenCV can open: is it there, free, and may you read it? `ls -l /dev/video* /dev/v4l/by-id` tells")
        self._camera = camera

    def grab(self) -> None:
        self._is_there = self._camera.grab()
        self._time_s = time.monotonic()

    def __iter__(self) -> Iterator[Tuple[Any, Optional[float]]]:
        try:
            while True:
                if self._is_there is None:
                    self.grab()
                is_there, image = self._camera.retrieve() if self._is_there else (False, None)
                if not is_there:
                    break
                self._is_there, self._begin_s = None, self._time_s if self._begin_s is None else self._begin_s
                yield image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2RGB), self._time_s - self._begin_s
            self.note = f"{self._name} gives no more images: was it unplugged?"
        finally:
            self._camera.release()


def _open(source: str) -> _Source:
    return (_Camera if is_camera(source) else _Files if _names_files(source) else _Video)(source)


def _same_size(pair: RawPair, what: str) -> RawPair:
    left, right = pair.left, pair.right
    if left.shape[:2] != right.shape[:2] or left.dtype != right.dtype:
        sizes = [f"{image.shape[1]}x{image.shape[0]} of {8 * image.itemsize} bits" for image in (left, right)]
        raise _refuse(f"{what}: the left image is {sizes[0]}, the right one {sizes[1]}: both need one size and depth")
    return pair


class RawPairs:
    """Iterate over it once. count: None where a video does not say. note: what was left out; known in full at the end."""

    count: Optional[int] = None
    note = ""

    def __iter__(self) -> Iterator[RawPair]:
        raise NotImplementedError


class _TwoSources(RawPairs):
    def __init__(self, left: str, right: str) -> None:
        if _device(left) == _device(right) or (os.path.exists(left) and os.path.exists(right) and os.path.samefile(left, right)):
            raise _refuse(f"--left {left} --right {right}: are one {'camera' if is_camera(left) else 'file'}: give one of each camera, or --side-by-side or --top-bottom where it holds both views")
        self._names = f"--left {left}", f"--right {right}"
        self._sources = _open(left), _open(right)
        counts = [source.count for source in self._sources]
        if None not in counts and counts[0] != counts[1]:
            raise _refuse(f"--left {left} has {counts[0]} images, --right {right} has {counts[1]}: give as many of both, cut where they show other moments; `ffmpeg -i VIDEO -frames:v N -c:v ffv1 VIDEO.mkv` keeps the first N")
        self.count = counts[0]
        rates = [source.rate_hz for source in self._sources]
        if min(rates) > 0 and max(rates) > _MOST_OTHER_RATE * min(rates):
            self.note = (f"{left} says that it has {rates[0]:g} images a second, {right} {rates[1]:g}: if so, pairs are of other moments; "
                         f"`ffmpeg -i VIDEO -vf fps={min(rates):g} -c:v ffv1 VIDEO.mkv` makes one of another rate")

    def __iter__(self) -> Iterator[RawPair]:
        images_of, pairs = [iter(source) for source in self._sources], 0
        while True:
            for source in self._sources:
                source.grab()
            left, right = (next(images, None) for images in images_of)
            if left is None or right is None:
                break
            yield _same_size(RawPair(left[0], right[0], left[1]), self._names[0][7:])
            pairs += 1
        notes = [note for note in (self.note, *(source.note for source in self._sources)) if note]
        if left is not None or right is not None:
            ended, longer = self._names if left is None else self._names[::-1]
            notes.append(f"{ended} ends after {counted(pairs, 'image')}, before {longer}: the rest of that one is left out")
        self.note = "; ".join(notes)


class _Halves(RawPairs):
    """Images with the left view in the left half, or in the upper one."""

    def __init__(self, option: str, pattern: str) -> None:
        self._what, self._is_wide, self._images = f"{option} {pattern}", option == "--side-by-side", _open(pattern)
        self.count = self._images.count

    def __iter__(self) -> Iterator[RawPair]:
        for both, time_s in self._images:
            size = both.shape[self._is_wide]
            if size % 2:
                raise _refuse(f"{self._what}: the images are {size} px {'wide' if self._is_wide else 'high'}, which has no half")
            if both.shape[0] > _MOST_HEIGHT * size // 2 and self._is_wide:
                self.note = f"a half is {size // 2} px wide and {both.shape[0]} high: does one view lie above the other? --top-bottom takes such images"
            halves = np.split(both, 2, axis=int(self._is_wide))
            yield RawPair(halves[0], halves[1], time_s)
        self.note = self._images.note or self.note


class _Listed(RawPairs):
    def __init__(self, pairs: Sequence[Tuple[pathlib.Path, pathlib.Path, Optional[float]]], note: str = "") -> None:
        self._pairs, self.count, self.note = pairs, len(pairs), note

    def __iter__(self) -> Iterator[RawPair]:
        return (_same_size(RawPair(_read_image(left), _read_image(right), time_s), str(right)) for left, right, time_s in self._pairs)


def _of_patterns(left: str, right: str, by_order: bool) -> RawPairs:
    """Files of equal names; those without a partner are left out, with a note."""
    pairs, alone = _egosgm._find_pairs(left, right, by_order)
    for suffix in _FOREIGN if "." not in left.rpartition("/")[2] + right.rpartition("/")[2] else ():
        if not pairs:
            pairs, alone = _egosgm._find_pairs(left + suffix, right + suffix, by_order)
    if not pairs:
        raise _refuse(f"--left {left} --right {right}: no file matches both")
    if len(alone) > 2 * len(pairs):
        raise _refuse(f"--left {left} --right {right}: only {counted(len(pairs), 'pair')} of equal names, {counted(len(alone), 'image')} without, "
                      f"{alone[0]} say: give --pair-by order where order tells, or other patterns")
    note = f"{counted(len(alone), 'image')} without the other camera's left out, the first is {alone[0]}" if alone else ""
    return _Listed([(*pair, None) for pair in pairs], note)


def _rows(file: pathlib.Path) -> List[str]:
    return _egosgm._read_file(file, _MOST_LIST_BYTES).decode("utf-8-sig", errors="surrogateescape").splitlines()


def _of_list(file: pathlib.Path) -> RawPairs:
    """Rows LEFT RIGHT [SECONDS]; paths from the list's folder on."""
    pairs = []
    for number, row in enumerate(_rows(file), 1):
        words = re.split(r"(?:^|\s)#", row, maxsplit=1)[0].split()  # a comment begins after a blank
        if not words:
            continue
        is_time = len(words) < 3 or bool(re.fullmatch(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?", words[2]))
        if len(words) not in (2, 3) or not is_time or (len(words) == 3 and not math.isfinite(float(words[2]))):
            raise _refuse(f"{file}:{number}: give LEFT RIGHT or LEFT RIGHT SECONDS")
        if words[0] == words[1]:
            raise _refuse(f"{file}:{number}: {words[0]} is the left and the right image; give one of each camera")
        pairs.append((file.parent / words[0], file.parent / words[1], float(words[2]) if len(words) == 3 else None))
    if not pairs:
        raise _refuse(f"{file}: lists no pair")
    if len({pair[2] is None for pair in pairs}) > 1:
        raise _refuse(f"{file}: has SECONDS in some rows only: give them in all, or in none")
    return _Listed(pairs)


def _euroc_images(camera: pathlib.Path) -> Dict[int, pathlib.Path]:
    """Nanoseconds and files of a camera's data.csv."""
    file, images = camera / "data.csv", {}
    for number, row in enumerate(_rows(file), 1):
        time, _, name = (part.strip() for part in row.partition(","))
        is_header = not images and time and not time[0].isdigit()
        if not row.strip() or row.startswith("#") or is_header:
            continue
        if not name or not re.fullmatch(r"-?[0-9]{1,19}", time):
            raise _refuse(f'{file}:{number}: "{row}" is not TIME,FILE')
        images[int(time)] = camera / "data" / name
    return images


def _of_euroc(mav0: pathlib.Path) -> RawPairs:
    left, right = (_euroc_images(mav0 / name) for name in ("cam0", "cam1"))
    times = sorted(left), sorted(right)

    def nearest(stamps: List[int], time_ns: int) -> int:
        at = bisect.bisect_left(stamps, time_ns)
        return min(stamps[max(at - 1, 0):at + 1], key=lambda stamp: abs(stamp - time_ns))

    pairs, largest_ns, nearest_ns = [], 0, None
    for time_ns in times[0] if right else []:
        other = nearest(times[1], time_ns)
        if nearest(times[0], other) != time_ns:
            continue
        apart_ns = abs(other - time_ns)
        if apart_ns > _MOST_SKEW_NS:
            nearest_ns = min(apart_ns, nearest_ns or apart_ns)
            continue
        largest_ns = max(largest_ns, apart_ns)
        pairs.append((left[time_ns], right[other], 1e-9 * (time_ns - times[0][0])))
    if not pairs:
        raise _refuse(f"{mav0}: cam0 and cam1 have no time stamp in common" + (
            f"; the nearest are {1e-6 * nearest_ns:.3f} ms apart, at most {_MOST_SKEW_NS // 1_000_000} ms are paired: --left, --right and --pair-by "
            "order pair the images as they come" if nearest_ns else ""))
    alone = len(left) + len(right) - 2 * len(pairs)
    notes = [f"{counted(alone, 'image')} without the other one left out"] if alone else []
    if largest_ns:
        notes.append(f"stamps of a pair differ by up to {1e-6 * largest_ns:.3f} ms")
    return _Listed(pairs, "; ".join(notes))


def open_pairs(left: Optional[str], right: Optional[str], side_by_side: Optional[str], top_bottom: Optional[str], list_: Optional[str], euroc: Optional[str],
               by_order: bool) -> RawPairs:
    """Throws InvalidArgument unless exactly one input was named."""
    two = bool(left or right)
    sources = two + bool(side_by_side) + bool(top_bottom) + bool(list_) + bool(euroc)
    if sources != 1 or (two and not (left and right)):
        what = "no input" if sources == 0 else "more than one input" if sources > 1 else "half a pair"
        raise _refuse(f"{what}: give --left and --right, or --side-by-side, or --top-bottom, or --list, or --euroc")
    if left and right:
        return _of_patterns(left, right, by_order) if _names_files(left) and _names_files(right) else _TwoSources(left, right)
    for option, pattern in (("--side-by-side", side_by_side), ("--top-bottom", top_bottom)):
        if pattern:
            return _Halves(option, pattern)
    return _of_list(pathlib.Path(list_)) if list_ else _of_euroc(pathlib.Path(euroc or ""))


def add_pairs(parser: Parser) -> Callable[..., Any]:
    """Adds the options of a command that name raw pairs. Returns what adds more of them."""
    add = parser.add_argument_group("input (one of)").add_argument
    add("--left", metavar="PATTERN", help="left images: a file, a pattern such as 'left/*.jpg' or 'left/%%06d.png', or a video")
    add("--right", metavar="PATTERN", help="right images, likewise")
    add("--pair-by", default="name", metavar="name|order", help="what tells which --left and --right images belong together: equal texts in their names "
        "(what * or %%d stands for), or their order")
    add("--side-by-side", metavar="PATTERN", help="images or a video with the left view in the left half and the right one in the right half")
    add("--top-bottom", metavar="PATTERN", help="images or a video with the left view in the upper half and the right one in the lower half")
    return add


def pairs_of(given: argparse.Namespace) -> RawPairs:
    """The pairs that these options name."""
    if given.pair_by not in ("name", "order"):
        raise _refuse(f"--pair-by {given.pair_by}: choose name or order")
    return open_pairs(given.left, given.right, given.side_by_side, given.top_bottom, getattr(given, "list", None), getattr(given, "euroc", None),
                      given.pair_by == "order")

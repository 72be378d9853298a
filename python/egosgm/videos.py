# SPDX-License-Identifier: Apache-2.0
"""Videos as `egosgm run` and run() read them: one of each camera, or one of both views side by side."""
import pathlib
import shlex
import types
from typing import Any, Iterator, List, Tuple

from . import _egosgm
from .calibration.reader import any_calibration

_LEAST_OF_TWO_VIEWS = 2.5  # width to height of an image that holds both side by side: less may be one camera's


class VideoSource:
    """Two videos, or one of both views side by side, as the run reads them (vision/frame_source.h)."""

    width: int
    height: int
    poses, has_lost_images = "", False

    def __init__(self, left: str, right: str, calib: str) -> None:
        try:
            from .calibration.raw_pairs import RawPair, open_pairs
            from .calibration.rectify import Rectifier
        except ImportError as error:
            raise _egosgm.InvalidArgument(f"{left}: is a video, which OpenCV reads ({error}): pip install opencv-python-headless") from None
        self._name, self._number, self._has_more = left, 0, False
        self._pairs = open_pairs(left, right, None, None, None, None, False) if right else open_pairs(None, None, left, None, None, None, False)
        self._stream = iter(self._pairs)
        self._first: Any = next(self._stream, None)
        if self._first is None:
            raise _egosgm.InvalidArgument(f"{left}: no image of it can be read")
        self.height, self.width = self._first.left.shape[:2]
        if not right and 2 * self.width < _LEAST_OF_TWO_VIEWS * self.height:
            raise _egosgm.InvalidArgument(
                f"{left}: its images are {2 * self.width}x{self.height}, as of one camera: give LEFT and RIGHT; where they hold both views, "
                f"`egosgm rectify --side-by-side {shlex.quote(left)} --calib FILE --out SEQUENCE` (or --top-bottom) makes a sequence of it")
        if not self._pairs.count:
            raise _egosgm.InvalidArgument(f"{left}: does not say how many images it has: `egosgm rectify` makes a sequence of it")
        self.count: int = self._pairs.count
        self._rectifier = Rectifier([calib], (self.width, self.height)) if calib else None
        self.bits = 8 * self._first.left.itemsize
        if self._rectifier:
            self._rectifier(RawPair(self._first.left, self._first.right))  # a pair of its own: the first one is rectified when it is asked for
        self.has_calibration = self._rectifier is not None
        self.calibration = self._rectifier.calibration if self._rectifier else any_calibration(self.width, self.height)
        self.is_rectified_here = bool(self._rectifier and self._rectifier.rig)
        self.title = f"video {pathlib.Path(left).name}"
        self.note = "; ".join(["the left and the right half of an image are taken as the views"] * (not right) +
                              ["the images are rectified here"] * self.is_rectified_here)

    def next(self) -> Any:
        pair, self._first = self._first or next(self._stream, None), None
        if pair is None or self._number == self.count:
            self._has_more = pair is not None
            return None
        if self._rectifier:
            self._rectifier(pair)
        self._number += 1
        return types.SimpleNamespace(number=self._number - 1, left=pair.left, right=pair.right, starts_anew=False, stamp_ns=None, frame_id="", world_from_camera=None)

    def notes(self) -> List[str]:
        told = [self._pairs.note] if self._pairs.note else []
        if self._has_more:
            told.append(f"{self._name} has more than the {self.count} images that it says: `egosgm rectify` reads all")
        return told


class VideoPairs:
    """The pairs (left, right) of a VideoSource, as often as they are asked for."""

    def __init__(self, left: str, right: str, calib: str) -> None:
        self._given = left, right, calib
        self.source = VideoSource(*self._given)  # of the last iteration; the first one takes this
        self._is_fresh, self._count = True, self.source.count

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[Tuple[Any, Any]]:
        source = self.source if self._is_fresh else VideoSource(*self._given)
        self.source, self._is_fresh = source, False
        return ((pair.left, pair.right) for pair in iter(source.next, None))

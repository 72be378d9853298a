# SPDX-License-Identifier: Apache-2.0
"""run(): a drive in, a disparity map for each of its frames out."""
import dataclasses
import os
from typing import Any, Dict, Iterable, Iterator, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class DriveFrame:
    """A frame of a drive: images, maps and what happened."""

    number: int
    name: str
    left: NDArray[Any]
    right: NDArray[Any]
    maps: _egosgm.Frame
    odometry: Optional[_egosgm.OdometryResult]
    calibration: _egosgm.Calibration

    @property
    def disparity(self) -> Optional[NDArray[np.float32]]:
        """Pixels; INVALID_DISPARITY where there is none."""
        return self.maps.disparity

    @property
    def variance(self) -> Optional[NDArray[np.float32]]:
        """Of the disparity [px^2]."""
        return self.maps.variance

    @property
    def depth(self) -> NDArray[np.float32]:
        """Metres; NaN where there is no disparity."""
        depth = _egosgm.depth_from_disparity(self.disparity, self.calibration)
        return np.where(depth > 0, depth, np.float32(np.nan))

    @property
    def motion(self) -> Optional[_egosgm.Motion]:
        """From the frame before."""
        return self.odometry.motion if self.odometry else None

    @property
    def report(self) -> _egosgm.FrameReport:
        return self.maps.report

    def __repr__(self) -> str:
        height, width = self.left.shape
        return (f"<DriveFrame {self.name}: {width}x{height}, density {self.report.density:.1%}, "
                f"search {min(1, self.report.search_fraction):.1%}>")


class Drive:
    """What run() gives: iterate over it, as often as you like."""

    def __init__(self, source: Union[str, "os.PathLike[str]", _egosgm.StereoSequence, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
                 calibration: Optional[_egosgm.Calibration] = None, *, frames: str = "", motion: bool = True,
                 outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None,
                 progress: Optional[bool] = None, **options: Any) -> None:
        if isinstance(source, (str, os.PathLike)):
            source = _egosgm.open_folder(source, frames)
        elif frames:
            raise _egosgm.InvalidArgument(f"frames={frames!r}: only a folder's are chosen here")
        self.sequence = source if isinstance(source, _egosgm.StereoSequence) else None
        if calibration is None:
            if self.sequence is None:
                raise _egosgm.InvalidArgument("calibration: pairs of images come without one, give it")
            calibration = self.sequence.calibration
        if not isinstance(calibration, _egosgm.Calibration):
            raise _egosgm.InvalidArgument(f"calibration: is a {type(calibration).__name__}: give an egosgm.Calibration; read_calibration reads a file")
        self.calibration = calibration
        self._source, self._outputs, self._options = source, outputs, options
        self._bar = _bar(progress)
        self._odometry = _egosgm.StereoOdometry(calibration, **(odometry or {})) if motion else None
        self._pipeline = _egosgm.Pipeline(calibration, *self.sequence.size, **options) if self.sequence is not None else None

    def __len__(self) -> int:
        return len(self._source)

    def __repr__(self) -> str:
        name = self.sequence.title if self.sequence is not None else "pairs of images"
        count = f", {len(self)} frames" if hasattr(self._source, "__len__") else ""
        return f"<Drive {name}{count}{'' if self._odometry else ', no motion'}>"

    def __iter__(self) -> Iterator[DriveFrame]:
        return iter(self._bar(self._frames(), len(self) if hasattr(self._source, "__len__") else None))

    def _pairs(self) -> Iterator[Tuple[int, str, NDArray[Any], NDArray[Any]]]:
        if self.sequence is not None:
            for frame in self.sequence.frames:
                yield (frame.number, frame.name, *frame.read())
        else:
            for number, pair in enumerate(self._source):
                if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                    raise _egosgm.InvalidArgument(f"pair {number}: is a {type(pair).__name__}: give (left, right), each an image")
                yield (number, f"{number:06d}", *pair)

    def _frames(self) -> Iterator[DriveFrame]:
        """The device matches a frame while the next one is read and its motion is found."""
        if self._odometry:
            self._odometry.reset()
        if self._pipeline:
            self._pipeline.reset()
        under_way = None
        for number, name, left, right in self._pairs():
            found = self._odometry.process(left, right) if self._odometry else None
            if self._pipeline is None:
                height, width = np.shape(left)[:2]
                self._pipeline = _egosgm.Pipeline(self.calibration, width, height, **self._options)
            self._pipeline.submit(left, right, found.motion if found else None, self._outputs)
            if under_way:
                yield self._collected(*under_way)
            under_way = number, name, left, right, found
        if under_way:
            yield self._collected(*under_way)

    def _collected(self, number: int, name: str, left: NDArray[Any], right: NDArray[Any],
                   found: Optional[_egosgm.OdometryResult]) -> DriveFrame:
        return DriveFrame(number, name, left, right, self._pipeline.collect(), found, self.calibration)


def _bar(progress: Optional[bool]):
    """What shows how far a loop is, (frames, count) -> frames. None: where tqdm is there and somebody looks."""
    try:
        from tqdm.auto import tqdm
    except ImportError:
        if progress:
            raise _egosgm.InvalidArgument("progress=True needs tqdm: pip install tqdm") from None
        progress = False
    if progress is False:
        return lambda frames, count: frames
    return lambda frames, count: tqdm(frames, total=count, unit=" frames", disable=False if progress else None)


def run(source: Union[str, "os.PathLike[str]", _egosgm.StereoSequence, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
        calibration: Optional[_egosgm.Calibration] = None, *, frames: str = "", motion: bool = True,
        outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None,
        progress: Optional[bool] = None, **options: Any) -> Drive:
    """Disparity and variance for each frame of a drive:

        for frame in egosgm.run("drive/"):
            print(frame, frame.disparity, frame.depth)

    source: a folder as open_folder takes it, a StereoSequence, or pairs of rectified images, which need `calibration`.
    frames: "7:10" of a folder. motion=False: no odometry, so nothing is predicted. outputs: names of maps, found in
    `frame.maps`. odometry: options of StereoOdometry. progress: a bar by tqdm; None: where somebody looks.
    All else is for Pipeline: device, preset and its options.
    """
    return Drive(source, calibration, frames=frames, motion=motion, outputs=outputs, odometry=odometry, progress=progress, **options)

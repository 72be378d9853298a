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
        self._odometry_options = (odometry or {}) if motion else None
        self._begun = False
        # What an iteration has of its own, ready for the next one. Made now where the size is known: what is wrong is said at once.
        self._spare = [self._tools(*(self.sequence.size if self.sequence is not None else ()))]

    def __len__(self) -> int:
        return len(self._source)

    def __repr__(self) -> str:
        name = self.sequence.title if self.sequence is not None else "pairs of images"
        count = f", {len(self)} frames" if hasattr(self._source, "__len__") else ""
        return f"<Drive {name}{count}{', no motion' if self._odometry_options is None else ''}>"

    def __iter__(self) -> Iterator[DriveFrame]:
        if self._begun and hasattr(self._source, "__next__"):
            raise _egosgm.InvalidArgument("the pairs come from an iterator, which gives them once: give a list, or make a drive of a new iterator")
        self._begun = True
        return iter(self._bar(self._frames(), len(self) if hasattr(self._source, "__len__") else None))

    def _pairs(self) -> Iterator[Tuple[int, str, NDArray[Any], NDArray[Any]]]:
        if self.sequence is not None:
            for frame in self.sequence.frames:
                yield (frame.number, frame.name, *frame.read())
        else:
            for number, pair in enumerate(self._source):
                if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                    raise _egosgm.InvalidArgument(f"pair {number}: is a {type(pair).__name__}: give (left, right), each an image")
                # Copies: a camera may use its buffers again before the frame is handed out.
                yield (number, f"{number:06d}", *(np.array(image) for image in pair))

    def _tools(self, width: int = 0, height: int = 0) -> Tuple[Optional[_egosgm.StereoOdometry], Optional[_egosgm.Pipeline]]:
        odometry = None if self._odometry_options is None else _egosgm.StereoOdometry(self.calibration, **self._odometry_options)
        return odometry, _egosgm.Pipeline(self.calibration, width, height, **self._options) if width else None

    def _frames(self) -> Iterator[DriveFrame]:
        """The device matches a frame while the next one is read and its motion is found. Iterations share nothing, so that each may end
        where it likes, and two may run at once."""
        odometry, pipeline = self._spare.pop() if self._spare else self._tools(*(self.sequence.size if self.sequence is not None else ()))
        pairs, under_way, failure = self._pairs(), None, None
        try:
            while True:
                next_one = None
                try:
                    for number, name, left, right in pairs:
                        found = odometry.process(left, right) if odometry else None
                        if pipeline is None:
                            pipeline = _egosgm.Pipeline(self.calibration, *np.shape(left)[1::-1], **self._options)
                        pipeline.submit(left, right, found.motion if found else None, self._outputs)
                        next_one = number, name, left, right, found
                        break
                except Exception as error:  # what is under way does not suffer from a next frame that is none
                    failure = error
                if under_way and (failure is None or pipeline.under_way):
                    number, name, left, right, found = under_way
                    yield DriveFrame(number, name, left, right, pipeline.collect(), found, self.calibration)
                if failure:
                    raise failure
                under_way = next_one
                if under_way is None:
                    return
        finally:
            while pipeline and pipeline.under_way:
                pipeline.collect()
            for tool in (odometry, pipeline):
                if tool:
                    tool.reset()
            self._spare = [(odometry, pipeline)]


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

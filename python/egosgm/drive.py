# SPDX-License-Identifier: Apache-2.0
"""run(): a drive in, a disparity map for each of its frames out."""
import contextlib
import dataclasses
import os
import warnings
from typing import Any, Dict, Iterable, Iterator, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm
from .bag import Bag
from .calibrations import read_calibration
from .depth import depth_sigma_from_disparity
from .rectification import StereoRig


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class DriveFrame:
    """A frame of a drive: images, maps and what happened."""

    number: int
    name: str
    left: NDArray[Any]
    right: NDArray[Any]
    maps: _egosgm.Frame
    odometry: Optional[_egosgm.OdometryResult]
    motion: Optional[_egosgm.Motion]  # from the frame before
    calibration: Optional[_egosgm.Calibration]

    @property
    def disparity(self) -> Optional[NDArray[np.float32]]:
        """x_left - x_right [px]; INVALID_DISPARITY where there is none."""
        return self.maps.disparity

    @property
    def variance(self) -> Optional[NDArray[np.float32]]:
        """Of the disparity [px^2]; 0 where there is none."""
        return self.maps.variance

    def _of_depth(self, *needed: str) -> Tuple[Any, ...]:
        """The maps that depth comes from, and the calibration."""
        if self.calibration is None:
            raise _egosgm.InvalidArgument("depth: a disparity is none without a calibration: give it to run()")
        for name in needed:
            if getattr(self.maps, name) is None:
                raise _egosgm.InvalidArgument(f'depth: needs the {name}: name it too, outputs=("disparity", "variance")')
        return (*(getattr(self.maps, name) for name in needed), self.calibration)

    @property
    def depth(self) -> NDArray[np.float32]:
        """Along the left camera's axis [m]; NaN where there is none."""
        return _egosgm.depth_from_disparity(*self._of_depth("disparity"))

    @property
    def depth_sigma(self) -> NDArray[np.float32]:
        """Standard deviation of `depth` [m]; NaN where there is none."""
        return depth_sigma_from_disparity(*self._of_depth("disparity", "variance"))

    @property
    def report(self) -> _egosgm.FrameReport:
        return self.maps.report

    def __repr__(self) -> str:
        height, width = self.left.shape[:2]
        return (f"<DriveFrame {self.name}: {width}x{height}, density {self.report.density:.1%}, "
                f"search {min(1, self.report.search_fraction):.1%}>")


class Drive:
    """What run() gives: iterate over it, as often as you like."""

    def __init__(self, source: Union[str, "os.PathLike[str]", _egosgm.StereoSequence, Bag, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
                 calibration: "_egosgm.Calibration | str | os.PathLike[str] | None" = None, *, frames: str = "", motion: bool = True,
                 outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None,
                 progress: Optional[bool] = None, **options: Any) -> None:
        if isinstance(source, (str, os.PathLike)):
            source = _egosgm.open_folder(source, frames)
        elif frames:
            raise _egosgm.InvalidArgument(f"frames={frames!r}: only a folder's are chosen here")
        if not isinstance(motion, (int, np.bool_)):
            raise _egosgm.InvalidArgument(f"motion: is a {type(motion).__name__}: choose True or False; Pipeline.process takes motions that are known")
        self.sequence = source if isinstance(source, _egosgm.StereoSequence) else None
        if calibration is None and self.sequence is not None:
            _egosgm._expect_calibrated(self.sequence)
            calibration = self.sequence.calibration
        if isinstance(source, Bag):
            if calibration is not None:
                raise _egosgm.InvalidArgument("calibration: a bag has its own: give it to the Bag, as calib")
            calibration = source.find_cameras().calibration
        self._calibration_file: "str | os.PathLike[str]" = ""
        if isinstance(calibration, (str, os.PathLike)):
            self._calibration_file = calibration if self.sequence is None else ""
            calibration = read_calibration(calibration, size=self.sequence.size if self.sequence is not None else None)
        if isinstance(calibration, StereoRig):
            raise _egosgm.InvalidArgument("calibration: is of raw images: rectify them first (egosgm.Rectification, egosgm rectify)")
        if calibration is not None and not isinstance(calibration, _egosgm.Calibration):
            raise _egosgm.InvalidArgument(f"calibration: is a {type(calibration).__name__}: give an egosgm.Calibration; read_calibration reads a file")
        self.calibration = calibration
        self._source, self._outputs, self._options = source, outputs, options
        self._bar = _bar(progress)
        self._odometry_options = (odometry or {}) if motion and calibration is not None else None
        if odometry and self._odometry_options is None:
            raise _egosgm.InvalidArgument("odometry: has options, but without a calibration, or with motion=False, there is none: leave them out")
        self._begun = False
        # What an iteration has of its own, ready for the next one. Made now where the size is known: what is wrong is said at once.
        self._motions()
        self._spare = [self._pipeline(*self.sequence.size)] if self.sequence is not None else []

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

    def _pairs(self) -> Iterator[Tuple[Any, ...]]:
        """Number, name, images, the camera's pose where it is known, and whether what was before says nothing of this frame."""
        if self.sequence is not None:
            left_out = 0
            for frame in self.sequence.frames:
                try:
                    images = frame.read()
                except _egosgm.Error as error:  # a pair that cannot be read costs itself alone
                    left_out += 1
                    if 2 * left_out > len(self):
                        raise
                    warnings.warn(f"frame {frame.name}: left out: {error}", UserWarning, stacklevel=5)
                    continue
                yield (frame.number, frame.name, *images, None, False)
        elif isinstance(self._source, Bag):
            for frame in self._source.frames():
                pose = frame.world_from_camera if self._odometry_options is not None else None
                yield frame.number, f"{frame.number:06d}", frame.left, frame.right, pose, frame.starts_anew and frame.number > 0
        else:
            first: Tuple[int, ...] = ()
            for number, pair in enumerate(self._source):
                if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                    raise _egosgm.InvalidArgument(f"pair {number}: is a {type(pair).__name__}: give (left, right), each an image")
                left, right = (np.array(image) for image in pair)  # copies: a camera may use its buffers again before the frame is handed out
                if not first and left.ndim >= 2 and os.path.isfile(self._calibration_file):
                    read_calibration(self._calibration_file, size=left.shape[1::-1])  # refused where it is of another size
                first = first or left.shape[:2]
                if left.shape[:2] != first:
                    raise _egosgm.InvalidArgument(f"pair {number}: its left image is of the shape {left.shape}, and the first one's began with {first}: "
                                                  "all need one size")
                yield number, f"{number:06d}", left, right, None, False

    def _motions(self) -> _egosgm._MotionSource:
        return _egosgm._MotionSource(None if self._odometry_options is None else self.calibration, **(self._odometry_options or {}))

    def _pipeline(self, width: int, height: int) -> _egosgm.Pipeline:
        """Without a calibration, nothing is predicted: any one does."""
        calibration = self.calibration or _egosgm.Calibration(width, width, width / 2, height / 2, 1)
        return _egosgm.Pipeline(calibration, width, height, **self._options)

    def _tell(self, *doubts: str) -> None:
        text = "; ".join(filter(None, doubts))
        if text:
            warnings.warn(f"{text}: `egosgm doctor` tells why", UserWarning, stacklevel=4)

    def _frames(self) -> Iterator[DriveFrame]:
        """The device matches a frame while the next one is read and its motion is found. Iterations share nothing, so that each may end
        where it likes, and two may run at once."""
        motions, pipeline = self._motions(), None
        with contextlib.suppress(IndexError):  # none is left, or another thread was quicker
            pipeline = self._spare.pop()
        pairs, under_way, failure, doubt = self._pairs(), None, None, None
        try:
            while True:
                next_one = None
                try:
                    for number, name, left, right, pose, starts_anew in pairs:
                        found = motions.next(left, right, pose, starts_anew)
                        if pipeline is None:
                            pipeline = self._pipeline(*np.shape(left)[1::-1])
                        next_one = number, name, left, right, found
                        if not starts_anew:
                            pipeline.submit(left, right, found.motion, self._outputs)
                        break
                except Exception as error:  # what is under way does not suffer from a next frame that is none
                    failure = error
                if under_way and (failure is None or pipeline.under_way):
                    number, name, left, right, found = under_way
                    maps = pipeline.collect()
                    if doubt is None:
                        options = pipeline.options
                        doubt = _egosgm._Doubt(self.calibration, options["min_disparity"], options["disparities"])
                    doubt.add(left, right, maps.report, found.motion is not None or self._odometry_options is None)
                    odometry = None if self._odometry_options is None else found.odometry
                    yield DriveFrame(number, name, left, right, maps, odometry, found.motion, self.calibration)
                if failure:
                    raise failure
                under_way = next_one
                if under_way is None:
                    self._tell(doubt.text() if doubt else "", motions.doubt(), self._source.gaps.text() if isinstance(self._source, Bag) else "")
                    return
                if starts_anew:
                    pipeline.reset()
                    pipeline.submit(left, right, under_way[4].motion, self._outputs)
        finally:
            while pipeline and pipeline.under_way:
                pipeline.collect()
            if pipeline:
                pipeline.reset()
                self._spare = [pipeline]


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


def run(source: Union[str, "os.PathLike[str]", _egosgm.StereoSequence, Bag, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
        calibration: "_egosgm.Calibration | str | os.PathLike[str] | None" = None, *, frames: str = "", motion: bool = True,
        outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None,
        progress: Optional[bool] = None, **options: Any) -> Drive:
    """Disparity and variance for each frame of a drive:

        for frame in egosgm.run("drive/"):
            print(frame, frame.disparity, frame.depth, frame.depth_sigma)

    source: a folder as open_folder takes it, a StereoSequence, an egosgm.bag.Bag, or pairs of rectified images, grey or colour (RGB).
    calibration: a Calibration, or a file as read_calibration takes it; without any there are disparities, but no depth and
    no odometry.
    frames: "7:10" of a folder. motion=False: no odometry, so nothing is predicted. outputs: names of maps, found in
    `frame.maps`. odometry: options of StereoOdometry. progress: a bar by tqdm; None: where somebody looks.
    All else is for Pipeline: device, preset and its options.
    """
    return Drive(source, calibration, frames=frames, motion=motion, outputs=outputs, odometry=odometry, progress=progress, **options)

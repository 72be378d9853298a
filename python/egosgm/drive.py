# SPDX-License-Identifier: Apache-2.0
"""run(): a drive in, a disparity map for each of its frames out."""
import contextlib
import dataclasses
import itertools
import os
import warnings
from typing import Any, Dict, Iterable, Iterator, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm
from .bag import Bag
from .calibration.reader import any_calibration, read_calibration
from .calibration.rectification import StereoRig
from .geometry.depth import depth_sigma_from_disparity
from .videos import VideoPairs


_KINDS: Dict[str, Tuple[Any, str]] = {
    "frames": (str, 'give text, such as "7:10"'),
    "motion": ((int, np.bool_), "choose True or False; Pipeline.process takes motions that are known"),
    "objects": ((int, np.bool_), "choose True or False"),
    "outputs": (Iterable, 'give names of maps, such as ("disparity", "variance")'),
    "odometry": ((dict, type(None)), "give a dict of StereoOdometry's options")}


def _expect_kinds(**given: Any) -> None:
    for name, value in given.items():
        kinds, choice = _KINDS[name]
        if not isinstance(value, kinds):
            raise _egosgm.InvalidArgument(f"{name}: is a {type(value).__name__}: {choice}")


_OWN = ("calibration", *_KINDS, "lag", "progress")
_OF_PIPELINE = ("device", "cache", "constants")


def _expect_names(options: Dict[str, Any]) -> None:
    known = (*_OWN, *_OF_PIPELINE, *_egosgm.pipeline_options())
    for name in options:
        if name not in known and not name.startswith("constants."):
            raise _egosgm.InvalidArgument(f'no option named "{name}": choose from {", ".join(known)}')


def _opened(paths: Sequence[str], frames: str, calibration: Any) -> Tuple[Any, Any]:
    """What one path or two name, as for `egosgm run`: a bag, videos, pictures or a folder; and the calibration that is left to be read."""
    path, right = (*paths, "")[:2]
    if not path:
        raise _egosgm.InvalidArgument('source: is "": give the path of a folder, a bag or a video')
    if not right and _egosgm._is_bag(path):
        return Bag(path), calibration
    if _egosgm._is_video(path):
        is_file = isinstance(calibration, (str, os.PathLike))
        pairs = VideoPairs(path, right, os.fsdecode(calibration) if is_file else "")
        return pairs, pairs.source.calibration if is_file else calibration
    patterns = (path, right) if right else _egosgm._find_two_cameras(path) if calibration is not None else None
    return _egosgm.open_patterns(*patterns, "", frames) if patterns else _egosgm.open_folder(path, frames), calibration


@dataclasses.dataclass(frozen=True, repr=False, eq=False)
class VideoFrame:
    """A frame of a drive: images, maps and what happened."""

    number: int
    name: str
    left: NDArray[Any]
    right: NDArray[Any]
    maps: _egosgm.Frame
    odometry: Optional[_egosgm.OdometryResult]
    motion: Optional[_egosgm.Motion]  # from the frame before
    calibration: Optional[_egosgm.Calibration]
    objects: Optional[_egosgm.LabelledObjects] = None  # where run() was asked for objects
    scene_flow: Optional[_egosgm.SceneFlow] = None  # likewise: from the frame before to this one, None without a motion

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
        return (f"<VideoFrame {self.name}: {width}x{height}, density {self.report.density:.1%}, "
                f"search {min(1, self.report.search_fraction):.1%}>")


class StereoVideo:
    """What run() gives: iterate over it, as often as you like."""

    def __init__(self, source: Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]], _egosgm.StereoSequence, Bag, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
                 calibration: "_egosgm.Calibration | str | os.PathLike[str] | None" = None, *, frames: str = "", motion: bool = True,
                 outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None, lag: int = 1,
                 progress: Optional[bool] = None, objects: bool = False, **options: Any) -> None:
        _expect_names(options)
        _expect_kinds(frames=frames, motion=motion, objects=objects, outputs=outputs, odometry=odometry)
        paths = [source] if isinstance(source, (str, os.PathLike)) else source if isinstance(source, (tuple, list)) and len(source) == 2 else []
        are_paths = [isinstance(path, (str, os.PathLike)) for path in paths]
        is_path = bool(paths) and all(are_paths)
        if isinstance(source, bytes) or any(are_paths) and not is_path:
            raise _egosgm.InvalidArgument(f"source: is {source!r}: give a path, or two, as text or pathlib.Path")
        if is_path:
            source, calibration = _opened([os.fsdecode(path) for path in paths], frames, calibration)
        if frames and not (is_path and isinstance(source, _egosgm.StereoSequence)):
            raise _egosgm.InvalidArgument(f"frames={frames!r}: only a folder's are chosen here; open_folder and open_patterns take frames, too")
        if not hasattr(source, "__iter__") and not isinstance(source, (_egosgm.StereoSequence, Bag)):
            raise _egosgm.InvalidArgument(f"source: is a {type(source).__name__}: give a path, a sequence, a bag, or pairs of images, as egosgm.live.LivePairs takes from cameras")
        self.sequence = source if isinstance(source, _egosgm.StereoSequence) else None
        self._calibration_file: "str | os.PathLike[str]" = ""
        self.calibration = self._calibration_from(source, calibration)
        if not isinstance(lag, (int, np.integer)) or lag not in (0, 1):
            raise _egosgm.InvalidArgument(f"lag={lag!r}: choose 1, the device works while the next pair comes, or 0, a frame comes before the next pair is asked for")
        self._source, self._outputs, self._lag, self._options = source, outputs, int(lag), options
        self._bar = _bar(progress)
        self._odometry_options = self._odometry_from(odometry, motion, objects)
        self._objects = bool(objects)
        if self._objects:  # the tracker needs these maps
            self._outputs = tuple(dict.fromkeys((*((outputs,) if isinstance(outputs, str) else outputs), "disparity", "dynamic")))
        self._begun = False
        # What is wrong with options is said at once, as far as the size is known.
        if self._odometry_options is not None:
            _egosgm.StereoOdometry(self.calibration, **self._odometry_options)
        self._size = self.sequence.size if self.sequence is not None else None
        self._spare = [self._pipeline(*self._size)] if self._size else []  # pipelines for the next iterations

    def _calibration_from(self, source: Any, given: Any) -> Optional[_egosgm.Calibration]:
        """What is given, read where it is a file, or the source's own."""
        if given is None and self.sequence is not None:
            _egosgm._expect_calibrated(self.sequence)
            given = self.sequence.calibration
        if isinstance(source, Bag):
            if given is not None:
                raise _egosgm.InvalidArgument("calibration: a bag has its own: give it to the Bag, as calib")
            given = source.find_cameras().calibration
        if isinstance(given, (str, os.PathLike)):
            self._calibration_file = given if self.sequence is None else ""
            given = read_calibration(given, size=self.sequence.size if self.sequence is not None else None)
        if isinstance(given, StereoRig):
            raise _egosgm.InvalidArgument("calibration: is of raw images: rectify them first (egosgm.Rectification, egosgm rectify)")
        if given is not None and not isinstance(given, _egosgm.Calibration):
            raise _egosgm.InvalidArgument(f"calibration: is a {type(given).__name__}: give an egosgm.Calibration; read_calibration reads a file")
        return given

    def _odometry_from(self, given: Optional[Dict[str, Any]], motion: bool, objects: bool) -> Optional[Dict[str, Any]]:
        """Its options. None: there is no odometry."""
        if motion and self.calibration is not None:
            return given or {}
        if given:
            raise _egosgm.InvalidArgument("odometry: has options, but without a calibration, or with motion=False, there is none: leave them out")
        if objects:
            raise _egosgm.InvalidArgument("objects=True: what moves by itself is told from the camera's motion: give a calibration, and leave motion=False out")
        return None

    def __len__(self) -> int:
        return len(self._source)

    def __repr__(self) -> str:
        name = self.sequence.title if self.sequence is not None else "pairs of images"
        count = f", {len(self)} frames" if hasattr(self._source, "__len__") else ""
        return f"<StereoVideo {name}{count}{', no motion' if self._odometry_options is None else ''}>"

    def __iter__(self) -> Iterator[VideoFrame]:
        if self._begun and hasattr(self._source, "__next__"):
            raise _egosgm.InvalidArgument("the pairs come from an iterator, which gives them once: give a list, or make a drive of a new iterator")
        self._begun = True
        return iter(self._bar(self._frames(), len(self) if hasattr(self._source, "__len__") else None))

    def _pairs(self) -> Iterator[Tuple[Any, ...]]:
        """Left, right, the camera's pose where it is known, and whether what was before says nothing of this frame."""
        if isinstance(self._source, Bag):
            for frame in self._source.frames():
                yield frame.left, frame.right, frame.world_from_camera if self._odometry_options is not None else None, frame.starts_anew
            return
        first: Tuple[int, ...] = ()
        for number, pair in enumerate(self._source):  # type: ignore[arg-type]
            if isinstance(pair, (tuple, list)) and any(isinstance(image, (str, os.PathLike)) for image in pair):
                raise _egosgm.InvalidArgument(f"pair {number}: holds names in place of images: one pair of files, or a pattern for each camera, is the source, "
                                              'run(("left/*.png", "right/*.png")); of lists of names, read the images')
            if not isinstance(pair, (tuple, list)) or len(pair) != 2:
                of = f" of {len(pair)}" if isinstance(pair, (tuple, list)) else ""
                raise _egosgm.InvalidArgument(f"pair {number}: is a {type(pair).__name__}{of}: give pairs (left, right), each an image; one alone is [(left, right)]")
            if any(image is None for image in pair):
                raise _egosgm.InvalidArgument(f"pair {number}: holds None in place of an image, as a camera or cv2.imread gives where it has none: leave it out")
            left, right = (np.array(image, subok=True) for image in pair)  # copies, masks and all, which are refused: a camera may use its buffers again before the frame is handed out
            if not first and left.ndim >= 2 and os.path.isfile(self._calibration_file):
                read_calibration(self._calibration_file, size=left.shape[1::-1])  # refused where it is of another size
            first = first or left.shape[:2]
            if left.shape[:2] != first:
                raise _egosgm.InvalidArgument(f"pair {number}: its left image is of the shape {left.shape}, and the first one's began with {first}: "
                                              "all need one size")
            yield left, right, None, False

    def _pipeline(self, width: int, height: int) -> _egosgm.Pipeline:
        return _egosgm.Pipeline(self.calibration or any_calibration(width, height), width, height, **self._options)

    def _tell(self, text: str) -> None:
        warnings.warn(text, UserWarning, stacklevel=4)

    def _frames(self) -> Iterator[VideoFrame]:
        """Iterations share nothing, so that each may end where it likes, and two may run at once. The loop is C++'s (vision/stereo_video.h)."""
        pipeline, video, failure = None, None, None
        pairs = self._pairs() if self.sequence is None else iter(())
        first = list(itertools.islice(pairs, 1))
        if self.sequence is None and not first:
            return
        pairs = itertools.chain(first, pairs)
        size = self._size or _egosgm._size_of_image(first[0][0])
        with contextlib.suppress(IndexError):  # none is left, or another thread was quicker
            pipeline = self._spare.pop()
        try:
            pipeline = pipeline or self._pipeline(*size)
            video = _egosgm._Video(pipeline, *size, self.calibration, self.sequence, self._outputs, self._lag, self._odometry_options is not None,
                                   **(self._odometry_options or {}))
            tracker = _egosgm.ObjectTracker(self.calibration) if self._objects else None
            while True:
                failure = failure or _feed(video, pairs)
                found = video.next()
                if found is None:
                    break
                left_out, number, name, images, maps, odometry, motion = found
                if left_out:
                    self._tell(f"frame {name}: left out: {left_out}")
                    continue
                found_objects = tracker.process(images[0], maps.disparity, maps.dynamic, motion) if tracker else None
                yield VideoFrame(number, name, *images, maps, None if self._odometry_options is None else odometry, motion, self.calibration,
                                 found_objects, tracker.scene_flow() if tracker else None)
            if failure:
                raise failure
            told = "; ".join(filter(None, (*video.warnings(), *_notes_of(self._source))))
            if told:
                self._tell(f"{told}: `egosgm doctor` tells why")
        finally:
            if video:
                video.close()
            if pipeline:
                pipeline.reset()
                self._spare = [pipeline]


def _notes_of(source: Any) -> Sequence[str]:
    """What was unusual, of a bag or a video that was read."""
    return [source.gaps.text()] if isinstance(source, Bag) else source.source.notes() if hasattr(source, "source") else []


def _feed(video: Any, pairs: Iterator[Tuple[Any, ...]]) -> Optional[Exception]:
    """Gives the video all pairs that it wants now. What is under way does not suffer from a next pair that is none: its error is returned."""
    while video.wants_pair:
        try:
            video.add(*next(pairs))
        except StopIteration:
            video.end()
        except Exception as error:
            video.end()
            return error
    return None


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


def run(source: Union[str, "os.PathLike[str]", Sequence[Union[str, "os.PathLike[str]"]], _egosgm.StereoSequence, Bag, Iterable[Tuple[NDArray[Any], NDArray[Any]]]],
        calibration: "_egosgm.Calibration | str | os.PathLike[str] | None" = None, *, frames: str = "", motion: bool = True,
        outputs: Union[str, Sequence[str]] = ("disparity", "variance"), odometry: Optional[Dict[str, Any]] = None, lag: int = 1,
        progress: Optional[bool] = None, objects: bool = False, **options: Any) -> StereoVideo:
    """Disparity and variance for each frame of a drive:

        for frame in egosgm.run("drive/"):
            print(frame, frame.disparity, frame.depth, frame.depth_sigma)

    source: a path as `egosgm run` takes it (a folder as open_folder does, a bag, a video of both views), or two, (left, right), of
    videos, pictures or patterns; a StereoSequence, an egosgm.bag.Bag, or pairs of rectified images, grey or colour (RGB).
    calibration: a Calibration, or a file as read_calibration takes it, by which a video of raw images is rectified; without any there
    are disparities, but no depth and no odometry.
    frames: "7:10" of a folder. motion=False: no odometry, so nothing is predicted. outputs: names of maps, found in
    `frame.maps`. odometry: options of StereoOdometry. lag: 1, the device matches a frame while the next pair is asked for; 0, for a
    live camera: a frame comes before the next pair is asked for. progress: a bar by tqdm; None: where somebody looks.
    objects=True: `frame.objects` has what moves by itself, and `frame.scene_flow` where the pixels of the frame before went.
    All else is for Pipeline: device, preset and its options.
    """
    return StereoVideo(source, calibration, frames=frames, motion=motion, outputs=outputs, odometry=odometry, lag=lag, progress=progress, objects=objects, **options)

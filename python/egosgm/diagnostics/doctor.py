# SPDX-License-Identifier: Apache-2.0
"""egosgm doctor: looks for what is wrong with a sequence before it is matched. Needs no device."""
import argparse
import itertools
import math
from typing import Any, Dict, Iterator, List, NamedTuple, Optional, Sequence, Tuple

import cv2
import numpy as np

from .. import _egosgm
from ..arguments import counted, json_text, Parser, tell, whole_number
from .examination import FEWEST_MATCHES, Examination, Finding, match_pair, spread
from ..calibration.rectification import Rectification, StereoRig
from ..sequences import add_input, frame_times, open_input, open_without_calibration, videos_of_input, words_of_input
from ..videos import VideoSource

_MOST_GAP = 1.6  # of the usual time between two frames
_LEAST_STEP_S, _MOST_STEP_S = 1e-4, 20.0  # between two frames
_MOST_LATE = 2  # frames that a camera may be late and is found to be
_LEAST_LATE_PX = 0.4  # rows of another moment are farther apart
_MOST_PAIRED_PX = 1.0  # rows of one moment are not
_MOST_OF_STREAM = 300  # frames of a bag or a video, which is read from its start on
_EXCHANGE = ("the calibration's right camera stands left of its left one: exchange the two cameras' rows, and where the images are swapped, too, exchange "
             "them as well; or its transformation is the inverse of the one that is meant")

_OTHER_CAMERAS = ("so come the images out of its matrices, R and distortion: are they of these cameras and of this size, R in radians, and the distortion in the order k1, k2, "
                  "p1, p2? `egosgm calibrate` finds them anew")


class _Pair(NamedTuple):
    place: int
    name: str
    left: Any
    right: Any


class _Source:
    """Pairs, whatever they come from. read() goes forward only."""

    count = 0
    note = ""
    rectified = ""  # by what they were rectified here
    calibration: Optional[_egosgm.Calibration] = None

    def read(self, places: Sequence[int]) -> Iterator["_Pair | Tuple[str, Exception]"]:
        """The pairs in these places, in order; the name of one that cannot be read, and why."""
        raise NotImplementedError

    def times(self) -> Finding:
        raise NotImplementedError

    def is_of_other_moments(self) -> bool:
        """Whether left and right were taken too far apart, by their stamps. Known once all was read."""
        return False


class _OfSequence(_Source):
    def __init__(self, sequence: _egosgm.StereoSequence, calibration: "_egosgm.Calibration | StereoRig | None", calib: str) -> None:
        self._sequence, self.count, self.note = sequence, len(sequence), sequence.note
        self._rectification = None
        _egosgm._expect_calibrated(sequence)
        if isinstance(calibration, StereoRig):
            self._rectification = Rectification(calibration, *sequence.size)
            self.calibration, self.rectified = self._rectification.calibration, calib
        else:
            self.calibration = calibration

    def read(self, places: Sequence[int]) -> Iterator["_Pair | Tuple[str, Exception]"]:
        for place in places:
            frame = self._sequence.frames[place]
            try:
                left, right = frame.read()
            except _egosgm.Error as error:
                yield frame.name, error
                continue
            if self._rectification:
                left, right = self._rectification.rectify(left, right)
            yield _Pair(place, frame.name, left, right)

    def times(self) -> Finding:
        try:
            times, file = frame_times(self._sequence)
        except _egosgm.InvalidArgument as error:
            return Finding("problem", "times", str(error), "give a row for each frame, or remove the file")
        if not times:
            return Finding("note", "times", "no time stamps (times.txt or timestamps.txt) beside the images", "without them, gaps are not seen")
        frames = self._sequence.frames
        return _of_times(times, file, [frame.name for frame in frames], [frame.number for frame in frames])


class _OfStream(_Source):
    """Frames that come one after the other."""

    def _begin(self, frames: Iterator[Any]) -> None:
        self._stamps: List[Any] = []
        self._frames = itertools.islice(frames, _MOST_OF_STREAM)
        self._next: Any = next(self._frames, None)  # then the cameras of a bag are known

    def _expect(self, count: int) -> None:
        self.count = min(count, _MOST_OF_STREAM)
        if count > self.count:
            self.note = f"of {count} pairs the first {self.count} are looked at"

    def read(self, places: Sequence[int]) -> Iterator["_Pair | Tuple[str, Exception]"]:
        wanted = set(places)
        while self._next is not None:
            frame, self._next = self._next, next(self._frames, None)
            self._stamps.append(frame.stamp_ns)
            if frame.number in wanted:
                yield _Pair(frame.number, f"{frame.number:06d}", *(image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_RGB2GRAY) for image in (frame.left, frame.right)))


class _OfVideo(_OfStream):
    def __init__(self, left: str, right: str, calib: Sequence[str]) -> None:
        if len(calib) > 1:
            raise _egosgm.InvalidArgument("--calib: give one file for a video")
        self._video = VideoSource(left, right, *(calib or [""]))
        self._begin(iter(self._video.next, None))
        self._expect(self._video.count)
        self.calibration = self._video.calibration if self._video.has_calibration else None
        self.rectified = calib[0] if self._video.is_rectified_here else ""

    def times(self) -> Finding:
        told = self._video.notes()
        if told:
            return Finding("problem", "times", "; ".join(told), "record or convert it again")
        return Finding("note", "times", "a video has no time stamps that cameras gave", "without them, gaps are not seen")


class _OfBag(_OfStream):
    def __init__(self, given: argparse.Namespace) -> None:
        from ..bag import Bag
        self._bag = Bag(given.bag, given.left_topic or "", given.right_topic or "", given.info_topics or (), max_skew_ms=given.max_skew_ms,
                        calib=given.calib or "")
        self._begin(self._bag.frames())
        self._expect(len(self._bag))
        self.calibration = self._bag.cameras.calibration
        self.rectified = "its camera infos" if self._bag.is_rectified_here else ""

    def is_of_other_moments(self) -> bool:
        return self._bag.gaps.are_other_moments(self._bag.gaps.largest_skew_ms)

    def times(self) -> Finding:
        gaps, text = self._bag.gaps, self._bag.gaps.text()
        if text:
            is_problem = bool(gaps.broken or gaps.unpaired_left or gaps.unpaired_right or gaps.are_other_moments(gaps.largest_skew_ms)
                              or gaps.repeated > len(self._stamps))  # more than are left
            return Finding("problem" if is_problem else "note", "times", text, "record all topics without loss, from cameras that are triggered together")
        places = list(range(len(self._stamps)))
        return _of_times([1e-9 * (stamp - self._stamps[0]) for stamp in self._stamps], "stamps of the images", [f"{place:06d}" for place in places], places)


def _of_times(times: Sequence[float], source: str, names: Sequence[str], numbers: Sequence[int]) -> Finding:
    steps = np.diff(times)
    if not len(steps):
        return Finding("ok", "times", "a single frame")
    usual = float(np.median(steps))
    text = f"{usual:.4g} s between two frames ({source})"
    for unit, seconds in (("milliseconds", 1e-3), ("microseconds", 1e-6), ("nanoseconds", 1e-9)):
        if usual > _MOST_STEP_S and _LEAST_STEP_S <= usual * seconds <= _MOST_STEP_S:
            return Finding("problem", "times", text, f"a time is in seconds: are these {unit} ({usual * seconds:.4g} s)? Divide them")
    gaps = np.flatnonzero((steps <= 0) | (steps > _MOST_GAP * usual))
    if not len(gaps):
        return Finding("ok", "times", text)
    first = int(gaps[0])
    if steps[first] <= 0:
        what = f"after frame {names[first]} the time goes back by {-steps[first]:.4g} s" if steps[first] else f"frame {names[first + 1]} has the time of the one before"
        return Finding("problem", "times", f"{text}, but {what}", "sort the frames by time, and drop those that came twice")
    return Finding("problem", "times", f"{text}, but {counted(len(gaps), 'gap')}, the first of {steps[first]:.4g} s after frame {names[first]}",
                   f"record without dropping frames, or run the parts alone: --frames :{numbers[first]} and --frames {numbers[first + 1]}:")


def _steps(pairs: Dict[int, _Pair], places: Sequence[int], lag: int) -> List[Tuple[_Pair, _Pair]]:
    return [(pairs[place], pairs[place + lag]) for place in places if place in pairs and place + lag in pairs]


def _spread_px(left: Any, right: Any) -> float:
    """Rows of 90 % of the matches are no farther apart, beside a constant; infinite where there are few."""
    matches = match_pair(left, right)
    return spread(matches[:, 3] - matches[:, 1]) if len(matches) >= FEWEST_MATCHES else math.inf


def _moments(pairs: Dict[int, _Pair], places: Sequence[int]) -> List[Finding]:
    """A camera that stands still, or is some frames late, or pictures that come again. pairs: by their places."""
    laters = [_steps(pairs, places, lag) for lag in range(1, _MOST_LATE + 1)]
    steps = laters[0]
    stands_still: List[Finding] = []
    for this, other in (("left", "right"), ("right", "left")):
        frozen = sum(np.ptp(getattr(b, this)) > 0 and np.array_equal(getattr(a, this), getattr(b, this)) and not np.array_equal(getattr(a, other), getattr(b, other)) for a, b in steps)
        if frozen:
            stands_still = [Finding("problem", "moments", f"the {this} image is that of the frame before in {frozen} of {len(steps)} steps that were looked at, and the {other} "
                            "one is not", "leave such pairs out: they are of other moments")]
            if 4 * frozen > len(steps):  # else an image that came twice may have made all later ones late
                return stands_still
    own = float(np.median([_spread_px(b.left, b.right) for _, b in steps])) if steps else 0.0
    if own > _LEAST_LATE_PX:
        late = [(float(np.median([_spread_px(*views) for views in pairing])), lag, name) for lag, later in enumerate(laters, 1) if later
                for name, pairing in (("right", [(a.left, b.right) for a, b in later]), ("left", [(b.left, a.right) for a, b in later]))]
        spread, lag, name = min(late)
        ends = [pairs[place] for place in (places[0], places[-1]) if place in pairs]
        turned = float(np.median([_spread_px(a.left, b.right) for a, b in zip(ends, ends[::-1])])) if len(ends) == 2 and places[-1] > 2 * _MOST_LATE else math.inf
        if turned < min(0.5 * own, _MOST_PAIRED_PX, spread):
            return [Finding("problem", "moments", f"one camera's images are in reversed order: so paired, first and last rows agree within {turned:.2f} px, as they are within "
                            f"{own:.2f} px", "sort the images of both cameras by the time they were taken")]
        if spread < min(0.5 * own, _MOST_PAIRED_PX):
            return [Finding("problem", "moments", f"the {name} images are {'a frame' if lag == 1 else f'{lag} frames'} late: so paired, rows agree within {spread:.2f} px, as they "
                            f"are within {own:.2f} px", f"leave out the first {counted(lag, 'image')} of that camera, and as many last ones of the other")]
    if stands_still:
        return stands_still
    repeated = sum(np.array_equal(a.left, b.left) and np.array_equal(a.right, b.right) for a, b in steps)
    return [Finding("note", "moments", f"both images are those of the frame before in {repeated} of {len(steps)} steps that were looked at",
                    "leave them out: nothing new is seen in them")] if repeated else []


def _motion(calibration: _egosgm.Calibration, steps: Sequence[Tuple[_Pair, _Pair]]) -> List[Finding]:
    """A run that finds no motion sends its user here."""
    reasons = []
    for pairs in steps:
        odometry = _egosgm.StereoOdometry(calibration)
        for pair in pairs:
            result = odometry.process(pair.left, pair.right)
        if result.motion is None:
            reasons.append(result.reason)
    if 2 * len(reasons) <= len(steps):
        return []
    return [Finding("note", "motion", f"no motion in {len(reasons)} of {len(steps)} steps that were looked at ({reasons[-1]})",
                    "without a motion nothing is predicted: give frames that follow each other closely, all of one drive, left and right of the same "
                    "moments; or the poses (run --poses)")]


def _examine(source: _Source, samples: int, least: int, end: int) -> List[Finding]:
    findings = []
    if source.note:
        findings.append(Finding("note", "frames", source.note, "a longer motion is harder: give all frames where there are some"))
    count = source.count
    samples = min(samples, count)
    places = sorted({0 if samples == 1 else i * (count - 1) // (samples - 1) for i in range(samples)})
    examination, looked_at, broken = Examination(source.calibration, least, end), 0, []
    pairs = {}
    for pair in source.read(sorted({place + lag for place in places for lag in range(_MOST_LATE + 1) if place + lag < count})):
        if not isinstance(pair, _Pair):
            broken.append(pair)
            continue
        if pair.place in places:
            examination.add(pair.left, pair.right)
            looked_at += 1
        pairs[pair.place] = pair
    if not looked_at:
        raise broken[0][1] if broken else _egosgm.InvalidArgument("no pair can be looked at")
    if broken:
        findings.append(Finding("problem", "files", f"frame {broken[0][0]} cannot be read: {broken[0][1]}", "`run` leaves such a pair out: save it again"))
    of_pairs = examination.findings(count)
    if source.rectified:
        images, calibration, *rest = of_pairs
        if calibration.verdict != "ok" and source.calibration and not _egosgm._suspect_baseline(source.calibration.baseline_m, source.calibration.fx):
            calibration = calibration._replace(remedy=_OTHER_CAMERAS)
        of_pairs = [images._replace(text=f"{images.text}, rectified here by {source.rectified}"), calibration, *rest]
    moments = _moments(pairs, places) if of_pairs[0].verdict != "problem" else []
    if any(finding.verdict == "problem" for finding in moments) or source.is_of_other_moments():  # which explains what rows, sides and range would say
        of_pairs = [finding for finding in of_pairs if finding.check in ("images", "calibration")]
    findings += of_pairs + moments
    is_sound = all(finding.verdict != "problem" for finding in findings)
    findings.append(source.times())
    if is_sound and source.calibration is not None and not examination.is_too_small():
        findings += _motion(source.calibration, _steps(pairs, places, 1))
    return findings


def _findings(given: argparse.Namespace) -> List[Finding]:
    end = given.min_disparity + given.disparities
    if given.bag:
        return _examine(_OfBag(given), given.samples, given.min_disparity, end)
    videos = videos_of_input(given)
    if videos:
        return _examine(_OfVideo(*videos, given.calib or []), given.samples, given.min_disparity, end)
    try:
        sequence, calibration = open_input(given)
        source = _OfSequence(sequence, calibration, " ".join(given.calib or ()))
    except _egosgm._NegativeBaseline as error:
        wrong = Finding("problem", "calibration", str(error), _EXCHANGE)
        if not given.calib:
            return [wrong]
        source = _OfSequence(open_without_calibration(given), None, "")
        return [wrong if finding.check == "calibration" else finding for finding in _examine(source, given.samples, given.min_disparity, end)]
    return _examine(source, given.samples, given.min_disparity, end)


def _parser() -> Parser:
    parser = Parser("doctor", usage="egosgm doctor [OPTIONS] [DATASET] [RIGHT]", description="Check a sequence or a video: rows, swapped sides, calibration, range, time stamps. Raw images are rectified, where --calib is of raw images",
                    epilog="Points are matched in the whole image, without regard to rows, sides or range. Exit code 2 where a problem was\n"
                    "found; below each stands its remedy.")
    add_input(parser)
    add = parser.add_argument_group("or a recording of ROS, as `egosgm run --bag` takes it").add_argument
    add("--bag", metavar="FILE.mcap|FILE.bag|FOLDER", help="ROS 2 (MCAP, SQLite) or ROS 1; --calib takes the place of camera infos")
    add("--left-topic", metavar="TOPIC", help="raw or compressed images; where names tell, and there is one choice, that one")
    add("--right-topic", metavar="TOPIC", help="likewise")
    add("--info-topics", nargs=2, metavar=("LEFT", "RIGHT"), help="camera infos; without: camera_info beside the images")
    add("--max-skew-ms", type=float, default=0.0, metavar="MS", help="how far the stamps of a pair may differ; without: 0")
    defaults = _egosgm.pipeline_options()
    add = parser.add_argument
    add("--disparities", type=whole_number, default=defaults["disparities"], metavar="D", help="size of the range that is to be searched [px, %(default)s]")
    add("--min-disparity", type=whole_number, default=defaults["min_disparity"], metavar="N", help="where it begins [px, %(default)s], of either sign")
    add("--samples", type=whole_number, default=5, metavar="N", help="frames to look at, spread over the sequence [%(default)s]")
    add("--json", action="store_true", help="print JSON")
    return parser


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    for name in ("DATASET", "dataset"):
        if not given.bag and _egosgm._is_bag(getattr(given, name) or ""):
            given.bag = getattr(given, name)
            setattr(given, name, None)
    _egosgm._check_range(given.disparities, given.min_disparity)
    if given.samples < 1:
        raise _egosgm.InvalidArgument(f"--samples {given.samples}: choose a number above 0")
    if given.bag and any(not word.startswith("--calib=") for word in words_of_input(given)):
        raise _egosgm.InvalidArgument(f"--bag {given.bag}: is an input of its own: give one input, and no --frames")
    if not given.bag and any((given.left_topic, given.right_topic, given.info_topics, given.max_skew_ms)):
        raise _egosgm.InvalidArgument("topics and --max-skew-ms are of a bag: give --bag FILE with them")
    if not math.isfinite(given.max_skew_ms):
        raise _egosgm.InvalidArgument(f"--max-skew-ms {given.max_skew_ms}: give 0 for equal stamps, or how far they may differ")
    findings = _findings(given)
    problems = sum(finding.verdict == "problem" for finding in findings)
    if given.json:
        tell(json_text([finding._asdict() for finding in findings]))
        return 2 if problems else 0
    for finding in findings:
        tell(f"{finding.verdict:<8} {finding.check:<12} {finding.text}")
        if finding.remedy:
            tell(f"{'->':>21} {finding.remedy}")
    tell(f"{counted(problems, 'problem') if problems else 'No problem was'} found.")
    return 2 if problems else 0

# SPDX-License-Identifier: Apache-2.0
"""What `egosgm run` takes of the package: frames of bags and videos, and calibrations in, recordings and a viewer out. The run itself is C++'s."""
import contextlib
import os
import pathlib
import sys
import types
from typing import Any, Dict, Iterator, List, Optional, Sequence, Tuple

from .. import _egosgm
from ..calibration import reader as calibrations
from ..arguments import decimal
from . import Bag, BagFrame
from .outputs import McapOutput
from ..videos import VideoSource  # noqa: F401  for C++, as BagSource is
from ..viewer import RerunOutput


def read_calibration(file: pathlib.Path, size: Tuple[int, int]) -> _egosgm.Calibration:
    found = calibrations.find(file, size=size)
    if isinstance(found, _egosgm.Calibration):
        return found
    raise _egosgm.InvalidArgument(f"{file}: is of raw images, and rectified ones are matched: `egosgm rectify` makes them, by it")


class BagSource:
    """A bag as the run reads it (vision/frame_source.h)."""

    has_calibration = True

    def __init__(self, bag: str, max_skew_ms: str, rectify: str, out: str, **given: Any) -> None:
        if rectify not in ("auto", "on", "off"):
            raise _egosgm.InvalidArgument(f"--rectify {rectify}: choose auto, on or off")
        try:
            skew = decimal(max_skew_ms)
        except ValueError:
            raise _egosgm.InvalidArgument(f"--max-skew-ms {max_skew_ms}: give a number of milliseconds") from None
        self._bag = Bag(bag, max_skew_ms=skew, rectify={"auto": None, "on": True, "off": False}[rectify], **given)
        folder, path = self._bag.path.resolve(), pathlib.Path(out).resolve()
        if folder.is_dir() and folder in (path, *path.parents):
            raise _egosgm.InvalidArgument(f"--out {out}: lies in the bag {bag}, which is read: give another name")
        self._frames = self._bag.frames()
        self._first: Optional[BagFrame] = next(self._frames)  # with it come the cameras
        self.title, self.count = f"bag {self._bag.path.name}", len(self._bag)
        self.calibration, (self.width, self.height) = self._bag.cameras.calibration, self._bag.cameras.size
        self.bits = 8 * self._first.left.itemsize
        self.poses = given["pose_topic"]
        self.note = "the images are rectified here" if self._bag.is_rectified_here else ""

    def next(self) -> Optional[BagFrame]:
        first, self._first = self._first, None
        return first or next(self._frames, None)

    @property
    def has_lost_images(self) -> bool:
        gaps = self._bag.gaps
        return bool(gaps.unpaired_left or gaps.broken or gaps.repeated)

    def notes(self) -> List[str]:
        told = self._bag.gaps.text()
        return [told] if told else []


class Outputs:
    """Who takes the maps of a run (apps/frame_sink.h): a recording, a viewer, a page in the browser, or several of them."""

    def __init__(self, file: str, viewer: bool, page: bool = False) -> None:
        self._file, self._viewer, self._outputs = pathlib.Path(file) if file else None, viewer, []
        self._page_output: Any = None
        if page:
            try:
                from ..live import PageOutput
            except ImportError as error:
                raise _egosgm.InvalidArgument(f"--show needs OpenCV ({error}): pip install opencv-python-headless, or apt install python3-opencv") from None
            self._page_output = PageOutput
        if file and os.path.lexists(file):
            raise _egosgm.InvalidArgument(f"--out {file}: is there already, and stays: give another name, or remove it first")
        if self._file and not self._file.parent.is_dir():
            raise _egosgm.InvalidArgument(f"--out {file}: {self._file.parent}: no such folder")

    def begin(self, options: Dict[str, Any], calibration: _egosgm.Calibration) -> None:
        self._calibration = calibration
        if self._file:
            with self._naming_the_file():
                self._outputs.append(McapOutput(self._file, options) if self._file.suffix == ".mcap" else RerunOutput(self._file))
        if self._viewer:
            self._outputs.append(RerunOutput())
        if self._page_output:
            self._outputs.append(self._page_output(options))

    def take(self, frame: Dict[str, Any], maps: _egosgm.Frame, motion: Any) -> None:
        with self._naming_the_file():
            for output in self._outputs:
                output.add(types.SimpleNamespace(**frame), maps, motion, self._calibration)

    def end(self, finished: bool) -> None:
        outputs, self._outputs = self._outputs, []
        try:
            with self._naming_the_file():
                while finished and outputs:
                    outputs[0].finish()
                    outputs.pop(0)  # what is finished stays, whatever becomes of the others
        finally:
            for output in outputs:
                output.give_up()

    @contextlib.contextmanager
    def _naming_the_file(self) -> Iterator[None]:
        """A stream's own error does not name it, or by the name of what is written until it is whole."""
        try:
            yield
        except OSError as error:
            if isinstance(error, _egosgm.Error) or not (self._file and error.strerror):
                raise
            raise _egosgm.IoError(f"{self._file}: cannot be written: {error.strerror}; free some space or choose a folder that can be written") from error


def main(arguments: Optional[Sequence[str]] = None) -> int:
    """`egosgm run`. What the program prints and returns."""
    words = ["run", *(sys.argv[1:] if arguments is None else arguments)]
    return _egosgm._main([os.fsencode(word) for word in words], sys.modules[__name__])


if __name__ == "__main__":
    sys.exit(main())

# SPDX-License-Identifier: Apache-2.0
"""What a folder tells that `egosgm run` wrote."""
import dataclasses
import pathlib
from typing import Any, Dict, List, Optional

from .arguments import read_json

_LARGEST_NUMBER = 2**31 - 1
_MOST_FRAMES = 2_000_000


@dataclasses.dataclass
class RunFrames:
    numbers: List[int]       # of the frames of the run
    images: Dict[str, str]   # the left image's name by the frame's; it need no longer be there
    sequence: List[int]      # all numbers that the run's were chosen from; empty where they are not known


def report_of(path: pathlib.Path) -> Optional[pathlib.Path]:
    """The report of the run that wrote `path`: OUT, or a file or folder in it."""
    folder = pathlib.Path(path).resolve()
    for place in (folder, *list(folder.parents)[:1 if folder.is_dir() else 2]):
        if (place / "report.json").is_file():
            return place / "report.json"
    return None


def _integer(entry: Any, key: str) -> int:
    """From 0 to the largest number, or -1."""
    value = entry.get(key) if isinstance(entry, dict) else None
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value <= _LARGEST_NUMBER else -1


def frames_of_run(path: pathlib.Path) -> Optional[RunFrames]:
    """None where no run is known that wrote `path`."""
    file = report_of(path)
    if file is None:
        return None
    report = read_json(file)
    frames = report.get("frames") if isinstance(report, dict) else None
    if not isinstance(frames, list) or not frames or any(_integer(frame, "frame") < 0 for frame in frames):
        return None
    names = [frame["name"] if isinstance(frame.get("name"), str) else f"{frame['frame']:06d}" for frame in frames]
    images = {name: pathlib.Path(frame["left"]).stem for name, frame in zip(names, frames) if isinstance(frame.get("left"), str)}
    first, last, count = (_integer(report.get("sequence"), key) for key in ("first_frame", "last_frame", "frames"))
    known = first >= 0 and 1 <= count <= _MOST_FRAMES and last - first == count - 1
    return RunFrames([frame["frame"] for frame in frames], images, list(range(first, last + 1)) if known else [])

# SPDX-License-Identifier: Apache-2.0
"""egosgm report: one HTML page of a run, with everything that it shows in it."""
import argparse
import base64
import io
import json
import operator
import pathlib
import re
import zlib
from typing import Any, Dict, List, Optional, Sequence

import numpy
import PIL.Image

from . import _egosgm
from .arguments import counted, left_of_run, Parser, read_json, tell, text_argument, whole_number
from .moving_objects import ObjectPictures

_PICTURES = 6
_LARGEST = 2**31 - 1
_MOST_SIDE = 16384
_FIGURES = ("bad_or_missing", "bad_1px", "bad_of_valid", "density", "interpolated", "d1", "d1_interpolated", "mae_px", "mean_error_px", "filled",
            "wrong_of_all")


def _parser() -> Parser:
    parser = Parser("report", description="Make one HTML page of a run: pictures, charts, path, options",
                    epilog="The page holds everything that it shows: it needs no network and no other file. Variance and the width of the\n"
                    "search are shown where the run wrote them, and so is what moves by itself: egosgm run --write variance,search,objects")
    add = parser.add_argument
    add("run", metavar="OUT", help="the folder that `egosgm run` wrote")
    add("positional_truth", metavar="TRUTH", nargs="?", help="what --truth takes")
    add("--truth", metavar="FILE|DIR", help="true disparity: a file, a folder, or a data set's folder")
    add("--poses", metavar="FILE", help="true KITTI poses, drawn beside the estimated path")
    add("--frames", metavar="FIRST:LAST", help="only these frame numbers, both ends included: 7:10, 7:, :10 or 7; without: all")
    add("--pictures", metavar="LIST", help="numbers of the frames to show, separated by commas; without: six, from the first to the last")
    add("--picture-width", metavar="N", type=whole_number, default=1242, help="wider pictures are scaled down to this [px, %(default)s]")
    add("--out", metavar="FILE.html", help="the page: a new file; without: OUT/report.html")
    return parser


def _number(entry: Any, key: str) -> int:
    """From 0 to 2^31 - 1, or -1."""
    value = entry.get(key) if isinstance(entry, dict) else None
    return value if type(value) is int and 0 <= value <= _LARGEST else -1


def _read_run(folder: pathlib.Path) -> Dict[str, Any]:
    file = folder / "report.json"
    if not file.exists():
        raise _egosgm.InvalidArgument(f"{file}: no such file: give the folder that `egosgm run --out` wrote")
    run = read_json(file)
    for key in ("input", "version", "device", "calibration", "options", "frames"):
        if not isinstance(run, dict) or key not in run:
            raise _egosgm.InvalidArgument(f'{file}: not the report of a run: it has no "{key}"')
    if not run["frames"]:
        raise _egosgm.InvalidArgument(f"{file}: lists no frame, as the run was killed, is under way, or was stopped before its first: "
                                      "let it end, or run it again with --resume")
    if any(_number(entry, "frame") < 0 for entry in run["frames"]):
        raise _egosgm.InvalidArgument(f"{file}: not the report of a run: its frames have no numbers")
    return run


def _short(text: str) -> str:
    """With the last folder and the name of each path in it: a page that is passed on tells nothing of the machine."""
    parts = []
    for part in text.split(" and "):
        root = 0 if part.startswith("/") else part.find(" /") + 1
        if part[root:].startswith("/"):
            part = part[:root] + "/".join(pathlib.PurePath(part[root:]).parts[-2:])
        parts.append(part)
    return " and ".join(parts)


def _with_short_paths(part: Any) -> Any:
    if isinstance(part, str):
        return _short(part)
    if isinstance(part, dict):
        return {key: _with_short_paths(inner) for key, inner in part.items()}
    return [_with_short_paths(inner) for inner in part] if isinstance(part, list) else part


def _data_uri(picture: numpy.ndarray, kind: str) -> str:
    encoded = io.BytesIO()
    PIL.Image.fromarray(numpy.ascontiguousarray(picture)).save(encoded, kind, **({"quality": 92} if kind == "jpeg" else {}))
    return f"data:image/{kind};base64,{base64.b64encode(encoded.getvalue()).decode()}"


def _narrowed(picture: numpy.ndarray, width: int) -> numpy.ndarray:
    height, own = picture.shape[:2]
    if own <= width:
        return picture
    return numpy.asarray(PIL.Image.fromarray(numpy.ascontiguousarray(picture)).resize((width, max(1, height * width // own)), PIL.Image.BOX))


def _figures(counts: Any) -> Dict[str, Any]:
    values = {name: getattr(counts.metrics, name) for name in _FIGURES}
    return {{"mae_px": "mae", "mean_error_px": "mean_error"}.get(name, name): None if value != value else value for name, value in values.items()}


def _warnings(text: str) -> List[Dict[str, str]]:
    """The warnings of a run, one by one: "what (remedy), what; what" as `egosgm run` says it."""
    inner, warnings = r"\((?:[^()]|\([^()]*\))*\)", []
    for part in re.findall(rf"(?:[^,;(]|{inner}|[,;](?! ))+", text):
        what, remedy = re.fullmatch(rf"(.*?)(?: ({inner}))?", part.strip(), re.DOTALL).groups("")  # type: ignore[union-attr]
        warnings.append({"what": what, "remedy": f"run it with {remedy[1:-1]}" if remedy.startswith("(--") else remedy[1:-1] or "`egosgm doctor` tells why"})
    return warnings


_SIGMA_LEAST_PX, _SIGMA_STEP = 0.01, 1.04  # a byte's scale; 0: none


class _Values:
    """A frame's maps as the page reads them under the mouse: 16 bits of disparity a pixel, 8 of its sigma, 8 of its reason."""

    def __init__(self, folder: pathlib.Path, name: str, most_width: int) -> None:
        exact = folder / "disparity" / f"{name}.pfm"
        whole = _egosgm.read_disparity(exact if exact.exists() else exact.with_suffix(".png"))
        self._size, self._folder, self._name = whole.shape, folder, name
        width = min(whole.shape[1], most_width)
        height = max(1, whole.shape[0] * width // whole.shape[1])
        self._place = numpy.ix_(*((2 * numpy.arange(shown) + 1) * own // (2 * shown) for shown, own in zip((height, width), whole.shape)))
        disparity = whole[self._place]
        valid = disparity != _egosgm.INVALID_DISPARITY
        least, largest = (float(end(disparity[valid])) if valid.any() else 0.0 for end in (numpy.min, numpy.max))
        step = max(1 / 256, (largest - least) / 65534)
        planes = [numpy.where(valid, numpy.rint((disparity - least) / step) + 1, 0).astype("<u2")]
        variance, reason = self._of("variance", ".pfm", _egosgm.read_disparity), self._of("reason", ".png", _egosgm.read_grey)
        if variance is not None:
            known = valid & (variance > 0)
            code = numpy.log(numpy.sqrt(numpy.where(known, variance, 1)) / _SIGMA_LEAST_PX) / numpy.log(_SIGMA_STEP)
            planes.append(numpy.where(known, numpy.clip(numpy.rint(code), 0, 254) + 1, 0).astype(numpy.uint8))
        if reason is not None:
            planes.append(reason.astype(numpy.uint8))
        self.json = {"width": width, "height": height, "least": least, "step": step, "sigma": variance is not None, "reason": reason is not None,
                     "data": base64.b64encode(zlib.compress(b"".join(plane.tobytes() for plane in planes), 9)).decode()}

    def _of(self, kind: str, extension: str, read: Any) -> Optional[numpy.ndarray]:
        file = self._folder / kind / (self._name + extension)
        if not file.exists():
            return None
        found = read(file)
        if found.shape != self._size:
            raise _egosgm.InvalidArgument(f"{file}: is {found.shape[1]}x{found.shape[0]}, while the disparity is {self._size[1]}x{self._size[0]}")
        return found[self._place]


class _Frame:
    def __init__(self, folder: pathlib.Path, place: int, entry: Dict[str, Any]) -> None:
        self.place = place  # among all of the run
        self.entry = entry
        self.number = entry["frame"]
        self.name = entry["name"] if isinstance(entry.get("name"), str) else f"{self.number:06}"
        left = left_of_run(folder, self.name, entry["left"] if isinstance(entry.get("left"), str) else "")
        self.left = left if pathlib.Path(left).is_file() else ""
        self.truth = ""


class _Page:
    """What the page shows; its script reads it."""

    def __init__(self, given: argparse.Namespace) -> None:
        self._given = given
        self._folder = pathlib.Path(given.run)
        self._run = _read_run(self._folder)
        self._of_run = [_Frame(self._folder, place, entry) for place, entry in enumerate(self._run["frames"])]
        self._panels = _egosgm._FramePanels(operator.index(self._run["options"].get("disparities", 128)))
        self._notes = [str(note) for note in self._run.get("notes", [])]
        first, last = _egosgm._parse_frame_range(text_argument(given.frames or ""))
        self._frames = [f for f in self._of_run if (first is None or f.number >= first) and (last is None or f.number <= last)]
        if not self._frames:
            raise _egosgm.InvalidArgument(f"--frames {given.frames}: the run has none of them: choose from {self._of_run[0].number} to "
                                          f"{self._of_run[-1].number}")

    def html(self) -> str:
        data: Dict[str, Any] = {**self._truth(), **self._pictures(), **self._paths()}
        data["changed"] = self._changed_options()
        data["notes"] = self._notes
        data["warnings"] = _warnings(str(self._run.get("warning", "")))
        data["scales"] = {"sigma_least_px": _SIGMA_LEAST_PX, "sigma_step": _SIGMA_STEP, "reasons": _egosgm.REASONS}
        data["run"] = _with_short_paths({**self._run, "frames": [frame.entry for frame in self._frames]})
        text = json.dumps(data).replace("<", "\\u003c")  # nothing in a text may end the script element
        return pathlib.Path(__file__).with_name("report.html").read_text(encoding="utf-8").replace("@DATA@", text, 1)

    def _truth(self) -> Dict[str, Any]:
        if not self._given.truth:
            self._notes.append("Without truth there are no errors: egosgm report OUT TRUTH compares.")
            return {"metrics": {}}
        pairs, _, alone = _egosgm._pair_with_truth(self._given.run, self._given.truth, text_argument(self._given.frames or ""))
        truths = [pair.truth for pair in pairs]
        note = f"Compared with {(truths[0] if len(truths) == 1 else truths[0].parent).name}."
        for pair in pairs:
            if not pair.same_name:
                note += f" {pair.estimate.name} and {pair.truth.name} belong together by their number only."
                break
        if alone:
            note += f" {counted(len(alone), 'frame')} without truth."
        self._notes.append(note)
        frames = {frame.name: frame for frame in self._frames}
        pooled, metrics = _egosgm.DisparityCounts(), {}
        for pair in pairs:
            if pair.name in frames:
                frames[pair.name].truth = pair.truth
                counts = _egosgm.compare_disparity(_egosgm.read_disparity(pair.estimate), _egosgm.read_disparity(pair.truth))
                pooled = pooled + counts
                metrics[str(frames[pair.name].number)] = _figures(counts)
        return {"metrics": metrics, "pooled": _figures(pooled)}

    def _shown(self) -> List[_Frame]:
        count = len(self._frames)
        if not self._given.pictures:
            wanted = min(_PICTURES, count)
            return [self._frames[i * (count - 1) // max(wanted - 1, 1)] for i in range(wanted)]
        chosen = set()
        for text in str(self._given.pictures).split(","):
            found = [frame.place for frame in self._frames if text in (str(frame.number), frame.name)]
            if not found:
                raise _egosgm.InvalidArgument(f'--pictures "{text}": the run has no such frame: choose from {self._frames[0].number} to '
                                              f"{self._frames[-1].number}")
            chosen.add(found[0])
        return [self._of_run[place] for place in sorted(chosen)]

    def _pictures(self) -> Dict[str, Any]:
        pictures, bars = [], {}
        moving = ObjectPictures(self._folder, self._run["calibration"])
        for frame in self._shown():
            layers = []
            frame.left = self._left_of_size(frame)
            for name, picture, bar in self._panels.layers(self._folder, frame.name, frame.left, frame.truth):
                has_edges = name.startswith("error") or name == "reason"  # ten colours
                layers.append({"name": name, "picture": _data_uri(_narrowed(picture, self._given.picture_width), "png" if has_edges else "jpeg")})
                if bar is not None:
                    bars[name] = _data_uri(bar, "png")
            what_moves = moving.picture(frame.name, frame.left)
            if what_moves is not None:
                layers.append({"name": "what moves", "picture": _data_uri(_narrowed(what_moves, self._given.picture_width), "jpeg")})
            pictures.append({"frame": frame.number, "name": frame.name, "layers": layers,
                             "values": _Values(self._folder, frame.name, self._given.picture_width).json})
        if not self._frames[0].left:
            self._notes.append("The left images are not where the report of the run says, so they are not shown.")
        for kind in ("variance", "search"):
            if not (self._folder / kind).exists():
                self._notes.append(f'The run did not write "{kind}": egosgm run --write variance,search does.')
        return {"pictures": pictures, "bars": bars}

    def _left_of_size(self, frame: _Frame) -> str:
        """The left image, where it has the disparity's size."""
        if not frame.left:
            return ""
        image = _egosgm._read_stored_image(pathlib.Path(frame.left))
        width, height = self._run["width"], self._run["height"]
        if image.shape[:2] == (height, width):
            return frame.left
        self._notes.append(f"{pathlib.Path(frame.left).name} is {image.shape[1]}x{image.shape[0]} while the run's images were {width}x{height}: it was changed after the run, so it is not shown.")
        return ""

    def _paths(self) -> Dict[str, Any]:
        def from_above(poses: Any) -> List[List[float]]:
            return [(numpy.linalg.inv(poses[0]) @ pose)[[0, 2], 3].tolist() for pose in poses]

        estimated, true = [], []
        file = self._folder / "poses.txt"
        if file.exists():
            if len(poses := _egosgm.read_poses(file)) == len(self._of_run):
                estimated = poses[[frame.place for frame in self._frames]]
            else:
                self._notes.append(f"poses.txt has {len(poses)} poses and report.json {len(self._of_run)} frames: one of them was changed, so the path is not shown.")
        if self._given.poses:
            poses, numbers = _egosgm.read_poses(self._given.poses), [frame.number for frame in self._frames]
            whole = _egosgm._frames_of_run(self._folder).numbers
            true = poses[_egosgm._rows_of_frames(numbers, whole, len(poses), self._given.poses, "poses")]
        return {"path": from_above(estimated), "true_path": from_above(true)}

    def _changed_options(self) -> List[str]:
        used = self._run["options"]
        return [name for name, value in _egosgm.pipeline_options().items() if name in used and used[name] != value]


def main(arguments: Sequence[str]) -> int:
    given = _parser().parse(arguments)
    if given.positional_truth:
        if given.truth:
            raise _egosgm.InvalidArgument(f'unexpected argument "{given.positional_truth}": --truth is given already')
        given.truth = given.positional_truth
    if not 16 <= given.picture_width <= _MOST_SIDE:
        raise _egosgm.InvalidArgument(f"--picture-width {given.picture_width}: choose from 16 to {_MOST_SIDE}")
    if re.fullmatch(r"report\.(json|html)", pathlib.Path(given.run).name) and pathlib.Path(given.run).is_file():
        given.run = pathlib.Path(given.run).parent
    file = pathlib.Path(given.out) if given.out else pathlib.Path(given.run) / "report.html"
    try:
        page = _Page(given)
        _egosgm._expect_new_file("--out", file)
        text = page.html().encode(errors="replace")
    except (AttributeError, KeyError, TypeError) as error:
        raise _egosgm.InvalidArgument(f"{given.run}/report.json: not the report of a run: {re.sub(r'_egosgm[.]', '', str(error))}") from error
    _egosgm._write_new_file(file, text)
    tell(f"{file}: {len(text) / 1e6:.1f} MB, opens in any browser")
    return 0

# SPDX-License-Identifier: Apache-2.0
"""What formats of calibrations are made of: texts, matrices, distortions, pairs of cameras."""
import contextlib
import difflib
import gzip
import io
import json
import pathlib
import re
import xml.etree.ElementTree as ElementTree
import zlib
from typing import Any, Callable, Dict, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from .rectification import StereoRig, is_transposed

Matrix = NDArray[np.float64]
Camera = Tuple[Matrix, Matrix, bool]  # matrix, distortion, whether that is a fisheye's
MOST_BYTES, _MOST_PARTS, _MOST_VALUES = 1 << 22, 2000, 100_000


def refuse(file: pathlib.Path, text: str) -> _egosgm.InvalidArgument:
    return _egosgm.InvalidArgument(f"{file}: {text}")


def _yaml_of(text: str, file: pathlib.Path) -> Any:
    try:
        import yaml
    except ImportError:
        raise refuse(file, "YAML of other programs needs the package PyYAML: pip install pyyaml") from None

    class Loader(yaml.SafeLoader):
        def flatten_mapping(self, node: Any) -> None:
            """Nothing is merged, which calibrations never ask for: a few bytes can ask for any number of copies."""

    # OpenCV's matrices are maps with a tag, and its first line is of YAML 1.0.
    Loader.add_multi_constructor("", lambda loader, suffix, node: loader.construct_mapping(node, deep=True)
                                 if isinstance(node, yaml.MappingNode) else loader.construct_scalar(node))
    body = re.sub(r"^%YAML[^\n]*\n", "", text.lstrip("\ufeff"))
    body = re.sub(r"(?m)^(\s*[\w.]+):(?=[^\s:])", r"\1: ", body)
    try:
        documents = [document for document in yaml.load_all(body, Loader) if document is not None]  # a topic's, one message each
        return documents[0] if documents else None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise refuse(file, "is no YAML that can be read: " + str(error).replace("\n", " ")) from None


def matrix(value: Any, shape: Tuple[int, ...]) -> Optional[Matrix]:
    if isinstance(value, dict):
        if str(value.get("dt", "d"))[-1:] not in tuple("ucwsifd"):
            return None
        value = value.get("data")
    if isinstance(value, str):  # in XML
        value = value.split()
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return None
    if numbers.size == 0 or not np.isfinite(numbers).all() or (shape and numbers.size != int(np.prod(shape))):
        return None
    return numbers.reshape(shape or -1)


def expect_upright(numbers: Optional[Matrix], name: str, file: pathlib.Path) -> None:
    if numbers is not None and is_transposed(numbers):
        raise refuse(file, f"{name} is transposed, as MATLAB writes it, with the numbers of its last column in its last row: transpose it, and the file's other matrices, R too")


def size_of(value: Any) -> Optional[Tuple[int, int]]:
    numbers = matrix(re.findall(r"\d+", value) if isinstance(value, str) else value, (2,)) if value is not None else None  # 640x480, too
    return (int(numbers[0]), int(numbers[1])) if numbers is not None else None


def expect_size(calibrated: Optional[Tuple[int, int]], size: Optional[Tuple[int, int]], file: pathlib.Path) -> None:
    """Of images that stay as they are, where both sizes are known: a calibration of others gives wrong depths."""
    if calibrated and size and 0 not in calibrated and calibrated != size:
        raise refuse(file, "is of images of {}x{}, and these have {}x{}: give the calibration of this size".format(*calibrated, *size))


class Values:
    """What a file holds, or a part of it, by names. what: the kind of file, for errors."""

    def __init__(self, data: Dict[str, Any], file: pathlib.Path, what: str) -> None:
        self.data, self.file, self.what = data, file, what

    def part(self, data: Dict[str, Any]) -> "Values":
        return Values(data, self.file, self.what)

    def refuse(self, text: str) -> _egosgm.InvalidArgument:
        return refuse(self.file, f"is {self.what}{text}")

    def first(self, shape: Tuple[int, ...], *names: str) -> Optional[Matrix]:
        """Of the first of the names that is there; None where none is, or it is empty. Throws InvalidArgument where it is no numbers."""
        name = next((name for name in names if name in self.data), None)
        value = self.data.get(name)
        if name is None or (value.get("data", value) if isinstance(value, dict) else value) == []:
            return None
        found = matrix(value, shape)
        if found is None:
            raise self.refuse(f", and {name} is not {int(np.prod(shape)) if shape else 'of'} finite numbers")
        expect_upright(found, name or "", self.file)
        return found

    def matrix(self, shape: Tuple[int, ...], *names: str) -> Matrix:
        """Of the first of the names that has one."""
        found = self.first(shape, *names)
        if found is None:
            raise self.refuse(f" and lacks {' or '.join(names)}, {int(np.prod(shape)) if shape else 'some'} finite numbers")
        return found

    def four(self, *names: str) -> Matrix:
        """fx, fy, cx and cy of a list. Throws InvalidArgument where they stand in another order: both focal lengths are alike, those of other places are not."""
        found = self.matrix((4,), *names)
        for order, x, y in (("fx, cx, fy, cy", 0, 2), ("cx, cy, fx, fy", 2, 3), ("fx, cx, cy, fy", 0, 3)):
            if abs(found[0] - found[1]) > 0.05 * abs(found[0]) and abs(found[x] - found[y]) <= 0.01 * abs(found[x]):
                raise self.refuse(f", and {names[0]} {found.tolist()} seem to be {order}: give fx, fy, cx, cy")
        return found

    def numbers(self, names: str, prefix: str = "") -> Matrix:
        return np.array([self.matrix((1,), prefix + name)[0] for name in names.split()])

    def lens(self, values: Any, model: str) -> Tuple[Matrix, bool]:
        """OpenCV's coefficients of what others call the same, and whether they are a fisheye's."""
        numbers = matrix(values, ()) if values is not None else None
        model = model.lower().replace("-", "").replace("_", "")
        if model in ("", "none", "pinhole") and (values in (None, []) or (numbers is not None and not numbers.any())):
            return np.zeros(5), False
        if numbers is None:
            raise self.refuse(f" without coefficients of its distortion ({model}): give finite numbers, zeros where there is none")
        if model in ("", "radtan", "radialtangential", "plumbbob", "brown", "opencv", "pinhole", "rationalpolynomial"):
            return (numbers if numbers.size in (4, 5, 8, 12, 14) else np.pad(numbers, (0, max(0, 5 - numbers.size)))), False
        if model in ("equi", "equidistant", "fisheye", "kannalabrandt8", "kannalabrandt"):
            return numbers[:4], True
        raise refuse(self.file, f"its distortion is of the model \"{model}\": radtan and equidistant are read")

    def resolution(self) -> Any:
        """None where it is missing. Throws InvalidArgument where it is misspelt: the size of the images would not be checked."""
        near = [] if "resolution" in self.data else difflib.get_close_matches("resolution", map(str, self.data), 1, 0.8)
        if near:
            raise self.refuse(f", and {near[0]} stands in place of resolution")
        return self.data.get("resolution")

    def pair(self, cameras: Sequence[Camera], right_from_left: Matrix, size: Any) -> StereoRig:
        left, right = cameras
        if left[2] != right[2]:
            raise refuse(self.file, "one camera is a fisheye and the other one is not: calibrate both by one model")
        return StereoRig(left[0], left[1], right[0], right[1], right_from_left[:3, :3], right_from_left[:3, 3], left[2], size_of(size))

    def pair_on_body(self, cameras: Sequence[Camera], body_from: Sequence[Matrix], size: Any) -> StereoRig:
        return self.pair(cameras, np.linalg.inv(body_from[1]) @ body_from[0], size)


def expect_one_size(left: Optional[Tuple[int, int]], right: Optional[Tuple[int, int]], refuse: Callable[[str], Exception]) -> None:
    """Of both cameras' images, where both sizes are known."""
    if left and right and 0 not in left + right and left != right:
        raise refuse(" of two resolutions, {}x{} and {}x{}: give both cameras' of one".format(*left, *right))


def one_resolution(*cameras: Values) -> Any:
    """Of all cameras: None where the first has none."""
    first, *others = (camera.resolution() for camera in cameras)
    for camera, other in zip(cameras[1:], others):
        expect_one_size(size_of(first), size_of(other), camera.refuse)
    return first


def of_four(numbers: Matrix) -> Matrix:
    fx, fy, cx, cy = numbers
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def transform(rotation: Matrix, translation: Sequence[float]) -> Matrix:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, translation
    return transform


def rotation(value: Any) -> Optional[Matrix]:
    """Of a matrix, or of a vector along the axis whose length is the angle."""
    vector = matrix(value, (3,))
    if vector is None:
        return matrix(value, (3, 3))
    angle = float(np.linalg.norm(vector))
    if angle > np.pi:
        raise _egosgm.InvalidArgument(f"R is a vector of the length {angle:.4g}, more than half a turn in radians: is it in degrees? Give radians, or a matrix")
    x, y, z = vector / (angle or 1.0)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def _check_parts(text: str, file: pathlib.Path) -> None:
    """Readers call themselves for what is nested, as deep as it is: what begins something is counted."""
    begun = len(re.findall(r"[\[{<]|[:-](?=\s|$)", text))
    if begun > _MOST_PARTS:
        raise refuse(file, f"has {begun} nested or named parts, the most is {_MOST_PARTS}; give a calibration alone")


def _expect_few_values(data: Any, file: pathlib.Path) -> Any:
    """By YAML's aliases, a few bytes can stand for any number of values."""
    waiting, taken = [data], 0
    while waiting:
        part = waiting.pop()
        taken += 1
        waiting.extend(part.values() if isinstance(part, dict) else part if isinstance(part, (list, tuple)) else ())
        if taken + len(waiting) > _MOST_VALUES:
            raise refuse(file, f"has more than {_MOST_VALUES} values; give a calibration alone")
    return data


def text_of(file: pathlib.Path) -> str:
    if not file.exists():
        raise refuse(file, "no such file")
    content = _egosgm._read_file(file, MOST_BYTES)
    if content[:2] == b"\x1f\x8b":
        with contextlib.suppress(EOFError, OSError, zlib.error):
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(MOST_BYTES)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff") or 0 < content[:64].count(0) == len(content[:64]) // 2:
        raise refuse(file, "is UTF-16, as some editors write: save it as UTF-8")
    return content.decode("utf-8-sig", errors="replace")


def _of_element(element: Any) -> Any:
    return {part.tag: _of_element(part) for part in element} if len(element) else element.text


def data_of(text: str, file: pathlib.Path) -> Any:
    """What XML, JSON or YAML holds, or rows of NAME=VALUE."""
    if all(re.match(r"[\w.]+[ \t]*=[^=]*$", row) for row in (row.strip() for row in text.splitlines()) if row and row[0] != "#"):
        text = text.replace("=", ": ")
    _check_parts(text, file)
    start = text.lstrip()[:1]
    try:
        if re.match(r"\s*<(!doctype\s+)?html", text, re.IGNORECASE):
            raise refuse(file, "is a web page: was its download refused? Download the file itself")
        if start == "<":
            return _of_element(ElementTree.fromstring(text))
        return _expect_few_values(json.loads(text) if start in ("{", "[") and start else _yaml_of(text, file), file)
    except (ValueError, RecursionError, ElementTree.ParseError) as error:
        if isinstance(error, _egosgm.InvalidArgument):
            raise
        raise refuse(file, f"is no {'XML' if start == '<' else 'JSON'} that can be read: {error}") from None

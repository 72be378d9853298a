# SPDX-License-Identifier: Apache-2.0
"""Calibrations of no program's own format: known by the names or by the number of their values."""
import math
import pathlib
import re
from typing import Any, Dict, Optional, Tuple

import numpy as np

from .. import _egosgm
from .formats import Found
from .parts import Matrix, expect_size, expect_upright, matrix, refuse, rotation, size_of
from .rectification import StereoRig

# Names that NumPy's users and others give the matrices of stereoCalibrate, and the numbers of a rectified pair (Cityscapes' in two groups), in small letters
# without marks.
_NAMES = {
    "left_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(l|left|1)|(l|left|1)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "right_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(r|right|2)|(r|right|2)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "left_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(l|left|1)|(l|left|1)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "right_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(r|right|2)|(r|right|2)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "R": r"r|om|rot|rotmat|rotation(matrix)?|rmat|rstereo|stereor", "T": r"t|trans|transvec|translation(vector)?|tvec|tstereo|stereot",
    "Q": r"q|disptodepthmat|disparitytodepth", "size": r"(image|img)?(size|shape|resolution)|dims", "width": r"(left|intrinsics?)?(image|img|camera)?(size|resolution)?(width|sizex)", "height": r"(left|intrinsics?)?(image|img|camera)?(size|resolution)?(height|sizey)",
    "R1": r"r1", "R2": r"r2", "P1": r"p1", "P2": r"p2",
    "fx": r"(intrinsics?)?(f|fx|focal(length)?(px)?)", "fy": r"(intrinsics?)?fy", "cx": r"(intrinsics?)?(cx[0l]?|u0|ppx)", "cy": r"(intrinsics?)?(cy[0l]?|v0|ppy)",
    "right_cx": r"cx[1r]", "baseline": r"b|(extrinsics?|stereo)?baseline(m|met(er|re)s?)?", "baseline_mm": r"baseline(mm|millimet(er|re)s?)",
    "fov": r"(camera|image)?(h|x|horizontal)?(fov|fieldofview)(h|x|horizontal)?(deg|degrees?)?", "vertical_fov": r"(camera|image)?(v|y|vertical)(fov|fieldofview)(deg|degrees?)?",
}


def is_camera(data: Dict[str, Any]) -> bool:
    """Whether it holds the numbers of one lens, whoever wrote them."""
    names = {re.sub(r"[^a-z0-9]", "", str(name).lower()) for name in data}
    return bool(names & {"projectionparameters", "cameramatrix", "intrinsicmatrix", "intrinsics", "intrinsic", "k", "mtx", "m", "fx", "f", "focallength"})


def of_q(q: Matrix, file: pathlib.Path) -> _egosgm.Calibration:
    expect_upright(q, "Q", file)
    if not q[3, 2] > 0:
        raise refuse(file, f"its Q has a baseline of {1 / q[3, 2]:.4g} m: are left and right swapped?" if q[3, 2] else "its Q has no baseline")
    return _egosgm.Calibration(q[2, 3], q[2, 3], -q[0, 3], -q[1, 3], 1 / q[3, 2], q[3, 3] / q[3, 2])


def named(data: Dict[str, Any]) -> Dict[str, Any]:
    """The values of a stereo calibration by our names."""
    found: Dict[str, Any] = {}
    for key, value in data.items():
        plain = re.sub(r"[^a-z0-9]", "", str(key).lower())
        for name, pattern in _NAMES.items():
            if re.fullmatch(pattern, plain) and value is not None:
                found.setdefault(name, value)
    return found


def _coefficients(value: Any, name: str, is_fisheye: bool, file: pathlib.Path) -> Matrix:
    numbers = matrix(value, ())
    if numbers is None or numbers.size not in ((4,) if is_fisheye else (4, 5, 8, 12, 14)):
        count = 0 if numbers is None else numbers.size
        raise refuse(file, f"{name} has {count} numbers; OpenCV's {'fisheye model has 4' if is_fisheye else 'model has 4, 5, 8, 12 or 14'}")
    return numbers


_SHAPES = "3x3 of a matrix and of R (or a vector of 3), 3 of T"


def _number(value: Any, name: str, what: str, file: pathlib.Path) -> float:
    found = matrix(value, (1,))
    if found is None:
        raise refuse(file, f"is {what}, and its {name} is '{str(value)[:40]}', not one finite number: write it with a decimal point and without a unit (lengths in metres)")
    return float(found[0])


_NUMBERS = ("fx", "fy", "cx", "cy", "right_cx", "baseline", "baseline_mm", "fov", "vertical_fov")


def _of_numbers(numbers: Dict[str, float], size: Optional[Tuple[int, int]], file: pathlib.Path, what: str) -> _egosgm.Calibration:
    """Of a rectified pair. A field of view is of a rendered camera, whose principal point is the middle; of another one nothing is guessed."""
    middle = dict(zip(("cx", "cy"), ((side - 1) / 2 for side in size or ())))
    if "fx" not in numbers:
        name, degrees = ("fov", numbers["fov"]) if "fov" in numbers else ("vertical_fov", numbers["vertical_fov"])
        if not math.pi < degrees < 180:
            raise refuse(file, f"is {what} with a field of view of {degrees:g}: it is in degrees"
                         + (f": is this one in radians ({math.degrees(degrees):.4g} degrees)?" if 0 < degrees <= math.pi else ", below 180"))
        if not size:
            raise refuse(file, f"is {what} of a field of view, and nothing tells the images' size: give width and height")
        numbers = {**middle, "fx": size[name != "fov"] / (2 * math.tan(math.radians(degrees) / 2)), **numbers}
    lacking = [name for name in ("cx", "cy") if name not in numbers]
    if lacking:
        near = f"; the middle would be cx {middle['cx']:g}, cy {middle['cy']:g}" if middle else ""
        raise refuse(file, f"is {what} and lacks {' and '.join(lacking)}, the principal point [px], which lies near the middle of the images{near}")
    fx, cx, baseline_m = numbers["fx"], numbers["cx"], numbers.get("baseline", 0.001 * numbers.get("baseline_mm", 0))
    if not baseline_m:
        raise refuse(file, f"is {what} of fx, cx and cy, and lacks the baseline: give the distance of the two cameras in metres")
    return _egosgm.Calibration(fx, numbers.get("fy", fx), cx, numbers["cy"], baseline_m, numbers.get("right_cx", cx) - cx)


def by_names(data: Dict[str, Any], file: pathlib.Path, what: str, is_fisheye: bool = False, images_size: Optional[Tuple[int, int]] = None) -> Found:
    found = named(data)
    size = size_of(found.get("size"))
    if size is None and ("width" in found) != ("height" in found):
        raise refuse(file, f"is {what} with the images' {'width' if 'width' in found else 'height'} alone: give image_width and image_height, or neither")
    if size is None and "width" in found:
        size = size_of([found["width"], found["height"]])
    matrices = {name: matrix(found.get(name), (3, 3)) for name in ("left_matrix", "right_matrix")}
    for side, one in enumerate(matrices.values(), 1):
        expect_upright(one, f"M{side}", file)
    matrices["R"], matrices["T"] = rotation(found.get("R")), matrix(found.get("T"), (3,))
    missing = [name for name, one in matrices.items() if one is None]
    if not missing:
        lacking = [f"D{side}" for side, name in enumerate(("left_distortion", "right_distortion"), 1) if name not in found]
        if lacking:
            raise refuse(file, f"is {what} and lacks {' and '.join(lacking)}, the distortion: give zeros where there is none")
        for side, name in enumerate(("left_distortion", "right_distortion"), 1):
            matrices[name] = _coefficients(found[name], f"D{side}", is_fisheye, file)
        given = tuple(matrix(found.get(name), (3, 3) if name[0] == "R" else (3, 4)) for name in ("R1", "R2", "P1", "P2"))
        return StereoRig(**matrices, is_fisheye=is_fisheye, size=size,  # type: ignore[arg-type]
                         given=None if any(one is None for one in given) else given)  # type: ignore[arg-type]
    q = matrix(found["Q"], (4, 4)) if "Q" in found else None
    if q is not None and len(missing) >= 2:
        expect_size(size, images_size, file)
        return of_q(q, file)
    if not {"fx", "fov", "vertical_fov"}.isdisjoint(found):
        numbers = {name: _number(found[name], name, what, file) for name in _NUMBERS if name in found}
        expect_size(size, images_size, file)
        return _of_numbers(numbers, size or images_size, file, what)
    if all(name in found for name in missing):
        raise refuse(file, f"is {what}, and its {' and '.join(missing)} {'are' if missing[1:] else 'is'} not of finite numbers, {_SHAPES}: does a decimal comma part one of them?")
    there = ", ".join(str(key) for key in list(data)[:12])
    raise refuse(file, f"is {what} ({there}) and lacks {', '.join(missing)}: a stereo calibration has the matrix and the distortion of both cameras, "
                        "R and T, of finite numbers (M1, D1, M2, D2, R, T); that of rectified images fx, cx, cy and baseline")


def foundation_stereo(text: str, file: pathlib.Path) -> Optional[_egosgm.Calibration]:
    """FoundationStereo's K.txt: nine numbers, and the baseline [m]."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
    if len(numbers) == 9:
        raise refuse(file, "is a camera matrix alone, as of FoundationStereo's K.txt without its second row, the baseline in metres")
    if len(numbers) != 10:
        return None
    expect_upright(np.array(numbers[:9]), "K", file)
    if numbers[6:9] != [0, 0, 1]:
        return None
    return _egosgm.Calibration(numbers[0], numbers[4], numbers[2], numbers[5], numbers[9])

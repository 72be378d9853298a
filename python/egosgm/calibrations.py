# SPDX-License-Identifier: Apache-2.0
"""Calibrations as other programs write them, told apart by what they hold: the one place that reads them."""
import configparser
import contextlib
import dataclasses
import functools
import gzip
import io
import json
import math
import os
import pathlib
import re
import types
import xml.etree.ElementTree as ElementTree
import zlib
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm
from .rectification import StereoRig

_Path = Union[str, "os.PathLike[str]"]
_Matrix = NDArray[np.float64]


_MOST_BYTES, _MOST_PARTS = 1 << 22, 2000
Found = Union[StereoRig, _egosgm.Calibration]
_Camera = Tuple[_Matrix, _Matrix, bool]  # matrix, distortion, whether that is a fisheye's
_Reader = TypeVar("_Reader", bound=Callable[..., Any])


def _with_words(reader: _Reader) -> _Reader:
    """The reader, for which whatever a part of another kind than it should be raises is an InvalidArgument."""
    @functools.wraps(reader)
    def read(file: Any, *arguments: Any, **options: Any) -> Any:
        try:
            with np.errstate(all="ignore"):  # what comes of it is refused
                return reader(file, *arguments, **options)
        except (_egosgm.Error, OSError, ImportError):
            raise
        except Exception as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise _egosgm.InvalidArgument(f"{file}: is a calibration with a part that cannot be read ({reason}): was it edited or cut?") from error
    return read  # type: ignore[return-value]


def _without_rectification(rig: StereoRig) -> Optional[_egosgm.Calibration]:
    """The calibration of images that need no rectification; None where they need one."""
    k, other, t = np.asarray(rig.left_matrix), np.asarray(rig.right_matrix), np.ravel(rig.T)
    is_level = np.allclose(rig.R, np.eye(3), atol=1e-6) and np.allclose(t[1:], 0, atol=1e-6 * abs(t[0]))
    if rig.given is not None or np.any(rig.left_distortion) or np.any(rig.right_distortion) or not is_level or not t[0] < 0:
        return None
    if not np.allclose([k[0, 0], k[1, 1], k[1, 2]], [other[0, 0], other[1, 1], other[1, 2]], rtol=1e-6):
        return None
    return _egosgm.Calibration(k[0, 0], k[1, 1], k[0, 2], k[1, 2], -t[0], other[0, 2] - k[0, 2])


def _refuse(file: pathlib.Path, text: str) -> _egosgm.InvalidArgument:
    return _egosgm.InvalidArgument(f"{file}: {text}")


def _yaml_of(text: str, file: pathlib.Path) -> Any:
    try:
        import yaml
    except ImportError:
        raise _refuse(file, "YAML of other programs needs the package PyYAML: pip install pyyaml") from None

    class Loader(yaml.SafeLoader):
        pass

    # OpenCV's matrices are maps with a tag, and its first line is of YAML 1.0.
    Loader.add_multi_constructor("", lambda loader, suffix, node: loader.construct_mapping(node, deep=True)
                                 if isinstance(node, yaml.MappingNode) else loader.construct_scalar(node))
    body = re.sub(r"^%YAML[^\n]*\n", "", text.lstrip("\ufeff"))
    body = re.sub(r"(?m)^(\s*[\w.]+):(?=[^\s:])", r"\1: ", body)
    try:
        documents = [document for document in yaml.load_all(body, Loader) if document is not None]  # a topic's, one message each
        return documents[0] if documents else None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise _refuse(file, "is no YAML that can be read: " + str(error).replace("\n", " ")) from None


def _matrix(value: Any, shape: Tuple[int, ...]) -> Optional[_Matrix]:
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


def _needed(data: Dict[str, Any], names: Tuple[str, ...], shape: Tuple[int, ...], file: pathlib.Path, what: str) -> _Matrix:
    found = _first(data, names, shape)
    if found is not None:
        return found
    raise _refuse(file, f"is {what} and lacks {' or '.join(names)}, {int(np.prod(shape)) if shape else 'some'} finite numbers")


def _first(data: Dict[str, Any], names: Tuple[str, ...], shape: Tuple[int, ...]) -> Optional[_Matrix]:
    return next((found for name in names if name in data and (found := _matrix(data[name], shape)) is not None), None)


def _number(data: Dict[str, Any], name: str, file: pathlib.Path, what: str) -> float:
    return float(_needed(data, (name,), (1,), file, what)[0])


def _of_four(numbers: _Matrix) -> _Matrix:
    fx, fy, cx, cy = numbers
    return np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])


def _size_of(value: Any) -> Optional[Tuple[int, int]]:
    numbers = _matrix(value, (2,)) if value is not None else None
    return (int(numbers[0]), int(numbers[1])) if numbers is not None else None


def _distortion(values: Any, model: str, file: pathlib.Path) -> Tuple[_Matrix, bool]:
    """OpenCV's coefficients of what others call the same, and whether they are a fisheye's."""
    numbers = _matrix(values, ()) if values is not None else None
    model = model.lower().replace("-", "").replace("_", "")
    if model in ("", "none", "pinhole") and (numbers is None or not numbers.any()):
        return np.zeros(5), False
    if numbers is None:
        numbers = np.zeros(4)
    if model in ("", "radtan", "radialtangential", "plumbbob", "brown", "opencv", "pinhole", "rationalpolynomial"):
        return (numbers if numbers.size in (4, 5, 8, 12, 14) else np.pad(numbers, (0, max(0, 5 - numbers.size)))), False
    if model in ("equi", "equidistant", "fisheye", "kannalabrandt8", "kannalabrandt"):
        return numbers[:4], True
    raise _refuse(file, f"its distortion is of the model \"{model}\": radtan and equidistant are read")


def _pair(left: _Camera, right: _Camera, right_from_left: _Matrix, size: Any,
          file: pathlib.Path) -> StereoRig:
    if left[2] != right[2]:
        raise _refuse(file, "one camera is a fisheye and the other one is not: calibrate both by one model")
    return StereoRig(left[0], left[1], right[0], right[1], right_from_left[:3, :3], right_from_left[:3, 3], left[2], _size_of(size))


def _kalibr(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    what = "a camera chain of Kalibr"
    cameras: List[_Camera] = []
    for name in ("cam0", "cam1"):
        camera = data.get(name)
        if not isinstance(camera, dict):
            raise _refuse(file, f"is {what} of one camera: {name} is missing")
        if camera.get("camera_model", "pinhole") != "pinhole":
            raise _refuse(file, f"is {what}, and {name} is of the model \"{camera['camera_model']}\": pinhole is read")
        matrix = _of_four(_needed(camera, ("intrinsics", "camera_matrix"), (4,), file, what))
        cameras.append((matrix, *_distortion(camera.get("distortion_coeffs"), str(camera.get("distortion_model", "")), file)))
    second = data["cam1"]
    if "T_cn_cnm1" in second:
        right_from_left = _needed(second, ("T_cn_cnm1",), (4, 4), file, what)
    elif "T_cam_imu" in second and "T_cam_imu" in data["cam0"]:
        right_from_left = _needed(second, ("T_cam_imu",), (4, 4), file, what) @ np.linalg.inv(
            _needed(data["cam0"], ("T_cam_imu",), (4, 4), file, what))
    else:
        raise _refuse(file, f"is {what} and lacks T_cn_cnm1, where the second camera stands")
    return _pair(cameras[0], cameras[1], right_from_left, data["cam0"].get("resolution"), file)


def _sensors(files: List[pathlib.Path], contents: List[Dict[str, Any]]) -> StereoRig:
    """EuRoC's and Kimera's, a file for each camera."""
    cameras, body_from = [], []
    for file, data in zip(files, contents):
        what = "one camera of EuRoC or Kimera"
        matrix = _of_four(_needed(data, ("intrinsics",), (4,), file, what))
        model = str(data.get("distortion_model", ""))
        cameras.append((matrix, *_distortion(data.get("distortion_coefficients"), model, file)))
        body_from.append(_needed(data, ("T_BS",), (4, 4), file, what))
    return _pair(cameras[0], cameras[1], np.linalg.inv(body_from[1]) @ body_from[0], contents[0].get("resolution"), files[0])


class _Info:
    """A camera of ROS's calibrator, as a camera info has it."""

    def __init__(self, data: Dict[str, Any], file: pathlib.Path) -> None:
        """data: of the calibrator's file, or of a message as `ros2 topic echo` and `rostopic echo` print it."""
        what = "a camera of ROS's calibrator"
        self.k = _needed(data, ("camera_matrix", "k", "K"), (9,), file, what)
        self.p = _needed(data, ("projection_matrix", "p", "P"), (12,), file, what)
        rotation, distortion = _first(data, ("rectification_matrix", "r", "R"), (9,)), _first(data, ("distortion_coefficients", "d", "D"), ())
        self.r = np.eye(3).reshape(-1) if rotation is None else rotation
        self.d = np.zeros(0) if distortion is None else distortion
        self.width, self.height = (int(data.get(f"image_{side}", data.get(side, 0))) for side in ("width", "height"))
        self.distortion_model = str(data.get("distortion_model", ""))
        self.binning_x, self.binning_y = int(data.get("binning_x", 0)), int(data.get("binning_y", 0))
        region = data.get("roi")
        self.roi = types.SimpleNamespace(**{name: int(region.get(name, 0)) for name in ("x_offset", "y_offset", "width", "height")}) \
            if isinstance(region, dict) else None


def _is_info(data: Dict[str, Any]) -> bool:
    return "projection_matrix" in data or any(_matrix(data.get(p), (12,)) is not None and k in data for p, k in (("p", "k"), ("P", "K")))


def _ros(files: List[pathlib.Path], contents: List[Dict[str, Any]]) -> Found:
    from .ros_images import Cameras, are_raw
    infos = [_Info(data, file) for data, file in zip(contents, files)]
    cameras = Cameras(*infos, are_raw(infos[0], ""), names=tuple(str(file) for file in files))
    return cameras.calibration if cameras.rig is None else cameras.rig


def _orb_slam(data: Dict[str, Any], file: pathlib.Path) -> Found:
    what = "a file of settings of ORB-SLAM"
    size = [data.get("Camera.width"), data.get("Camera.height")]
    if "RIGHT.K" in data:  # raw images
        cameras = []
        for side in ("LEFT", "RIGHT"):
            matrix = _needed(data, (f"{side}.K",), (3, 3), file, what)
            cameras.append((matrix, _needed(data, (f"{side}.D",), (), file, what), False))
        rotations = [_needed(data, (f"{side}.R",), (3, 3), file, what) for side in ("LEFT", "RIGHT")]
        p = _needed(data, ("RIGHT.P",), (3, 4), file, what)
        transform = np.eye(4)
        transform[:3, :3] = rotations[1].T @ rotations[0]
        transform[:3, 3] = rotations[1].T @ [p[0, 3] / p[0, 0], 0, 0]
        return _pair(cameras[0], cameras[1], transform, size, file)
    prefix = "Camera1" if "Camera1.fx" in data else "Camera"
    four = np.array([_number(data, f"{prefix}.{name}", file, what) for name in ("fx", "fy", "cx", "cy")])
    if "Stereo.T_c1_c2" in data and data.get("Camera.type") != "Rectified":
        model = "equidistant" if data.get("Camera.type") == "KannalaBrandt8" else "radtan"
        cameras = []
        for name in ("Camera1", "Camera2"):
            matrix = _of_four(np.array([_number(data, f"{name}.{part}", file, what) for part in ("fx", "fy", "cx", "cy")]))
            order = ("k1", "k2", "k3", "k4") if model == "equidistant" else ("k1", "k2", "p1", "p2", "k3")
            cameras.append((matrix, *_distortion([float(data.get(f"{name}.{part}", 0)) for part in order], model, file)))
        return _pair(cameras[0], cameras[1], np.linalg.inv(_needed(data, ("Stereo.T_c1_c2",), (4, 4), file, what)), size, file)
    for name, of_focal in (("Stereo.b", 1.0), ("Camera.bf", four[0])):
        if name in data:
            return _egosgm.Calibration(*four, _number(data, name, file, what) / of_focal)
    raise _refuse(file, f"is {what} of one camera: it lacks Stereo.b or Camera.bf, the baseline")


def _transform(rotation: _Matrix, translation: Sequence[float]) -> _Matrix:
    transform = np.eye(4)
    transform[:3, :3], transform[:3, 3] = rotation, translation
    return transform


def _vins(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    """VINS-Fusion's, with a file for each camera beside it."""
    what = "a configuration of VINS"
    if int(data.get("num_of_cam", 2)) < 2 or "cam1_calib" not in data:
        raise _refuse(file, f"is {what} of one camera: cam1_calib is missing")
    cameras = [_camodocal(file.parent / str(data[f"cam{i}_calib"])) for i in (0, 1)]
    body_from = [_needed(data, (f"body_T_cam{i}",), (4, 4), file, what) for i in (0, 1)]
    return _pair(cameras[0], cameras[1], np.linalg.inv(body_from[1]) @ body_from[0], [data.get("image_width"), data.get("image_height")], file)


def _camodocal(file: pathlib.Path) -> _Camera:
    what, data = "a camera of VINS", _data_of(_text_of(file), file)
    kind = str(data.get("model_type", "")).upper() if isinstance(data, dict) else ""
    if kind == "KANNALA_BRANDT":
        numbers = [_number(data["projection_parameters"], name, file, what) for name in ("mu", "mv", "u0", "v0", "k2", "k3", "k4", "k5")]
        return _of_four(np.array(numbers[:4])), np.array(numbers[4:]), True
    if kind != "PINHOLE":
        raise _refuse(file, f"is {what} of the model \"{kind}\": PINHOLE and KANNALA_BRANDT are read")
    four = [_number(data["projection_parameters"], name, file, what) for name in ("fx", "fy", "cx", "cy")]
    return _of_four(np.array(four)), np.array([_number(data["distortion_parameters"], name, file, what) for name in ("k1", "k2", "p1", "p2")]), False


def _basalt(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    from .ros_images import rotation_of
    what = "a calibration of Basalt"
    cameras, body_from = [], []
    for camera, pose in zip(data.get("intrinsics", [])[:2], data.get("T_imu_cam", [])[:2]):
        kind, numbers = camera.get("camera_type"), camera.get("intrinsics", {})
        if kind not in ("pinhole", "kb4", "pinhole-radtan8"):
            raise _refuse(file, f"is {what} of the model \"{kind}\": pinhole, pinhole-radtan8 and kb4 are read")
        order = {"pinhole": (), "kb4": ("k1", "k2", "k3", "k4"), "pinhole-radtan8": ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6")}[kind]
        lens = [_number(numbers, name, file, what) for name in order]
        cameras.append((_of_four(np.array([_number(numbers, name, file, what) for name in ("fx", "fy", "cx", "cy")])), np.array(lens or [0.0] * 4), kind == "kb4"))
        p = [_number(pose, name, file, what) for name in ("px", "py", "pz", "qx", "qy", "qz", "qw")]
        body_from.append(_transform(rotation_of(*p[3:]), p[:3]))
    if len(cameras) < 2:
        raise _refuse(file, f"is {what} of one camera")
    return _pair(cameras[0], cameras[1], np.linalg.inv(body_from[1]) @ body_from[0], (data.get("resolution") or [None])[0], file)


def _depthai(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    """Of the left and the right camera of an OAK, sockets 1 and 2; where one stands is told from the other, or both from a third one [cm]."""
    what = "the calibration of an OAK camera"
    sockets = {int(socket): camera for socket, camera in data["cameraData"]}
    if not {1, 2} <= set(sockets):
        raise _refuse(file, f"is {what} without a left and a right camera (sockets 1 and 2)")

    def to_root(socket: int) -> Tuple[int, _Matrix]:
        transform = np.eye(4)
        for _ in range(len(sockets)):
            extrinsics = sockets[socket].get("extrinsics", {})
            rotation, t = _matrix(extrinsics.get("rotationMatrix"), (3, 3)), extrinsics.get("translation", {})
            if rotation is None or int(extrinsics.get("toCameraSocket", -1)) not in sockets:
                break
            transform = _transform(rotation, [0.01 * float(t[axis]) for axis in "xyz"]) @ transform
            socket = int(extrinsics["toCameraSocket"])
        return socket, transform

    cameras = [(_needed(sockets[i], ("intrinsicMatrix",), (3, 3), file, what), _needed(sockets[i], ("distortionCoeff",), (14,), file, what), False) for i in (1, 2)]
    (root, left), (other_root, right) = to_root(1), to_root(2)
    if root != other_root:
        raise _refuse(file, f"is {what}, which does not say how the cameras of sockets 1 and 2 stand")
    return _pair(cameras[0], cameras[1], np.linalg.inv(right) @ left, [sockets[1].get("width"), sockets[1].get("height")], file)


_ZED_SIZES = {"2K": (2208, 1242), "FHD": (1920, 1080), "HD": (1280, 720), "VGA": (672, 376), "FHD1200": (1920, 1200), "SVGA": (960, 600)}


def _zed(text: str, file: pathlib.Path, size: Optional[Tuple[int, int]]) -> StereoRig:
    """The factory calibration of a ZED camera, of several sizes of images; its lengths are millimetres."""
    what, parser = "the factory calibration of a ZED camera", configparser.ConfigParser(strict=False)
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise _refuse(file, f"is {what} that cannot be read: {str(error).splitlines()[0]}") from None
    there = [name for name in _ZED_SIZES if parser.has_section(f"LEFT_CAM_{name}") and parser.has_section(f"RIGHT_CAM_{name}")]
    chosen = [name for name in there if _ZED_SIZES[name] == size] if size else there
    if len(chosen) != 1:
        sizes = ", ".join("{}x{}".format(*_ZED_SIZES[name]) for name in there) or "none"
        raise _refuse(file, f"is {what} for images of {sizes}, " + (f"not of {size[0]}x{size[1]}" if size else "and here nothing tells which: `egosgm rectify` "
                      "goes by the images' size; in Python give read_calibration the size"))
    name = chosen[0]
    cameras = []
    for side in ("LEFT", "RIGHT"):
        values = dict(parser[f"{side}_CAM_{name}"])
        four = np.array([_number(values, key, file, what) for key in ("fx", "fy", "cx", "cy")])
        cameras.append((_of_four(four), np.array([float(values.get(key, 0)) for key in ("k1", "k2", "p1", "p2", "k3")]), False))
    stereo = dict(parser["STEREO"]) if parser.has_section("STEREO") else {}
    sized = [float(stereo.get(f"{key}_{name}".lower(), stereo.get(key, 0))) for key in ("ty", "tz", "rx", "cv", "rz")]
    rotation = _rotation(sized[2:])
    assert rotation is not None
    return _pair(cameras[0], cameras[1], _transform(rotation, 0.001 * np.array([-_number(stereo, "baseline", file, what), *sized[:2]])), _ZED_SIZES[name], file)


def _vkitti(file: pathlib.Path) -> _egosgm.Calibration:
    """Virtual KITTI 2's intrinsic.txt and extrinsic.txt, of its first frame."""
    def rows(name: str, count: int) -> Dict[int, _Matrix]:
        path = file.with_name(name)
        found: Dict[int, _Matrix] = {}
        for row in _text_of(path).splitlines()[1:]:
            numbers = _matrix(row.split(), (count + 2,))
            if numbers is None:
                raise _refuse(path, f"is of Virtual KITTI 2, and a row has not {count + 2} numbers")
            found.setdefault(int(numbers[1]), numbers[2:])
        if not {0, 1} <= set(found):
            raise _refuse(path, "is of Virtual KITTI 2 without cameras 0 and 1")
        return found

    fx, fy, cx, cy = rows("intrinsic.txt", 4)[0]
    poses = rows("extrinsic.txt", 16)
    right_from_left = poses[1].reshape(4, 4) @ np.linalg.inv(poses[0].reshape(4, 4))
    return _egosgm.Calibration(fx, fy, cx, cy, -right_from_left[0, 3])


def _of_q(q: _Matrix, file: pathlib.Path) -> _egosgm.Calibration:
    if not q[3, 2]:
        raise _refuse(file, "its Q has no baseline")
    return _egosgm.Calibration(q[2, 3], q[2, 3], -q[0, 3], -q[1, 3], abs(1 / q[3, 2]), q[3, 3] / q[3, 2])


# How NumPy's users and others call the matrices of stereoCalibrate, and the numbers of a rectified pair (Cityscapes' in two groups), in small letters
# without marks.
_NAMES = {
    "left_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(l|left|1)|(l|left|1)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "right_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(r|right|2)|(r|right|2)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "left_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(l|left|1)|(l|left|1)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "right_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(r|right|2)|(r|right|2)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "R": r"r|om|rot|rotmat|rotation(matrix)?|rmat|rstereo|stereor", "T": r"t|trans|transvec|translation(vector)?|tvec|tstereo|stereot",
    "Q": r"q|disptodepthmat|disparitytodepth", "size": r"(image|img)?(size|shape|resolution)|dims", "width": r"image_?width", "height": r"image_?height",
    "R1": r"r1", "R2": r"r2", "P1": r"p1", "P2": r"p2",
    "fx": r"(intrinsics?)?(f|fx|focal(length)?(px)?)", "fy": r"(intrinsics?)?fy", "cx": r"(intrinsics?)?(cx[0l]?|u0|ppx)", "cy": r"(intrinsics?)?(cy[0l]?|v0|ppy)",
    "right_cx": r"cx[1r]", "baseline": r"(extrinsics?)?baseline(m|met(er|re)s?)?", "baseline_mm": r"baseline(mm|millimet(er|re)s?)",
}


def _named(data: Dict[str, Any]) -> Dict[str, Any]:
    """The values of a stereo calibration by our names."""
    found: Dict[str, Any] = {}
    for key, value in data.items():
        plain = re.sub(r"[^a-z0-9]", "", str(key).lower())
        for name, pattern in _NAMES.items():
            if re.fullmatch(pattern, plain) and value is not None:
                found.setdefault(name, value)
    return found


def _coefficients(value: Any, name: str, is_fisheye: bool, file: pathlib.Path) -> _Matrix:
    if value is None:
        return np.zeros(4 if is_fisheye else 5)
    numbers = _matrix(value, ())
    if numbers is None or numbers.size not in ((4,) if is_fisheye else (4, 5, 8, 12, 14)):
        count = 0 if numbers is None else numbers.size
        raise _refuse(file, f"{name} has {count} numbers; OpenCV's {'fisheye model has 4' if is_fisheye else 'model has 4, 5, 8, 12 or 14'}")
    return numbers


def _rotation(value: Any) -> Optional[_Matrix]:
    """Of a matrix, or of a vector along the axis whose length is the angle."""
    vector = _matrix(value, (3,))
    if vector is None:
        return _matrix(value, (3, 3))
    angle = float(np.linalg.norm(vector))
    x, y, z = vector / (angle or 1.0)
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k


def _by_names(data: Dict[str, Any], file: pathlib.Path, what: str, is_fisheye: bool = False) -> Found:
    found = _named(data)
    matrices = {name: _matrix(found.get(name), (3, 3)) for name in ("left_matrix", "right_matrix")}
    matrices["R"], matrices["T"] = _rotation(found.get("R")), _matrix(found.get("T"), (3,))
    missing = [name for name, matrix in matrices.items() if matrix is None]
    if not missing:
        for side, name in enumerate(("left_distortion", "right_distortion"), 1):
            matrices[name] = _coefficients(found.get(name), f"D{side}", is_fisheye, file)
        given = tuple(_matrix(found.get(name), (3, 3) if name[0] == "R" else (3, 4)) for name in ("R1", "R2", "P1", "P2"))
        size = _size_of(found.get("size"))
        if size is None and "width" in found and "height" in found:
            size = _size_of([found["width"], found["height"]])
        return StereoRig(**matrices, is_fisheye=is_fisheye, size=size,  # type: ignore[arg-type]
                         given=None if any(matrix is None for matrix in given) else given)  # type: ignore[arg-type]
    q = _matrix(found["Q"], (4, 4)) if "Q" in found else None
    if q is not None and len(missing) >= 2:
        return _of_q(q, file)
    numbers = {name: float(value[0]) for name in ("fx", "fy", "cx", "cy", "right_cx", "baseline", "baseline_mm")
               if (value := _matrix(found.get(name), (1,))) is not None}
    if {"fx", "cx", "cy"} <= set(numbers):
        fx, cx, baseline_m = numbers["fx"], numbers["cx"], numbers.get("baseline", 0.001 * numbers.get("baseline_mm", 0))
        if not baseline_m:
            raise _refuse(file, f"is {what} of fx, cx and cy, and lacks the baseline: give the distance of the two cameras in metres")
        return _egosgm.Calibration(fx, numbers.get("fy", fx), cx, numbers["cy"], baseline_m, numbers.get("right_cx", cx) - cx)
    there = ", ".join(str(key) for key in list(data)[:12])
    raise _refuse(file, f"is {what} ({there}) and lacks {', '.join(missing)}: a stereo calibration has the matrix and the distortion of both cameras, "
                        "R and T, of finite numbers (M1, D1, M2, D2, R, T)")


def _other_side(file: pathlib.Path) -> Tuple[pathlib.Path, pathlib.Path]:
    """The files of both cameras, where one has the name of the other with the other side in it."""
    for left, right in (("left", "right"), ("Left", "Right"), ("LEFT", "RIGHT"), ("cam0", "cam1"), ("camera0", "camera1"), ("_l", "_r"), ("_0", "_1"),
                        ("0", "1")):
        if left in file.name and (other := file.with_name(file.name.replace(left, right))).is_file():
            return file, other
        if right in file.name and (other := file.with_name(file.name.replace(right, left))).is_file():
            return other, file
        if left in file.parent.name and (other := file.parent.with_name(file.parent.name.replace(left, right)) / file.name).is_file():
            return file, other
    raise _refuse(file, "is the calibration of one camera: put the other one's beside it, of the same name with left and right (or cam0 and cam1) in it")


def _plain_numbers(text: str, file: pathlib.Path) -> Optional[_egosgm.Calibration]:
    """FoundationStereo's K.txt: nine numbers, and the baseline [m]."""
    try:
        numbers = [float(word) for word in text.replace(",", " ").split()]
    except ValueError:
        return None
    if len(numbers) == 9:
        raise _refuse(file, "is a camera matrix alone, as of FoundationStereo's K.txt without its second row, the baseline in metres")
    if len(numbers) != 10 or numbers[6:9] != [0, 0, 1]:
        return None
    return _egosgm.Calibration(numbers[0], numbers[4], numbers[2], numbers[5], numbers[9])


def _check_parts(text: str, file: pathlib.Path) -> None:
    """Readers call themselves for what is nested, as deep as it is: what begins something is counted."""
    begun = len(re.findall(r"[\[{<]|[:-](?=\s|$)", text))
    if begun > _MOST_PARTS:
        raise _refuse(file, f"has {begun} nested or named parts, the most is {_MOST_PARTS}; give a calibration alone")


def _text_of(file: pathlib.Path) -> str:
    if not file.exists():
        raise _refuse(file, "no such file")
    content = _egosgm._read_file(file, _MOST_BYTES)
    if content[:2] == b"\x1f\x8b":
        with contextlib.suppress(EOFError, OSError, zlib.error):
            content = gzip.GzipFile(fileobj=io.BytesIO(content)).read(_MOST_BYTES)
    if content[:2] in (b"\xff\xfe", b"\xfe\xff"):
        raise _refuse(file, "is UTF-16, as some editors write: save it as UTF-8")
    return content.decode("utf-8-sig", errors="replace")


def _of_element(element: Any) -> Any:
    return {part.tag: _of_element(part) for part in element} if len(element) else element.text


def _data_of(text: str, file: pathlib.Path) -> Any:
    """What XML, JSON or YAML holds."""
    _check_parts(text, file)
    start = text.lstrip()[:1]
    try:
        if start == "<":
            return _of_element(ElementTree.fromstring(text))
        return json.loads(text) if start in ("{", "[") and start else _yaml_of(text, file)
    except (ValueError, RecursionError, ElementTree.ParseError) as error:
        if isinstance(error, _egosgm.InvalidArgument):
            raise
        raise _refuse(file, f"is no {'XML' if start == '<' else 'JSON'} that can be read: {error}") from None


def _of_data(data: Any, file: pathlib.Path, is_fisheye: bool) -> Found:
    if not isinstance(data, dict):
        raise _refuse(file, "holds no names with values: it is no calibration that is known")
    flat = {str(key): value for key, value in data.items()}
    if isinstance(flat.get("cam0"), dict):
        return _kalibr(flat, file)
    if "T_BS" in flat or _is_info(flat):
        return _of_two_files(list(_other_side(file)))
    if "projection_parameters" in flat:
        raise _refuse(file, "is one camera of VINS: give the configuration that names both, with cam0_calib and cam1_calib")
    if "cam0_calib" in flat:
        return _vins(flat, file)
    if isinstance(flat.get("value0"), dict) and "T_imu_cam" in flat["value0"]:
        return _basalt(flat["value0"], file)
    if isinstance(flat.get("cameraData"), list):
        return _depthai(flat, file)
    if isinstance(flat.get("disparity_to_depth"), dict):
        name = next((name for name in ("cams_12", "cams_03") if name in flat["disparity_to_depth"]), "cams_12")
        return _of_q(_needed(flat["disparity_to_depth"], (name,), (4, 4), file, "DSEC's cam_to_cam.yaml"), file)
    if "Camera.fx" in flat or "Camera1.fx" in flat:
        return _orb_slam(flat, file)
    nested = {f"{outer}_{inner}": value for outer, group in flat.items() if isinstance(group, dict) and "data" not in group
              for inner, value in group.items()}
    return _by_names({**nested, **flat}, file, "YAML, XML or JSON", is_fisheye)


def _of_two_files(files: List[pathlib.Path]) -> Found:
    contents = [_data_of(_text_of(path), path) for path in files]
    for file, data in zip(files, contents):
        if not isinstance(data, dict) or not ("T_BS" in data or _is_info(data)):
            raise _refuse(file, "is not the calibration of one camera, as of ROS (camera_matrix, projection_matrix) or EuRoC (T_BS, intrinsics)")
    if ("T_BS" in contents[0]) != ("T_BS" in contents[1]):
        raise _refuse(files[1], f"is of another kind than {files[0]}: give both cameras' files of one program")
    return (_sensors if "T_BS" in contents[0] else _ros)(files, contents)


def _of_folder(folder: pathlib.Path, is_fisheye: bool) -> Found:
    for mav0 in (folder, folder / "mav0"):
        if (mav0 / "cam0/sensor.yaml").exists():
            return read_euroc_rig(mav0)
    if (folder / "intrinsics.yml").exists():
        found = read_opencv_rig(folder, 1.0, is_fisheye)
        if found is not None:
            return found
    arrays = [file for file in sorted(folder.glob("*.npy")) if file.is_file()]  # NumPy would wait for a pipe
    if arrays:
        return _by_names({file.stem: np.load(file, allow_pickle=False) for file in arrays}, folder, "a folder of .npy")
    candidates = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in (".yaml", ".yml", ".json", ".xml", ".txt", ".npz")]
    lefts = [file for file in candidates if re.search("left|cam0|_l[.]", file.name, re.IGNORECASE)]
    if len(lefts) == 1:
        return _found(lefts[0], is_fisheye)
    if len(candidates) == 1:
        return _found(candidates[0], is_fisheye)
    raise _refuse(folder, "is a folder without one calibration: give the file" + (", of " + ", ".join(c.name for c in candidates[:8]) if candidates else ""))


def _found(file: pathlib.Path, is_fisheye: bool, size: Optional[Tuple[int, int]] = None) -> Found:
    if file.is_dir():
        return _of_folder(file, is_fisheye)
    if not file.is_file():
        raise _refuse(file, "is a pipe or a device; give a file" if file.exists() else "no such file")
    with open(file, "rb") as stream:
        start = stream.read(8)
    if start.startswith((b"\x80", b"MATLAB")):
        kind, remedy = ("a file of MATLAB", "write its matrices as JSON, by jsonencode, or of OpenCV's names") if start.startswith(b"M") else \
            ("a pickle of Python, which may run programs", "save its matrices by numpy.savez, or as JSON")
        raise _refuse(file, f"is {kind}: it is not read; {remedy}")
    if start.startswith(b"PK"):
        try:
            with np.load(file, allow_pickle=False) as archive:
                if sum(part.file_size for part in archive.zip.infolist()) > _MOST_BYTES:
                    raise _refuse(file, f"holds more than {_MOST_BYTES >> 20} MiB of arrays: give a calibration alone")
                return _by_names({name: archive[name] for name in archive.files}, file, "an archive of NumPy arrays")
        except (ValueError, OSError) as error:
            raise _refuse(file, f"is no archive of NumPy arrays: {error}") from None
    if start.startswith(b"\x93NUMPY"):
        array = np.load(file, allow_pickle=False)
        if array.shape == (4, 4):
            return _of_q(array.astype(float), file)
        raise _refuse(file, f"is one NumPy array of the shape {array.shape}: give the folder that holds all of them, or Q")
    try:
        return _egosgm._read_calibration(file)
    except _egosgm.InvalidArgument as error:
        own_error = error
    text = _text_of(file)
    if re.search(r"(?m)^\[(LEFT|RIGHT)_CAM_\w+\]", text):
        return _zed(text, file, size)
    if text.startswith("frame cameraID "):
        return _vkitti(file)
    plain = _plain_numbers(text, file)
    if plain is not None:
        return plain
    is_own = re.search(r"(?m)^\s*(P_rect_\d|P[0-3]\s*:(?!\s*!!)|cam0\s*=|baseline_m\b)", text) and not text.startswith("%YAML")
    if is_own or file.suffix.lower() not in (".yaml", ".yml", ".json", ".xml", ".txt", ".conf", ".cfg", ".gz", ""):
        raise own_error
    data = _data_of(text, file)
    if not isinstance(data, dict):
        raise own_error
    return _of_data(data, file, is_fisheye)


def _in_unit(rig: StereoRig, unit_m: float) -> StereoRig:
    """The rig whose translation was in units of unit_m, in metres."""
    given = rig.given and (*rig.given[:3], np.asarray(rig.given[3]) * [1, 1, 1, unit_m])
    return dataclasses.replace(rig, T=np.asarray(rig.T) * unit_m, given=given)


@_with_words
def read_opencv_rig(file: _Path, unit_m: float = 1.0, is_fisheye: bool = False) -> Optional[StereoRig]:
    """Reads OpenCV's stereo calibration (M1, D1, M2, D2, R, T; YAML, XML or JSON). unit_m: metres in a unit of T. None where the file is of another
    kind."""
    path = pathlib.Path(file)
    data: Any = {}
    for part in (path / "intrinsics.yml", path / "extrinsics.yml") if path.is_dir() else (path,):
        text = _text_of(part)
        try:
            contents = _data_of(text, part)
        except _egosgm.InvalidArgument:
            if text.startswith(("%YAML", "{", "<")):
                raise
            contents = None
        if not isinstance(contents, dict):
            return None
        data = {**contents, **data}
    if "left_matrix" not in _named(data):
        return None
    found = _by_names(data, path, "a calibration of OpenCV", is_fisheye)
    return _in_unit(found, unit_m) if isinstance(found, StereoRig) else None


@_with_words
def read_euroc_rig(mav0: _Path) -> StereoRig:
    """Reads cam0/sensor.yaml and cam1/sensor.yaml of an EuRoC sequence."""
    files = [pathlib.Path(mav0, camera, "sensor.yaml") for camera in ("cam0", "cam1")]
    contents = [_data_of(_text_of(file), file) for file in files]
    for file, data in zip(files, contents):
        if not isinstance(data, dict):
            raise _refuse(file, "is no sensor.yaml of EuRoC")
    return _sensors(files, contents)


@_with_words
def find(file: "_Path | Sequence[_Path]", unit_m: Optional[float] = None, is_fisheye: bool = False, size: Optional[Tuple[int, int]] = None) -> Found:
    """The calibration of a file or a folder, of whichever program, or of a file for each camera: a Calibration of rectified images, or a rig of raw ones.
    unit_m: metres in a unit of the translation; None: 1, and a baseline that no rig has is refused. size: (width, height) of the images, for files that
    are of several. Throws InvalidArgument with what the file is, and what it lacks."""
    files = [pathlib.Path(part) for part in ([file] if isinstance(file, (str, os.PathLike)) else file)]
    if not 1 <= len(files) <= 2:
        raise _egosgm.InvalidArgument(f"a calibration is one file, or one for each camera, left and right, not {len(files)}")
    path = files[0]
    found = _found(path, is_fisheye, size) if len(files) == 1 else _of_two_files(files)
    if not isinstance(found, StereoRig):
        return found
    found = dataclasses.replace(_in_unit(found, unit_m or 1.0), is_fisheye=found.is_fisheye or is_fisheye)
    baseline_m = float(np.linalg.norm(found.T))
    if unit_m is None and math.isfinite(baseline_m) and baseline_m > 1e-3:
        doubt = _egosgm._suspect_baseline(baseline_m, 0.0)
        if doubt and doubt.is_certain:
            raise _refuse(path, f"T gives {doubt.what}: {doubt.remedy} Give --unit cm or --unit mm (unit_m 0.01 or 0.001), whichever it is; the side of a square in metres where T "
                                "counts a board's squares (--unit 0.025, unit_m 0.025); or --unit m (unit_m 1) where it is right")
    return _without_rectification(found) or found


def read_calibration(file: "_Path | Sequence[_Path]", unit_m: Optional[float] = None, is_fisheye: bool = False,
                     size: Optional[Tuple[int, int]] = None) -> Found:
    """Reads a calibration, of whichever program: EgoSGM's, KITTI's, Middlebury's, Cityscapes', DSEC's, ORB-SLAM's, FoundationStereo's and Virtual KITTI's of
    rectified images give a Calibration; OpenCV's, ROS's, Kalibr's, EuRoC's, VINS', Basalt's, an OAK's, a ZED's, and NumPy's arrays, of raw ones a
    StereoRig. file: one, or (left, right). size: (width, height) of the images, for a ZED's file."""
    return find(file, unit_m, is_fisheye, size)

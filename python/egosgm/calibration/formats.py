# SPDX-License-Identifier: Apache-2.0
"""Calibrations as other programs write them, a function a format."""
import configparser
import math
import pathlib
import re
import types
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

from .. import _egosgm
from .parts import Camera, Matrix, Values, data_of, expect_size, expect_upright, matrix, of_four, one_resolution, refuse, rotation, size_of, text_of, transform
from .rectification import StereoRig

Found = Union[StereoRig, _egosgm.Calibration]


def cameras_of_chain(data: Dict[str, Any]) -> List[int]:
    """Numbers of the cameras in a camera chain of Kalibr; none where it is no such chain."""
    return sorted(int(name[3:]) for name, value in data.items() if re.fullmatch(r"cam\d+", name) and isinstance(value, dict))


def kalibr(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    chain = Values(data, file, "a camera chain of Kalibr")
    cameras: List[Camera] = []
    number = cameras_of_chain(data)[0]
    left, right = f"cam{number}", f"cam{number + 1}"
    for name in (left, right):
        if not isinstance(data.get(name), dict):
            raise chain.refuse(f" of one camera: {name} is missing")
        camera = chain.part(data[name])
        if camera.data.get("camera_model", "pinhole") != "pinhole":
            raise chain.refuse(f", and {name} is of the model \"{camera.data['camera_model']}\": pinhole is read")
        lens = camera.lens(camera.data.get("distortion_coeffs"), str(camera.data.get("distortion_model", "")))
        numbers = matrix(camera.data.get("distortion_coeffs"), ())
        if numbers is not None and numbers.size > 4 and numbers.any():
            raise chain.refuse(f", and distortion_coeffs of {name} are {numbers.size} numbers, not 4: does a decimal comma part one of them?")
        cameras.append((of_four(camera.matrix((4,), "intrinsics", "camera_matrix")), *lens))
    first, second = chain.part(data[left]), chain.part(data[right])
    if "T_cn_cnm1" in second.data:
        right_from_left = second.matrix((4, 4), "T_cn_cnm1")
    elif "T_cam_imu" in second.data and "T_cam_imu" in first.data:
        right_from_left = second.matrix((4, 4), "T_cam_imu") @ np.linalg.inv(first.matrix((4, 4), "T_cam_imu"))
    elif "T_imu_cam" in second.data and "T_imu_cam" in first.data:  # OpenVINS's
        right_from_left = np.linalg.inv(second.matrix((4, 4), "T_imu_cam")) @ first.matrix((4, 4), "T_imu_cam")
    else:
        raise chain.refuse(" and lacks T_cn_cnm1, where the second camera stands")
    return chain.pair(cameras, right_from_left, one_resolution(first, second))


def euroc(files: List[pathlib.Path], contents: List[Dict[str, Any]]) -> StereoRig:
    """EuRoC's and Kimera's, a file for each camera."""
    both = [Values(data, file, "one camera of EuRoC or Kimera") for file, data in zip(files, contents)]
    cameras = [(of_four(camera.matrix((4,), "intrinsics")),
                *camera.lens(camera.data.get("distortion_coefficients"), str(camera.data.get("distortion_model", "")))) for camera in both]
    return both[0].pair_on_body(cameras, [camera.matrix((4, 4), "T_BS") for camera in both], one_resolution(*both))


class _Info:
    """A camera of ROS's calibrator, as a camera info has it."""

    def __init__(self, data: Dict[str, Any], file: pathlib.Path) -> None:
        """data: of the calibrator's file, or of a message as `ros2 topic echo` and `rostopic echo` print it."""
        camera = Values(data, file, "a camera of ROS's calibrator")
        self.k, self.p = camera.matrix((9,), "camera_matrix", "k", "K"), camera.matrix((12,), "projection_matrix", "p", "P")
        rotation, distortion = camera.first((9,), "rectification_matrix", "r", "R"), camera.first((), "distortion_coefficients", "d", "D")
        if data.get("distortion_model") and not {"distortion_coefficients", "d", "D"} & set(data):
            raise camera.refuse(" and lacks distortion_coefficients: give zeros where there is no distortion")
        self.r = np.eye(3).reshape(-1) if rotation is None else rotation
        self.d = np.zeros(0) if distortion is None else distortion
        self.width, self.height = (int(camera.matrix((1,), f"image_{side}", side)[0]) for side in ("width", "height"))
        self.distortion_model = str(data.get("distortion_model", ""))
        self.binning_x, self.binning_y = int(data.get("binning_x", 0)), int(data.get("binning_y", 0))
        region = data.get("roi")
        self.roi = types.SimpleNamespace(**{name: int(region.get(name, 0)) for name in ("x_offset", "y_offset", "width", "height")}) \
            if isinstance(region, dict) else None


def is_info(data: Dict[str, Any]) -> bool:
    return "projection_matrix" in data or any(matrix(data.get(p), (12,)) is not None and k in data for p, k in (("p", "k"), ("P", "K")))


def ros(files: List[pathlib.Path], contents: List[Dict[str, Any]], size: Optional[Tuple[int, int]]) -> Found:
    from ..bag.ros_images import Cameras, are_raw
    infos = [_Info(data, file) for data, file in zip(contents, files)]
    cameras = Cameras(*infos, any(are_raw(info, "") for info in infos), names=tuple(str(file) for file in files))
    if cameras.rig is not None:
        return cameras.rig
    expect_size(cameras.size, size, files[0])
    return cameras.calibration


def orb_slam(data: Dict[str, Any], file: pathlib.Path, images_size: Optional[Tuple[int, int]]) -> Found:
    settings = Values(data, file, "a file of settings of ORB-SLAM")
    size = [data.get("Camera.width"), data.get("Camera.height")]
    if "RIGHT.K" in data:  # raw images
        cameras: List[Camera] = [(settings.matrix((3, 3), f"{side}.K"), settings.matrix((), f"{side}.D"), False) for side in ("LEFT", "RIGHT")]
        left, right = (settings.matrix((3, 3), f"{side}.R") for side in ("LEFT", "RIGHT"))
        p = settings.matrix((3, 4), "RIGHT.P")
        return settings.pair(cameras, transform(right.T @ left, right.T @ [p[0, 3] / p[0, 0], 0, 0]), size)
    four = settings.numbers("fx fy cx cy", "Camera1." if "Camera1.fx" in data else "Camera.")
    kind = data.get("Camera.type")
    if "Stereo.T_c1_c2" in data and kind != "Rectified":
        model, order = ("equidistant", "k1 k2 k3 k4") if kind == "KannalaBrandt8" else ("radtan", "k1 k2 p1 p2 k3")
        cameras = []
        for name in ("Camera1.", "Camera2."):
            there = [part for part in order.split() if name + part in data or (part != "k3" and any(key.startswith((f"{name}k", f"{name}p")) for key in data))]
            cameras.append((of_four(settings.numbers("fx fy cx cy", name)), *settings.lens(settings.numbers(" ".join(there), name).tolist() or [0.0] * 4, model)))
        return settings.pair(cameras, np.linalg.inv(settings.matrix((4, 4), "Stereo.T_c1_c2")), size)
    for name, of_focal in (("Stereo.b", 1.0), ("Camera.bf", four[0])):
        if name in data:
            expect_size(size_of(size), images_size, file)
            return _egosgm.Calibration(*four, settings.numbers(name)[0] / of_focal)
    raise settings.refuse(" of one camera: it lacks Stereo.b or Camera.bf, the baseline")


def vins(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    """VINS-Fusion's, with a file for each camera beside it."""
    configuration = Values(data, file, "a configuration of VINS")
    if int(data.get("num_of_cam", 2)) < 2 or "cam1_calib" not in data:
        raise configuration.refuse(" of one camera: cam1_calib is missing")
    cameras = [_camodocal(file.parent / str(data[f"cam{i}_calib"])) for i in (0, 1)]
    body_from = [configuration.matrix((4, 4), f"body_T_cam{i}") for i in (0, 1)]
    return configuration.pair_on_body(cameras, body_from, [data.get("image_width"), data.get("image_height")])


def _camodocal(file: pathlib.Path) -> Camera:
    camera = Values(data_of(text_of(file), file), file, "a camera of VINS")
    kind = str(camera.data.get("model_type", "")).upper() if isinstance(camera.data, dict) else ""
    if kind not in ("PINHOLE", "KANNALA_BRANDT"):
        raise camera.refuse(f" of the model \"{kind}\": PINHOLE and KANNALA_BRANDT are read")
    projection = camera.part(camera.data["projection_parameters"])
    if kind == "KANNALA_BRANDT":
        return of_four(projection.numbers("mu mv u0 v0")), projection.numbers("k2 k3 k4 k5"), True
    return of_four(projection.numbers("fx fy cx cy")), camera.part(camera.data["distortion_parameters"]).numbers("k1 k2 p1 p2"), False


_BASALT_LENSES = {"pinhole": "", "kb4": "k1 k2 k3 k4", "pinhole-radtan8": "k1 k2 p1 p2 k3 k4 k5 k6"}


def basalt(data: Dict[str, Any], file: pathlib.Path) -> StereoRig:
    from ..bag.ros_images import rotation_of
    calibration = Values(data, file, "a calibration of Basalt")
    cameras, body_from = [], []
    for camera, pose in zip(data.get("intrinsics", [])[:2], data.get("T_imu_cam", [])[:2]):
        kind, values = camera.get("camera_type"), calibration.part(camera.get("intrinsics", {}))
        if kind not in _BASALT_LENSES:
            raise calibration.refuse(f" of the model \"{kind}\": pinhole, pinhole-radtan8 and kb4 are read")
        lens = values.numbers(_BASALT_LENSES[kind])
        cameras.append((of_four(values.numbers("fx fy cx cy")), lens if lens.size else np.zeros(4), kind == "kb4"))
        p = calibration.part(pose).numbers("px py pz qx qy qz qw")
        body_from.append(transform(rotation_of(*p[3:]), p[:3]))
    if len(cameras) < 2:
        raise calibration.refuse(" of one camera")
    return calibration.pair_on_body(cameras, body_from, (data.get("resolution") or [None])[0])


def _stream_from(calibrated: Optional[Tuple[int, int]], size: Optional[Tuple[int, int]]) -> Optional[Matrix]:
    """What an OAK's matrices are multiplied by for images of another size, which it makes by whole numbers of pixels and by cutting alike on both sides; None of other
    sizes."""
    if not calibrated or not size or 0 in calibrated + size:
        return None
    step = min(whole // part for whole, part in zip(calibrated, size))
    if step < 1 or not any(whole == step * part for whole, part in zip(calibrated, size)):
        return None
    left, top = ((whole / step - part) / 2 for whole, part in zip(calibrated, size))
    return np.array([[1 / step, 0, -left], [0, 1 / step, -top], [0, 0, 1]])


def oak(data: Dict[str, Any], file: pathlib.Path, images_size: Optional[Tuple[int, int]]) -> StereoRig:
    """Of the left and the right camera of an OAK, sockets 1 and 2; where one stands is told from the other, or both from a third one [cm]."""
    calibration = Values(data, file, "the calibration of an OAK camera")
    sockets = {int(socket): camera for socket, camera in data["cameraData"]}
    if not {1, 2} <= set(sockets):
        raise calibration.refuse(" without a left and a right camera (sockets 1 and 2)")

    def to_root(socket: int) -> Tuple[int, Matrix]:
        root_from = np.eye(4)
        for _ in range(len(sockets)):
            extrinsics = sockets[socket].get("extrinsics", {})
            turn, t = matrix(extrinsics.get("rotationMatrix"), (3, 3)), extrinsics.get("translation", {})
            if turn is None or int(extrinsics.get("toCameraSocket", -1)) not in sockets:
                break
            root_from = transform(turn, [0.01 * float(t[axis]) for axis in "xyz"]) @ root_from
            socket = int(extrinsics["toCameraSocket"])
        return socket, root_from

    both = [calibration.part(sockets[i]) for i in (1, 2)]
    kinds = [camera.data.get("cameraType", 0) for camera in both]
    if not set(kinds) <= {0, 1}:  # perspective and fisheye
        raise calibration.refuse(f" of the lenses cameraType {kinds[0]} and {kinds[1]}: 0 and 1 are read")
    calibrated = size_of([both[0].data.get("width"), both[0].data.get("height")])
    stream = _stream_from(calibrated, images_size)
    cameras = [((np.eye(3) if stream is None else stream) @ camera.matrix((3, 3), "intrinsicMatrix"), camera.matrix((), "distortionCoeff")[:4 if kind else 14], bool(kind))
               for camera, kind in zip(both, kinds)]
    (root, left), (other_root, right) = to_root(1), to_root(2)
    if root != other_root:
        raise calibration.refuse(", which does not say how the cameras of sockets 1 and 2 stand")
    return calibration.pair_on_body(cameras, [left, right], calibrated if stream is None else images_size)


_ZED_SIZES = {"2K": (2208, 1242), "FHD": (1920, 1080), "HD": (1280, 720), "VGA": (672, 376), "FHD1200": (1920, 1200), "SVGA": (960, 600)}


def zed(text: str, file: pathlib.Path, size: Optional[Tuple[int, int]]) -> StereoRig:
    """The factory calibration of a ZED camera, of several sizes of images; its lengths are millimetres, of all three axes against OpenCV's T."""
    parser, factory = configparser.ConfigParser(strict=False, interpolation=None), Values({}, file, "the factory calibration of a ZED camera")
    try:
        parser.read_string(text)
    except configparser.Error as error:
        raise factory.refuse(f" that cannot be read: {str(error).splitlines()[0]}") from None
    there = [name for name in _ZED_SIZES if parser.has_section(f"LEFT_CAM_{name}") and parser.has_section(f"RIGHT_CAM_{name}")]
    chosen = [name for name in there if _ZED_SIZES[name] == size] if size else there
    if len(chosen) != 1:
        sizes = ", ".join("{}x{}".format(*_ZED_SIZES[name]) for name in there) or "none"
        raise factory.refuse(f" for images of {sizes}, " + (f"not of {size[0]}x{size[1]}" if size else "and here nothing tells which: `egosgm rectify` "
                             "goes by the images' size; in Python give read_calibration the size"))
    name = chosen[0]
    cameras = []
    for side in ("LEFT", "RIGHT"):
        values = dict(parser[f"{side}_CAM_{name}"])
        lens = np.array([float(values.get(key, 0)) for key in ("k1", "k2", "p1", "p2", "k3")])
        cameras.append((of_four(factory.part(values).numbers("fx fy cx cy")), lens, False))
    stereo = dict(parser["STEREO"]) if parser.has_section("STEREO") else {}
    sized = [float(stereo.get(f"{key}_{name}".lower(), stereo.get(key, 0))) for key in ("ty", "tz", "rx", "cv", "rz")]
    turn = rotation(sized[2:])
    assert turn is not None
    return factory.pair(cameras, transform(turn, -0.001 * np.array([factory.part(stereo).numbers("baseline")[0], *sized[:2]])), _ZED_SIZES[name])


def virtual_kitti(file: pathlib.Path) -> _egosgm.Calibration:
    """Virtual KITTI 2's intrinsic.txt and extrinsic.txt, of its first frame."""
    def rows(name: str, count: int) -> Dict[int, Matrix]:
        path = file.with_name(name)
        found: Dict[int, Matrix] = {}
        for row in text_of(path).splitlines()[1:]:
            numbers = matrix(row.split(), (count + 2,))
            if numbers is None:
                raise refuse(path, f"is of Virtual KITTI 2, and a row has not {count + 2} numbers")
            found.setdefault(int(numbers[1]), numbers[2:])
        if not {0, 1} <= set(found):
            raise refuse(path, "is of Virtual KITTI 2 without cameras 0 and 1")
        return found

    four, poses = rows("intrinsic.txt", 4)[0], rows("extrinsic.txt", 16)
    right_from_left = poses[1].reshape(4, 4) @ np.linalg.inv(poses[0].reshape(4, 4))
    return _egosgm.Calibration(*four, -right_from_left[0, 3])


def is_cahv(text: str) -> bool:
    return all(re.search(rf"(?m)^\s*{name}\s*=", text) for name in "CAHV")


def _cahv(text: str, file: pathlib.Path) -> Tuple[Camera, Matrix, Optional[Tuple[int, int]]]:
    """A camera, where it stands in the rover's frame [m], and the size of its images. CAHV is Yakimovsky and Cunningham's, O and R of CAHVOR a radial lens of
    Gennery's, whose axis O is A's here."""
    rover = Values({}, file, "a rover's camera (CAHV)")
    rows = dict(re.findall(r"(?m)^\s*(\w+)\s*=\s*(.*?)\s*$", text))
    values = rover.part({name: row.strip("()[]").replace(",", " ").split() for name, row in rows.items()})
    c, a, h, v = (values.matrix((3,), name) for name in "CAHV")
    if "E" in rows:
        raise rover.refuse(" with E, of the model CAHVORE for fisheyes: give images and cameras that were linearized to CAHV")
    axis, lens = values.first((3,), "O"), values.first((3,), "R")
    if lens is None or not lens.any():
        axis, lens = a, np.zeros(3)
    elif axis is None or np.linalg.norm(np.cross(a, axis)) > _MOST_AXIS_ERROR:
        raise rover.refuse(" of the model CAHVOR, whose lens has an axis O that is not A: give images and cameras that were linearized to CAHV")
    cx, cy, fx, fy = a @ h, a @ v, np.linalg.norm(np.cross(a, h)), np.linalg.norm(np.cross(a, v))
    if not (abs(np.linalg.norm(a) - 1) < 1e-3 and fx > 0 and fy > 0):
        raise rover.refuse(", and A is no vector of length 1, or H or V lies along it")
    scale = 1 + lens[0]
    k = np.array([[scale * fx, 0, cx], [0, scale * fy, cy], [0, 0, 1]])
    turn = np.array([(h - cx * a) / fx, (v - cy * a) / fy, a])
    return (k, np.array([lens[1] / scale, lens[2] / scale, 0, 0, 0]), False), np.linalg.inv(transform(turn, -turn @ c)), size_of(rows.get("Dimensions"))


def cahv(files: List[pathlib.Path], texts: List[str]) -> StereoRig:
    """Two cameras of a rover."""
    (left, rover_from_left, size), (right, rover_from_right, _) = (_cahv(text, file) for text, file in zip(texts, files))
    return Values({}, files[0], "a rover's camera (CAHV)").pair_on_body([left, right], [rover_from_left, rover_from_right], size)


def is_camera(data: Dict[str, Any]) -> bool:
    """Whether it holds the numbers of one lens, whoever wrote them."""
    names = {re.sub(r"[^a-z0-9]", "", str(name).lower()) for name in data}
    return bool(names & {"projectionparameters", "cameramatrix", "intrinsicmatrix", "intrinsics", "intrinsic", "k", "mtx", "m", "fx", "f", "focallength"})


def of_q(q: Matrix, file: pathlib.Path) -> _egosgm.Calibration:
    expect_upright(q, "Q", file)
    if not q[3, 2] > 0:
        raise refuse(file, f"its Q has a baseline of {1 / q[3, 2]:.4g} m: are left and right swapped?" if q[3, 2] else "its Q has no baseline")
    return _egosgm.Calibration(q[2, 3], q[2, 3], -q[0, 3], -q[1, 3], 1 / q[3, 2], q[3, 3] / q[3, 2])


_MOST_AXIS_ERROR = 1e-3  # of a lens's axis, which moves its centre by as many focal lengths


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

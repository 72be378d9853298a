# SPDX-License-Identifier: Apache-2.0
"""Calibrations as other programs write them, a function a format."""
import configparser
import pathlib
import re
import types
from typing import Any, Dict, List, Optional, Tuple, Union

import numpy as np

from .. import _egosgm
from .parts import Camera, Matrix, Values, data_of, expect_one_size, expect_size, matrix, of_four, one_resolution, refuse, rotation, size_of, text_of, transform
from .rectification import StereoRig

Found = Union[StereoRig, _egosgm.Calibration]
_MOST_AXIS_ERROR = 1e-3  # of a lens's axis, which moves its centre by as many focal lengths


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
        cameras.append((of_four(camera.four("intrinsics", "camera_matrix")), *lens))
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
    cameras = [(of_four(camera.four("intrinsics")),
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
    calibrated, other = (size_of([camera.data.get("width"), camera.data.get("height")]) for camera in both)
    expect_one_size(calibrated, other, calibration.refuse)
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
    (left, rover_from_left, size), (right, rover_from_right, other_size) = (_cahv(text, file) for text, file in zip(texts, files))
    rover = Values({}, files[0], "a rover's camera (CAHV)")
    expect_one_size(size, other_size, rover.refuse)
    return rover.pair_on_body([left, right], [rover_from_left, rover_from_right], size)

# SPDX-License-Identifier: Apache-2.0
"""Calibrations as other programs write them, told apart by what they hold: the one place that reads them."""
import dataclasses
import json
import os
import pathlib
import re
from typing import Any, Callable, Dict, List, Optional, Tuple, Union

import numpy as np
from numpy.typing import NDArray

from . import _egosgm

_Path = Union[str, "os.PathLike[str]"]
_Matrix = NDArray[np.float64]


@dataclasses.dataclass
class Rig:
    """Two raw cameras, as StereoRig; this one can be written."""

    left_matrix: _Matrix
    left_distortion: _Matrix
    right_matrix: _Matrix
    right_distortion: _Matrix
    R: _Matrix
    T: _Matrix
    is_fisheye: bool = False
    size: Optional[Tuple[int, int]] = None

    def stereo_rig(self) -> _egosgm.StereoRig:
        return _egosgm.StereoRig(self.left_matrix, self.left_distortion, self.right_matrix, self.right_distortion, self.R, self.T,
                                 self.is_fisheye, self.size)

    def rectified(self) -> Optional[_egosgm.Calibration]:
        """The calibration of images that need no rectification; None where they need one."""
        k, other = self.left_matrix, self.right_matrix
        is_level = np.allclose(self.R, np.eye(3), atol=1e-6) and np.allclose(self.T[1:], 0, atol=1e-6 * abs(self.T[0]))
        if np.any(self.left_distortion) or np.any(self.right_distortion) or not is_level or not self.T[0] < 0:
            return None
        if not np.allclose([k[0, 0], k[1, 1], k[1, 2]], [other[0, 0], other[1, 1], other[1, 2]], rtol=1e-6):
            return None
        return _egosgm.Calibration(k[0, 0], k[1, 1], k[0, 2], k[1, 2], -self.T[0], other[0, 2] - k[0, 2])

    def text(self) -> str:
        """As `egosgm rectify` reads it."""
        values = {"K1": self.left_matrix, "D1": self.left_distortion, "K2": self.right_matrix, "D2": self.right_distortion, "R": self.R,
                  "T": self.T, **({"image_size": np.array(self.size)} if self.size else {})}
        return json.dumps({name: np.asarray(value).tolist() for name, value in values.items()})


Found = Union[Rig, _egosgm.StereoRig, _egosgm.Calibration]


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
        return yaml.load(body, Loader)
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        raise _refuse(file, "is no YAML that can be read: " + str(error).replace("\n", " ")) from None


def _matrix(value: Any, shape: Tuple[int, ...]) -> Optional[_Matrix]:
    if isinstance(value, dict):
        value = value.get("data")
    try:
        numbers = np.array(value, dtype=float)
    except (TypeError, ValueError):
        return None
    if numbers.size == 0 or not np.isfinite(numbers).all() or (shape and numbers.size != int(np.prod(shape))):
        return None
    return numbers.reshape(shape or -1)


def _needed(data: Dict[str, Any], names: Tuple[str, ...], shape: Tuple[int, ...], file: pathlib.Path, what: str) -> _Matrix:
    for name in names:
        if name in data and (found := _matrix(data[name], shape)) is not None:
            return found
    raise _refuse(file, f"is {what} and lacks {' or '.join(names)}, {int(np.prod(shape)) if shape else 'some'} finite numbers")


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


def _pair(left: Tuple[_Matrix, _Matrix, bool], right: Tuple[_Matrix, _Matrix, bool], right_from_left: _Matrix, size: Any,
          file: pathlib.Path) -> Rig:
    if left[2] != right[2]:
        raise _refuse(file, "one camera is a fisheye and the other one is not: calibrate both by one model")
    return Rig(left[0], left[1], right[0], right[1], right_from_left[:3, :3], right_from_left[:3, 3], left[2], _size_of(size))


def _kalibr(data: Dict[str, Any], file: pathlib.Path) -> Rig:
    what = "a camera chain of Kalibr"
    cameras: List[Tuple[_Matrix, _Matrix, bool]] = []
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


def _sensors(files: List[pathlib.Path], contents: List[Dict[str, Any]]) -> Rig:
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
        what = "a camera of ROS's calibrator"
        self.k = _needed(data, ("camera_matrix",), (9,), file, what)
        self.p = _needed(data, ("projection_matrix",), (12,), file, what)
        rotation = _matrix(data.get("rectification_matrix"), (9,))
        self.r = np.eye(3).reshape(-1) if rotation is None else rotation
        distortion = _matrix(data.get("distortion_coefficients"), ())
        self.d = np.zeros(0) if distortion is None else distortion
        self.width, self.height = int(data.get("image_width", 0)), int(data.get("image_height", 0))
        self.distortion_model = str(data.get("distortion_model", ""))
        self.binning_x = self.binning_y = 0
        self.roi = None


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


def _of_q(q: _Matrix, file: pathlib.Path) -> _egosgm.Calibration:
    if not q[3, 2]:
        raise _refuse(file, "its Q has no baseline")
    return _egosgm.Calibration(q[2, 3], q[2, 3], -q[0, 3], -q[1, 3], abs(1 / q[3, 2]), q[3, 3] / q[3, 2])


def _cityscapes(data: Dict[str, Any], file: pathlib.Path) -> _egosgm.Calibration:
    what = "Cityscapes' camera.json"
    four = [_number(data["intrinsic"], name, file, what) for name in ("fx", "fy", "u0", "v0")]
    return _egosgm.Calibration(*four, _number(data["extrinsic"], "baseline", file, what))


# How NumPy's users and others call the matrices of stereoCalibrate, in small letters without marks.
_NAMES = {
    "left_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(l|left|1)|(l|left|1)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "right_matrix": r"(m|k|mtx|cam(era)?(mats?|matrix|matrices)|intrinsics?|cam)(r|right|2)|(r|right|2)(k|m|mtx|cam(era)?(mat|matrix)|intrinsics?)",
    "left_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(l|left|1)|(l|left|1)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "right_distortion": r"(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)(r|right|2)|(r|right|2)(d|dist|distortion|dist(ortion)?coef(f)?(s|icients)?)",
    "R": r"r|rot|rotmat|rotation(matrix)?|rmat|rstereo|stereor", "T": r"t|trans|transvec|translation(vector)?|tvec|tstereo|stereot",
    "Q": r"q|disptodepthmat|disparitytodepth", "size": r"(image|img)?(size|shape|resolution)|dims",
}


def _by_names(data: Dict[str, Any], file: pathlib.Path, what: str) -> Found:
    found: Dict[str, Any] = {}
    for key, value in data.items():
        plain = re.sub(r"[^a-z0-9]", "", str(key).lower())
        for name, pattern in _NAMES.items():
            if re.fullmatch(pattern, plain) and value is not None:
                found.setdefault(name, value)
    shapes: Dict[str, Tuple[int, ...]] = {"left_matrix": (3, 3), "right_matrix": (3, 3), "left_distortion": (), "right_distortion": (), "R": (3, 3),
                                          "T": (3,)}
    matrices = {name: _matrix(found.get(name), shape) if name in found else None for name, shape in shapes.items()}
    for name in ("left_distortion", "right_distortion"):
        if matrices[name] is None and name not in found:
            matrices[name] = np.zeros(5)
    missing = [name for name, matrix in matrices.items() if matrix is None]
    if not missing:
        return Rig(**matrices, size=_size_of(found.get("size")))  # type: ignore[arg-type]
    q = _matrix(found["Q"], (4, 4)) if "Q" in found else None
    if q is not None and len(missing) >= 2:
        return _of_q(q, file)
    there = ", ".join(str(key) for key in list(data)[:12])
    raise _refuse(file, f"is {what} ({there}) and lacks {', '.join(missing)}: a stereo calibration has the matrix and the distortion of both cameras, "
                        "R and T")


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


def _of_data(data: Any, file: pathlib.Path) -> Found:
    if not isinstance(data, dict):
        raise _refuse(file, "holds no names with values: it is no calibration that is known")
    flat = {str(key): value for key, value in data.items()}
    if isinstance(flat.get("cam0"), dict):
        return _kalibr(flat, file)
    if "T_BS" in flat or "projection_matrix" in flat:
        both = list(_other_side(file))
        contents = [_yaml_of(path.read_text(errors="replace"), path) for path in both]
        return (_sensors if "T_BS" in flat else _ros)(both, contents)
    if isinstance(flat.get("disparity_to_depth"), dict):
        name = next((name for name in ("cams_12", "cams_03") if name in flat["disparity_to_depth"]), "cams_12")
        return _of_q(_needed(flat["disparity_to_depth"], (name,), (4, 4), file, "DSEC's cam_to_cam.yaml"), file)
    if "Camera.fx" in flat or "Camera1.fx" in flat:
        return _orb_slam(flat, file)
    if isinstance(flat.get("intrinsic"), dict) and isinstance(flat.get("extrinsic"), dict):
        return _cityscapes(flat, file)
    nested = {f"{outer}_{inner}": value for outer, group in flat.items() if isinstance(group, dict) and "data" not in group
              for inner, value in group.items()}
    return _by_names({**nested, **flat}, file, "YAML or JSON")


def _of_folder(folder: pathlib.Path) -> Found:
    for mav0 in (folder, folder / "mav0"):
        if (mav0 / "cam0/sensor.yaml").exists():
            return _egosgm.read_euroc_rig(mav0)
    if (folder / "intrinsics.yml").exists():
        found = _egosgm.read_opencv_rig(folder)
        if found is not None:
            return found
    arrays = sorted(folder.glob("*.npy"))
    if arrays:
        return _by_names({file.stem: np.load(file, allow_pickle=False) for file in arrays}, folder, "a folder of .npy")
    candidates = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in (".yaml", ".yml", ".json", ".xml", ".txt", ".npz")]
    lefts = [file for file in candidates if re.search("left|cam0|_l[.]", file.name, re.IGNORECASE)]
    if len(lefts) == 1:
        return _found(lefts[0])
    if len(candidates) == 1:
        return _found(candidates[0])
    raise _refuse(folder, "is a folder without one calibration: give the file" + (", of " + ", ".join(c.name for c in candidates[:8]) if candidates else ""))


def _found(file: pathlib.Path, unit_m: float = 1.0, is_fisheye: bool = False) -> Found:
    if file.is_dir():
        return _of_folder(file)
    if not file.is_file():
        raise _refuse(file, "no such file")
    start = file.read_bytes()[:8]
    if start.startswith(b"PK"):
        try:
            with np.load(file, allow_pickle=False) as archive:
                return _by_names({name: archive[name] for name in archive.files}, file, "an archive of NumPy arrays")
        except (ValueError, OSError) as error:
            raise _refuse(file, f"is no archive of NumPy arrays: {error}") from None
    if start.startswith(b"\x93NUMPY"):
        array = np.load(file, allow_pickle=False)
        if array.shape == (4, 4):
            return _of_q(array.astype(float), file)
        raise _refuse(file, f"is one NumPy array of the shape {array.shape}: give the folder that holds all of them, or Q")
    errors: List[Exception] = []
    readers: Tuple[Callable[[], Optional[Found]], ...] = (lambda: _egosgm.read_opencv_rig(file, unit_m, is_fisheye), lambda: _egosgm._read_calibration(file))
    for reader in readers:
        try:
            found = reader()
        except _egosgm.InvalidArgument as error:
            errors.append(error)
            continue
        if found is not None:
            return found
    text = file.read_bytes().decode("utf-8-sig", errors="replace")
    plain = _plain_numbers(text, file)
    if plain is not None:
        return plain
    is_own = re.search(r"(?m)^\s*(P_rect_\d|P[0-3]\s*:|cam0\s*=|baseline_m)", text)
    if is_own or file.suffix.lower() not in (".yaml", ".yml", ".json", ".xml", ".txt", ".conf", ".cfg", ""):
        raise errors[-1]
    if text.lstrip().startswith("<"):
        raise errors[0]
    try:
        data = json.loads(text) if text.lstrip().startswith(("{", "[")) else _yaml_of(text, file)
    except ValueError as error:
        raise _refuse(file, f"is no JSON that can be read: {error}") from None
    if not isinstance(data, dict):
        raise errors[-1]
    return _of_data(data, file)


def find(file: _Path, unit_m: Optional[float] = None, is_fisheye: bool = False) -> Found:
    """The calibration of a file or a folder, of whichever program: a Calibration of rectified images, or a rig of raw ones. unit_m: metres in a unit of
    the translation; None: 1, and a baseline that no rig has is refused. Throws InvalidArgument with what the file is, and what it lacks."""
    path = pathlib.Path(file)
    found = _found(path, unit_m or 1.0, is_fisheye)
    if isinstance(found, Rig):
        found.T = found.T * (unit_m or 1.0)
        found.is_fisheye = found.is_fisheye or is_fisheye
    if unit_m is None and isinstance(found, Rig):
        baseline = float(np.linalg.norm(found.T))
        doubt = _egosgm._suspect_baseline(baseline, 0.0)
        if doubt and baseline > 1:
            raise _refuse(path, f"{doubt} Give unit_m (--unit): 0.01 (cm) or 0.001 (mm), or 1 (m) where it is right")
    return found


def read_calibration(file: _Path, unit_m: Optional[float] = None, is_fisheye: bool = False) -> "_egosgm.Calibration | _egosgm.StereoRig":
    """Reads a calibration, of whichever program: EgoSGM's, KITTI's, Middlebury's, Cityscapes', DSEC's, ORB-SLAM's and FoundationStereo's of rectified
    images give a Calibration; OpenCV's, ROS's, Kalibr's, EuRoC's, and NumPy's arrays, of raw ones a StereoRig."""
    found = find(file, unit_m, is_fisheye)
    return found.rectified() or found.stereo_rig() if isinstance(found, Rig) else found

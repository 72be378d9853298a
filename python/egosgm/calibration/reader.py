# SPDX-License-Identifier: Apache-2.0
"""Calibrations of any program, told apart by what they hold: the one place that reads them."""
import dataclasses
import functools
import math
import os
import pathlib
import re
import zipfile
from typing import Any, Callable, Dict, List, Optional, Sequence, Tuple, TypeVar, Union

import numpy as np

from .. import _egosgm
from . import formats, named_values, parts
from .formats import Found
from .rectification import StereoRig, check_rig

_Path = Union[str, "os.PathLike[str]"]
_Reader = TypeVar("_Reader", bound=Callable[..., Any])


def _with_words(reader: _Reader) -> _Reader:
    """The reader, for which whatever a part of another kind than it should be raises is an InvalidArgument, and each of these names a file."""
    @functools.wraps(reader)
    def read(file: Any, *arguments: Any, **options: Any) -> Any:
        try:
            names = [os.fspath(part) for part in ([file] if isinstance(file, (str, os.PathLike)) else file)]
        except TypeError:
            raise _egosgm.InvalidArgument(f"{file!r:.60}: give the name of a calibration's file, or one for each camera") from None
        try:
            with np.errstate(all="ignore"):  # what comes of it is refused
                return reader(file, *arguments, **options)
        except _egosgm.InvalidArgument as error:  # of a value, perhaps
            if any(name in str(error) for name in names):
                raise
            raise type(error)(f"{' and '.join(names)}: {error}") from None
        except (_egosgm.Error, OSError, ImportError):
            raise
        except Exception as error:
            reason = str(error).partition("\n")[0] or type(error).__name__
            raise _egosgm.InvalidArgument(f"{' and '.join(names)}: is a calibration with a part that cannot be read ({reason}): was it edited or cut?") from error
    return read  # type: ignore[return-value]


def _without_rectification(rig: StereoRig) -> Optional[_egosgm.Calibration]:
    """The calibration of images that need no rectification; None where they need one."""
    k, other, t = np.asarray(rig.left_matrix), np.asarray(rig.right_matrix), np.ravel(rig.T)
    is_level = np.allclose(rig.R, np.eye(3), atol=1e-6) and np.allclose(t[1:], 0, atol=1e-6 * abs(t[0]))
    # A fisheye without coefficients is still none of straight lines.
    if rig.given is not None or rig.is_fisheye or np.any(rig.left_distortion) or np.any(rig.right_distortion) or not is_level or not t[0] < 0:
        return None
    if not np.allclose([k[0, 0], k[1, 1], k[1, 2]], [other[0, 0], other[1, 1], other[1, 2]], rtol=1e-6):
        return None
    return _egosgm.Calibration(k[0, 0], k[1, 1], k[0, 2], k[1, 2], -t[0], other[0, 2] - k[0, 2])


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
    raise parts.refuse(file, "is the calibration of one camera: put the other one's beside it, of the same name with left and right (or cam0 and cam1) in it")


def _of_data(data: Any, file: pathlib.Path, is_fisheye: bool, size: Optional[Tuple[int, int]]) -> Found:
    if not isinstance(data, dict):
        raise parts.refuse(file, "holds no names with values: it is no calibration that is known")
    flat = {str(key): value for key, value in data.items()}
    if formats.cameras_of_chain(flat):
        return formats.kalibr(flat, file)
    if "T_BS" in flat or formats.is_info(flat):
        return _of_two_files(list(_other_side(file)), size)
    if "projection_parameters" in flat:
        raise parts.refuse(file, "is one camera of VINS: give the configuration that names both, with cam0_calib and cam1_calib")
    if "cam0_calib" in flat:
        return formats.vins(flat, file)
    if isinstance(flat.get("value0"), dict) and "T_imu_cam" in flat["value0"]:
        return formats.basalt(flat["value0"], file)
    if isinstance(flat.get("cameraData"), list):
        return formats.oak(flat, file, size)
    if isinstance(flat.get("disparity_to_depth"), dict):
        name = next((name for name in ("cams_12", "cams_03") if name in flat["disparity_to_depth"]), "cams_12")
        return named_values.of_q(parts.Values(flat["disparity_to_depth"], file, "DSEC's cam_to_cam.yaml").matrix((4, 4), name), file)
    if "Camera.fx" in flat or "Camera1.fx" in flat:
        return formats.orb_slam(flat, file, size)
    nested = {f"{outer}_{inner}": value for outer, group in flat.items() if isinstance(group, dict) and "data" not in group
              for inner, value in group.items()}
    return named_values.by_names({**nested, **flat}, file, "a file of names and values", is_fisheye, size)


def _contents(file: pathlib.Path) -> Any:
    """Of a file of one camera: what YAML, JSON, XML or an archive of arrays holds, or the text itself of a rover's camera."""
    start = _egosgm._read_file(file, parts.MOST_BYTES)[:2] if file.is_file() else b""
    if start == b"PK":
        return _arrays(file)
    text = parts.text_of(file)
    return text if formats.is_cahv(text) else parts.data_of(text, file)


def _of_two_files(files: List[pathlib.Path], size: Optional[Tuple[int, int]] = None) -> Found:
    contents = [_contents(path) for path in files]
    kinds = ["CAHV" if isinstance(data, str) else "" if not isinstance(data, dict) else "EuRoC" if "T_BS" in data else "ROS" if formats.is_info(data) else
             "lens" if named_values.is_camera(data) else "" for data in contents]
    for file, kind in zip(files, kinds):
        if not kind:
            raise parts.refuse(file, "is not the calibration of one camera, as of ROS (camera_matrix, projection_matrix), EuRoC (T_BS, intrinsics) or a rover (C, A, H, V)")
    if kinds[0] != kinds[1]:
        raise parts.refuse(files[1], f"is of another kind than {files[0]}: give both cameras' files of one program")
    if kinds[0] == "lens":
        raise _egosgm.InvalidArgument(f"{files[0]} and {files[1]}: each is the calibration of one camera alone, and neither says how the cameras stand: R and T are missing. "
                                      "`egosgm calibrate` finds all of it by pictures of a board that both cameras took at once")
    return formats.cahv(files, contents) if kinds[0] == "CAHV" else formats.euroc(files, contents) if kinds[0] == "EuRoC" else formats.ros(files, contents, size)


def _of_folder(folder: pathlib.Path, is_fisheye: bool, size: Optional[Tuple[int, int]]) -> Found:
    for mav0 in (folder, folder / "mav0"):
        if (mav0 / "cam0/sensor.yaml").exists():
            return read_euroc_rig(mav0)
    if (folder / "intrinsics.yml").exists():
        found = read_opencv_rig(folder, 1.0, is_fisheye)
        if found is not None:
            return found
    arrays = [file for file in sorted(folder.glob("*.npy")) if file.is_file()]  # NumPy would wait for a pipe
    if arrays:
        return named_values.by_names({file.stem: _array(file) for file in arrays}, folder, "a folder of .npy", is_fisheye, size)
    candidates = [file for file in sorted(folder.iterdir()) if file.suffix.lower() in (".yaml", ".yml", ".json", ".xml", ".txt", ".npz")]
    lefts = [file for file in candidates if re.search("left|cam0|_l[.]", file.name, re.IGNORECASE)]
    if len(lefts) == 1:
        return _found(lefts[0], is_fisheye, size)
    if len(candidates) == 1:
        return _found(candidates[0], is_fisheye, size)
    raise parts.refuse(folder, "is a folder without one calibration: give the file" + (", of " + ", ".join(c.name for c in candidates[:8]) if candidates else ""))


def _array(file: pathlib.Path) -> Any:
    """Mapped: where the file says more numbers than it holds, none are allocated."""
    return np.load(file, mmap_mode="r", allow_pickle=False)


def _arrays(file: pathlib.Path) -> Dict[str, Any]:
    try:
        with np.load(file, allow_pickle=False) as archive:
            if sum(part.file_size for part in archive.zip.infolist()) > parts.MOST_BYTES:
                raise parts.refuse(file, f"holds more than {parts.MOST_BYTES >> 20} MiB of arrays: give a calibration alone")
            return {name: archive[name] for name in archive.files}
    except _egosgm.InvalidArgument:
        raise
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise parts.refuse(file, f"is no archive of NumPy arrays: {error}") from None


def _found(file: pathlib.Path, is_fisheye: bool, size: Optional[Tuple[int, int]] = None) -> Found:
    if file.is_dir():
        return _of_folder(file, is_fisheye, size)
    if not file.is_file():
        raise parts.refuse(file, "is a pipe or a device; give a file" if file.exists() else "no such file")
    with open(file, "rb") as stream:
        start = stream.read(8)
    if start.startswith((b"\x89PNG", b"\xff\xd8\xff")):
        raise parts.refuse(file, "is a picture: give the file of the cameras' calibration")
    if start.startswith((b"\x80", b"MATLAB", b"\x89HDF")):
        kind, remedy = ("a file of MATLAB", "write its matrices as JSON, by jsonencode, or of OpenCV's names") if not start.startswith(b"\x80") else \
            ("a pickle of Python, which may run programs", "save its matrices by numpy.savez, or as JSON")
        raise parts.refuse(file, f"is {kind}: it is not read; {remedy}")
    if start.startswith(b"PK"):
        return named_values.by_names(_arrays(file), file, "an archive of NumPy arrays", is_fisheye, size)
    if start.startswith(b"\x93NUMPY"):
        array = _array(file)
        if array.shape == (4, 4):
            return named_values.of_q(array.astype(float), file)
        raise parts.refuse(file, f"is one NumPy array of the shape {array.shape}: give the folder that holds all of them, or Q")
    try:
        calibration, calibrated = _egosgm._read_calibration(file)
    except _egosgm.InvalidArgument as error:
        own_error = error
    else:
        parts.expect_size(calibrated, size, file)
        return calibration
    text = parts.text_of(file)
    if re.search(r"(?m)^\[(LEFT|RIGHT)_CAM_\w+\]", text):
        return formats.zed(text, file, size)
    if formats.is_cahv(text):
        return _of_two_files(list(_other_side(file)), size)
    if text.startswith("frame cameraID "):
        return formats.virtual_kitti(file)
    plain = named_values.foundation_stereo(text, file)
    if plain is not None:
        return plain
    is_own = _egosgm._is_own_calibration(file)
    if is_own or file.suffix.lower() not in (".yaml", ".yml", ".json", ".xml", ".txt", ".conf", ".cfg", ".gz", ""):
        raise own_error
    data = parts.data_of(text, file)
    if not isinstance(data, dict):
        raise own_error
    return _of_data(data, file, is_fisheye, size)


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
        text = parts.text_of(part)
        try:
            contents = parts.data_of(text, part)
        except _egosgm.InvalidArgument:
            if text.startswith(("%YAML", "{", "<")):
                raise
            contents = None
        if not isinstance(contents, dict):
            return None
        data = {**contents, **data}
    if "left_matrix" not in named_values.named(data):
        return None
    found = named_values.by_names(data, path, "a calibration of OpenCV", is_fisheye)
    return _in_unit(found, unit_m) if isinstance(found, StereoRig) else None


@_with_words
def read_euroc_rig(mav0: _Path) -> StereoRig:
    """Reads cam0/sensor.yaml and cam1/sensor.yaml of an EuRoC sequence."""
    files = [pathlib.Path(mav0, camera, "sensor.yaml") for camera in ("cam0", "cam1")]
    contents = [parts.data_of(parts.text_of(file), file) for file in files]
    for file, data in zip(files, contents):
        if not isinstance(data, dict):
            raise parts.refuse(file, "is no sensor.yaml of EuRoC")
    return formats.euroc(files, contents)


@_with_words
def find(file: "_Path | Sequence[_Path]", unit_m: Optional[float] = None, is_fisheye: bool = False, size: Optional[Tuple[int, int]] = None) -> Found:
    """The calibration of a file or a folder, of whichever program, or of a file for each camera: a Calibration of rectified images, or a rig of raw ones.
    unit_m: metres in a unit of the translation; None: 1, and a baseline that no rig has is refused. size: (width, height) of the images: a file may be of
    several sizes, or of another one, which is refused for rectified images, and by Rectification for raw ones. Throws InvalidArgument with what the file is, and what it lacks."""
    files = [pathlib.Path(part) for part in ([file] if isinstance(file, (str, os.PathLike)) else file)]
    if not 1 <= len(files) <= 2:
        raise _egosgm.InvalidArgument(f"a calibration is one file, or one for each camera, left and right, not {len(files)}")
    if len(files) == 2 and files[0].exists() and files[1].exists() and files[0].samefile(files[1]):
        raise parts.refuse(files[0], "is given for both cameras: give the file of each")
    path, given, size = files[0], size, parts.size_of(size)
    if given is not None and size is None:
        raise _egosgm.InvalidArgument(f"size {given}: give (width, height)")
    found = _found(path, is_fisheye, size) if len(files) == 1 else _of_two_files(files, size)
    if is_fisheye and not (isinstance(found, StereoRig) and found.is_fisheye):
        raise parts.refuse(path, "is of rectified images, or says itself what its lenses are: --fisheye (is_fisheye) belongs to OpenCV's M1, D1, M2, D2, R, T")
    if not isinstance(found, StereoRig):
        if unit_m not in (None, 1):
            raise parts.refuse(path, "is of rectified images, and its format says the unit of the baseline (OpenCV's Q: metres): leave --unit (unit_m) out")
        return found
    found = _in_unit(found, 1.0 if unit_m is None else unit_m)
    baseline_m = float(np.linalg.norm(found.T))
    if unit_m is None and math.isfinite(baseline_m) and baseline_m > 1e-3:
        warning = _egosgm._suspect_baseline(baseline_m, 0.0)
        if warning and warning.is_certain:
            raise parts.refuse(path, f"T gives {warning.what}: {warning.remedy} Give --unit cm or --unit mm (unit_m 0.01 or 0.001), whichever it is; the side of a square in metres where T "
                                "counts a board's squares (--unit 0.025, unit_m 0.025); or --unit m (unit_m 1) where it is right")
    check_rig(found)
    calibration = _without_rectification(found)
    if calibration is not None:
        parts.expect_size(found.size, size, path)
    return calibration or found


def read_calibration(file: "_Path | Sequence[_Path]", unit_m: Optional[float] = None, is_fisheye: bool = False,
                     size: Optional[Tuple[int, int]] = None) -> Found:
    """Reads a calibration, of whichever program: EgoSGM's, KITTI's, Middlebury's, Cityscapes', DSEC's, ORB-SLAM's, FoundationStereo's and Virtual KITTI's of
    rectified images give a Calibration; OpenCV's, ROS's, Kalibr's, EuRoC's, VINS', Basalt's, an OAK's, a ZED's, and NumPy's arrays, of raw ones a
    StereoRig. file: one, or (left, right). size: (width, height) of the images: it chooses in a ZED's file, and a
    calibration of rectified images of another size is refused."""
    return find(file, unit_m, is_fisheye, size)


def any_calibration(width: int, height: int) -> _egosgm.Calibration:
    """In place of one that is not known: nothing is predicted then, so that any one does."""
    return _egosgm.Calibration(width, width, width / 2, height / 2, 1)

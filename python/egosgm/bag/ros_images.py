# SPDX-License-Identifier: Apache-2.0
"""ROS's images and camera infos as the library's, and its maps as ROS wants them. Messages of rclpy and of rosbags, ROS 1 and 2."""
import importlib
import pathlib
import re
import tempfile
from typing import Any, Dict, Optional, Sequence, Tuple

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from ..geometry.depth import depth_sigma_from_disparity
from ..calibration.parts import expect_one_size
from ..calibration.rectification import Rectification, StereoRig

# Bytes between neighbouring pixels of an encoding, and where the brightness lies in them, or red, green and blue.
_GREY8 = {"mono8": (1, 0), "8UC1": (1, 0), "yuv422": (2, 1), "uyvy": (2, 1), "yuv422_yuy2": (2, 0), "yuyv": (2, 0), "nv12": (1, 0),
          "nv21": (1, 0)}
_COLOURS = {"rgb8": (3, (0, 1, 2)), "bgr8": (3, (2, 1, 0)), "rgba8": (4, (0, 1, 2)), "bgra8": (4, (2, 1, 0)), "8UC3": (3, (2, 1, 0)),
            "8UC4": (4, (2, 1, 0))}
_GREY16 = ("mono16", "16UC1")
_BAYER = tuple(f"bayer_{order}{bits}" for bits in (8, 16) for order in ("rggb", "bggr", "gbrg", "grbg"))


def needs(module: str) -> Any:
    try:
        return importlib.import_module(module)
    except ImportError:
        raise _egosgm.InvalidArgument('bags need the packages rosbags and mcap: pip install rosbags mcap') from None


def grey_of(message: Any) -> NDArray[Any]:
    """A sensor_msgs Image or CompressedImage as uint8 or uint16, H x W."""
    if hasattr(message, "format"):
        grey = _decompressed(bytes(message.data), message.format)
        return _of_bayer(grey) if _is_mosaic(message.format) else grey
    height, width, step, encoding = message.height, message.width, message.step, message.encoding
    data = np.frombuffer(message.data, np.uint8) if len(message.data) > 0 else np.empty(0, np.uint8)
    is_16_bit = encoding in _GREY16 or encoding in _BAYER[4:]
    pixel_bytes = _GREY8.get(encoding, (0,))[0] or _COLOURS.get(encoding, (0,))[0] or (2 if is_16_bit else int(encoding in _BAYER))
    if not pixel_bytes:
        known = ", ".join((*_GREY8, *_COLOURS, *_GREY16, *_BAYER))
        raise _egosgm.InvalidArgument(f"images of encoding \"{encoding}\" are not read: convert them to one of {known}")
    if step < width * pixel_bytes or data.size < height * step:
        raise _egosgm.InvalidArgument(f"an image of {width}x{height} px of {encoding} with rows of {step} bytes has {data.size} bytes")
    rows = data[:height * step].reshape(height, step)
    if is_16_bit:
        grey = rows[:, :2 * width].copy().view(">u2" if message.is_bigendian else "<u2").astype(np.uint16)
        return _of_bayer(grey) if encoding in _BAYER else grey
    if encoding in _BAYER:
        return _of_bayer(rows[:, :width])
    pixels = rows[:, :width * pixel_bytes].reshape(height, width, pixel_bytes)
    if encoding in _GREY8:
        return np.ascontiguousarray(pixels[:, :, _GREY8[encoding][1]])
    red, green, blue = (pixels[:, :, channel].astype(np.uint32) for channel in _COLOURS[encoding][1])
    return ((9798 * red + 19235 * green + 3735 * blue + (1 << 14)) >> 15).astype(np.uint8)  # as OpenCV weighs and rounds


def rgb_of(message: Any) -> Optional[NDArray[np.uint8]]:
    """A sensor_msgs Image as H x W x 3; None where its encoding has no colours."""
    pixel_bytes, channels = _COLOURS.get(getattr(message, "encoding", ""), (0, ()))
    if not pixel_bytes:
        return None
    rows = np.frombuffer(message.data, np.uint8)[:message.height * message.step].reshape(message.height, message.step)
    return rows[:, :message.width * pixel_bytes].reshape(message.height, message.width, pixel_bytes)[:, :, channels]


def _of_bayer(pixels: NDArray[Any]) -> NDArray[Any]:
    """The mean of the 3x3 neighbourhood weighed by 1 2 1 has a quarter of red, half of green and a quarter of blue at each pixel, whatever
    the order of the colours."""
    if 0 in pixels.shape:
        return pixels
    padded = np.pad(pixels.astype(np.uint32), 1, mode="reflect")  # which goes on with the order
    rows = padded[:-2] + 2 * padded[1:-1] + padded[2:]
    return ((rows[:, :-2] + 2 * rows[:, 1:-1] + rows[:, 2:] + 8) >> 4).astype(pixels.dtype)


def _is_mosaic(kind: str) -> bool:
    """Whether a compressed image is the mosaic of a sensor: "ENCODING; CODEC compressed ENCODING" names no colour after it."""
    encoding, _, compression = kind.partition(";")
    target = compression.rpartition("compressed")[2].strip()
    return encoding.strip().startswith("bayer_") and (not target or target.startswith("bayer_"))


def _decompressed(data: bytes, kind: str) -> NDArray[Any]:
    with tempfile.TemporaryDirectory(prefix="egosgm_") as folder:
        file = pathlib.Path(folder) / "image"
        file.write_bytes(data)
        try:
            return _egosgm.read_grey(file)
        except (ValueError, OSError) as error:
            reason = str(error).replace(str(file), "the image")
            raise _egosgm.InvalidArgument(f"a compressed image ({kind}) cannot be read, PNG and JPEG are: {reason}") from None


def stamp_ns(message: Any) -> int:
    stamp = message.header.stamp
    return int(stamp.sec if hasattr(stamp, "sec") else stamp.secs) * 10**9 + int(
        stamp.nanosec if hasattr(stamp, "nanosec") else stamp.nsecs)


def _values(info: Any, name: str) -> NDArray[np.float64]:
    return np.array(getattr(info, name.lower(), None) if hasattr(info, name.lower()) else getattr(info, name), dtype=float)


def _matrix(info: Any, name: str, rows: int, columns: int) -> NDArray[np.float64]:
    """R is no rotation where nobody set it."""
    values = _values(info, name)
    return np.eye(3) if name == "R" and not values.any() else values.reshape(rows, columns)


def _distortion(info: Any) -> NDArray[np.float64]:
    """An empty D is none."""
    values = _values(info, "D").ravel()
    return values if values.size else np.zeros(5)


def _region(info: Any) -> Tuple[int, int, int, int]:
    """x, y, width, height of what the image shows of the sensor, in its pixels; all of it where the region is 0."""
    roi = getattr(info, "roi", None)
    if roi is None or not (roi.width and roi.height):
        x, y = (int(roi.x_offset), int(roi.y_offset)) if roi is not None else (0, 0)
        return x, y, int(info.width), int(info.height)
    return int(roi.x_offset), int(roi.y_offset), int(roi.width), int(roi.height)


def _camera(info: Any, name: str, columns: int) -> NDArray[np.float64]:
    """K or P, of the pixels that there are: CameraInfo's are of the whole sensor, of which the image shows a region, and binning makes one pixel of
    several."""
    matrix = _matrix(info, name, 3, columns).copy()
    x, y, _, _ = _region(info)
    matrix[0] -= x * matrix[2]
    matrix[1] -= y * matrix[2]
    matrix[:2] /= [[max(1, info.binning_x)], [max(1, info.binning_y)]]
    return matrix


def _size(info: Any) -> Tuple[int, int]:
    _, _, width, height = _region(info)
    return width // max(1, info.binning_x), height // max(1, info.binning_y)


def is_set(info: Any) -> bool:
    """Some drivers send infos before they have a calibration."""
    return bool(_values(info, "P").any()) or bool(_values(info, "K").any())


def _check(info: Any, name: str) -> None:
    if 0 in _size(info):
        raise _egosgm.InvalidArgument(f"{name}: the camera info is of {info.width}x{info.height} px, in bins of {info.binning_x}x{info.binning_y}, which leaves no pixel: it has to say the images' size")
    for field in "KPRD":
        values = _values(info, field)
        if not np.isfinite(values).all():
            raise _egosgm.InvalidArgument(f"{name}: {field} of the camera info holds a value that is not finite")
        if field == "D" and values.size not in (0, 4, 5, 8, 12, 14):
            raise _egosgm.InvalidArgument(f"{name}: D of the camera info has {values.size} values, not 0, 4, 5, 8, 12 or 14")
    focal = _values(info, "P")[0]
    if not focal > 0:
        raise _egosgm.InvalidArgument(f"{name}: P of the camera info {f'has an fx of {focal:g} px' if focal else 'is zero'}: the cameras were calibrated one by one, or not at all; calibrate both at once, "
                                      "as `egosgm calibrate` does, or give the pair's calibration (of a bag, --calib)")
    if abs(_values(info, "P")[1]) > 1e-3 * focal:
        raise _egosgm.InvalidArgument(f"{name}: P of the camera info has a skew of {_values(info, 'P')[1]:g} px, which no rectified camera has")


class Cameras:
    """Two sensor_msgs/CameraInfo: the calibration of rectified images, and how raw ones are rectified."""

    def __init__(self, left: Any, right: Any, rectify: bool, names: Sequence[str] = ("left", "right")) -> None:
        """Throws InvalidArgument where they are no calibration. names: where they come from, for messages."""
        for info, name in zip((left, right), names):
            _check(info, name)
        left_p, right_p = _camera(left, "P", 4), _camera(right, "P", 4)
        shift = (right_p[0, 3] - left_p[0, 3]) / right_p[0, 0]  # both may be told from where a third camera stands, as KITTI's are
        if not shift < 0:
            hint = "Tx is equal in both: is it of a stereo pair? Give --calib with the baseline" if shift == 0 else \
                "its Tx is above the left one's: are left and right swapped, or has Tx, which is -fx times the baseline, the wrong sign?"
            raise _egosgm.InvalidArgument(f"camera info: P of the right camera has no baseline: {hint}")
        if abs(left_p[0, 0] - right_p[0, 0]) > 1e-3 * left_p[0, 0] or abs(left_p[1, 2] - right_p[1, 2]) > 1e-2:
            raise _egosgm.InvalidArgument("camera info: P of both cameras have different focal lengths or rows: they are not of one rectified pair")
        self.size = _size(left)
        expect_one_size(self.size, _size(right), lambda text: _egosgm.InvalidArgument(f"camera info: is{text}"))
        self.rig: Optional[StereoRig] = None
        self._rectification: Optional[Rectification] = None
        if rectify:
            self.rig = _rig(left, right, shift)
            self._rectification = Rectification(self.rig, *self.size)
            self.calibration = self._rectification.calibration
        else:
            self.calibration = _egosgm.Calibration(left_p[0, 0], left_p[1, 1], left_p[0, 2], left_p[1, 2],
                                                   -shift, right_p[0, 2] - left_p[0, 2])

    @classmethod
    def of_calibration(cls, rig_or_calibration: "StereoRig | _egosgm.Calibration", width: int, height: int) -> "Cameras":
        """Without infos: of raw images by a rig, of rectified ones by their calibration."""
        cameras = cls.__new__(cls)
        cameras.size, cameras.rig, cameras._rectification = (width, height), None, None
        if isinstance(rig_or_calibration, StereoRig):
            cameras._rectification = Rectification(rig_or_calibration, width, height)
            cameras.calibration = cameras._rectification.calibration
        else:
            cameras.calibration = rig_or_calibration
        return cameras

    def rectified(self, left: NDArray[Any], right: NDArray[Any]) -> Tuple[NDArray[Any], NDArray[Any]]:
        return self._rectification.rectify(left, right) if self._rectification else (left, right)


def is_named_rect(topic: str) -> bool:
    return any(re.search("(^|_)rect", part) for part in topic.split("/")[-2:])


def are_raw(info: Any, topic: str) -> bool:
    """Whether images of this camera need rectifying, by its name and its distortion."""
    if is_named_rect(topic):
        return False
    return bool(np.any(_distortion(info) != 0)) or not np.allclose(_matrix(info, "R", 3, 3), np.eye(3), atol=1e-9)


def _rig(left: Any, right: Any, shift: float) -> StereoRig:
    """From where both cameras look after rectification: a point's x differs by `shift` there."""
    names = {"fisheye": "equidistant", "radtan": "plumb_bob"}  # of Kalibr and some drivers
    models = {names.get(info.distortion_model, info.distortion_model) for info in (left, right)}
    distortions = [_distortion(info) for info in (left, right)]
    fisheye = models == {"equidistant"}
    has_lens = any(d.any() for d in distortions)  # without distortion, any model says the same
    if not fisheye and has_lens and not models <= {"plumb_bob", "rational_polynomial", ""}:
        raise _egosgm.InvalidArgument(f"camera info: distortion of the model {' and '.join(sorted(models))} is not known: "
                                      "plumb_bob, rational_polynomial or equidistant is; or give rectified images")
    left_r, right_r = _matrix(left, "R", 3, 3), _matrix(right, "R", 3, 3)
    if fisheye:  # some drivers fill up with zeros
        distortions = [d[:4] if not np.any(d[4:]) else d for d in distortions]
    return StereoRig(_camera(left, "K", 3), distortions[0], _camera(right, "K", 3), distortions[1],
                             right_r.T @ left_r, right_r.T @ np.array([shift, 0, 0]), fisheye, _size(left))


def depth_maps(disparity: NDArray[np.float32], variance: NDArray[np.float32],
               calibration: _egosgm.Calibration) -> Tuple[NDArray[np.float32], NDArray[np.float32]]:
    """Depth [m] and its variance [m^2], NaN where there is none (REP 118)."""
    return _egosgm.depth_from_disparity(disparity, calibration), variance_of_depth(disparity, variance, calibration)


def variance_of_depth(disparity: NDArray[np.float32], variance: NDArray[np.float32], calibration: _egosgm.Calibration) -> NDArray[np.float32]:
    """[m^2], NaN where there is none."""
    with np.errstate(over="ignore"):
        return depth_sigma_from_disparity(disparity, variance, calibration) ** 2


def ros_range(options: Dict[str, Any], calibration: _egosgm.Calibration) -> Tuple[float, float]:
    """Least and largest disparity of the searched range, as ros_disparity means them. options: of the pipeline, by name."""
    least = options["min_disparity"] + calibration.doffs_px
    return max(0.0, least), least + options["disparities"] - 1


def ros_disparity(disparity: NDArray[np.float32], calibration: _egosgm.Calibration) -> NDArray[np.float32]:
    """As stereo_msgs/DisparityImage means it: depth is f T / d, so without the offset of the principal points; -1, which is below
    min_disparity, where there is none."""
    shifted = disparity + np.float32(calibration.doffs_px)
    return np.where((disparity == _egosgm.INVALID_DISPARITY) | (shifted < 0), np.float32(-1), shifted)


# The body's axes (x forward, y left, z up; REP 103) from the camera's (x right, y down, z forward).
BODY_FROM_OPTICAL = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def quaternion_of(rotation: NDArray[np.float64]) -> NDArray[np.float64]:
    """(x, y, z, w) of a rotation matrix: the eigenvector of the largest eigenvalue of Bar-Itzhack's matrix."""
    r = rotation
    k = np.array([[r[0, 0] - r[1, 1] - r[2, 2], 0, 0, 0], [r[1, 0] + r[0, 1], r[1, 1] - r[0, 0] - r[2, 2], 0, 0],
                  [r[2, 0] + r[0, 2], r[2, 1] + r[1, 2], r[2, 2] - r[0, 0] - r[1, 1], 0],
                  [r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1], r[0, 0] + r[1, 1] + r[2, 2]]]) / 3
    q = np.linalg.eigh(k)[1][:, -1]
    return q if q[3] >= 0 else -q


def rotation_of(x: float, y: float, z: float, w: float) -> NDArray[np.float64]:
    n = x * x + y * y + z * z + w * w
    if not n > 0:
        raise _egosgm.InvalidArgument("a pose has the quaternion 0, 0, 0, 0, which is no rotation")
    s = 2 / n
    return np.array([[1 - s * (y * y + z * z), s * (x * y - z * w), s * (x * z + y * w)],
                     [s * (x * y + z * w), 1 - s * (x * x + z * z), s * (y * z - x * w)],
                     [s * (x * z - y * w), s * (y * z + x * w), 1 - s * (x * x + y * y)]])

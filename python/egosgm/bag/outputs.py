# SPDX-License-Identifier: Apache-2.0
"""What is made of a bag: a ROS 2 MCAP file. egosgm.viewer has another one."""
import contextlib
import os
import pathlib
from time import time_ns
from typing import Any, Dict, Optional

import numpy as np
from numpy.typing import NDArray

from .. import _egosgm
from . import BagFrame
from ..geometry.points import cloud_of_maps
from .ros_images import BODY_FROM_OPTICAL, depth_maps, needs, quaternion_of, ros_disparity, ros_range


_MOST_POINTS = 100_000  # of a frame: more are slow to look at, and make large files


class McapOutput:
    """Depth, disparity, variance, points, odometry, tf and camera infos as a ROS 2 MCAP file, which appears when all of it is there."""

    def __init__(self, file: pathlib.Path, options: Dict[str, Any]) -> None:
        """options: those of the pipeline, by name."""
        writer = needs("mcap.writer")
        typesys = needs("rosbags.typesys")
        if not file.parent.is_dir():
            raise _egosgm.InvalidArgument(f"{file}: {file.parent}: no such folder")
        self._file, self._options = file, options
        self._expect_free()
        # Not the name of another run's, which may have been killed.
        self._part = file.with_name(f".egosgm-{os.getpid()}-{time_ns()}.part")
        self._store = typesys.get_typestore(typesys.Stores.ROS2_HUMBLE)
        self._types = self._store.types
        self._stream = open(self._part, "xb")
        self._writer = writer.Writer(self._stream)
        self._writer.start(profile="ros2", library="egosgm")
        self._schemas: Dict[str, int] = {}
        self._channels: Dict[str, int] = {}
        self._world_from_camera = np.eye(4)
        self._last_motion: Optional[NDArray[np.float64]] = None

    def _expect_free(self) -> None:
        if os.path.lexists(self._file):
            raise _egosgm.InvalidArgument(f"{self._file}: is there already, and stays: give another name, or remove it first")

    def _write(self, topic: str, kind: str, message: Any, time: int) -> None:
        if kind not in self._schemas:
            text = self._store.generate_msgdef(kind, ros_version=2)[0]
            self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text.encode())
        if topic not in self._channels:
            self._channels[topic] = self._writer.register_channel(topic, "cdr", self._schemas[kind])
        self._writer.add_message(self._channels[topic], time, bytes(self._store.serialize_cdr(message, kind)), time)

    def _header(self, time: int, frame_id: str) -> Any:
        stamp = self._types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
        return self._types["std_msgs/msg/Header"](stamp=stamp, frame_id=frame_id)

    def _image(self, header: Any, map_: NDArray[Any], encoding: str) -> Any:
        height, width = map_.shape
        return self._types["sensor_msgs/msg/Image"](header=header, height=height, width=width, encoding=encoding, is_bigendian=0,
                                                    step=width * map_.itemsize, data=np.ascontiguousarray(map_).view(np.uint8).reshape(-1))

    def add(self, frame: BagFrame, maps: Any, motion: Optional[NDArray[np.float64]], calibration: _egosgm.Calibration) -> None:
        time, types = frame.stamp_ns, self._types
        header = self._header(time, frame.frame_id or "egosgm_camera_optical")  # a frame without a name is none in tf
        depth, variance = depth_maps(maps.disparity, maps.variance, calibration)
        self._write("/egosgm/depth", "sensor_msgs/msg/Image", self._image(header, depth, "32FC1"), time)
        self._write("/egosgm/variance", "sensor_msgs/msg/Image", self._image(header, variance, "32FC1"), time)
        height, width = depth.shape
        least, largest = ros_range(self._options, calibration)
        region = types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=height, width=width, do_rectify=False)
        self._write("/egosgm/disparity", "stereo_msgs/msg/DisparityImage", types["stereo_msgs/msg/DisparityImage"](
            header=header, image=self._image(header, ros_disparity(maps.disparity, calibration), "32FC1"), f=calibration.fx,
            t=calibration.baseline_m, valid_window=region, min_disparity=least,
            max_disparity=largest, delta_d=0.0), time)
        reason = getattr(maps, "reason", None)
        if reason is not None:
            self._write("/egosgm/reason", "sensor_msgs/msg/Image", self._image(header, reason, "mono8"), time)
        for side, shift in (("left", 0.0), ("right", -calibration.fx * calibration.baseline_m)):
            self._write(f"/egosgm/{side}/camera_info", "sensor_msgs/msg/CameraInfo", self._info(header, calibration, shift, width, height, region), time)
        if motion is not None or frame.starts_anew:
            self._last_motion = motion
        if self._last_motion is not None:  # where none was found, the last one is repeated
            self._world_from_camera = self._world_from_camera @ np.linalg.inv(self._last_motion)
        self._write("/egosgm/odom", "nav_msgs/msg/Odometry", self._odometry(header), time)
        self._write("/tf", "tf2_msgs/msg/TFMessage", self._tf(header), time)
        self._write("/egosgm/points", "sensor_msgs/msg/PointCloud2", self._points(header, frame.left, maps, calibration), time)

    def _points(self, header: Any, grey: NDArray[Any], maps: Any, calibration: _egosgm.Calibration) -> Any:
        """Those of `egosgm.point_cloud`, evenly thinned out, in the greys of the image."""
        types = self._types
        cloud = cloud_of_maps(maps.disparity, maps.variance, grey, calibration, 0.1, None, None, 80, 1)
        step = slice(None, None, 1 + len(cloud.points) // _MOST_POINTS)
        values = np.empty((len(cloud.points[step]), 4), np.float32)
        values[:, :3] = cloud.points[step]
        rgb = cloud.colors[step].astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)
        values[:, 3] = rgb.astype(np.uint32).view(np.float32)  # as PCL packs it: three bytes of a float
        fields = [types["sensor_msgs/msg/PointField"](name=name, offset=4 * i, datatype=7, count=1) for i, name in enumerate(("x", "y", "z", "rgb"))]
        return types["sensor_msgs/msg/PointCloud2"](header=header, height=1, width=len(values), fields=fields, is_bigendian=False, point_step=16,
                                                    row_step=16 * len(values), data=values.view(np.uint8).reshape(-1), is_dense=True)

    def _tf(self, header: Any) -> Any:
        """odom to the camera's body, and from there to the images' frame."""
        types = self._types

        def transform(parent: str, child: str, matrix: NDArray[np.float64]) -> Any:
            x, y, z, w = quaternion_of(matrix[:3, :3])
            return types["geometry_msgs/msg/TransformStamped"](
                header=types["std_msgs/msg/Header"](stamp=header.stamp, frame_id=parent), child_frame_id=child,
                transform=types["geometry_msgs/msg/Transform"](
                    translation=types["geometry_msgs/msg/Vector3"](x=matrix[0, 3], y=matrix[1, 3], z=matrix[2, 3]),
                    rotation=types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)))

        body = BODY_FROM_OPTICAL @ self._world_from_camera @ BODY_FROM_OPTICAL.T
        return types["tf2_msgs/msg/TFMessage"](transforms=[transform("odom", "egosgm_camera", body),
                                                           transform("egosgm_camera", header.frame_id, BODY_FROM_OPTICAL)])

    def _info(self, header: Any, c: _egosgm.Calibration, shift: float, width: int, height: int, region: Any) -> Any:
        cx = c.cx + (c.doffs_px if shift else 0.0)
        return self._types["sensor_msgs/msg/CameraInfo"](
            header=header, height=height, width=width, distortion_model="plumb_bob", d=np.zeros(5), k=np.array([c.fx, 0, cx, 0, c.fy, c.cy, 0, 0, 1.0]),
            r=np.eye(3).reshape(-1), p=np.array([c.fx, 0, cx, shift, 0, c.fy, c.cy, 0, 0, 0, 1.0, 0]), binning_x=0, binning_y=0, roi=region)

    def _odometry(self, header: Any) -> Any:
        types = self._types
        pose = BODY_FROM_OPTICAL @ self._world_from_camera @ BODY_FROM_OPTICAL.T
        x, y, z, w = quaternion_of(pose[:3, :3])
        vector, zero = types["geometry_msgs/msg/Vector3"], np.zeros(36)
        return types["nav_msgs/msg/Odometry"](
            header=types["std_msgs/msg/Header"](stamp=header.stamp, frame_id="odom"), child_frame_id="egosgm_camera",
            pose=types["geometry_msgs/msg/PoseWithCovariance"](pose=types["geometry_msgs/msg/Pose"](
                position=types["geometry_msgs/msg/Point"](x=pose[0, 3], y=pose[1, 3], z=pose[2, 3]),
                orientation=types["geometry_msgs/msg/Quaternion"](x=x, y=y, z=z, w=w)), covariance=zero),
            twist=types["geometry_msgs/msg/TwistWithCovariance"](twist=types["geometry_msgs/msg/Twist"](
                linear=vector(x=0.0, y=0.0, z=0.0), angular=vector(x=0.0, y=0.0, z=0.0)), covariance=zero))

    def finish(self) -> None:
        self._writer.finish()
        self._stream.close()
        try:
            os.link(self._part, self._file)  # replaces nothing
        except OSError:  # others were quicker, or the file system has no links
            self._expect_free()
            os.rename(self._part, self._file)
            return
        self._part.unlink()

    def give_up(self) -> None:
        self._part.unlink(missing_ok=True)
        with contextlib.suppress(OSError):  # of a full disk
            self._stream.close()

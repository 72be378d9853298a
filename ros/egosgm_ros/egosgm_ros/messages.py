# SPDX-License-Identifier: Apache-2.0
"""Maps, points and poses as messages."""
import array
from typing import Any

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, PointCloud2, PointField
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.ros_images import BODY_FROM_OPTICAL, quaternion_of, ros_disparity, ros_range


def image_of(header: Any, values: Any) -> Image:
    """float32 as 32FC1, uint8 as mono8."""
    height, width = values.shape
    return Image(header=header, height=height, width=width, encoding="mono8" if values.dtype == np.uint8 else "32FC1", is_bigendian=0,
                 step=values.itemsize * width, data=array.array("B", np.ascontiguousarray(values).tobytes()))


def disparity_of(header: Any, disparity: Any, calibration: egosgm.Calibration, options: Any) -> DisparityImage:
    """options: of the pipeline, by name."""
    message = DisparityImage(header=header, image=image_of(header, ros_disparity(disparity, calibration)), f=calibration.fx,
                             t=calibration.baseline_m)
    message.valid_window.height, message.valid_window.width = disparity.shape
    message.min_disparity, message.max_disparity = ros_range(options, calibration)
    return message


def points_of(header: Any, depth: Any, grey: Any, calibration: egosgm.Calibration) -> PointCloud2:
    """In rows and columns as the image, NaN where there is no depth."""
    height, width = depth.shape
    points = np.empty((height, width, 4), np.float32)
    points[..., 0] = (np.arange(width, dtype=np.float32) - np.float32(calibration.cx)) / np.float32(calibration.fx) * depth
    points[..., 1] = (np.arange(height, dtype=np.float32)[:, None] - np.float32(calibration.cy)) / np.float32(calibration.fy) * depth
    points[..., 2] = depth
    points[..., 3] = grey
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(("x", "y", "z", "intensity"))]
    return PointCloud2(header=header, height=height, width=width, fields=fields, is_bigendian=False, point_step=16, row_step=16 * width,
                       data=array.array("B", points.tobytes()), is_dense=False)


def odometry_of(header: Any, frame_id: str, world_from_camera: Any) -> Odometry:
    """Of the camera's body, x forward, y left, z up."""
    message = Odometry(child_frame_id="egosgm_camera")
    message.header.stamp, message.header.frame_id = header.stamp, frame_id
    _put(BODY_FROM_OPTICAL @ world_from_camera @ BODY_FROM_OPTICAL.T, message.pose.pose.position, message.pose.pose.orientation)
    return message


def transform_of(header: Any, frame_id: str, world_from_camera: Any) -> TransformStamped:
    """Of the images' own frame, whose axes are z forward, y down."""
    message = TransformStamped(child_frame_id=header.frame_id)
    message.header.stamp, message.header.frame_id = header.stamp, frame_id
    _put(BODY_FROM_OPTICAL @ world_from_camera, message.transform.translation, message.transform.rotation)
    return message


def _put(pose: Any, position: Any, orientation: Any) -> None:
    position.x, position.y, position.z = (float(value) for value in pose[:3, 3])
    orientation.x, orientation.y, orientation.z, orientation.w = (float(value) for value in quaternion_of(pose[:3, :3]))

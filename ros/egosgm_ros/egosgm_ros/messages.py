# SPDX-License-Identifier: Apache-2.0
"""Maps, points and poses as messages."""
import array
from typing import Any, Optional

import numpy as np
from geometry_msgs.msg import TransformStamped
from nav_msgs.msg import Odometry
from sensor_msgs.msg import Image, PointCloud2, PointField
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.bag.ros_images import BODY_FROM_OPTICAL, quaternion_of, ros_disparity, ros_range

try:
    import vision_msgs.msg as vision
except ImportError:  # a ROS installation may have it, the package index has not
    vision = None

BOX_QUANTILES = 0.05, 0.95  # of an object's points along each axis: some lie on the background beside it


def bytes_of(values: Any) -> array.array:
    """Copied once."""
    data = array.array("B")
    data.frombytes(np.ascontiguousarray(values).reshape(-1).view(np.uint8))
    return data


def image_of(header: Any, values: Any) -> Image:
    """float32 as 32FC1, uint8 as mono8."""
    height, width = values.shape
    return Image(header=header, height=height, width=width, encoding="mono8" if values.dtype == np.uint8 else "32FC1", is_bigendian=0,
                 step=values.itemsize * width, data=bytes_of(values))


def disparity_of(header: Any, disparity: Any, calibration: egosgm.Calibration, options: Any) -> DisparityImage:
    """options: of the pipeline, by name."""
    message = DisparityImage(header=header, image=image_of(header, ros_disparity(disparity, calibration)), f=calibration.fx,
                             t=calibration.baseline_m)
    message.valid_window.height, message.valid_window.width = disparity.shape
    message.min_disparity, message.max_disparity = ros_range(options, calibration)
    return message


def points_of(header: Any, depth: Any, grey: Any, rgb: Any, calibration: egosgm.Calibration) -> PointCloud2:
    """In rows and columns as the image, NaN where there is no depth. rgb: None of grey images."""
    height, width = depth.shape
    names = ("x", "y", "z", "intensity") if rgb is None else ("x", "y", "z", "intensity", "rgb")
    points = np.empty((height, width, len(names)), np.float32)
    _put_points(points, depth, calibration)
    points[..., 3] = grey
    if rgb is not None:  # as PCL packs it: three bytes of a float
        points[..., 4] = (rgb.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], np.uint32)).astype(np.uint32).view(np.float32)
    fields = [PointField(name=name, offset=4 * i, datatype=PointField.FLOAT32, count=1) for i, name in enumerate(names)]
    step = 4 * len(names)
    return PointCloud2(header=header, height=height, width=width, fields=fields, is_bigendian=False, point_step=step, row_step=step * width,
                       data=bytes_of(points), is_dense=False)


def _put_points(points: Any, depth: Any, calibration: egosgm.Calibration) -> None:
    """x, y and z, in the axes of the images' frame, as the first values of each pixel."""
    height, width = depth.shape
    points[..., 0] = (np.arange(width, dtype=np.float32) - np.float32(calibration.cx)) / np.float32(calibration.fx) * depth
    points[..., 1] = (np.arange(height, dtype=np.float32)[:, None] - np.float32(calibration.cy)) / np.float32(calibration.fy) * depth
    points[..., 2] = depth


def detections_of(header: Any, objects: egosgm.LabelledObjects, depth: Any, calibration: egosgm.Calibration) -> Any:
    """A Detection3DArray of what moves by itself, in the axes of the images' frame: each with the centre of its visible surface and the box
    of its points. The message has no place for a velocity."""
    message = vision.Detection3DArray(header=header)
    points = np.empty((*depth.shape, 3), np.float32)
    _put_points(points, depth, calibration)
    for moving in objects.moving:
        own = points[(objects.labels == moving.id) & np.isfinite(depth)]
        low, high = np.quantile(own, BOX_QUANTILES, axis=0) if own.size else (np.array(moving.centre_m),) * 2
        detection = vision.Detection3D(header=header, id=str(moving.id))
        found = vision.ObjectHypothesisWithPose()
        found.hypothesis.class_id, found.hypothesis.score = "moving", 1.0
        _put_place(moving.centre_m, found.pose.pose.position)
        _put_place((low + high) / 2, detection.bbox.center.position)
        _put_place(high - low, detection.bbox.size)
        detection.results = [found]
        message.detections.append(detection)
    return message


class Path:
    """Motions added up: the camera's pose, and how uncertain it is."""

    def __init__(self) -> None:
        self.world_from_camera = np.eye(4)
        self.covariance = np.zeros((6, 6))  # of the pose's right perturbation, (translation [m], rotation [rad]) in the camera's axes
        self.motion: Optional[egosgm.Motion] = None
        self.interval_s = 0.0

    def add(self, motion: Optional[egosgm.Motion], interval_s: float) -> None:
        """None: the last motion is repeated, and is as uncertain as it is large."""
        self.interval_s = interval_s
        if motion is None:
            if self.motion is None:
                return
            moved = self.motion.current_from_previous
            size = np.concatenate([moved[:3, 3], _rotation_vector(moved[:3, :3])])
            motion = egosgm.Motion(moved, np.diag(size**2))
        self.motion = motion
        self.covariance = _moved(self.covariance, motion.current_from_previous) + motion.covariance
        self.world_from_camera = self.world_from_camera @ np.linalg.inv(motion.current_from_previous)


def _moved(covariance: Any, current_from_previous: Any) -> Any:
    """By the motion's adjoint: a turn that is uncertain makes what comes after it uncertain."""
    rotation, (x, y, z) = current_from_previous[:3, :3], current_from_previous[:3, 3]
    adjoint = np.zeros((6, 6))
    adjoint[:3, :3] = adjoint[3:, 3:] = rotation
    adjoint[:3, 3:] = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ rotation
    return adjoint @ covariance @ adjoint.T


def _rotation_vector(rotation: Any) -> Any:
    """Axis times angle [rad]."""
    q = quaternion_of(rotation)
    sine = np.linalg.norm(q[:3])
    return 2 * q[:3] if sine < 1e-12 else 2 * np.arctan2(sine, q[3]) / sine * q[:3]


def _turned(covariance: Any, rotation: Any) -> Any:
    both = np.kron(np.eye(2), rotation)
    return (both @ covariance @ both.T).ravel()


def odometry_of(header: Any, frame_id: str, path: Path) -> Odometry:
    """Of the camera's body, x forward, y left, z up; the twist is in the body's axes."""
    message = Odometry(child_frame_id="egosgm_camera")
    message.header.stamp, message.header.frame_id = header.stamp, frame_id
    pose, body = BODY_FROM_OPTICAL @ path.world_from_camera, BODY_FROM_OPTICAL[:3, :3]
    _put(pose @ BODY_FROM_OPTICAL.T, message.pose.pose.position, message.pose.pose.orientation)
    message.pose.covariance = _turned(path.covariance, pose[:3, :3])
    if path.motion is not None and path.interval_s > 0:
        moved, twist = path.motion.current_from_previous, message.twist.twist
        linear, angular = (-body @ change / path.interval_s for change in (moved[:3, 3], _rotation_vector(moved[:3, :3])))
        _put_place(linear, twist.linear)
        _put_place(angular, twist.angular)
        message.twist.covariance = _turned(path.motion.covariance / path.interval_s**2, body)
    return message


def transform_of(header: Any, frame_id: str, world_from_camera: Any) -> TransformStamped:
    """Of the images' own frame, whose axes are z forward, y down."""
    message = TransformStamped(child_frame_id=header.frame_id)
    message.header.stamp, message.header.frame_id = header.stamp, frame_id
    _put(BODY_FROM_OPTICAL @ world_from_camera, message.transform.translation, message.transform.rotation)
    return message


def _put(pose: Any, position: Any, orientation: Any) -> None:
    _put_place(pose[:3, 3], position)
    orientation.x, orientation.y, orientation.z, orientation.w = (float(value) for value in quaternion_of(pose[:3, :3]))


def _put_place(values: Any, place: Any) -> None:
    place.x, place.y, place.z = (float(value) for value in values)

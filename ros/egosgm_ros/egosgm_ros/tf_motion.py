# SPDX-License-Identifier: Apache-2.0
"""The camera's motion as tf has it: a robot's own odometry."""
from typing import Any

import numpy as np
from rclpy.duration import Duration
from rclpy.time import Time

import egosgm
from egosgm.bag.ros_images import rotation_of


class TfMotion:
    """Motions between stamps of a frame that moves in `fixed_frame`."""

    def __init__(self, node: Any, fixed_frame: str, wait_s: float) -> None:
        self._tf2_ros = tf2_ros()
        self._fixed_frame, self._wait = fixed_frame, Duration(seconds=wait_s)
        self._node = node
        self._buffer = self._tf2_ros.Buffer(node=node)
        self._listener = self._tf2_ros.TransformListener(self._buffer, node)

    def close(self) -> None:
        self._listener.unregister()
        self._node.destroy_service(self._buffer.srv)

    def between(self, frame_id: str, previous_ns: int, current_ns: int) -> egosgm.Motion:
        """Throws LookupError, which says why tf has none."""
        if not frame_id:
            raise LookupError("images name no frame in their headers, so tf knows nothing of them")
        previous, current = Time(nanoseconds=previous_ns), Time(nanoseconds=current_ns)
        try:
            found = self._buffer.lookup_transform_full(frame_id, current, frame_id, previous, self._fixed_frame, self._wait).transform
        except self._tf2_ros.TransformException as error:
            raise LookupError(f"no motion of {frame_id} in {self._fixed_frame} from tf: {error}") from None
        current_from_previous = np.eye(4)
        current_from_previous[:3, :3] = rotation_of(found.rotation.x, found.rotation.y, found.rotation.z, found.rotation.w)
        current_from_previous[:3, 3] = found.translation.x, found.translation.y, found.translation.z
        return egosgm.Motion(current_from_previous)


def tf2_ros() -> Any:
    """The module, which a robot has, but not every Python with rclpy."""
    try:
        import tf2_ros
    except ImportError as error:
        raise egosgm.InvalidArgument(f"motion_frame and publish_tf need tf2_ros ({error}): apt install ros-$ROS_DISTRO-tf2-ros-py") from None
    return tf2_ros

# SPDX-License-Identifier: Apache-2.0
"""What the tests of the ROS node share. Needs rclpy (scripts/install-dependencies --ros)."""
import array
import os
import pathlib
import sys

from sensor_msgs.msg import CameraInfo, Image

PACKAGE = pathlib.Path(__file__).resolve().parents[2] / "ros/egosgm_ros"
sys.path.insert(0, str(PACKAGE))
WIDTH, HEIGHT, RENDERED = 640, 480, 6
STREET = dict(frames=RENDERED, width=WIDTH, height=HEIGHT, seed=1, speed_m=0.1, turn_deg=0, supersampling=1)
DOMAIN = os.getpid() % 100
PATHS = {"PYTHONPATH": f"{PACKAGE}:{os.environ.get('PYTHONPATH', '')}"}  # of processes that find the package


def infos_of(c, width, height, **more):
    """The camera infos of a rectified pair: left, right."""
    k, rest = [c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1.0], [0, c.fy, c.cy, 0, 0, 0, 1.0, 0]
    return [CameraInfo(height=height, width=width, distortion_model="plumb_bob", k=k, p=[c.fx, 0, c.cx, -c.fx * c.baseline_m * side, *rest], **{"d": [0.0] * 5, **more})
            for side in (0, 1)]


def image_of(pixels, sec=0):
    """A grey image."""
    height, width = pixels.shape
    image = Image(height=height, width=width, step=width, encoding="mono8", data=array.array("B", pixels.tobytes()))
    image.header.stamp.sec, image.header.frame_id = sec, "left_optical"
    return image

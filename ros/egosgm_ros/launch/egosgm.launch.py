# SPDX-License-Identifier: Apache-2.0
"""ros2 launch egosgm_ros egosgm.launch.py camera:=oak device:=gpu rviz:=true publish_tf:=true"""
import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration, PythonExpression
from launch_ros.actions import Node
from launch_ros.parameter_descriptions import ParameterValue

# Parameters of the node that are arguments here: name, type, default, meaning. The type is given so that device:=0 stays a text.
PARAMETERS = (
    ("device", str, "", "as egosgm run --device"),
    ("preset", str, "default", "as egosgm run --preset"),
    ("max_skew_ms", float, "0.0", "how far the stamps of a pair may differ"),
    ("reliable", bool, "false", "reliable topics in place of those of sensors"),
    ("motion_frame", str, "", "the frame in which tf knows where the camera is, such as odom; else motion is found in the images"),
    ("publish_tf", bool, "false", "the camera's pose to tf"),
)
# The rectified images of drivers as they name them by default, of both sides; the camera info lies beside each. docs/use/robots.md says how a driver
# is to be started.
CAMERAS = {
    "": ("left/image_rect", "right/image_rect"),
    "oak": ("/oak/left/image_rect", "/oak/right/image_rect"),
    "realsense": ("/camera/camera/infra1/image_rect_raw", "/camera/camera/infra2/image_rect_raw"),
    "zed": ("/zed/zed_node/left/gray/rect/image", "/zed/zed_node/right/gray/rect/image"),
}


def of_camera(topics):
    """The one of the chosen camera, of a dict."""
    return PythonExpression([repr(topics), "['", LaunchConfiguration("camera"), "']"])


def remappings():
    for index, own in enumerate(CAMERAS[""]):
        yield own, of_camera({camera: images[index] for camera, images in CAMERAS.items()})
        yield info_of(own), of_camera({camera: info_of(images[index]) for camera, images in CAMERAS.items()})


def info_of(image):
    return image.rpartition("/")[0] + "/camera_info"


def generate_launch_description():
    rviz = os.path.join(get_package_share_directory("egosgm_ros"), "rviz", "egosgm.rviz")
    namespace = LaunchConfiguration("namespace")
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, kind, _, _ in PARAMETERS}
    return LaunchDescription([
        DeclareLaunchArgument("namespace", default_value="", description="of the camera: NAMESPACE/left/image_rect"),
        DeclareLaunchArgument("camera", default_value="", choices=tuple(CAMERAS), description="whose driver's names of topics are taken"),
        *(DeclareLaunchArgument(name, default_value=default, description=meaning) for name, _, default, meaning in PARAMETERS),
        DeclareLaunchArgument("rviz", default_value="false"),
        Node(package="egosgm_ros", executable="egosgm_node", name="egosgm", namespace=namespace, output="screen", parameters=[parameters],
             remappings=list(remappings())),
        Node(package="rviz2", executable="rviz2", namespace=namespace, arguments=["-d", rviz], condition=IfCondition(LaunchConfiguration("rviz"))),
    ])

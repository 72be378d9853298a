# SPDX-License-Identifier: Apache-2.0
"""ros2 launch egosgm_ros egosgm.launch.py namespace:=/stereo device:=gpu rviz:=true publish_tf:=true"""
import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
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


def generate_launch_description():
    rviz = os.path.join(get_package_share_directory("egosgm_ros"), "rviz", "egosgm.rviz")
    namespace = LaunchConfiguration("namespace")
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=kind) for name, kind, _, _ in PARAMETERS}
    return LaunchDescription([
        DeclareLaunchArgument("namespace", default_value="", description="of the camera: NAMESPACE/left/image_rect"),
        *(DeclareLaunchArgument(name, default_value=default, description=meaning) for name, _, default, meaning in PARAMETERS),
        DeclareLaunchArgument("rviz", default_value="false"),
        Node(package="egosgm_ros", executable="egosgm_node", name="egosgm", namespace=namespace, output="screen", parameters=[parameters]),
        Node(package="rviz2", executable="rviz2", namespace=namespace, arguments=["-d", rviz], condition=IfCondition(LaunchConfiguration("rviz"))),
    ])

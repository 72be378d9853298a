# SPDX-License-Identifier: Apache-2.0
"""ros2 launch egosgm_ros egosgm.launch.py namespace:=/stereo device:=gpu rviz:=true"""
import os

from ament_index_python.packages import get_package_share_directory
from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.conditions import IfCondition
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node


def generate_launch_description():
    rviz = os.path.join(get_package_share_directory("egosgm_ros"), "rviz", "egosgm.rviz")
    return LaunchDescription([
        DeclareLaunchArgument("namespace", default_value="", description="of the camera: NAMESPACE/left/image_rect"),
        DeclareLaunchArgument("device", default_value="", description="as egosgm run --device"),
        DeclareLaunchArgument("max_skew_ms", default_value="0.0", description="how far the stamps of a pair may differ"),
        DeclareLaunchArgument("rviz", default_value="false"),
        Node(package="egosgm_ros", executable="egosgm_node", name="egosgm", namespace=LaunchConfiguration("namespace"), output="screen",
             parameters=[{"device": LaunchConfiguration("device"), "max_skew_ms": LaunchConfiguration("max_skew_ms")}]),
        Node(package="rviz2", executable="rviz2", arguments=["-d", rviz], condition=IfCondition(LaunchConfiguration("rviz"))),
    ])

# SPDX-License-Identifier: Apache-2.0
"""The files of the ROS package: what rviz shows, and what the launch file starts, which needs launch_ros."""
import importlib.util
import os
import pathlib
import tempfile
import unittest

import rclpy
import yaml
from rclpy.parameter import Parameter
from rclpy.qos import ReliabilityPolicy

from egosgm.bag.ros_images import is_named_rect
from node_case import DOMAIN, PACKAGE
from egosgm_ros.node import EgosgmNode
from egosgm_ros.parameters import OWN


class Files(unittest.TestCase):
    def test_rviz_shows_what_the_node_publishes(self):
        """By its topics, of the types that the displays take, as reliably as it is published, in a frame that the node knows."""
        shown = yaml.safe_load((PACKAGE / "rviz/egosgm.rviz").read_text())["Visualization Manager"]
        displays = {display["Topic"]["Value"]: display for display in shown["Displays"]}
        self.assertEqual(set(displays), {"points2", "depth", "odom"})
        rclpy.init(domain_id=DOMAIN)
        node = EgosgmNode()
        try:
            node.trigger_configure()
            published = {topic: (publisher.msg_type.__name__, publisher.qos_profile.reliability) for topic, publisher in node._outputs.items()}
        finally:
            node.destroy_node()
            rclpy.shutdown()
        for topic, display in displays.items():
            kind, reliability = published[topic]
            self.assertEqual(display["Class"], f"rviz_default_plugins/{kind}")
            best_effort = display["Topic"].get("Reliability Policy") == "Best Effort"  # rviz's own default is reliable
            self.assertEqual(best_effort, reliability == ReliabilityPolicy.BEST_EFFORT, topic)
        self.assertEqual(shown["Global Options"]["Fixed Frame"], OWN["odom_frame"])

    def launched(self, **given):
        """By launch itself, which is told where the package is: its context, the node and the viewer. No process is started."""
        import launch
        import launch_ros.actions
        with tempfile.TemporaryDirectory() as prefix:
            share = pathlib.Path(prefix) / "share"
            (share / "ament_index/resource_index/packages").mkdir(parents=True)
            (share / "ament_index/resource_index/packages/egosgm_ros").touch()
            (share / "egosgm_ros").symlink_to(PACKAGE)
            os.environ["AMENT_PREFIX_PATH"] = f"{prefix}:{os.environ.get('AMENT_PREFIX_PATH', '')}"
            source = launch.launch_description_sources.PythonLaunchDescriptionSource(str(PACKAGE / "launch/egosgm.launch.py"))
            context = launch.LaunchContext()
            description = source.get_launch_description(context)
        context.launch_configurations.update(given)
        for entity in description.entities:
            if isinstance(entity, launch.actions.DeclareLaunchArgument):
                entity.execute(context)
        return context, *(entity for entity in description.entities if isinstance(entity, launch_ros.actions.Node))

    @unittest.skipUnless(importlib.util.find_spec("launch_ros"), "no launch_ros")
    def test_the_launch_file_gives_the_node_its_parameters_by_their_types(self):
        import launch_ros.utilities
        context, node, viewer = self.launched(device="0", max_skew_ms="3", reliable="true", motion_frame="odom", namespace="/stereo")
        self.assertFalse(viewer.condition.evaluate(context))
        parameters = launch_ros.utilities.evaluate_parameters(context, node._Node__parameters)[0]
        self.assertEqual(parameters, dict(device="0", preset="default", max_skew_ms=3.0, reliable=True, motion_frame="odom", publish_tf=False))
        for name, value in parameters.items():
            self.assertEqual(Parameter(name, value=value).type_, Parameter(name, value=OWN[name]).type_, name)

    @unittest.skipUnless(importlib.util.find_spec("launch_ros"), "no launch_ros")
    def test_the_launch_file_takes_the_topics_of_a_cameras_driver(self):
        """They are those that docs/use/robots.md names, and rectified by their names."""
        from launch.utilities import perform_substitutions
        page = (PACKAGE.parents[1] / "docs/use/robots.md").read_text()
        for camera, left in (("", "left/image_rect"), ("oak", "/oak/left/image_rect"), ("realsense", "/camera/camera/infra1/image_rect_raw"),
                             ("zed", "/zed/zed_node/left/gray/rect/image")):
            context, node, _ = self.launched(camera=camera)
            remapped = {perform_substitutions(context, name): perform_substitutions(context, topic) for name, topic in node._Node__remappings}
            right = left.replace("left", "right").replace("infra1", "infra2")
            self.assertEqual(remapped, {"left/image_rect": left, "left/camera_info": str(pathlib.PurePosixPath(left).with_name("camera_info")),
                                        "right/image_rect": right, "right/camera_info": str(pathlib.PurePosixPath(right).with_name("camera_info"))})
            self.assertTrue(is_named_rect(left))
            self.assertIn(f"`{left}`", page)
        with self.assertRaisesRegex(RuntimeError, "camera"):
            self.launched(camera="kinect")


if __name__ == "__main__":
    unittest.main()

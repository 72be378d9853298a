# SPDX-License-Identifier: Apache-2.0
"""A ROS node in this process, which is asked what it would run with and what it does with messages."""
import array
import os
import time
import unittest
from unittest import mock

import cv2
import numpy as np
import rclpy
from geometry_msgs.msg import Pose, PoseWithCovariance, Vector3
from rclpy.lifecycle import TransitionCallbackReturn
from rclpy.parameter import Parameter
from sensor_msgs.msg import CameraInfo, CompressedImage, Image
from std_msgs.msg import Header

import egosgm
from egosgm.bag.ros_images import rgb_of
from node_case import DOMAIN, HEIGHT, STREET, WIDTH, image_of, infos_of
from egosgm_ros import messages, process
from egosgm_ros.messages import Path, odometry_of, points_of
from egosgm_ros.node import EgosgmNode

STREET_WITH_A_BUS = dict(frames=3, width=480, height=180, seed=3, moving_object=True, supersampling=1)


def vision_msgs_stand_in():
    """vision_msgs.msg as far as the node uses it: the package index has it not."""

    def message(**fields):
        class Message:
            __slots__ = tuple(fields)

            def __init__(self, **values):
                for name, kind in fields.items():
                    setattr(self, name, values.pop(name) if name in values else kind())
                assert not values, values
        return Message

    box, hypothesis = message(center=Pose, size=Vector3), message(class_id=str, score=float)
    detection = message(header=Header, results=list, bbox=box, id=str)
    return type("Vision", (), dict(ObjectHypothesisWithPose=message(hypothesis=hypothesis, pose=PoseWithCovariance), Detection3D=detection,
                                   Detection3DArray=message(header=Header, detections=list)))


class Parameters(unittest.TestCase):
    """A node in this process, which is asked what it would run with."""

    def setUp(self):
        rclpy.init(domain_id=DOMAIN)
        self.addCleanup(rclpy.shutdown)

    def node(self, *arguments, **parameters):
        node = EgosgmNode(parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()], cli_args=arguments)
        self.addCleanup(node.destroy_node)
        return node

    def configured(self, *arguments, **parameters):
        node = self.node(*arguments, **parameters)
        node.trigger_configure()
        return node

    def tiny_node(self, **parameters):
        """Configured, with the infos of images of 64x32."""
        node = self.configured(disparities=16, **parameters)
        self.inform(node, 100.0)
        return node

    @staticmethod
    def inform(node, focal, **more):
        for side, info in zip(("left", "right"), infos_of(egosgm.Calibration(focal, focal, 32, 16, 1), 64, 32, **more)):
            node._on_info(side, info)

    def assert_runs_with(self, node, preset, **changed):
        calibration = egosgm.Calibration(100, 100, 32, 32, 0.1)
        self.assertEqual(egosgm.Pipeline(calibration, 64, 64, **node._options()).options,
                         egosgm.Pipeline(calibration, 64, 64, preset=preset, **changed).options)

    def test_a_preset_is_the_presets_and_over_it_is_what_the_user_set(self):
        self.assert_runs_with(self.node(), "default")
        self.assert_runs_with(self.node(preset="paper"), "paper")
        defaults = dict(p2=190, gate_px=3.0, coarse_match=True)  # as the default preset has them
        node = self.node(preset="paper", **defaults)
        self.assert_runs_with(node, "paper", **defaults)
        node.set_parameters([Parameter("p2", value=120)])
        self.assert_runs_with(node, "paper", gate_px=3.0, coarse_match=True)
        node = self.node()
        node.set_parameters([Parameter("preset", value="paper")])
        self.assert_runs_with(node, "paper")
        node.set_parameters([Parameter("p2", value=190)])
        self.assert_runs_with(node, "paper", p2=190)

    def test_a_parameter_is_not_set_where_it_would_change_nothing(self):
        node = self.node()
        for transition, is_set in ((node.trigger_configure, False), (node.trigger_activate, False), (node.trigger_deactivate, False), (node.trigger_cleanup, True)):
            transition()
            for parameter in (Parameter("p2", value=120), Parameter("max_depth_sigma", value=0.2)):
                result = node.set_parameters([parameter])[0]
                self.assertEqual((result.successful, f"{parameter.name} is read when the node is configured" in result.reason), (is_set, not is_set))
        self.assertEqual(node._options()["p2"], 120)

    def test_whole_numbers_are_texts_and_fractions_too(self):
        node = self.node(device=0, max_skew_ms=5, gate_px=3)
        self.assertEqual([repr(node._value(name)) for name in ("device", "max_skew_ms", "gate_px")], ["'0'", "5.0", "3.0"])

    def test_what_cannot_work_is_not_configured(self):
        for parameters in (dict(max_skew_ms=-1.0), dict(max_skew_ms=float("inf")), dict(preset="papr"), dict(p2=-1), dict(max_depth_sigma=0.0), dict(point_reasons="trused")):
            node = self.node(**parameters)
            self.assertEqual(node.trigger_configure(), TransitionCallbackReturn.FAILURE, parameters)
            self.assertIn(next(iter(parameters)), node._problem)

    def test_points_are_certain_of_chosen_reasons_and_coloured(self):
        node = self.configured(max_depth_sigma=0.1, point_reasons="trusted, flat")
        depth = np.array([[2.0, 2.0, 2.0, np.nan]], np.float32)
        flat, ambiguous = (egosgm.REASONS.index(name) for name in ("flat", "ambiguous"))
        maps = type("Maps", (), dict(reason=np.array([[0, flat, ambiguous, 0]], np.uint8)))
        variance = np.array([[0.03, 0.05, 0.01, 0.01]], np.float32)  # a sigma of 0.2 m is the bound
        np.testing.assert_array_equal(node._certain(depth, variance, maps, None), [[2, np.nan, np.nan, np.nan]])
        np.testing.assert_array_equal(node._certain(depth, variance * 0.1, maps, None), [[2, 2, np.nan, np.nan]])
        for encoding, colours in (("rgb8", [1, 2, 3]), ("bgra8", [3, 2, 1, 9])):
            image = Image(height=1, width=4, step=20, encoding=encoding, data=array.array("B", (colours * 4 + [7] * 20)[:20]))
            cloud = points_of(Header(), depth, np.full((1, 4), 5, np.uint8), rgb_of(image), egosgm.Calibration(100, 100, 2, 0, 0.1))
            points = np.frombuffer(cloud.data, np.float32).reshape(4, -1)
            self.assertEqual([field.name for field in cloud.fields], ["x", "y", "z", "intensity", "rgb"])
            self.assertEqual(cloud.row_step, 4 * cloud.point_step)
            self.assertEqual(set(points[:, 4].copy().view(np.uint32)), {0x010203})
            np.testing.assert_allclose(points[0, :4], [-0.04, 0, 2, 5], rtol=1e-6)
        self.assertIsNone(rgb_of(Image(encoding="mono8")))

    def process_street_with_a_bus(self, topics, frames=3, **parameters):
        """The node, and for each topic what it published of each frame: the real node's work, without the middleware."""
        street = egosgm.SyntheticSequence(**STREET_WITH_A_BUS)
        node = self.configured(disparities=64, paths=4, **parameters)
        for side, info in zip(("left", "right"), infos_of(street.calibration, 480, 180)):
            node._on_info(side, info)
        node._listened_to = lambda: set(topics)
        sent = {topic: [] for topic in topics}
        for topic in topics:
            node._outputs[topic] = type("Publisher", (), dict(publish=sent[topic].append))
        for i in range(frames):
            frame = street.render(i)
            node._process(image_of(frame.left, i + 1), image_of(frame.right, i + 1))
        return node, sent

    @staticmethod
    def expected_street_with_a_bus():
        street = egosgm.SyntheticSequence(**STREET_WITH_A_BUS)
        return list(egosgm.run([(frame.left, frame.right) for frame in map(street.render, range(3))], street.calibration, objects=True, disparities=64, paths=4))

    def test_points_without_what_moves_by_itself(self):
        """Of the real node: it leaves out what is marked or labelled, keeps all else, and tracks only where somebody listens to such points."""
        points = []
        for without in (False, True):
            with mock.patch.object(egosgm, "ObjectTracker", wraps=egosgm.ObjectTracker) as tracker:
                _, sent = self.process_street_with_a_bus(["points2"], points_without_moving=without)
            self.assertEqual(tracker.call_count, without)
            points.append([np.isfinite(np.frombuffer(cloud.data, np.float32).reshape(180, 480, -1)[..., 2]) for cloud in sent["points2"]])
        for all_points, kept, expected in zip(*points, self.expected_street_with_a_bus()):
            np.testing.assert_array_equal(kept, all_points & (expected.maps.dynamic == 0) & (expected.objects.labels == 0))
        labels, marks = expected.objects.labels > 0, expected.maps.dynamic > 0
        self.assertGreater((all_points & labels & ~marks).sum(), 50)  # neither alone would do
        self.assertGreater((all_points & marks & ~labels).sum(), 50)

    def test_what_moves_by_itself_is_detected_in_3d(self):
        """With a stand-in of vision_msgs, whose classes have the fields of the real ones."""
        with mock.patch.object(messages, "vision", vision_msgs_stand_in()):
            with mock.patch("egosgm_ros.node.EgosgmNode.create_lifecycle_publisher", return_value=mock.Mock()) as create:
                _, sent = self.process_street_with_a_bus(["objects"])
            self.assertIn((messages.vision.Detection3DArray, "objects"), [call.args[:2] for call in create.call_args_list])
        for message, expected in zip(sent["objects"], self.expected_street_with_a_bus()):
            self.assertEqual(message.header.frame_id, "left_optical")
            self.assertEqual([detection.id for detection in message.detections], [str(moving.id) for moving in expected.objects.moving])
        c, depth = expected.calibration, egosgm.depth_from_disparity(expected.disparity, expected.calibration)
        self.assertGreater(len(message.detections), 0)
        for detection, moving in zip(message.detections, expected.objects.moving):
            (found,) = detection.results
            centre, box, size = found.pose.pose.position, detection.bbox.center.position, detection.bbox.size
            self.assertEqual([detection.header.frame_id, found.hypothesis.class_id], ["left_optical", "moving"])
            np.testing.assert_allclose([centre.x, centre.y, centre.z], moving.centre_m)
            is_own = (expected.objects.labels == moving.id) & np.isfinite(depth)
            rows, columns = np.nonzero(is_own)
            for values, middle, length in (((columns - c.cx) / c.fx * depth[is_own], box.x, size.x), ((rows - c.cy) / c.fy * depth[is_own], box.y, size.y),
                                           (depth[is_own], box.z, size.z)):
                low, high = np.sort(values)[[int(0.05 * len(values)), int(0.95 * len(values))]]
                np.testing.assert_allclose([middle - length / 2, middle + length / 2], [low, high], atol=0.02)
            self.assertGreater(min(size.x, size.y), 0.5)

    def test_objects_end_where_nobody_listens_for_a_frame(self):
        """The tracker would take the motion from a frame that it has not seen."""
        node, _ = self.process_street_with_a_bus(["points2"], frames=1, points_without_moving=True)
        grey, flat = np.zeros((180, 480), np.uint8), np.full((180, 480), 8, np.float32)
        maps = type("Maps", (), dict(disparity=flat, dynamic=grey))
        with mock.patch.object(egosgm, "ObjectTracker") as tracker:
            self.assertIsNone(node._track({"depth"}, grey, maps, "motion"))
            for _ in range(2):
                node._track({"points2"}, grey, maps, "motion")
        self.assertEqual(tracker.call_count, 1)
        self.assertEqual([call.args[3] for call in tracker.return_value.process.call_args_list], [None, "motion"])

    def test_what_is_nearer_than_the_range_is_told(self):
        street = egosgm.SyntheticSequence(**STREET)
        frame, told = street.render(0), []
        report = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, temporal=False).process(frame.left, frame.right).report
        for disparities in (16, 128):
            node = self.node(disparities=disparities)
            node._pipeline = type("Pipeline", (), dict(options=dict(min_disparity=0, disparities=disparities)))
            node._cameras = type("Cameras", (), dict(calibration=street.calibration))
            warned = []
            node.get_logger().warning = warned.append
            for _ in range(2):
                node._look_at_input((frame.left, frame.right), report)
            told.append((node._suspicion, len(warned)))
            node.destroy_node()
        self.assertRegex(told[0][0], r"^\d+ % of the image is nearer than the range \(disparities:=\d+\)$")
        self.assertEqual([told[0][1], *told[1]], [1, "", 0])

    def test_a_rectified_and_a_raw_topic_are_told(self):
        for left, right, is_told in (("cam/left/image_rect", "cam/right/image_raw", True), ("image_raw", "image_rect_color", True), ("a/image_rect", "b/image_rect", False),
                                     ("a/image_raw", "b/image_raw", False)):
            node = self.node("--ros-args", "-r", f"left/image_rect:={left}", "-r", f"right/image_rect:={right}")
            said, warned = [], []
            node.get_logger().warning = warned.append
            node._diagnostics.publish = lambda message: said.append(message.status[0])
            node.trigger_configure()
            node.trigger_activate()
            node._count += 1
            node._tell()
            node.trigger_deactivate()
            self.assertEqual([text.startswith("by their names, /") and f"/{left}" in text and f"/{right}" in text for text in warned], [True] * is_told, warned)
            self.assertEqual((said[-1].level, said[-1].message), (b"\1", warned[0]) if is_told else (b"\0", "matching"))
            node.destroy_node()

    def test_the_newest_pair_comes_next(self):
        """Whatever waited meanwhile."""
        node = self.configured(reliable=True)
        node._is_active = True
        for i in range(1, 4):
            image = image_of(np.zeros((1, 1), np.uint8), i)
            for index in (0, 1):
                node._on_image(index, image)
        self.assertEqual([image.header.stamp.sec for image in node._newest], [3, 3])
        self.assertEqual(node._replaced, 2)
        processed = []
        node._process = lambda left, right: (processed.append(left.header.stamp.sec), setattr(node, "_is_active", False))
        node._work()
        self.assertEqual((processed, node._newest), ([3], None))
        told = []
        node.get_logger().error = told.append
        for is_ok in (True, False):  # a process that ends can publish nothing
            node._process = lambda left, right: (setattr(node, "_is_active", False), getattr(node, f"no_{is_ok}"))
            node._is_active, node._newest = True, (image, image)
            with mock.patch.object(node.context, "ok", return_value=is_ok):
                node._work()
        self.assertEqual(len(told), 1)

    def test_each_kind_of_loss_has_its_own_words(self):
        node = self.configured()
        node._is_active = True
        said, warned = [], []
        node._diagnostics.publish = lambda message: said.append(message.status[0].message)
        node._listened_to = lambda: set()
        node._warn = lambda cause, text: warned.append(text)
        for on_the_way, replaced in ((3, 0), (0, 2), (4, 1), (0, 0)):
            node._lost_on_the_way += on_the_way
            node._replaced += replaced
            node._count += 1
            node._tell()
        for index, (on_the_way, replaced) in enumerate((("3 images lost on the way", ""), ("", "2 pairs replaced"), ("4 images lost on the way", "1 pairs replaced"))):
            self.assertIn(on_the_way, said[index])
            self.assertIn(replaced, said[index])
        self.assertEqual([("fastdds.xml" in text, "replaced by newer" in text) for text in said], [(True, False), (False, True), (True, True), (False, False)])
        self.assertEqual(len(warned), 4)

    def test_maps_are_made_for_those_who_listen(self):
        for parameters, topics, maps in (({}, {"depth", "odom"}, ("disparity",)), ({}, {"points2"}, ("disparity", "variance")), ({}, {"reason"}, ("disparity", "reason")),
                                         ({}, {"objects"}, ("disparity", "dynamic")), ({"points_without_moving": True}, {"points2"}, ("disparity", "variance", "dynamic")),
                                         ({"points_without_moving": True}, {"depth"}, ("disparity",)),
                                         ({"point_reasons": "trusted"}, {"points2"}, ("disparity", "variance", "reason")), ({"point_reasons": "trusted"}, {"depth"}, ("disparity",))):
            node = self.configured(**parameters)
            self.assertEqual(node._maps_for(topics), maps)
            node.destroy_node()

    def test_the_middleware_has_room_for_maps_unless_somebody_chose(self):
        for chosen in ({}, {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}):
            with mock.patch.dict(os.environ, chosen, clear=True):
                process.prepare()
                self.assertEqual(dict(os.environ), chosen or {"FASTDDS_DEFAULT_PROFILES_FILE": str(process.PROFILES)})
        self.assertTrue(process.PROFILES.exists())

    def test_compressed_images_are_matched_and_the_info_goes_with_them(self):
        node = self.tiny_node(compressed=True, temporal=False)
        self.assertEqual([subscription.topic_name for subscription in node._inputs],
                         ["/left/camera_info", "/left/image_rect/compressed", "/right/camera_info", "/right/image_rect/compressed"])
        sent = []
        node._listened_to = lambda: {"camera_info", "depth", "points2"}
        for name in node._listened_to():
            node._outputs[name].publish = sent.append
        grey = np.random.default_rng(1).integers(0, 256, (32, 64), dtype=np.uint8)
        image = CompressedImage(format="mono8; png compressed", data=array.array("B", cv2.imencode(".png", grey)[1].tobytes()))
        image.header.stamp.sec, image.header.frame_id = 7, "left_optical"
        node._process(image, image)
        self.assertEqual(sorted(type(message).__name__ for message in sent), ["CameraInfo", "Image", "PointCloud2"])
        self.assertEqual({(message.header.stamp.sec, message.header.frame_id, message.width) for message in sent}, {(7, "left_optical", 64)})
        self.assertEqual([message.p[0] for message in sent if isinstance(message, CameraInfo)], [100.0])

    def test_stamps_that_do_not_pair_are_told_once_a_minute(self):
        node = self.configured()
        node._is_active = True
        node._listened_to = lambda: set()
        warned = []
        node.get_logger().warning = warned.append
        for i in range(3):
            for index in (0, 1):
                image = image_of(np.zeros((1, 1), np.uint8), i)
                image.header.stamp.nanosec = 385000 * index
                node._on_image(index, image)
            node._waits_since = time.monotonic() - 1 - i
            node._tell()
        self.assertEqual(warned, ["no pairs of images: the nearest stamps differ by 0.385 ms, max_skew_ms is 0.0"])
        node._warned_at = {cause: at - 60 for cause, at in node._warned_at.items()}
        node._tell()
        self.assertEqual(len(warned), 2)

    def test_a_pipeline_that_could_not_be_made_is_made_for_the_next_pair(self):
        node, image = self.tiny_node(), image_of(np.zeros((32, 64), np.uint8))
        for focal in (100.0, 101.0):
            self.inform(node, focal)
            image.header.stamp.sec += 1
            before = node._pipeline
            with mock.patch.object(egosgm, "Pipeline", side_effect=egosgm.DeviceError("no memory")), self.assertRaises(egosgm.DeviceError):
                node._process(image, image)
            node._process(image, image)
            self.assertIsNot(node._pipeline, before)
            self.assertEqual(node._cameras.calibration.fx, focal)
            self.assertEqual(node._warning, "")
        node._process(image, image)
        self.assertIn("pairs of one stamp, 2.000 s", node._warning)

    def test_infos_that_change_and_the_range_that_messages_tell(self):
        node, sent = self.tiny_node(min_disparity=4, temporal=False), []
        node._listened_to = lambda: {"disparity"}
        node._outputs["disparity"].publish = sent.append
        grey = np.random.default_rng(1).integers(0, 256, (32, 64), dtype=np.uint8)
        for i in range(4):
            image = image_of(grey, i + 1)
            self.inform(node, 100.0 + i // 2)
            node._process(image, image)
        self.assertEqual([message.f for message in sent], [100, 100, 101, 101])
        self.assertEqual([(message.min_disparity, message.max_disparity) for message in sent], [(4, 19)] * 4)
        self.assertEqual(node._topics_warning, "")
        for side in ("left", "right"):  # of a sensor twice as fine, of which the image shows a binned region
            fine = CameraInfo(height=80, width=200, binning_x=2, binning_y=2, k=[202.0, 0, 74.0, 0, 202.0, 36.0, 0, 0, 1.0])
            fine.p = [202.0, 0, 74.0, -202.0 * (side == "right"), 0, 202.0, 36.0, 0, 0, 0, 1.0, 0]
            fine.roi.x_offset, fine.roi.y_offset, fine.roi.width, fine.roi.height = 10, 4, 128, 64
            node._on_info(side, fine)
        image.header.stamp.sec += 1
        node._process(image, image)
        found = node._cameras.calibration
        self.assertEqual((found.fx, found.fy, found.cx, found.cy, found.baseline_m), (101, 101, 32, 16, 1))
        self.assertEqual((sent[-1].f, sent[-1].t, sent[-1].image.width), (101, 1, 64))
        for name, lens, is_told in (("image_raw", 0.1, True), ("image_raw", 0.0, False), ("image_rect_color", 0.1, False)):
            node = self.configured("--ros-args", "-r", f"left/image_rect:=left/{name}", "-r", f"right/image_rect:=right/{name}", disparities=16, temporal=False)
            self.inform(node, 101.0, d=[lens] * 5)
            node._process(image, image)
            self.assertEqual("/left/image_raw and /right/image_raw's name and camera info" in node._topics_warning, is_told)


class Odometry(unittest.TestCase):
    @staticmethod
    def transform(xi):
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = cv2.Rodrigues(np.array(xi[3:], float))[0], xi[:3]
        return result

    def test_a_path_is_as_uncertain_as_its_motions_make_it(self):
        """Against poses of motions that are disturbed at random."""
        random = np.random.default_rng(1)
        moved = self.transform([0.1, 0.05, -1.0, 0.05, 0.3, -0.1])
        sigmas = np.array([0.01, 0.02, 0.03, 0.004, 0.01, 0.006])
        path, ends = Path(), []
        for _ in range(5):
            path.add(egosgm.Motion(moved, np.diag(sigmas**2)), 0.1)
        for _ in range(3000):
            pose = np.eye(4)
            for _ in range(5):
                pose = pose @ np.linalg.inv(self.transform(random.normal(size=6) * sigmas) @ moved)
            ends.append(pose[[2, 0, 1], 3] * [1, -1, -1])  # x forward, y left, z up
        message = odometry_of(Header(), "odom", path)
        covariance = np.reshape(message.pose.covariance, (6, 6))
        np.testing.assert_allclose(covariance[:3, :3], np.cov(np.array(ends).T), atol=0.08 * covariance[:3, :3].max())
        self.assertTrue((np.linalg.eigvalsh(covariance) > 0).all())
        path.add(None, 0.1)
        self.assertGreater(np.trace(np.reshape(odometry_of(Header(), "odom", path).twist.covariance, (6, 6))), 100)  # as uncertain as it is large

    def test_the_twist_is_the_motion_in_its_time(self):
        path = Path()
        # The camera goes 0.2 m ahead and turns to the left by 0.1 rad in half a second.
        path.add(egosgm.Motion(self.transform([0, 0, -0.2, 0, 0.1, 0]), np.diag([1, 4, 9, 16, 25, 36.0])), 0.5)
        message = odometry_of(Header(), "odom", path)
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        np.testing.assert_allclose([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z], [0.4, 0, 0, 0, 0, 0.2], atol=1e-9)
        np.testing.assert_allclose(np.diag(np.reshape(message.twist.covariance, (6, 6))), 4 * np.array([9, 1, 4, 36, 16, 25.0]))


if __name__ == "__main__":
    unittest.main()

# SPDX-License-Identifier: Apache-2.0
"""The ROS node as a robot has it: a publisher, the node and a subscriber are three processes. Needs rclpy (scripts/install-dependencies --ros).
EGOSGM_ROS_FRAMES [100] frames of 640x480. What concerns tf needs tf2_ros, what concerns the launch file launch_ros.
EGOSGM_ROS_COMPONENT: the node that ros/egosgm_component builds, egosgm_component_node; tried where it is named."""
import array
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import time
import unittest
from unittest import mock

import numpy as np

WIDTH, HEIGHT, RENDERED = 640, 480, 6
FRAMES, RATE = int(os.environ.get("EGOSGM_ROS_FRAMES", "100")), 5.0
PACKAGE = pathlib.Path(__file__).resolve().parents[2] / "ros/egosgm_ros"
HAS_TF = importlib.util.find_spec("tf2_ros") is not None
TOPICS = ("camera_info", "disparity", "depth", "variance", "reason", "points2", "odom")
STREET = dict(frames=RENDERED, width=WIDTH, height=HEIGHT, seed=1, speed_m=0.1, turn_deg=0, supersampling=1)
STREET_WITH_A_BUS = dict(frames=3, width=480, height=180, seed=3, moving_object=True, supersampling=1)


def infos_of(c, width, height, **more):
    """The camera infos of a rectified pair: left, right."""
    from sensor_msgs.msg import CameraInfo
    k, rest = [c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1.0], [0, c.fy, c.cy, 0, 0, 0, 1.0, 0]
    return [CameraInfo(height=height, width=width, distortion_model="plumb_bob", k=k, p=[c.fx, 0, c.cx, -c.fx * c.baseline_m * side, *rest], **{"d": [0.0] * 5, **more})
            for side in (0, 1)]


def image_of(pixels, sec=0):
    """A grey image."""
    from sensor_msgs.msg import Image
    height, width = pixels.shape
    image = Image(height=height, width=width, step=width, encoding="mono8", data=array.array("B", pixels.tobytes()))
    image.header.stamp.sec, image.header.frame_id = sec, "left_optical"
    return image


def publish(frames, rate, right_width=WIDTH, reliable=True, tf=False, tells=True, waits=False):
    """Forwards and backwards through the street, once the node has its listeners; tells: its diagnostics name them. tf: where the camera truly
    is, in the frame odom. waits: for the disparities of each pair before the next one, so that the machine may be slow."""
    import egosgm
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import QoSProfile, qos_profile_sensor_data
    from sensor_msgs.msg import CameraInfo, Image
    street = egosgm.SyntheticSequence(**STREET)
    rendered = [street.render(i) for i in range(RENDERED)]
    rclpy.init()
    node = rclpy.create_node("publisher")
    qos = QoSProfile(depth=100) if reliable else qos_profile_sensor_data
    images = [node.create_publisher(Image, f"{side}/image_rect", qos) for side in ("left", "right")]
    infos = [node.create_publisher(CameraInfo, f"{side}/camera_info", qos) for side in ("left", "right")]
    if tf:
        from egosgm_ros.messages import transform_of
        from tf2_ros import TransformBroadcaster
        broadcaster = TransformBroadcaster(node)
    matched = set()
    if waits:
        from stereo_msgs.msg import DisparityImage
        node.create_subscription(DisparityImage, "disparity", lambda message: matched.add((message.header.stamp.sec, message.header.stamp.nanosec)), qos)
    ready = [] if tells else [True]
    listened_to = " ".join(sorted(TOPICS))
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: ready.extend(
        True for status in message.status for value in status.values if value.key == "listened_to" and value.value == listened_to), 10)
    while not ready or any(publisher.get_subscription_count() == 0 for publisher in images + infos) or tf and node.count_subscribers("/tf") == 0:
        rclpy.spin_once(node, timeout_sec=0.1)
    if not tells:
        time.sleep(5)  # for its listeners
    turn = 2 * (RENDERED - 1)
    for i in range(-2, frames):  # camera infos alone at first
        stamp = node.get_clock().now().to_msg()
        for side, info in enumerate(infos_of(street.calibration, WIDTH, HEIGHT)):
            info.header.stamp = stamp
            infos[side].publish(info)
            if i < 0:
                continue
            frame = rendered[min(i % turn, turn - i % turn)]
            pixels = frame.right[:, :right_width] if side else frame.left
            if pixels.size == 0:
                continue  # a camera that is silent
            image = image_of(pixels)
            image.header.stamp = stamp
            if tf and side == 0:
                broadcaster.sendTransform(transform_of(image.header, "odom", frame.world_from_camera))
            images[side].publish(image)
        end = time.monotonic() + 60
        while waits and i >= 0 and (stamp.sec, stamp.nanosec) not in matched and time.monotonic() < end:
            rclpy.spin_once(node, timeout_sec=0.1)
        time.sleep(1 / rate)
    time.sleep(2)


def subscribe(frames, seconds, reliable=True, tf=False):
    """Prints what came."""
    import egosgm
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile, qos_profile_sensor_data
    from sensor_msgs.msg import CameraInfo, Image, PointCloud2
    from stereo_msgs.msg import DisparityImage
    street = egosgm.SyntheticSequence(**STREET)
    truth = street.render(0).left_disparity
    rclpy.init()
    node = rclpy.create_node("subscriber")
    told = dict(stamps=[], latencies_ms=[], depth=0, variance=0, camera_info=0, reason=[], points2=0, odom=[], tf=[], bad=[], diagnostics=[])

    def on_disparity(message):
        now = node.get_clock().now().nanoseconds
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        told["stamps"].append(stamp)
        told["latencies_ms"].append((now - stamp) / 1e6)
        if (len(told["stamps"]) - 1) % (2 * (RENDERED - 1)) == 0:
            values = np.frombuffer(message.image.data, np.float32).reshape(HEIGHT, WIDTH)
            both = (values >= message.min_disparity) & (truth > 0)
            told["bad"].append(float((np.abs(values - truth)[both] > 3).mean()))
            told["f_t"] = message.f * message.t

    def count(name):
        return lambda message: told.__setitem__(name, told[name] + 1)

    def on_odom(message):
        position = message.pose.pose.position
        told["odom"].append([position.x, position.y, position.z])

    def on_reason(message):
        told["reason"].append([message.encoding, int(np.frombuffer(message.data, np.uint8).max())])

    def on_tf(message):
        for transform in message.transforms:
            position = transform.transform.translation
            told["tf"].append([transform.header.frame_id, transform.child_frame_id, position.x, position.y, position.z])

    qos = QoSProfile(depth=100) if reliable else qos_profile_sensor_data
    node.create_subscription(DisparityImage, "disparity", on_disparity, qos)
    for kind, topic in ((Image, "depth"), (Image, "variance"), (PointCloud2, "points2"), (CameraInfo, "camera_info")):
        node.create_subscription(kind, topic, count(topic), qos)
    node.create_subscription(Image, "reason", on_reason, qos)
    node.create_subscription(Odometry, "odom", on_odom, QoSProfile(depth=100))
    if tf:
        from tf2_msgs.msg import TFMessage
        node.create_subscription(TFMessage, "/tf", on_tf, 100)

    def on_diagnostics(message):
        for status in message.status:
            told["diagnostics"].append([status.level[0], status.message, {value.key: value.value for value in status.values}])

    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    end = time.monotonic() + seconds
    while time.monotonic() < end and (len(told["stamps"]) < frames or len(told["odom"]) < frames):
        rclpy.spin_once(node, timeout_sec=0.2)
    end = time.monotonic() + 3
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.2)
    c = street.calibration
    told["expected_f_t"] = c.fx * c.baseline_m
    print(json.dumps(told))


def vision_msgs_stand_in():
    """vision_msgs.msg as far as the node uses it: the package index has it not."""
    from geometry_msgs.msg import Pose, PoseWithCovariance, Vector3
    from std_msgs.msg import Header

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


class Node(unittest.TestCase):
    def run_three(self, frames, rate, seconds=None, parameters=(), reliable=True, right_width=WIDTH, tf=False, listens_to_tf=False,
                  component=None, waits=True):
        environment = {"FASTDDS_DEFAULT_PROFILES_FILE": str(PACKAGE / "egosgm_ros/fastdds.xml"), **os.environ, "ROS_DOMAIN_ID": str(os.getpid() % 100), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                       "PYTHONPATH": f"{PACKAGE}:{os.environ.get('PYTHONPATH', '')}"}
        seconds = seconds or 60 + 2 * frames / rate
        ros = ["-p", "reliable:=true"] if reliable else []
        ros += [word for p in parameters for word in ("-p", p)]
        start = [sys.executable, "-B", __file__]
        program = [component] if component else [sys.executable, "-B", "-m", "egosgm_ros.node"]
        node = subprocess.Popen([*program, *(["--ros-args", *ros] if ros else [])], env=environment)
        subscriber = subprocess.Popen([*start, "subscribe", json.dumps(dict(frames=frames, seconds=seconds, reliable=reliable, tf=listens_to_tf))],
                                      env=environment, stdout=subprocess.PIPE, text=True)
        publisher = subprocess.Popen([*start, "publish", json.dumps(dict(frames=frames, rate=rate, right_width=right_width, reliable=reliable, tf=tf,
                                                                          tells=not component, waits=waits))],
                                     env=environment)
        try:
            output, _ = subscriber.communicate(timeout=seconds + 60)
        finally:
            for process in (publisher, node, subscriber):
                process.terminate()
                process.wait(10)
        told = json.loads(output.splitlines()[-1])
        told["active"] = [values for _, _, values in told["diagnostics"] if "device" in values]
        return told

    def test_nothing_is_lost_and_the_maps_are_right(self):
        told = self.run_three(FRAMES, RATE)
        latencies, last = np.array(told["latencies_ms"]), told["active"][-1]
        print(f"{len(told['stamps'])} of {FRAMES} frames, {np.median([float(values['rate_hz']) for values in told['active']]):.1f} Hz matched; latency: median {np.median(latencies):.1f} ms, 95 % {np.percentile(latencies, 95):.1f} ms; "
              f"last diagnostics: {last}")
        self.assertEqual(len(told["stamps"]), FRAMES)
        self.assertEqual(told["stamps"], sorted(set(told["stamps"])))
        for name in ("depth", "variance", "points2", "camera_info"):
            self.assertEqual(told[name], FRAMES, name)
        self.assertEqual([len(told["odom"]), len(told["reason"])], [FRAMES, FRAMES])
        self.assertEqual({encoding for encoding, _ in told["reason"]}, {"mono8"})
        self.assertGreater(max(largest for _, largest in told["reason"]), 0)
        self.assertLess(max(told["bad"]), 0.1)
        self.assertAlmostEqual(told["f_t"] / told["expected_f_t"], 1, places=5)
        self.assertEqual([last[name] for name in ("replaced", "lost_on_the_way", "unpaired_left", "unpaired_right")], ["0"] * 4)
        self.assertLess(abs(float(last["vertical_offset_px"])), 0.5)

    @unittest.skipUnless("EGOSGM_ROS_COMPONENT" in os.environ, "no component is named")
    def test_the_component_gives_disparity_and_depth(self):
        told = self.run_three(20, RATE, seconds=40, parameters=("disparities:=128", "cost:=census9x7"), component=os.environ["EGOSGM_ROS_COMPONENT"])
        print(f"component: {len(told['stamps'])} of 20 frames at {RATE} Hz; latency: median {np.median(told['latencies_ms']):.1f} ms")
        self.assertEqual((len(told["stamps"]), told["depth"]), (20, 20))
        self.assertLess(max(told["bad"]), 0.1)
        self.assertAlmostEqual(told["f_t"] / told["expected_f_t"], 1, places=5)

    def test_what_is_too_fast_is_dropped_and_told(self):
        frames = 150
        told = self.run_three(frames, 100.0, reliable=False, seconds=40, waits=False)
        last = told["active"][-1]
        lost = int(last["replaced"]) + int(last["lost_on_the_way"]) + int(last["unpaired_left"]) + int(last["unpaired_right"])
        print(f"of {frames} frames at once: {last}")
        self.assertGreater(int(last["frames"]), 0)
        self.assertLess(int(last["frames"]), frames)
        self.assertGreaterEqual(int(last["frames"]) + lost, frames)  # nothing goes untold
        messages = " ".join(message for level, message, _ in told["diagnostics"] if level == 1)
        self.assertEqual("FASTDDS_DEFAULT_PROFILES_FILE" in messages, int(last["lost_on_the_way"]) > 0, told["diagnostics"])
        self.assertEqual("replaced by newer" in messages, int(last["replaced"]) > 0, told["diagnostics"])

    def test_wrong_images_are_told_on_diagnostics(self):
        told = self.run_three(5, 5.0, right_width=WIDTH - 8, seconds=30, waits=False)
        self.assertEqual(told["stamps"], [])
        self.assertTrue(any(level == 2 and "632" in message for level, message, _ in told["diagnostics"]), told["diagnostics"])

    def test_a_silent_camera_is_told(self):
        """Of the other one few images are kept, however long it lasts."""
        told = self.run_three(90, 30.0, right_width=0, seconds=30, waits=False)
        self.assertTrue(any(level == 1 and "right/image_rect is silent" in message for level, message, _ in told["diagnostics"]), told["diagnostics"])
        self.assertGreater(max(int(values["unpaired_left"]) for _, _, values in told["diagnostics"] if "unpaired_left" in values), 0)

    @unittest.skipUnless(HAS_TF, "no tf2_ros")
    def test_motion_of_tf_is_taken(self):
        import egosgm
        from egosgm.bag.ros_images import BODY_FROM_OPTICAL
        street = egosgm.SyntheticSequence(**STREET)
        told = self.run_three(RENDERED, RATE, parameters=("motion_frame:=odom", "tf_wait_s:=5.0"), tf=True)
        poses = [street.render(i).world_from_camera for i in range(RENDERED)]
        truth = [(BODY_FROM_OPTICAL @ np.linalg.inv(poses[0]) @ pose)[:3, 3] for pose in poses]
        self.assertGreater(np.linalg.norm(truth[-1]), 0.4)
        np.testing.assert_allclose(told["odom"], truth, atol=1e-6)  # far nearer than what images tell
        self.assertLess(float(told["active"][-1]["search_fraction"]), 0.5)

    @unittest.skipUnless(HAS_TF, "no tf2_ros")
    def test_frames_without_tf_are_searched_whole_and_told(self):
        told = self.run_three(5, RATE, parameters=("motion_frame:=odom",))
        self.assertEqual(len(told["stamps"]), 5)
        self.assertEqual(told["active"][-1]["search_fraction"], "1.0000")
        self.assertTrue(any(level == 1 and "no motion of left_optical in odom" in message for level, message, _ in told["diagnostics"]), told["diagnostics"])

    @unittest.skipUnless(HAS_TF, "no tf2_ros")
    def test_tf_is_published_where_asked_for(self):
        told = self.run_three(5, RATE, parameters=("publish_tf:=true", "odom_frame:=map"), listens_to_tf=True)
        self.assertEqual([transform[:2] for transform in told["tf"]], [["map", "left_optical"]] * 5)
        np.testing.assert_allclose([transform[2:] for transform in told["tf"]], told["odom"], atol=1e-9)
        self.assertGreater(np.linalg.norm(told["odom"][-1]), 0.1)

    @unittest.skipIf(HAS_TF, "tf2_ros is there")
    def test_without_tf_the_package_is_named(self):
        environment = {**os.environ, "PYTHONPATH": f"{PACKAGE}:{os.environ.get('PYTHONPATH', '')}"}
        node = subprocess.Popen([sys.executable, "-B", "-m", "egosgm_ros.node", "--ros-args", "-p", "motion_frame:=odom"], env=environment,
                                stderr=subprocess.PIPE, text=True)
        try:
            self.assertIn("tf2-ros-py", node.stderr.readline())
        finally:
            node.terminate()
            node.wait(10)
            node.stderr.close()


class Parameters(unittest.TestCase):
    """A node in this process, which is asked what it would run with."""

    def setUp(self):
        import rclpy
        sys.path.insert(0, str(PACKAGE))
        rclpy.init(domain_id=os.getpid() % 100)
        self.addCleanup(rclpy.shutdown)

    def node(self, *arguments, **parameters):
        from egosgm_ros.node import EgosgmNode
        from rclpy.parameter import Parameter
        node = EgosgmNode(parameter_overrides=[Parameter(name, value=value) for name, value in parameters.items()], cli_args=arguments)
        self.addCleanup(node.destroy_node)
        return node

    def tiny_node(self, **parameters):
        """Configured, with the infos of images of 64x32."""
        node = self.node(disparities=16, **parameters)
        node.trigger_configure()
        self.inform(node, 100.0)
        return node

    @staticmethod
    def inform(node, focal, **more):
        import egosgm
        for side, info in zip(("left", "right"), infos_of(egosgm.Calibration(focal, focal, 32, 16, 1), 64, 32, **more)):
            node._on_info(side, info)

    def assert_runs_with(self, node, preset, **changed):
        import egosgm
        calibration = egosgm.Calibration(100, 100, 32, 32, 0.1)
        self.assertEqual(egosgm.Pipeline(calibration, 64, 64, **node._options()).options,
                         egosgm.Pipeline(calibration, 64, 64, preset=preset, **changed).options)

    def test_a_preset_is_the_presets_and_over_it_is_what_the_user_set(self):
        from rclpy.parameter import Parameter
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
        from rclpy.parameter import Parameter
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
        from rclpy.lifecycle import TransitionCallbackReturn
        for parameters in (dict(max_skew_ms=-1.0), dict(max_skew_ms=float("inf")), dict(preset="papr"), dict(p2=-1), dict(max_depth_sigma=0.0), dict(point_reasons="trused")):
            node = self.node(**parameters)
            self.assertEqual(node.trigger_configure(), TransitionCallbackReturn.FAILURE, parameters)
            self.assertIn(next(iter(parameters)), node._problem)

    def test_points_are_certain_of_chosen_reasons_and_coloured(self):
        import egosgm
        from egosgm.bag.ros_images import rgb_of
        from egosgm_ros.messages import points_of
        from sensor_msgs.msg import Image
        from std_msgs.msg import Header
        node = self.node(max_depth_sigma=0.1, point_reasons="trusted, flat")
        node.trigger_configure()
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
        import egosgm
        street = egosgm.SyntheticSequence(**STREET_WITH_A_BUS)
        node = self.node(disparities=64, paths=4, **parameters)
        node.trigger_configure()
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
        import egosgm
        street = egosgm.SyntheticSequence(**STREET_WITH_A_BUS)
        return list(egosgm.run([(frame.left, frame.right) for frame in map(street.render, range(3))], street.calibration, objects=True, disparities=64, paths=4))

    def test_points_without_what_moves_by_itself(self):
        """Of the real node: it leaves out what is marked or labelled, keeps all else, and tracks only where somebody listens to such points."""
        import egosgm
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
        import egosgm
        from egosgm_ros import messages
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
        import egosgm
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
        import egosgm
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
        node = self.node(reliable=True)
        node.trigger_configure()
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
        node = self.node()
        node.trigger_configure()
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
            node = self.node(**parameters)
            node.trigger_configure()
            self.assertEqual(node._maps_for(topics), maps)
            node.destroy_node()

    def test_the_middleware_has_room_for_maps_unless_somebody_chose(self):
        from egosgm_ros import node
        for chosen in ({}, {"FASTDDS_BUILTIN_TRANSPORTS": "UDPv4"}, {"FASTRTPS_DEFAULT_PROFILES_FILE": "mine.xml"}):
            with mock.patch.dict(os.environ, chosen, clear=True):
                node._prepare_process()
                self.assertEqual(dict(os.environ), chosen or {"FASTDDS_DEFAULT_PROFILES_FILE": str(node.PROFILES)})
        self.assertTrue(node.PROFILES.exists())

    def test_compressed_images_are_matched_and_the_info_goes_with_them(self):
        import cv2
        from sensor_msgs.msg import CameraInfo, CompressedImage
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
        node = self.node()
        node.trigger_configure()
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
        import egosgm
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
        from sensor_msgs.msg import CameraInfo
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
            node = self.node("--ros-args", "-r", f"left/image_rect:=left/{name}", "-r", f"right/image_rect:=right/{name}", disparities=16, temporal=False)
            node.trigger_configure()
            self.inform(node, 101.0, d=[lens] * 5)
            node._process(image, image)
            self.assertEqual("/left/image_raw and /right/image_raw's name and camera info" in node._topics_warning, is_told)


class Odometry(unittest.TestCase):
    def setUp(self):
        sys.path.insert(0, str(PACKAGE))

    @staticmethod
    def transform(xi):
        import cv2
        result = np.eye(4)
        result[:3, :3], result[:3, 3] = cv2.Rodrigues(np.array(xi[3:], float))[0], xi[:3]
        return result

    def test_a_path_is_as_uncertain_as_its_motions_make_it(self):
        """Against poses of motions that are disturbed at random."""
        import egosgm
        from egosgm_ros.messages import Path, odometry_of
        from std_msgs.msg import Header
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
        import egosgm
        from egosgm_ros.messages import Path, odometry_of
        from std_msgs.msg import Header
        path = Path()
        # The camera goes 0.2 m ahead and turns to the left by 0.1 rad in half a second.
        path.add(egosgm.Motion(self.transform([0, 0, -0.2, 0, 0.1, 0]), np.diag([1, 4, 9, 16, 25, 36.0])), 0.5)
        message = odometry_of(Header(), "odom", path)
        linear, angular = message.twist.twist.linear, message.twist.twist.angular
        np.testing.assert_allclose([linear.x, linear.y, linear.z, angular.x, angular.y, angular.z], [0.4, 0, 0, 0, 0, 0.2], atol=1e-9)
        np.testing.assert_allclose(np.diag(np.reshape(message.twist.covariance, (6, 6))), 4 * np.array([9, 1, 4, 36, 16, 25.0]))


class Started(unittest.TestCase):
    """The node's process: what it says, and how it ends."""

    def start(self, *parameters):
        environment = {**os.environ, "ROS_DOMAIN_ID": str(os.getpid() % 100), "PYTHONPATH": f"{PACKAGE}:{os.environ.get('PYTHONPATH', '')}"}
        words = [word for parameter in parameters for word in ("-p", parameter)]
        node = subprocess.Popen([sys.executable, "-B", "-W", "ignore", "-m", "egosgm_ros.node", "--ros-args", "-r", "__ns:=/stereo", *words], env=environment,
                                stderr=subprocess.PIPE, text=True)
        self.addCleanup(lambda: (node.kill(), node.wait(), node.stderr.close()))
        return node

    def test_what_cannot_work_ends_it_with_one_line(self):
        for parameter, words in (("disparity:=64", "no parameter named disparity: "), ("disparities:=64.0", "disparities"), ("preset:=papr", "papr"),
                                 ("device:=no such one", "no such one")):
            node = self.start(parameter)
            _, said = node.communicate(timeout=60)
            self.assertEqual(node.returncode, 1, said)
            self.assertEqual(len(said.splitlines()), 1, said)
            self.assertIn(words, said)

    def test_it_tells_what_it_waits_for(self):
        node = self.start()
        if not importlib.util.find_spec("vision_msgs"):
            self.assertIn("no topic objects: it needs vision_msgs: apt install ros-", node.stderr.readline())
        self.assertIn("active: waits for /stereo/left/camera_info /stereo/left/image_rect /stereo/right/camera_info /stereo/right/image_rect (best effort)",
                      node.stderr.readline())
        self.assertIn("no pairs of images", node.stderr.readline())


class Files(unittest.TestCase):
    def test_rviz_shows_what_the_node_publishes(self):
        """By its topics, of the types that the displays take, as reliably as it is published, in a frame that the node knows."""
        import rclpy
        import yaml
        from rclpy.qos import ReliabilityPolicy
        sys.path.insert(0, str(PACKAGE))
        from egosgm_ros.node import OWN, EgosgmNode
        shown = yaml.safe_load((PACKAGE / "rviz/egosgm.rviz").read_text())["Visualization Manager"]
        displays = {display["Topic"]["Value"]: display for display in shown["Displays"]}
        self.assertEqual(set(displays), {"points2", "depth", "odom"})
        rclpy.init(domain_id=os.getpid() % 100)
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
        import tempfile

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
        from rclpy.parameter import Parameter
        context, node, viewer = self.launched(device="0", max_skew_ms="3", reliable="true", motion_frame="odom", namespace="/stereo")
        self.assertFalse(viewer.condition.evaluate(context))
        parameters = launch_ros.utilities.evaluate_parameters(context, node._Node__parameters)[0]
        self.assertEqual(parameters, dict(device="0", preset="default", max_skew_ms=3.0, reliable=True, motion_frame="odom", publish_tf=False))
        sys.path.insert(0, str(PACKAGE))
        from egosgm_ros.node import OWN
        for name, value in parameters.items():
            self.assertEqual(Parameter(name, value=value).type_, Parameter(name, value=OWN[name]).type_, name)

    @unittest.skipUnless(importlib.util.find_spec("launch_ros"), "no launch_ros")
    def test_the_launch_file_takes_the_topics_of_a_cameras_driver(self):
        """They are those that docs/use/robots.md names, and rectified by their names."""
        from egosgm.bag.ros_images import is_named_rect
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
    if sys.argv[1:2] == ["publish"]:
        publish(**json.loads(sys.argv[2]))
    elif sys.argv[1:2] == ["subscribe"]:
        subscribe(**json.loads(sys.argv[2]))
    else:
        unittest.main()

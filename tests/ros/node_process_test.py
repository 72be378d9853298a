# SPDX-License-Identifier: Apache-2.0
"""The ROS node as a robot has it: a publisher, the node and a subscriber are three processes.
EGOSGM_ROS_FRAMES [100] frames of 640x480. What concerns tf needs tf2_ros.
EGOSGM_ROS_COMPONENT: the node that ros/egosgm_component builds, egosgm_component_node; tried where it is named."""
import importlib.util
import json
import os
import subprocess
import sys
import time
import unittest

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from nav_msgs.msg import Odometry
from rclpy.qos import QoSProfile, qos_profile_sensor_data
from sensor_msgs.msg import CameraInfo, Image, PointCloud2
from stereo_msgs.msg import DisparityImage

import egosgm
from egosgm.bag.ros_images import BODY_FROM_OPTICAL
from node_case import DOMAIN, HEIGHT, PACKAGE, PATHS, RENDERED, STREET, WIDTH, image_of, infos_of
from egosgm_ros.messages import transform_of

FRAMES, RATE = int(os.environ.get("EGOSGM_ROS_FRAMES", "100")), 5.0
HAS_TF = importlib.util.find_spec("tf2_ros") is not None
TOPICS = ("camera_info", "disparity", "depth", "variance", "reason", "points2", "odom")


def publish(frames, rate, right_width=WIDTH, reliable=True, tf=False, tells=True, waits=False):
    """Forwards and backwards through the street, once the node has its listeners; tells: its diagnostics name them. tf: where the camera truly
    is, in the frame odom. waits: for the disparities of each pair before the next one, so that the machine may be slow."""
    street = egosgm.SyntheticSequence(**STREET)
    rendered = [street.render(i) for i in range(RENDERED)]
    rclpy.init()
    node = rclpy.create_node("publisher")
    qos = QoSProfile(depth=100) if reliable else qos_profile_sensor_data
    images = [node.create_publisher(Image, f"{side}/image_rect", qos) for side in ("left", "right")]
    infos = [node.create_publisher(CameraInfo, f"{side}/camera_info", qos) for side in ("left", "right")]
    if tf:
        from tf2_ros import TransformBroadcaster
        broadcaster = TransformBroadcaster(node)
    matched = set()
    if waits:
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


class Node(unittest.TestCase):
    def run_three(self, frames, rate, seconds=None, parameters=(), reliable=True, right_width=WIDTH, tf=False, listens_to_tf=False,
                  component=None, waits=True):
        environment = {"FASTDDS_DEFAULT_PROFILES_FILE": str(PACKAGE / "egosgm_ros/fastdds.xml"), **os.environ, "ROS_DOMAIN_ID": str(DOMAIN), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                       **PATHS}
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
        environment = {**os.environ, **PATHS}
        node = subprocess.Popen([sys.executable, "-B", "-m", "egosgm_ros.node", "--ros-args", "-p", "motion_frame:=odom"], env=environment,
                                stderr=subprocess.PIPE, text=True)
        try:
            self.assertIn("tf2-ros-py", node.stderr.readline())
        finally:
            node.terminate()
            node.wait(10)
            node.stderr.close()


class Started(unittest.TestCase):
    """The node's process: what it says, and how it ends."""

    def start(self, *parameters):
        environment = {**os.environ, "ROS_DOMAIN_ID": str(DOMAIN), **PATHS}
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


if __name__ == "__main__":
    if sys.argv[1:2] == ["publish"]:
        publish(**json.loads(sys.argv[2]))
    elif sys.argv[1:2] == ["subscribe"]:
        subscribe(**json.loads(sys.argv[2]))
    else:
        unittest.main()

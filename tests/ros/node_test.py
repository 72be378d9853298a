# SPDX-License-Identifier: Apache-2.0
"""The ROS node as a robot has it: a publisher, the node and a subscriber are three processes. Needs rclpy (scripts/install-dependencies --ros).
EGOSGM_ROS_FRAMES [100] frames of 640x480 at EGOSGM_ROS_RATE [5] Hz."""
import array
import json
import os
import pathlib
import subprocess
import sys
import time
import unittest

import numpy as np

WIDTH, HEIGHT, RENDERED = 640, 480, 6
FRAMES, RATE = int(os.environ.get("EGOSGM_ROS_FRAMES", "100")), float(os.environ.get("EGOSGM_ROS_RATE", "5"))
NODE = pathlib.Path(__file__).resolve().parents[2] / "ros/egosgm_ros/egosgm_ros/node.py"
STREET = dict(frames=RENDERED, width=WIDTH, height=HEIGHT, seed=1, speed_m=0.1, turn_deg=0, supersampling=1)


def publish(frames, rate, right_width):
    """Forwards and backwards through the street."""
    import egosgm
    import rclpy
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import CameraInfo, Image
    street = egosgm.SyntheticSequence(**STREET)
    rendered = [street.render(i) for i in range(RENDERED)]
    c = street.calibration
    rclpy.init()
    node = rclpy.create_node("publisher")
    qos = QoSProfile(depth=100)
    images = [node.create_publisher(Image, f"{side}/image_rect", qos) for side in ("left", "right")]
    infos = [node.create_publisher(CameraInfo, f"{side}/camera_info", qos) for side in ("left", "right")]
    while any(publisher.get_subscription_count() == 0 for publisher in images + infos):
        time.sleep(0.1)
    turn = 2 * (RENDERED - 1)
    for i in range(-2, frames):  # camera infos alone at first
        stamp = node.get_clock().now().to_msg()
        for side in (0, 1):
            info = CameraInfo(height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", d=[0.0] * 5)
            info.k = [c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1.0]
            info.p = [c.fx, 0, c.cx, -c.fx * c.baseline_m * side, 0, c.fy, c.cy, 0, 0, 0, 1.0, 0]
            info.header.stamp = stamp
            infos[side].publish(info)
            if i < 0:
                continue
            frame = rendered[min(i % turn, turn - i % turn)]
            pixels = frame.right[:, :right_width] if side else frame.left
            image = Image(height=HEIGHT, width=pixels.shape[1], step=pixels.shape[1], encoding="mono8", data=array.array("B", pixels.tobytes()))
            image.header.stamp, image.header.frame_id = stamp, "left_optical"
            images[side].publish(image)
        time.sleep(1 / rate)
    time.sleep(2)


def subscribe(frames, seconds):
    """Prints what came."""
    import egosgm
    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from nav_msgs.msg import Odometry
    from rclpy.qos import QoSProfile
    from sensor_msgs.msg import Image, PointCloud2
    from stereo_msgs.msg import DisparityImage
    street = egosgm.SyntheticSequence(**STREET)
    truth = street.render(0).left_disparity
    rclpy.init()
    node = rclpy.create_node("subscriber")
    told = dict(stamps=[], latencies_ms=[], depth=0, variance=0, points=0, odom=0, bad=[], depth_error=[], diagnostics=[])

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

    qos = QoSProfile(depth=100)
    node.create_subscription(DisparityImage, "disparity", on_disparity, qos)
    for name, kind, topic in (("depth", Image, "depth"), ("variance", Image, "variance"), ("points", PointCloud2, "points2"), ("odom", Odometry, "odom")):
        node.create_subscription(kind, topic, count(name), qos)

    def on_diagnostics(message):
        for status in message.status:
            told["diagnostics"].append([status.level[0], status.message, {value.key: value.value for value in status.values}])

    node.create_subscription(DiagnosticArray, "/diagnostics", on_diagnostics, 10)
    end = time.monotonic() + seconds
    while time.monotonic() < end and (len(told["stamps"]) < frames or told["odom"] < frames):
        rclpy.spin_once(node, timeout_sec=0.2)
    end = time.monotonic() + 3
    while time.monotonic() < end:
        rclpy.spin_once(node, timeout_sec=0.2)
    c = street.calibration
    told["expected_f_t"] = c.fx * c.baseline_m
    print(json.dumps(told))


class Node(unittest.TestCase):
    def run_three(self, frames, rate, right_width=WIDTH, seconds=None, parameters=()):
        environment = {**os.environ, "ROS_DOMAIN_ID": str(os.getpid() % 100), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        seconds = seconds or 60 + 2 * frames / rate
        start = [sys.executable, "-B", __file__]
        ros = ["--ros-args", "-p", "reliable:=true", "-p", "queue_size:=100", *(word for p in parameters for word in ("-p", p))]
        node = subprocess.Popen([sys.executable, "-B", str(NODE), *ros], env=environment)
        subscriber = subprocess.Popen([*start, "subscribe", str(frames), str(seconds)], env=environment, stdout=subprocess.PIPE, text=True)
        publisher = subprocess.Popen([*start, "publish", str(frames), str(rate), str(right_width)], env=environment)
        try:
            output, _ = subscriber.communicate(timeout=seconds + 60)
        finally:
            for process in (publisher, node, subscriber):
                process.terminate()
                process.wait(10)
        return json.loads(output.splitlines()[-1])

    def test_nothing_is_lost_and_the_maps_are_right(self):
        told = self.run_three(FRAMES, RATE)
        latencies = np.array(told["latencies_ms"])
        active = [values for level, _, values in told["diagnostics"] if "device" in values]
        print(f"{len(told['stamps'])} of {FRAMES} frames at {RATE} Hz; latency: median {np.median(latencies):.1f} ms, 95 % {np.percentile(latencies, 95):.1f} ms; "
              f"last diagnostics: {active[-1]}")
        self.assertEqual(len(told["stamps"]), FRAMES)
        self.assertEqual(told["stamps"], sorted(set(told["stamps"])))
        for name in ("depth", "variance", "points", "odom"):
            self.assertEqual(told[name], FRAMES, name)
        self.assertLess(max(told["bad"]), 0.1)
        self.assertAlmostEqual(told["f_t"] / told["expected_f_t"], 1, places=5)
        self.assertEqual(active[-1]["lost_in_queue"], "0")
        self.assertEqual([active[-1]["unpaired_left"], active[-1]["unpaired_right"]], ["0", "0"])
        self.assertLess(abs(float(active[-1]["vertical_offset_px"])), 0.5)

    def test_wrong_images_are_told_on_diagnostics(self):
        told = self.run_three(5, 5.0, right_width=WIDTH - 8, seconds=15)
        self.assertEqual(told["stamps"], [])
        self.assertTrue(any(level == 2 and "632" in message for level, message, _ in told["diagnostics"]), told["diagnostics"])


if __name__ == "__main__":
    if sys.argv[1:2] == ["publish"]:
        publish(int(sys.argv[2]), float(sys.argv[3]), int(sys.argv[4]))
    elif sys.argv[1:2] == ["subscribe"]:
        subscribe(int(sys.argv[2]), float(sys.argv[3]))
    else:
        unittest.main()

#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How late the ROS node's maps are, and what is lost on the way to them: a driver, the node and a subscriber in three processes, 640x480.
Needs rclpy (scripts/install-dependencies --ros) and the built module:
PYTHONPATH=build/python build-ros/bin/python bench/node_latency.py [--rate HZ]... [--topic NAME]... [--realtime] [--frames N]
--realtime runs all three before whatever else the machine does (chrt, as root): what a machine shows that has nothing else to do."""
import argparse
import importlib.util
import json
import os
import pathlib
import subprocess
import sys
import time

SOURCE = pathlib.Path(__file__).resolve().parents[1]
PROFILES = SOURCE / "ros/egosgm_ros/egosgm_ros/fastdds.xml"


def node_test():
    spec = importlib.util.spec_from_file_location("node_test", SOURCE / "tests/ros/node_test.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def subscribe(topics, reliable):
    """Prints the stamps and ages of what came [s], and the node's last diagnostics, when the standard input ends."""
    import select

    import rclpy
    from diagnostic_msgs.msg import DiagnosticArray
    from rclpy.qos import QoSProfile, ReliabilityPolicy
    from sensor_msgs.msg import Image, PointCloud2
    from stereo_msgs.msg import DisparityImage
    rclpy.init()
    node, came, told = rclpy.create_node("subscriber"), {topic: [] for topic in topics}, {}

    def on(topic):
        def note(message):
            stamp = message.header.stamp.sec + message.header.stamp.nanosec / 1e9
            came[topic].append((stamp, node.get_clock().now().nanoseconds / 1e9 - stamp))
        return note

    qos = QoSProfile(depth=5, reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT)
    for topic in topics:
        node.create_subscription({"disparity": DisparityImage, "points2": PointCloud2}.get(topic, Image), topic, on(topic), qos)
    node.create_subscription(DiagnosticArray, "/diagnostics", lambda message: told.update(
        {value.key: value.value for status in message.status for value in status.values}), 10)
    while not select.select([sys.stdin], [], [], 0)[0]:
        rclpy.spin_once(node, timeout_sec=0.05)
    print(json.dumps([came, told]))


def measure(rate, reliable, given):
    import numpy as np
    environment = {"FASTDDS_DEFAULT_PROFILES_FILE": str(PROFILES), **os.environ, "ROS_DOMAIN_ID": str(os.getpid() % 100), "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
                   "PYTHONPATH": f"{SOURCE / 'ros/egosgm_ros'}:{os.environ.get('PYTHONPATH', '')}"}
    before = ["chrt", "-r", "1"] if given.realtime else []
    start = [*before, sys.executable, "-B", "-W", "ignore"]
    node = subprocess.Popen([*start, "-m", "egosgm_ros.node", "--ros-args", "-p", f"reliable:={'true' if reliable else 'false'}"], env=environment, stderr=subprocess.DEVNULL)
    subscriber = subprocess.Popen([*start, __file__, "subscribe", json.dumps([given.topic, reliable])], env=environment, text=True,
                                  stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    driver = subprocess.Popen([*start, __file__, "publish", json.dumps(dict(frames=given.frames, rate=rate, reliable=reliable, tells=False))], env=environment)
    try:
        driver.wait()
        came, told = json.loads(subscriber.communicate("\n")[0])
    finally:
        for process in (driver, node, subscriber):
            process.kill()
            process.wait()
    lost = {name: told.get(name) for name in ("replaced", "lost_on_the_way", "unpaired_left", "unpaired_right")}
    for topic, messages in came.items():
        stamps, ages = np.array(messages or [(0, np.nan)]).T
        later = 1e3 * ages[stamps > stamps[0] + 1]
        print(f"{rate:g} Hz, {'reliable' if reliable else 'best effort'}: {topic} {len(messages)} of {given.frames}; age median {1e3 * np.median(ages):.1f} ms, "
              f"95 % {1e3 * np.percentile(ages, 95):.1f}, most after the first second {later.max(initial=0):.1f}; load {os.getloadavg()[0]:.1f}; {lost}", flush=True)


def main():
    if sys.argv[1:2] == ["subscribe"]:
        return subscribe(*json.loads(sys.argv[2]))
    if sys.argv[1:2] == ["publish"]:
        return node_test().publish(**json.loads(sys.argv[2]))
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--rate", type=float, action="append")
    parser.add_argument("--topic", action="append", help="what is listened to [depth]")
    parser.add_argument("--frames", type=int, default=150)
    parser.add_argument("--realtime", action="store_true")
    given = parser.parse_args()
    given.topic = given.topic or ["depth"]
    for rate in given.rate or (10, 15):
        for reliable in (False, True):
            measure(rate, reliable, given)
            time.sleep(1)


if __name__ == "__main__":
    main()

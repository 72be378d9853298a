# SPDX-License-Identifier: Apache-2.0
"""What the tests of bags share: a recording, and what the program says of it."""
import io
import subprocess
import sys
import tempfile

import numpy as np
import PIL.Image
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from egosgm.bag import program as bag_program

WIDTH, HEIGHT, FRAMES = 320, 96, 3
SEED = 7
OPTIONS = dict(disparities=48, paths=4)
RATE_NS = 100_000_000
SIDES = "left", "right"
START = 1_700_000_000_000_000_000
SET = ["--set", "disparities=48", "--set", "paths=4", "--quiet"]
TOPICS = ["--left-topic", "/left/image_rect", "--right-topic", "/right/image_rect"]


class Recording:
    """Messages of one bag, whatever its format."""

    frame_id = "left_optical"

    def __init__(self, kind):
        self.kind = kind
        self.store = get_typestore(Stores.ROS1_NOETIC if kind == "ros1" else Stores.ROS2_HUMBLE)
        self.types = self.store.types
        self.messages = []

    def header(self, time):
        stamp = self.types["builtin_interfaces/msg/Time"](sec=time // 10**9, nanosec=time % 10**9)
        seq = {"seq": 0} if self.kind == "ros1" else {}
        return self.types["std_msgs/msg/Header"](**seq, stamp=stamp, frame_id=self.frame_id)

    def add(self, topic, kind, time, received=None, **fields):
        message = self.types[kind](header=self.header(time), **fields)
        self.messages.append((START + len(self.messages) if received is None else received, topic, kind, message))

    def image(self, topic, time, pixels, encoding=None, received=None):
        height, width = pixels.shape[:2]
        encoding = encoding or {np.dtype(np.uint8): "mono8", np.dtype(np.uint16): "mono16"}[pixels.dtype]
        data = np.ascontiguousarray(pixels)
        self.add(topic, "sensor_msgs/msg/Image", time, received, height=height, width=width, encoding=encoding, is_bigendian=0,
                 step=data.strides[0], data=data.view(np.uint8).reshape(-1))

    def info(self, topic, calibration, is_right, distortion=(0, 0, 0, 0, 0), rotation=np.eye(3)):
        c = calibration
        k = np.array([c.fx, 0, c.cx, 0, c.fy, c.cy, 0, 0, 1.0])
        p = np.array([c.fx, 0, c.cx, -c.fx * c.baseline_m * is_right, 0, c.fy, c.cy, 0, 0, 0, 1.0, 0])
        region = self.types["sensor_msgs/msg/RegionOfInterest"](x_offset=0, y_offset=0, height=0, width=0, do_rectify=False)
        values = dict(d=np.array(distortion, float), k=k, r=np.asarray(rotation, float).reshape(-1), p=p)
        if self.kind == "ros1":
            values = {name.upper(): value for name, value in values.items()}
        self.add(topic, "sensor_msgs/msg/CameraInfo", START, height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", **values,
                 binning_x=0, binning_y=0, roi=region)

    def pose(self, time, received=None, at=(0.0, 0.0, 0.0), turn=(0.0, 0.0, 0.0, 1.0)):
        position, orientation = self.types["geometry_msgs/msg/Point"](*at), self.types["geometry_msgs/msg/Quaternion"](*turn)
        self.add("/odom", "geometry_msgs/msg/PoseStamped", time, received, pose=self.types["geometry_msgs/msg/Pose"](position, orientation))

    def write(self, path):
        self.messages.sort(key=lambda item: item[0])
        plugin = {} if self.kind == "ros1" else dict(version=9, storage_plugin=StoragePlugin.MCAP if self.kind == "mcap" else StoragePlugin.SQLITE3)
        with (Writer1(path) if self.kind == "ros1" else Writer(path, **plugin)) as writer:
            connections = {}
            for time, topic, kind, message in self.messages:
                if topic not in connections:
                    connections[topic] = writer.add_connection(topic, kind, typestore=self.store)
                data = self.store.serialize_ros1(message, kind) if self.kind == "ros1" else self.store.serialize_cdr(message, kind)
                writer.write(connections[topic], time, data)
        return next(path.glob("*.mcap")) if self.kind == "mcap" else path


def drive_of(street, frames, change=lambda message: message, image=lambda pixels: pixels, encoding=None, kind="mcap", times=None,
             of_right=lambda i, time: time, left_out=(), in_order=False):
    """A recording whose camera infos and images are changed; it received them when they are stamped, or in order."""
    recording = Recording(kind)
    for side, name in enumerate(SIDES):
        recording.info(f"/{name}/camera_info", street.calibration, side)
        change(recording.messages[-1][3])
    for i, frame in enumerate(frames):
        time = times[i] if times else START + i * RATE_NS
        for side, name in enumerate(SIDES):
            stamp = of_right(i, time) if side else time
            if (i, name) not in left_out:
                recording.image(f"/{name}/image_rect", stamp, image(getattr(frame, name)), encoding, None if in_order else stamp + side)
    return recording


def record(kind, path, street, frames, **how):
    return drive_of(street, frames, kind=kind, in_order=True, **how).write(path)


def program(*arguments):
    """`egosgm run`."""
    return subprocess.run([sys.executable, "-B", "-m", "egosgm.bag.program", *map(str, arguments)], capture_output=True, text=True, errors="replace", timeout=900)


def refused(capfd, arguments, *named, code=2):
    """One line on the standard error."""
    out = [] if "--out" in arguments else ["--out", "/nowhere"]
    assert bag_program.main([str(argument) for argument in (*arguments, *out)]) in ((1, 2) if code is None else (code,))
    told = capfd.readouterr()
    assert told.err.startswith("egosgm: error: ") and told.err.count("\n") == 1, told.err
    for text in named:
        assert str(text) in told.err


def told_of(capfd, path, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        code = bag_program.main(["--bag", str(path), *TOPICS, *SET[:-1], "--out", folder, *map(str, arguments)])
    said = capfd.readouterr()
    assert code == 0, said.err
    return said.out


def png_of(pixels):
    file = io.BytesIO()
    PIL.Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


def with_a_broken_message(street, frames):
    """The third one of four of the right camera."""
    recording = drive_of(street, [frames[i % FRAMES] for i in range(4)])
    for received, topic, _, message in recording.messages:
        if topic == "/right/image_rect" and received == START + 2 * RATE_NS + 1:
            message.height, message.width, message.step, message.data = 1, 1, 1, np.zeros(1, np.uint8)
    return recording

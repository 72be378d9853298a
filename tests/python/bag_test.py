# SPDX-License-Identifier: Apache-2.0
"""Bags of robots in and out: what is read equals the images that were recorded, and what is written says where things are."""
import io
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time

import numpy as np
import PIL.Image
import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import egosgm

from egosgm import bag as bags
from egosgm.bag import outputs as bag_outputs
from egosgm.bag import program as bag_program
from egosgm.bag import ros_images
from egosgm.geometry import cloud as cloud_program
from refusals import expect_refused

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


@pytest.mark.parametrize("kind, name", [("mcap", "drive"), ("sqlite", "drive"), ("ros1", "drive.bag")])
def test_every_kind_of_bag_gives_the_recorded_images(kind, name, tmp_path, street, frames):
    bag = bags.Bag(record(kind, tmp_path / name, street, frames), "/left/image_rect", "/right/image_rect")
    assert len(bag) == FRAMES
    for _ in range(2):
        found = list(bag.frames())
        assert [frame.stamp_ns for frame in found] == [START + i * RATE_NS for i in range(FRAMES)]
        for frame, expected in zip(found, frames, strict=True):
            np.testing.assert_array_equal(frame.left, expected.left)
            np.testing.assert_array_equal(frame.right, expected.right)
    assert found[0].starts_anew and not found[1].starts_anew and found[0].frame_id == "left_optical"
    for name in ("fx", "fy", "cx", "cy", "baseline_m", "doffs_px"):
        assert getattr(bag.cameras.calibration, name) == pytest.approx(getattr(street.calibration, name))
    assert bag.gaps.text() == ""


def test_the_written_bag_says_where_things_are(tmp_path, street, frames, shared_pipeline):
    """Depth in metres by f T / d, the disparities of the pipeline, and nothing left beside them."""
    out = tmp_path / "result.mcap"
    bag = record("mcap", tmp_path / "drive", street, frames)
    told = program("--bag", bag, *TOPICS, "--out", out, *SET[:-1])
    assert told.returncode == 0, told.stderr
    assert f"bag {bag.name}, {FRAMES} frames, {WIDTH}x{HEIGHT}, on " in told.stdout and "no motion" not in told.stdout
    assert sorted(file.name for file in tmp_path.iterdir()) == ["drive", "result.mcap"]
    odometry = egosgm.StereoOdometry(street.calibration)
    shared_pipeline.reset()
    expected = [shared_pipeline.process(f.left, f.right, odometry.process(f.left, f.right).motion, ("disparity", "variance", "reason"))
                for f in frames]
    found = {}
    with AnyReader([out]) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            assert time == ros_images.stamp_ns(message.transforms[0] if connection.topic == "/tf" else message)
            found.setdefault(connection.topic, []).append(message)
    assert {topic: len(messages) for topic, messages in found.items()} == dict.fromkeys(
        [f"/egosgm/{name}" for name in ("depth", "variance", "disparity", "reason", "odom", "points", "left/camera_info", "right/camera_info")] + ["/tf"], FRAMES)
    c = street.calibration
    for i, result in enumerate(expected):
        message = found["/egosgm/disparity"][i]
        disparity = message.image.data.view(np.float32).reshape(HEIGHT, WIDTH)
        valid = result.disparity != egosgm.INVALID_DISPARITY
        np.testing.assert_array_equal(disparity[valid], result.disparity[valid])
        assert (disparity[~valid] < message.min_disparity).all() and message.min_disparity <= disparity[valid].min()
        assert disparity.max() <= message.max_disparity == 47
        assert message.f == pytest.approx(c.fx) and message.t == pytest.approx(c.baseline_m)
        assert (message.valid_window.width, message.valid_window.height) == (WIDTH, HEIGHT)
        depth = found["/egosgm/depth"][i].data.view(np.float32).reshape(HEIGHT, WIDTH)
        seen = disparity > 0
        np.testing.assert_allclose(depth[seen], message.f * message.t / disparity[seen], rtol=1e-5)
        assert np.isnan(depth[~seen]).all() and found["/egosgm/depth"][i].encoding == "32FC1"
        variance = found["/egosgm/variance"][i].data.view(np.float32).reshape(HEIGHT, WIDTH)
        reason = found["/egosgm/reason"][i]
        assert reason.encoding == "mono8"
        np.testing.assert_array_equal(reason.data.reshape(HEIGHT, WIDTH), result.reason)
        near = seen & (disparity > 5)
        step = message.f * message.t / (disparity[near] - 0.01) - depth[near]  # a hundredth of a pixel, in metres
        np.testing.assert_allclose(variance[near], (100 * step) ** 2 * result.variance[near], rtol=0.01)
    right = found["/egosgm/right/camera_info"][0]
    assert -right.p[3] / right.p[0] == pytest.approx(c.baseline_m) and right.p[2] == pytest.approx(c.cx)
    position = found["/egosgm/odom"][-1].pose.pose.position  # x forward
    assert position.x == pytest.approx(2 * 0.8, abs=0.1) and abs(position.y) < 0.1 and abs(position.z) < 0.1
    refused = program("--bag", bag, *TOPICS, "--out", out, *SET)
    assert refused.returncode == 2 and "is there already" in refused.stderr
    again = bags.Bag(out, "/egosgm/depth", "/egosgm/variance", ["/egosgm/left/camera_info", "/egosgm/right/camera_info"])
    assert again.count == FRAMES  # a bag as any other


def matrix_of(transform):
    matrix, q, t = np.eye(4), transform.rotation, transform.translation
    matrix[:3, :3] = ros_images.rotation_of(q.x, q.y, q.z, q.w)
    matrix[:3, 3] = t.x, t.y, t.z
    return matrix


def test_a_3d_panel_can_place_the_points(tmp_path, street, frames, monkeypatch):
    """As Foxglove asks for it: an ROS 2 schema with all that it is made of, points in a frame that tf leads to from odom at their time, rgb in a float."""
    from mcap.reader import make_reader
    out = tmp_path / "result.mcap"
    monkeypatch.setattr(Recording, "frame_id", "")  # a camera that names none
    told = program("--bag", record("mcap", tmp_path / "drive", street, frames), *TOPICS, "--out", out, *SET)
    assert told.returncode == 0, told.stderr
    with open(out, "rb") as file:
        summary = make_reader(file).get_summary()
    for channel in summary.channels.values():
        schema = summary.schemas[channel.schema_id]
        assert (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
        own = {name.rsplit("/", 1)[-1] for name in re.findall(r"^MSG: (\S+)", schema.data.decode(), re.MULTILINE)}
        for kind in re.findall(r"^(?:\w+/)?([A-Z]\w+)(?:\[.*\])? \w+$", schema.data.decode(), re.MULTILINE):
            assert kind in own, (schema.name, kind)
    clouds, trees, poses = {}, {}, {}
    with AnyReader([out]) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            kept = {"/egosgm/points": clouds, "/tf": trees, "/egosgm/odom": poses}.get(connection.topic)
            if kept is not None:
                kept[time] = message
    assert len(clouds) == FRAMES and set(clouds) == set(trees) == set(poses)
    in_odom = []
    for time, message in clouds.items():
        tree = {transform.child_frame_id: transform for transform in trees[time].transforms}
        assert [field.name for field in message.fields] == ["x", "y", "z", "rgb"] and [field.offset for field in message.fields] == [0, 4, 8, 12]
        assert (message.height, message.point_step, message.row_step) == (1, 16, 16 * message.width) and len(message.data) == 16 * message.width > 16 * 1000
        points = message.data.view(np.float32).reshape(-1, 4)
        grey = points[:, 3].copy().view(np.uint32)
        np.testing.assert_array_equal(grey, (grey & 255) * 0x010101)
        assert len(np.unique(grey)) > 20
        pose, frame = np.eye(4), message.header.frame_id
        while frame != "odom":
            assert frame
            pose, frame = matrix_of(tree[frame].transform) @ pose, tree[frame].header.frame_id
        body, expected = matrix_of(tree["egosgm_camera"].transform), poses[time].pose.pose.position
        np.testing.assert_allclose(body[:3, 3], [expected.x, expected.y, expected.z])
        in_odom.append(points[:, :3] @ pose[:3, :3].T + pose[:3, 3])
    ahead, _, up = np.median(in_odom[-1], axis=0)
    assert ahead > 5 and up < ahead / 4  # x is forward, z up
    assert len({tuple(matrix_of(tree.transforms[0].transform)[:3, 3]) for tree in trees.values()}) == FRAMES  # it drives


def test_a_range_beyond_the_usual_is_said_and_nothing_of_it_is_lost(tmp_path, street, frames):
    """In a bag, whose messages tell the range, and in a folder, where KITTI's PNG has no room for negative disparities."""
    moved = [type("Frame", (), dict(left=frame.left, right=np.roll(frame.right, 25, axis=1))) for frame in frames]
    bag = record("mcap", tmp_path / "drive", street, moved)
    options = ["--set", "min_disparity=-40", "--set", "disparities=80", "--set", "paths=4", "--quiet"]
    told = program("--bag", bag, *TOPICS, "--out", tmp_path / "out", *options)
    assert told.returncode == 0, told.stderr
    found = [egosgm.read_disparity(tmp_path / f"out/disparity/{i:06d}.pfm") for i in range(FRAMES)]
    assert all((disparity > egosgm.INVALID_DISPARITY).mean() > 0.5 and (disparity[disparity > egosgm.INVALID_DISPARITY] < 0).any() for disparity in found)
    for least, disparities in ((-40, 80), (40, 48)):
        out = tmp_path / f"{least}.mcap"
        bag = record("mcap", tmp_path / f"drive{least}", street, frames)
        told = program("--bag", bag, *TOPICS, "--out", out, "--set", f"min_disparity={least}", "--set", f"disparities={disparities}", "--quiet")
        assert told.returncode == 0, told.stderr
        with AnyReader([out]) as reader:
            for connection, _, raw in reader.messages(connections=[c for c in reader.connections if c.topic == "/egosgm/disparity"]):
                message = reader.deserialize(raw, connection.msgtype)
                assert (message.min_disparity, message.max_disparity) == (max(0, least), least + disparities - 1)


def test_a_calibration_that_changes_is_seen(tmp_path, street, frames):
    recording = Recording("mcap")
    c = street.calibration
    half = egosgm.Calibration(c.fx / 2, c.fy, c.cx, c.cy, c.baseline_m)
    for i, frame in enumerate(frames):
        for side, name in enumerate(SIDES):
            recording.info(f"/{name}/camera_info", c if i < 2 else half, side)
            recording.image(f"/{name}/image_rect", START + i * RATE_NS, (frame.left, frame.right)[side])
    bag = bags.Bag(recording.write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect")
    found = []
    with pytest.raises(egosgm.InvalidArgument, match="/left/camera_info: another calibration than at the start"):
        for frame in bag.frames():
            found.append(frame.number)
    assert found == [0, 1]


def test_what_ends_a_run_leaves_nothing_and_is_in_nobodys_way(tmp_path, street, frames):
    bag, out = record("mcap", tmp_path / "drive", street, frames * 40, times=[START + i * RATE_NS for i in range(40 * FRAMES)]), tmp_path / "out.mcap"
    for stop in (signal.SIGTERM, signal.SIGKILL):
        process = subprocess.Popen([sys.executable, "-B", "-m", "egosgm.bag.program", "--bag", bag, *TOPICS, "--out", out, *SET],
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        while not [part for part in tmp_path.glob(".egosgm-*.part") if part.stat().st_size > 100_000]:  # at work
            assert process.poll() is None, process.stderr.read()
            time.sleep(0.01)
        process.send_signal(stop)
        _, errors = process.communicate(timeout=900)
        assert not out.exists()
        if stop == signal.SIGTERM:
            assert (process.returncode, errors) == (130, "egosgm: interrupted\n")
            assert sorted(file.name for file in tmp_path.iterdir()) == ["drive"]
    bag = record("mcap", tmp_path / "short", street, frames)
    assert program("--bag", bag, *TOPICS, "--out", out, *SET).returncode == 0


def test_a_viewer_gets_what_a_file_gets(tmp_path, street, frames, monkeypatch, capfd):
    bag = record("mcap", tmp_path / "drive", street, frames)
    outputs, fails_at = [], []

    class Viewer:
        def __init__(self, *file):
            self.calls = [file]
            outputs.append(self)

        def add(self, frame, maps, motion, calibration):
            if frame.number in fails_at:
                raise egosgm.IoError("the disk is full")
            assert frame.stamp_ns == START + frame.number * RATE_NS and (frame.left == frames[frame.number].left).all()
            assert maps.reason is not None and calibration.fx == pytest.approx(street.calibration.fx)
            self.calls.append((frame.number, motion is not None))

        def finish(self):
            self.calls.append("finish")

        def give_up(self):
            self.calls.append("give up")

    monkeypatch.setattr(bag_program, "RerunOutput", Viewer)
    given = ["--bag", str(bag), *TOPICS, *SET, "--out", str(tmp_path / "out.rrd"), "--rerun"]
    assert bag_program.main(given) == 0
    assert [output.calls for output in outputs] == [[file, *((i, i > 0) for i in range(FRAMES)), "finish"] for file in ((tmp_path / "out.rrd",), ())]
    outputs.clear()
    fails_at.append(1)
    assert bag_program.main(given) == 1 and "the disk is full" in capfd.readouterr().err
    assert [output.calls[-1] for output in outputs] == ["give up"] * 2
    outputs.clear()
    assert bag_program.main([*given, "--set", "disparities=-1"]) == 2 and outputs == []


def test_a_recording_that_is_finished_stays_where_the_viewer_fails():
    said = []

    class Output:
        def __init__(self, name):
            self.name = name

        def finish(self):
            said.append(f"{self.name} finished")
            if self.name == "viewer":
                raise OSError("the viewer is gone")

        def give_up(self):
            said.append(f"{self.name} given up")

    outputs = bag_program.Outputs("", False)
    outputs._outputs = [Output("recording"), Output("viewer"), Output("other")]
    with pytest.raises(OSError, match="gone"):
        outputs.end(True)
    assert said == ["recording finished", "viewer finished", "viewer given up", "other given up"]
    outputs._outputs = [Output("recording")]
    outputs.end(False)
    assert said[4:] == ["recording given up"]


def test_a_folder_is_that_of_any_run(tmp_path, street, frames, street_folder, capfd):
    """The maps of a folder with the same images, and what report and cloud read; options, warnings and --resume are those of any run."""
    bag, out = record("sqlite", tmp_path / "drive", street, frames), tmp_path / "result"
    given = ["--bag", bag, *TOPICS, *SET, "--out", out, "--write", "variance,color"]
    told = program(*given, "--save-config", tmp_path / "config.json")
    assert told.returncode == 0, told.stderr
    for i, frame in enumerate(frames):
        for side, image in enumerate((frame.left, frame.right)):
            (street_folder / f"image_{side}/{i:06d}.png").write_bytes(png_of(image))
    told = program(street_folder, *SET, "--out", tmp_path / "of_folder", "--config", tmp_path / "config.json", "--write", "variance,color")
    assert told.returncode == 0, told.stderr
    for i in range(FRAMES):
        for name in (f"disparity/{i:06d}.png", f"variance/{i:06d}.pfm", f"color/{i:06d}.png"):
            assert (out / name).read_bytes() == (tmp_path / "of_folder" / name).read_bytes()
        np.testing.assert_array_equal(egosgm.read_grey(out / f"left/{i:06d}.png"), frames[i].left)
    np.testing.assert_allclose(np.loadtxt(out / "poses.txt"), np.loadtxt(tmp_path / "of_folder/poses.txt"), atol=1e-6)
    assert egosgm.read_calibration(out / "calibration.txt").baseline_m == pytest.approx(street.calibration.baseline_m)
    report = json.loads((out / "report.json").read_text())
    assert report["finished"] and report["input"] == "bag drive" and "warning" not in report
    assert [frame["stamp_ns"] for frame in report["frames"]] == [START + i * RATE_NS for i in range(FRAMES)]
    assert cloud_program.main([str(out)]) == 0
    refused(capfd, given, "is not empty")
    (out / "disparity/000002.png").unlink()
    assert program(*given, "--resume").returncode == 0
    assert (out / "disparity/000002.png").read_bytes() == (tmp_path / "of_folder/disparity/000002.png").read_bytes()
    refused(capfd, [*given, "--resume", "--set", "p2=99"], "p2")


def test_names_that_are_no_text(tmp_path, street, frames, capfd):
    """Of the bag, of a part that cannot be read, and of the output."""
    whole = record("mcap", tmp_path / "drive", street, frames).read_bytes()
    folder, odd = tmp_path / "b\udcff\n", "o\udcff\n"
    folder.mkdir()
    (folder / "a.mcap").write_bytes(whole)
    (folder / "\udcff.mcap").write_bytes(b"nothing")
    for out in (odd, odd + ".mcap"):
        assert program("--bag", folder, *TOPICS, *SET, "--out", tmp_path / out).returncode == 0
        assert (tmp_path / out).exists()
    assert "1 of 2 parts cannot be read" in json.loads((tmp_path / odd / "report.json").read_text())["notes"][0]


def test_some_frames_of_a_bag(tmp_path, street, frames, capfd):
    bag = record("mcap", tmp_path / "drive", street, frames)
    assert "2 frames" in told_of(capfd, bag, "--frames", "1:2")
    assert "1 frame," in told_of(capfd, bag, "--frames", ":0")
    refused(capfd, ["--bag", bag, *TOPICS, *SET, "--frames", "3:"], f"at most {FRAMES} frames")
    lost = record("mcap", tmp_path / "lost", street, [*frames, frames[0]], left_out=[(1, "right"), (2, "left")])  # three images a side, two pairs
    refused(capfd, ["--bag", lost, *TOPICS, *SET, "--frames", "2:", "--out", tmp_path / "out"], "--frames", "has 2 frames")
    assert not (tmp_path / "out").exists()


def test_python_runs_a_bag(tmp_path, street, frames):
    """As the program does: where time steps back, nothing is predicted."""
    times = [START + i * RATE_NS for i in (50, 51, 1, 2)]
    bag = bags.Bag(record("mcap", tmp_path / "drive", street, [frames[i % FRAMES] for i in (0, 1, 0, 1)], times=times))
    found = list(egosgm.run(bag, progress=False, **OPTIONS))
    assert [frame.report.unpredicted for frame in found] == ["first frame", "", "reset", ""]
    assert [frame.motion is not None for frame in found] == [False, True, False, True]
    assert [frame.report.unpredicted for frame in egosgm.run(bag.path, progress=False, **OPTIONS)] == ["first frame", "", "reset", ""]
    assert program("--bag", bag.path, *TOPICS, *SET, "--out", tmp_path / "out").returncode == 0
    assert [frame["unpredicted"] for frame in json.loads((tmp_path / "out/report.json").read_text())["frames"]] == ["first frame", "", "reset", ""]


def test_stamps_pair_within_their_bound_and_gaps_are_told(tmp_path, street, frames):
    times = [START, START + RATE_NS, START + 2 * RATE_NS, START + 17 * RATE_NS, START + 3 * RATE_NS]
    path = record("mcap", tmp_path / "drive", street, [frames[i % FRAMES] for i in range(5)], of_right=lambda i, time: time + 2_000_000, times=times,
                  left_out=[(1, "right")])
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect", max_skew_ms=3)
    found = list(bag.frames())
    assert [(frame.stamp_ns - START) // RATE_NS for frame in found] == [0, 2, 17, 3]
    assert [frame.starts_anew for frame in found] == [True, False, False, True]
    text = bag.gaps.text()
    assert "1 left and 0 right images have no partner" in text and "differ by up to 2.000 ms" in text
    assert "1 gap, the longest of 1.500 s before frame 2" in text and "steps back 1 times" in text
    expect_refused("nearest stamps differ by 2.000 ms: allow that by --max-skew-ms", lambda: list(bags.Bag(path, "/left/image_rect", "/right/image_rect").frames()))


def test_messages_that_were_received_out_of_order(tmp_path, street, frames):
    """Within a second they are sorted: no pair is made up, and none is lost."""
    recording = Recording("mcap")
    for side, name in enumerate(SIDES):
        recording.info(f"/{name}/camera_info", street.calibration, side)
    for i, name in ((2, "left"), (0, "left"), (0, "right"), (2, "right"), (1, "right"), (1, "left"), (3, "left"), (3, "right")):
        recording.image(f"/{name}/image_rect", START + i * RATE_NS, getattr(frames[i % FRAMES], name))
    path = recording.write(tmp_path / "drive")
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect")
    for frame in (found := list(bag.frames())):
        i = (frame.stamp_ns - START) // RATE_NS % FRAMES
        np.testing.assert_array_equal(frame.left, frames[i].left)
        np.testing.assert_array_equal(frame.right, frames[i].right)
    assert [frame.stamp_ns - START for frame in found] == [i * RATE_NS for i in range(4)] and bag.gaps.text() == ""


def test_both_cameras_seen_from_a_third_one(tmp_path, street, frames):
    """As KITTI's colour cameras, whose P both have a Tx."""
    c = street.calibration

    for left_tx in (0.1 * c.fx, -0.3 * c.fx):
        def shifted(info):
            info.p[3] += left_tx
        path = drive_of(street, frames[:1], shifted).write(tmp_path / f"drive{left_tx:.0f}")
        for rectify in (False, True):
            bag = bags.Bag(path, "/left/image_rect", "/right/image_rect", rectify=rectify)
            next(bag.frames())
            assert bag.cameras.calibration.baseline_m == pytest.approx(c.baseline_m)


@pytest.mark.parametrize("offset", (0, 200))
@pytest.mark.parametrize("rectify", (False, True))
def test_binned_and_cropped_images_have_the_calibration_of_their_pixels(rectify, offset, tmp_path, street, frames):
    """The info is then of the sensor's pixels: here two columns and three rows make one, and the region begins so many columns to the right."""
    def whole_sensor(info):
        info.width, info.height, info.binning_x, info.binning_y = 2 * WIDTH + 2 * offset, 3 * HEIGHT, 2, 3
        finer = np.array([[2.0, 0, offset], [0, 3, 0], [0, 0, 1]])
        info.k, info.p = (finer @ info.k.reshape(3, 3)).reshape(-1), (finer @ info.p.reshape(3, 4)).reshape(-1)
        info.roi.x_offset, info.roi.width, info.roi.height = (offset, 2 * WIDTH, 3 * HEIGHT) if offset else (0, 0, 0)
    bag = bags.Bag(drive_of(street, frames[:1], whole_sensor).write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect", rectify=rectify)
    frame, = bag.frames()
    for name in ("fx", "fy", "cx", "cy", "baseline_m"):
        assert getattr(bag.cameras.calibration, name) == pytest.approx(getattr(street.calibration, name), abs=1e-4)
    np.testing.assert_array_equal(frame.left, frames[0].left)


def test_messages_that_are_not_of_ros(tmp_path, capfd):
    from mcap.writer import Writer as McapWriter
    with open(tmp_path / "json.mcap", "wb") as file:
        writer = McapWriter(file)
        writer.start(profile="", library="")
        schema = writer.register_schema("foxglove.RawImage", "jsonschema", b"{}")
        for topic in ("/left/image_rect", "/right/image_rect"):
            writer.add_message(writer.register_channel(topic, "json", schema), 1, b"{}", 1)
        writer.finish()
    refused(capfd, ["--bag", tmp_path / "json.mcap", *TOPICS, *SET], "its messages are not ROS's")


def test_stamps_that_cameras_set_a_little_apart_are_told_with_the_bound_that_allows_them(tmp_path, street, frames):
    path = drive_of(street, frames, of_right=lambda i, time: time + (30_400 if i else 0)).write(tmp_path / "drive")
    bag = bags.Bag(path, "left/image_rect", "right/image_rect")  # a leading slash is not missed
    assert len(list(bag.frames())) == 1
    assert "2 left and 2 right images have no partner: the nearest of them differ by 0.031 ms, which --max-skew-ms can allow" in bag.gaps.text()
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect", max_skew_ms=0.031)
    assert len(list(bag.frames())) == FRAMES and "no partner" not in bag.gaps.text()


def test_a_pair_that_comes_twice_is_left_out(tmp_path, street, frames):
    times = [START, START + RATE_NS, START + RATE_NS, START + 2 * RATE_NS]
    path = record("mcap", tmp_path / "drive", street, [frames[i] for i in (0, 1, 1, 2)], times=times)
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect")
    found = list(bag.frames())
    assert [(frame.stamp_ns - START) // RATE_NS for frame in found] == [0, 1, 2] and [frame.starts_anew for frame in found] == [True, False, False]
    assert bag.gaps.text() == "1 pairs have the stamp of the one before, and are left out"


def test_without_stamps_the_times_of_the_recording_are_taken(tmp_path, street, frames):
    recording = Recording("mcap")
    for side, name in enumerate(SIDES):
        recording.info(f"/{name}/camera_info", street.calibration, side)
        for i in range(FRAMES):
            recording.image(f"/{name}/image_rect", 0, (frames[i].left, frames[i].right)[side], received=START + i * RATE_NS + 1_000_000 * side)
    path = recording.write(tmp_path / "drive")
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect", max_skew_ms=1)
    found = list(bag.frames())
    assert [frame.stamp_ns for frame in found] == [START + i * RATE_NS for i in range(FRAMES)] and not found[1].starts_anew
    assert "the images have no stamps: the times at which they were recorded are taken" in bag.gaps.text()
    expect_refused(r"differ by 1.000 ms: allow that by --max-skew-ms \(images have no stamps here", lambda: list(bags.Bag(path, "/left/image_rect", "/right/image_rect").frames()))


@pytest.mark.parametrize("kind, suffix", [("mcap", ".mcap"), ("sqlite", ".db3"), ("ros1", ".bag")])
def test_the_parts_of_a_bag_in_a_folder_that_nothing_describes(kind, suffix, tmp_path, street, frames):
    (tmp_path / "parts").mkdir()
    for part in (1, 0):
        recording = Recording(kind)
        for side, name in enumerate(SIDES):
            if part == 0:
                recording.info(f"/{name}/camera_info", street.calibration, side)
            time = START + part * RATE_NS
            recording.image(f"/{name}/image_rect", time, (frames[part].left, frames[part].right)[side], received=time + side)
        written = recording.write(tmp_path / f"part_{part}{suffix if kind == 'ros1' else ''}")
        written = next(written.glob("*.db3")) if kind == "sqlite" else written
        written.rename(tmp_path / "parts" / f"part_{part}{suffix}")
    (tmp_path / "none").mkdir()
    for folder in (tmp_path / "none", tmp_path / "parts"):
        (folder / "notes.txt").write_text("not a bag")
    expect_refused("none: holds no bag, neither metadata.yaml nor .mcap", lambda: bags.Bag(tmp_path / "none"))
    bag = bags.Bag(tmp_path / "parts", "/left/image_rect", "/right/image_rect")
    assert [(frame.stamp_ns - START) // RATE_NS for frame in bag.frames()] == [0, 1] and len(bag) == 2
    expect_refused('no topic "/left/camera_info"; its topics of camera infos: none; without them give --calib', lambda: bags.Bag(tmp_path / "parts" / f"part_1{suffix}", "/left/image_rect", "/right/image_rect"))


def test_a_calibration_takes_the_place_of_camera_infos(tmp_path, street, frames, capfd):
    recording = Recording("mcap")
    recording.image("/left/image_rect", START, frames[0].left)
    recording.image("/right/image_rect", START, frames[0].right)
    path = recording.write(tmp_path / "drive")
    topics = "/left/image_rect", "/right/image_rect"
    plain = tmp_path / "calib.txt"
    egosgm.write_calibration(plain, street.calibration)
    bag = bags.Bag(path, *topics, calib=plain)
    frame, = bag.frames()
    np.testing.assert_array_equal(frame.left, frames[0].left)
    c = bag.cameras.calibration
    assert (c.fx, c.baseline_m) == pytest.approx((street.calibration.fx, street.calibration.baseline_m)) and not bag.is_rectified_here

    camera = dict(intrinsics=[c.fx, c.fy, c.cx, c.cy], resolution=[WIDTH // 2, HEIGHT // 2])
    shift = [[1, 0, 0, -c.baseline_m], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    (tmp_path / "chain.json").write_text(json.dumps(dict(cam0=camera, cam1=dict(camera, T_cn_cnm1=shift))))
    expect_refused(f"is of images of {WIDTH // 2}x.*, and these have {WIDTH}x{HEIGHT}", lambda: next(bags.Bag(path, *topics, calib=tmp_path / "chain.json").frames()))

    for camera in (0, 1):  # of EuRoC, turned by a little
        folder = tmp_path / f"mav0/cam{camera}"
        folder.mkdir(parents=True)
        (folder / "sensor.yaml").write_text(
            f"sensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [1.0, 0.0, 0.0, {c.baseline_m * camera}, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0]\n"
            f"rate_hz: 20\nresolution: [{WIDTH}, {HEIGHT}]\ncamera_model: pinhole\nintrinsics: [{c.fx}, {c.fy}, {c.cx}, {c.cy}]\n"
            "distortion_model: radial-tangential\ndistortion_coefficients: [0.01, 0.0, 0.0, 0.0]\n")
    for folder in (tmp_path / "mav0", tmp_path):
        bag = bags.Bag(path, *topics, calib=folder)
        frame, = bag.frames()
        assert bag.is_rectified_here and bag.cameras.calibration.baseline_m == pytest.approx(c.baseline_m) and (frame.left != frames[0].left).any()
    told = program("--bag", path, *TOPICS, *SET[:-1], "--calib", tmp_path / "mav0", "--out", tmp_path / "out.mcap")
    assert told.returncode == 0 and "rectified here" in told.stdout, told.stderr
    for arguments, named in ((["--calib", tmp_path / "none.txt"], "none.txt"), (["--calib", tmp_path / "drive"], "drive"),
                             (["--calib", plain, "--rectify", "on"], "leave rectify out"), (["--calib", plain, "--info-topics", "/a", "/b"], "no info topics")):
        refused(capfd, ["--bag", path, *TOPICS, *SET, *arguments], named)


@pytest.mark.parametrize("model, distortion", [("radtan", [0.01, 0, 0, 0]), ("fisheye", [0.01, 0, 0, 0]), ("equidistant", [0.01, 0, 0, 0, 0])])
def test_distortions_by_the_names_that_drivers_give_them(model, distortion, street, frames):
    recording = Recording("mcap")
    recording.info("/left/camera_info", street.calibration, 0, distortion=distortion)
    recording.info("/right/camera_info", street.calibration, 1, distortion=distortion)
    infos = [item[3] for item in recording.messages]
    for info in infos:
        info.distortion_model = model
    named = ros_images.Cameras(*infos, True).rectified(frames[0].left, frames[0].right)
    for info in infos:
        info.distortion_model, info.d = ("plumb_bob", info.d) if model == "radtan" else ("equidistant", info.d[:4])
    for image, expected in zip(named, ros_images.Cameras(*infos, True).rectified(frames[0].left, frames[0].right)):
        np.testing.assert_array_equal(image, expected)


def test_the_nearest_partner_is_taken():
    pairing = bags.Pairing(5)
    pairs = []
    for side, stamp in ((0, 10), (1, 6), (1, 11), (0, 20), (1, 19), (1, 21), (0, 30)):
        pairs += pairing.add(side, stamp, None)
    pairs += pairing.end()
    assert [(left[0], right[0]) for left, right in pairs] == [(10, 11), (20, 19)]
    assert pairing.gaps.unpaired_right == 2 and pairing.gaps.unpaired_left == 1


def test_encodings_give_the_same_grey(street, frames):
    recording = Recording("mcap")
    grey = frames[0].left

    def read(pixels, encoding):
        recording.messages.clear()
        recording.image("/x", START, pixels, encoding)
        return ros_images.grey_of(recording.messages[0][3])

    padded = np.pad(grey, ((0, 0), (0, 13)))
    recording.image("/x", START, padded, "mono8")
    message = recording.messages[0][3]
    message.width = WIDTH
    np.testing.assert_array_equal(ros_images.grey_of(message), grey)
    for encoding, channels in (("rgb8", 3), ("bgr8", 3), ("rgba8", 4), ("bgra8", 4)):
        np.testing.assert_array_equal(read(np.repeat(grey[:, :, None], channels, axis=2), encoding), grey)
    red = np.zeros((2, 2, 3), np.uint8)
    red[:, :, 0] = 255
    assert (read(red, "rgb8") == 76).all() and (read(red, "bgr8") == 29).all()
    wide = grey.astype(np.uint16) * 257
    assert read(wide, "mono16").dtype == np.uint16
    np.testing.assert_array_equal(read(wide, "mono16"), wide)
    yuv = np.stack([grey, np.full_like(grey, 128)], axis=2)
    np.testing.assert_array_equal(read(yuv, "yuyv"), grey)
    np.testing.assert_array_equal(read(yuv[:, :, ::-1], "uyvy"), grey)
    np.testing.assert_array_equal(read(np.repeat(grey[:, :, None], 4, axis=2), "8UC4"), grey)
    expect_refused("32FC1", lambda: read(grey.astype(np.float32), "32FC1"))
    message.step = WIDTH - 1
    expect_refused("rows of", lambda: ros_images.grey_of(message))


@pytest.mark.parametrize("order", ["rggb", "bggr", "gbrg", "grbg"])
def test_bayer_images_are_grey_to_their_border(order):
    recording = Recording("mcap")
    values = dict(r=200, g=100, b=40)
    mosaic = np.empty((8, 10), np.uint8)
    for i, colour in enumerate(order):
        mosaic[i // 2::2, i % 2::2] = values[colour]
    for scale, bits, dtype in ((1, 8, np.uint8), (256, 16, np.uint16)):
        recording.messages.clear()
        recording.image("/x", START, mosaic.astype(dtype) * scale, f"bayer_{order}{bits}")
        grey = ros_images.grey_of(recording.messages[0][3])
        assert grey.dtype == dtype and (grey == (200 + 2 * 100 + 40) // 4 * scale).all()


def test_compressed_images_are_read(tmp_path, street, frames):
    recording = Recording("mcap")
    egosgm.write_disparity(tmp_path / "left.png", frames[0].left.astype(np.float32))
    expected = egosgm.read_grey(tmp_path / "left.png")
    for name, data in (("left", (tmp_path / "left.png").read_bytes()), ("right", (tmp_path / "left.png").read_bytes())):
        recording.info(f"/{name}/camera_info", street.calibration, name == "right")
        recording.add(f"/{name}/image_rect/compressed", "sensor_msgs/msg/CompressedImage", START, format="png", data=np.frombuffer(data, np.uint8))
    path = recording.write(tmp_path / "drive")
    frame, = bags.Bag(path, "/left/image_rect/compressed", "/right/image_rect/compressed").frames()
    np.testing.assert_array_equal(frame.left, expected)
    recording.messages[-1][3].data = np.frombuffer(b"no image at all", np.uint8)
    expect_refused("compressed image .png. cannot be read", lambda: ros_images.grey_of(recording.messages[-1][3]))


def test_raw_images_are_rectified_by_their_infos(street):
    """Points of raw cameras that are turned against each other come to lie in equal rows."""
    angle = 0.02
    turn = np.array([[1, 0, 0], [0, np.cos(angle), -np.sin(angle)], [0, np.sin(angle), np.cos(angle)]])
    recording = Recording("mcap")
    recording.info("/left/camera_info", street.calibration, 0, distortion=(0.1, 0.01, 0, 0, 0))
    recording.info("/right/camera_info", street.calibration, 1, rotation=turn)
    left, right = (item[3] for item in recording.messages)
    assert ros_images.are_raw(left, "/left/image_raw") and not ros_images.are_raw(left, "/left/image_rect")
    assert ros_images.are_raw(right, "/direct/image_raw") and not ros_images.are_raw(left, "/left/rectified/compressed")
    assert ros_images.are_raw(right, "/right/image") and not ros_images.are_raw(right, "/camera/infra1/image_rect_raw")
    cameras = ros_images.Cameras(left, right, True)
    assert cameras.calibration.baseline_m == pytest.approx(street.calibration.baseline_m)
    points = np.array([[0.5, 0.1, 4.0], [-1.0, -0.2, 6.0], [2.0, 0.3, 9.0]])
    c = street.calibration
    raw = np.zeros((2, HEIGHT, WIDTH), np.uint8)
    for point, value in zip(points, (255, 200, 150)):
        for side in (0, 1):
            x, y, z = (point - [c.baseline_m, 0, 0]) @ turn if side else point  # R takes raw to rectified
            x, y = x / z, y / z
            if not side:
                r = x * x + y * y
                x, y = x * (1 + 0.1 * r + 0.01 * r * r), y * (1 + 0.1 * r + 0.01 * r * r)
            u, v = c.fx * x + c.cx, c.fy * y + c.cy
            grid_y, grid_x = np.mgrid[:HEIGHT, :WIDTH]
            spot = value * np.exp(-((grid_x - u) ** 2 + (grid_y - v) ** 2) / 8)
            raw[side] = np.maximum(raw[side], spot.astype(np.uint8))
    rectified = cameras.rectified(raw[0], raw[1])
    for point, value in zip(points, (255, 200, 150)):
        places = []
        for side, image in enumerate(rectified):
            x = cameras.calibration.fx * (point[0] - side * c.baseline_m) / point[2] + cameras.calibration.cx + side * cameras.calibration.doffs_px
            y = cameras.calibration.fy * point[1] / point[2] + cameras.calibration.cy
            # The library turns both cameras by half of what they are turned against each other: two rows here.
            top, first = max(0, int(y) - 7), max(0, int(x) - 7)
            window = image[top:top + 15, first:first + 15].astype(float)
            weight = np.where(window > 40, window, 0)
            places.append((top + (weight.sum(1) @ np.arange(window.shape[0])) / weight.sum(),
                           first + (weight.sum(0) @ np.arange(window.shape[1])) / weight.sum()))
        assert places[0][0] == pytest.approx(places[1][0], abs=0.3)
        assert places[0][1] - places[1][1] == pytest.approx(cameras.calibration.fx * c.baseline_m / point[2] - cameras.calibration.doffs_px, abs=0.5)


def test_either_camera_may_be_the_raw_one(tmp_path, street, frames):
    raw = []
    for side, name in enumerate(SIDES):
        recording = Recording("mcap")
        for other, topic in enumerate(SIDES):
            recording.info(f"/{topic}/camera_info", street.calibration, other, distortion=(0.1 * (side == other), 0, 0, 0, 0))
            recording.image(f"/{topic}/image", START, (frames[0].left, frames[0].right)[other])
        bag = bags.Bag(recording.write(tmp_path / name), "/left/image", "/right/image")
        raw.append(bool(bag.find_cameras()) and bag.is_rectified_here)
    assert raw == [True, True]


@pytest.mark.filterwarnings("error")
def test_next_to_no_disparity_is_infinitely_uncertain(street):
    depth, variance = ros_images.depth_maps(np.full((1, 1), 1e-20, np.float32), np.ones((1, 1), np.float32), street.calibration)
    assert depth[0, 0] > 1e20 and np.isinf(variance[0, 0])


def test_poses_of_the_bag_are_the_motion(tmp_path, street, frames):
    def recorded(name, times, received=None):
        recording = drive_of(street, frames, times=times)
        for i in (-1, 0, 1, 2, 3):  # between the frames, of a constant speed of 8 m/s, forward
            recording.pose(0 if received else START + i * RATE_NS + RATE_NS // 2, received, at=(0.8 * i, 0.0, 0.0))
        return recording.write(tmp_path / name)

    path = recorded("drive", None)
    for name, times, without in (("drive", None, 0), ("half", [START, START + RATE_NS, START + 10 * RATE_NS], 1)):
        bag = bags.Bag(path if name == "drive" else recorded(name, times), "/left/image_rect", "/right/image_rect", pose_topic="/odom")
        assert [frame.world_from_camera is None for frame in bag.frames()].count(True) == without
        assert (f"{without} frames lie outside of the poses' times" in bag.gaps.text()) == bool(without)
    unset = bags.Bag(recorded("unset", [START] * FRAMES, received=START), "/left/image_rect", "/right/image_rect", pose_topic="/odom")
    assert next(unset.frames()).world_from_camera is not None  # without a stamp, a pose is of the time at which it was recorded
    found = list(bags.Bag(path, "/left/image_rect", "/right/image_rect", pose_topic="/odom").frames())
    moved = np.linalg.inv(found[1].world_from_camera) @ found[0].world_from_camera
    np.testing.assert_allclose(moved[:3, 3], (0, 0, -0.8), atol=1e-9)  # z is forward
    np.testing.assert_allclose(moved[:3, :3], np.eye(3), atol=1e-9)
    bag = bags.Bag(path, "/left/image_rect", "/right/image_rect", pose_topic="/odom")
    assert [frame.motion is not None for frame in egosgm.run(bag, **OPTIONS)] == [False, True, True]
    assert [frame.motion for frame in egosgm.run(bag, motion=False, **OPTIONS)] == [None] * FRAMES


@pytest.mark.parametrize("change, named", [
    (dict(left_topic="/none"), r'has no topic "/none"; its topics of images: /left/image_rect, /right/image_rect'),
    (dict(right_topic="/left/image_rect"), "given as left and as right"), (dict(left_topic="/left/camera_info"), "is of type sensor_msgs/msg/CameraInfo"), (dict(info_topics=["/left/camera_info"]), "give two"),
    (dict(pose_topic="/odom"), "its topics of poses: none"), (dict(max_skew_ms=-1), "max skew -1"), (dict(pose_axes="x"), 'pose axes "x"')])
def test_wrong_arguments_are_refused_by_name(change, named, tmp_path, street, frames):
    path = record("mcap", tmp_path / "drive", street, frames[:1])
    expect_refused(named, lambda: bags.Bag(path, **{**dict(left_topic="/left/image_rect", right_topic="/right/image_rect"), **change}))


def refused(capfd, arguments, *named, code=2):
    """One line on the standard error."""
    out = [] if "--out" in arguments else ["--out", "/nowhere"]
    assert bag_program.main([str(argument) for argument in (*arguments, *out)]) in ((1, 2) if code is None else (code,))
    told = capfd.readouterr()
    assert told.err.startswith("egosgm: error: ") and told.err.count("\n") == 1, told.err
    for text in named:
        assert str(text) in told.err


def changed(**fields):
    return lambda message: [setattr(message, name, value) for name, value in fields.items()]


def of_pose(**fields):
    return lambda message: [setattr(message.pose.orientation if name in "xyzw" else message.pose.position, name.removeprefix("at_"), value)
                            for name, value in fields.items()]


@pytest.mark.parametrize("topic, change, named", [
    ("/left/image_rect", changed(step=WIDTH - 1), "rows of"), ("/right/image_rect", changed(data=np.zeros(10, np.uint8)), "has 10 bytes"),
    ("/right/image_rect", changed(data=np.zeros(0, np.uint8)), "has 0 bytes"), ("/left/image_rect", changed(height=2**32 - 1), "4294967295"),
    ("/left/image_rect", changed(width=2**32 - 1, step=2**32 - 1), "4294967295"), ("/left/image_rect", changed(width=0), "an image of 0x96 px"),
    ("/left/image_rect", changed(height=0), "x0 px"), ("/left/image_rect", changed(height=HEIGHT - 1), "320x95 px, while the camera info is of 320x96"),
    ("/left/image_rect", changed(encoding="bayer_rgbg8"), "bayer_rgbg8"), ("/left/image_rect", changed(encoding="mono16", width=WIDTH // 2), "160x96"),
    ("/left/camera_info", changed(p=np.array([100.0, 52, 160, 0, 0, 100, 48, 0, 0, 0, 1, 0])), "/left/camera_info: P of the camera info has a skew of 52 px"),
    ("/left/camera_info", changed(p=np.zeros(12)), "not calibrated"), ("/right/camera_info", changed(p=np.full(12, np.nan)), "P of the camera info holds a value that is not finite"),
    ("/left/camera_info", changed(width=0, height=0), "is of 0x0"), ("/left/camera_info", changed(d=np.full(5, np.nan)), "D of the camera info holds a value that is not finite"),
    ("/odom", of_pose(x=0.0, y=0.0, z=0.0, w=0.0), "no rotation"), ("/odom", of_pose(at_x=np.nan), "pose 0 is not finite"), ("/odom", of_pose(w=np.inf), "pose 0 is not finite")])
def test_a_message_that_is_wrong_is_one_line(topic, change, named, tmp_path, street, frames, capfd):
    recording = drive_of(street, frames[:1])
    recording.pose(START)
    message, = (item[3] for item in recording.messages if item[1] == topic)
    change(message)
    bag = recording.write(tmp_path / "drive")
    for out in (tmp_path / "out.mcap", tmp_path / "out"):
        refused(capfd, ["--bag", bag, *TOPICS, "--pose-topic", "/odom", "--rectify", "on" if named.startswith("D of") else "auto", "--out", out, *SET], named)
    assert os.listdir(tmp_path) == ["drive"]


def test_stamps_before_1970(tmp_path, street, frames, capfd):
    bag = record("mcap", tmp_path / "drive", street, frames[:1], times=[-5 * 10**9])
    refused(capfd, ["--bag", bag, *TOPICS, "--out", tmp_path / "out.mcap", *SET], "a stamp of -5 s")
    assert os.listdir(tmp_path) == ["drive"]


def test_files_that_are_no_bags(tmp_path, street, frames, capfd):
    whole = record("mcap", tmp_path / "drive", street, frames[:1]).read_bytes()
    sqlite, ros1 = record("sqlite", tmp_path / "sqlite", street, frames[:1]), record("ros1", tmp_path / "drive.bag", street, frames[:1])
    database = next(sqlite.glob("*.db3"))
    pages, old = database.read_bytes(), ros1.read_bytes()
    for name, data in (("empty.mcap", b""), ("empty.bag", b""), ("noise.mcap", bytes(range(256)) * 9), ("cut.mcap", whole[:len(whole) // 2]),
                       ("cut.bag", old[:len(old) // 2]), ("torn.bag", old[:5000] + b"\xff" * 3000 + old[8000:])):
        (tmp_path / name).write_bytes(data)
        refused(capfd, ["--bag", tmp_path / name, *TOPICS, *SET], name, "mcap recover" if name.endswith("mcap") else "rosbag reindex")
    database.write_bytes(b"")
    refused(capfd, ["--bag", database, *TOPICS, *SET], f"it is a part of the bag {sqlite}: give that folder")
    for data in (pages[:len(pages) // 2], b"", pages[:4096] + b"\xff" * (len(pages) - 4096)):
        database.write_bytes(data)
        refused(capfd, ["--bag", sqlite, *TOPICS, *SET], "sqlite")
    (sqlite / "metadata.yaml").write_text("rosbag2_bagfile_information: [")
    refused(capfd, ["--bag", sqlite, *TOPICS, *SET], "sqlite")
    os.mkfifo(tmp_path / "pipe.mcap")
    for name in (tmp_path / "pipe.mcap", "/dev/zero", tmp_path / "none", ""):
        refused(capfd, ["--bag", name, *TOPICS, *SET], name)


def test_what_is_the_users_stays(tmp_path, street, frames, capfd):
    """Whatever --out names that is there, and the bag itself."""
    bag = record("mcap", tmp_path / "drive", street, frames[:1])
    (tmp_path / "mine.mcap").write_text("mine")
    (tmp_path / "half.mcap.part").write_text("mine")
    (tmp_path / "link.mcap").symlink_to("nowhere.mcap")
    (tmp_path / "folder.mcap").mkdir()
    (tmp_path / "file.txt").write_text("mine")
    (tmp_path / "link").symlink_to(tmp_path / "drive")

    def state():
        return {path: path.read_bytes() if path.is_file() else os.path.islink(path) for path in tmp_path.rglob("*")}

    before = state()
    for name in ("mine.mcap", "link.mcap", "folder.mcap", "drive", "link", bag):
        refused(capfd, ["--bag", bag, *TOPICS, *SET, "--out", tmp_path / name])
    for name in ("drive", "drive/out", "drive/out.mcap", "link/out", "drive/../drive/out.mcap"):
        refused(capfd, ["--bag", tmp_path / "drive", *TOPICS, *SET, "--out", tmp_path / name], "in the bag")
    for name in ("file.txt", "drive/metadata.yaml"):
        refused(capfd, ["--bag", bag, *TOPICS, *SET, "--out", tmp_path / name], name, code=None)
    refused(capfd, ["--bag", bag, *TOPICS, *SET, "--out", ""], "--out")
    assert state() == before
    assert bag_program.main([str(word) for word in ["--bag", bag, *TOPICS, *SET, "--out", tmp_path / "half.mcap"]]) == 0
    assert (tmp_path / "half.mcap.part").read_text() == "mine"


def test_a_file_that_comes_while_it_is_written_stays(tmp_path, street, frames):
    out = tmp_path / "out.mcap"
    with pytest.raises(egosgm.InvalidArgument, match="is there already"):
        bag = bags.Bag(record("mcap", tmp_path / "drive", street, frames[:1]), "/left/image_rect", "/right/image_rect")
        output = bag_outputs.McapOutput(out, egosgm.pipeline_options())
        (frame,), (found,) = bag.frames(), egosgm.run(bag, progress=False, **OPTIONS)
        output.add(frame, found.maps, None, found.calibration)
        out.write_text("mine")
        output.finish()
    output.give_up()
    assert out.read_text() == "mine" and sorted(os.listdir(tmp_path)) == ["drive", "out.mcap"]


def test_a_full_disk_is_one_line(tmp_path, street, frames):
    """From the fourth frame on: by then the driver has written its kernel cache."""
    bag = record("mcap", tmp_path / "drive", street, [frames[i % FRAMES] for i in range(8)])
    limited = """import resource, sys
from egosgm import bag
from egosgm.bag import program as bag_program
plain = bag.Bag.frames
def limited(self):
    for frame in plain(self):
        if frame.number == 3:
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, 4096))
        yield frame
bag.Bag.frames = limited
sys.exit(bag_program.main(sys.argv[1:]))"""
    for out, left in (("out.mcap", ["drive"]), ("out", ["drive", "out"])):
        told = subprocess.run([sys.executable, "-B", "-c", limited, "--bag", bag, *TOPICS, *SET, "--out", tmp_path / out], capture_output=True, text=True, timeout=900)
        assert told.returncode == 1 and told.stderr.startswith("egosgm: error: ") and told.stderr.count("\n") == 1, told.stderr
        assert sorted(os.listdir(tmp_path)) == left
    assert sorted(os.listdir(tmp_path / "out/disparity")) == ["000000.png", "000001.png"]


@pytest.mark.parametrize("arguments, named", [
    (["--set", "bag=1"], "choose from"), (["--max-skew-ms", "inf"], "--max-skew-ms inf"), (["--max-skew-ms", "x"], "--max-skew-ms"), (["--rectify", "maybe"], "maybe"),
    (["--bag", "none.mcap"], "no such file"), (["--out", "no/x.mcap"], "no such folder"), (["--out", ""], "--out"),
    (["--out", "x.mcap", "--write", "color"], "--write, --interpolate and --resume are for a folder"), (["street"], "more than one input")])
def test_wrong_arguments_of_the_program_are_one_line(arguments, named, tmp_path, street, frames, capfd, monkeypatch):
    """What all input has in common, the tests of the program say."""
    monkeypatch.chdir(tmp_path)
    given = {"--bag": record("mcap", tmp_path / "drive", street, frames[:1]), "--out": "out.mcap", **dict(zip(arguments[::2], arguments[1::2]))}
    words = [word for pair in given.items() for word in pair] if len(arguments) % 2 == 0 else ["--bag", given["--bag"], "--out", "out.mcap", *arguments]
    refused(capfd, [*words, *TOPICS, *SET], named)
    assert os.listdir(tmp_path) == ["drive"]


def test_a_recording_needs_a_bag(street_folder, tmp_path, capfd):
    refused(capfd, [street_folder, *SET, "--out", tmp_path / "out.mcap"], "have the stamps of a bag")


def test_a_silent_camera_costs_no_memory():
    pairing = bags.Pairing(5)
    for stamp in range(1000):
        assert list(pairing.add(0, 10 * stamp, None)) == []
    assert pairing.gaps.unpaired_left == 1000 - bags.Pairing.MOST_WAITING
    assert [(left[0], right[0]) for left, right in pairing.add(1, 9990, None)] == [(9990, 9990)]


# What drives of other people are like.

def told_of(capfd, path, *arguments):
    with tempfile.TemporaryDirectory() as folder:
        code = bag_program.main(["--bag", str(path), *TOPICS, *SET[:-1], "--out", folder, *map(str, arguments)])
    said = capfd.readouterr()
    assert code == 0, said.err
    return said.out


def rescaled(factor):
    def change(info):
        p = np.array(info.p)
        p[3] *= factor
        info.p = p
    return change


def test_warnings_of_a_baseline(tmp_path, street, frames, capfd):
    assert "doctor" not in told_of(capfd, drive_of(street, frames).write(tmp_path / "good"))
    said = told_of(capfd, drive_of(street, frames, rescaled(1 / street.calibration.fx)).write(tmp_path / "no_fx"))
    assert f"`egosgm doctor --bag {tmp_path}" in said and "is fx missing" in said
    path = drive_of(street, frames, rescaled(3)).write(tmp_path / "wide")
    assert "few rigs are wider than a metre" in told_of(capfd, path) and examined(capfd, path)["calibration"]["verdict"] == "note"


def test_other_moments_get_no_advice(tmp_path, street, frames, capfd):
    path = drive_of(street, frames, of_right=lambda i, time: time + RATE_NS // 2).write(tmp_path / "between")
    refused(capfd, ["--bag", path, *TOPICS, *SET], "at 100.000 ms a frame: left and right are of other moments")
    assert "those are of other moments" in told_of(capfd, path, "--max-skew-ms", 50)
    after_a_stall = [START, START + RATE_NS, START + RATE_NS + 12_000_000, START + 2 * RATE_NS]  # two images at once, which are no measure of the usual time
    for name, times in (("near", None), ("stall", after_a_stall)):
        path = drive_of(street, [*frames, frames[0]], times=times, of_right=lambda i, time: time + 5_000_000).write(tmp_path / name)
        refused(capfd, ["--bag", path, *TOPICS, *SET], "allow that by --max-skew-ms")
        told = told_of(capfd, path, "--max-skew-ms", 5)
        assert "other moments" not in told and " gap" not in told


def test_an_empty_distortion_and_an_unset_rotation(tmp_path, street, frames):
    def unset(info):
        info.d, info.r, info.distortion_model = np.zeros(0), np.zeros(9), "unknown"
    bag = bags.Bag(drive_of(street, frames, unset).write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect", rectify=True)
    assert len(list(bag.frames())) == FRAMES and bag.cameras.calibration.baseline_m == pytest.approx(street.calibration.baseline_m)


def test_the_first_infos_may_be_unset(tmp_path, street, frames):
    recording = drive_of(street, frames)
    for side, name in enumerate(SIDES):
        recording.info(f"/{name}/camera_info", street.calibration, side)
        received, topic, kind, message = recording.messages.pop()
        message.k, message.p, message.r = np.zeros(9), np.zeros(12), np.zeros(9)
        recording.messages.append((START - 1, topic, kind, message))
    bag = bags.Bag(recording.write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect")
    assert len(list(bag.frames())) == FRAMES and bag.cameras.calibration.fx == pytest.approx(street.calibration.fx)


def with_a_broken_message(street, frames):
    """The third one of four of the right camera."""
    recording = drive_of(street, [frames[i % FRAMES] for i in range(4)])
    for received, topic, _, message in recording.messages:
        if topic == "/right/image_rect" and received == START + 2 * RATE_NS + 1:
            message.height, message.width, message.step, message.data = 1, 1, 1, np.zeros(1, np.uint8)
    return recording


def test_a_broken_message_costs_its_pair(tmp_path, street, frames, capfd):
    recording = with_a_broken_message(street, frames)
    path = recording.write(tmp_path / "drive")
    said = told_of(capfd, path)
    assert "3 frames" in said and "1 broken message, whose pairs are left out: /right/image_rect at 1700000000.200000000 s: an image of 1x1 px" in said


def test_a_drive_warns_of_broken_messages_and_iterations_keep_theirs(tmp_path, street, frames):
    recording = with_a_broken_message(street, frames)
    bag = bags.Bag(recording.write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect")
    with pytest.warns(UserWarning, match="1 broken message"):
        assert len(list(egosgm.run(bag, disparities=16))) == 3
    first = bag.frames()
    next(first)
    of_first = bag.gaps
    next(bag.frames())
    assert len(list(first)) == 2
    assert len(of_first.broken) == 1 and not bag.gaps.broken


def test_the_first_message_may_be_broken(tmp_path, street, frames, monkeypatch):
    """Cut, so that no decoder reads it."""
    recording = drive_of(street, frames)
    first = next(message for _, topic, _, message in sorted(recording.messages, key=lambda item: item[0]) if topic == "/left/image_rect")
    whole = recording.store.serialize_cdr
    monkeypatch.setattr(recording.store, "serialize_cdr", lambda message, kind: whole(message, kind)[:20 if message is first else None])
    bag = bags.Bag(recording.write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect")
    assert len(list(bag.frames())) == FRAMES - 1
    assert "1 broken message, whose pairs are left out: /left/image_rect" in bag.gaps.text()


def test_a_mosaic_that_was_compressed():
    pixels = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8)
    expected = ros_images._of_bayer(pixels)
    message = type("CompressedImage", (), dict(format="bayer_rggb8; png compressed ", data=png_of(pixels)))()
    np.testing.assert_array_equal(ros_images.grey_of(message), expected)
    for plain in ("bayer_rggb8; png compressed bgr8", "mono8; png compressed ", "png"):
        message.format = plain
        np.testing.assert_array_equal(ros_images.grey_of(message), pixels)


def png_of(pixels):
    file = io.BytesIO()
    PIL.Image.fromarray(pixels).save(file, "png")
    return file.getvalue()


@pytest.mark.parametrize("per_mille", [0, 1, 4, 8])
def test_highlights_of_sixteen_bits_cost_no_motion(per_mille, street, frames):
    """A lamp, many times as bright as the rest."""
    odometry = egosgm.StereoOdometry(street.calibration)
    side = int((WIDTH * HEIGHT * per_mille / 1000) ** 0.5)
    for i, frame in enumerate(frames):
        images = [image.astype(np.uint16) * 16 for image in (frame.left, frame.right)]
        for image in images:
            image[5:5 + side, 150:150 + side] = 65535
        assert (odometry.process(*images).motion is not None) == (i > 0)


def parts_of(street, frames, tmp_path):
    """A described bag of two MCAP files."""
    folder = tmp_path / "parts"
    folder.mkdir()
    for part in (0, 1):
        recording = drive_of(street, frames, times=[START + (part * FRAMES + i) * RATE_NS for i in range(FRAMES)])
        recording.write(tmp_path / f"part_{part}").rename(folder / f"part_{part}.mcap")
    return folder


def test_what_is_whole_of_a_bag_is_read(tmp_path, street, frames, capfd):
    folder = parts_of(street, frames, tmp_path)
    assert f"{2 * FRAMES} frames" in told_of(capfd, folder)
    for text in ("", "rosbag2_bagfile_information:\n  storage_identifier: ''\n", "no: [bag"):
        (folder / "metadata.yaml").write_text(text)
        said = told_of(capfd, folder)
        assert f"{2 * FRAMES} frames" in said and "metadata.yaml does not describe the bag" in said
    whole = (folder / "part_1.mcap").read_bytes()
    (folder / "part_1.mcap").write_bytes(whole[:len(whole) * 2 // 3])
    said = told_of(capfd, folder)
    frames_read = int(re.search(r"(\d+) frames,", said).group(1))
    assert FRAMES <= frames_read < 2 * FRAMES and "part_1.mcap" in said
    (folder / "part_1.mcap").write_bytes(b"")
    said = told_of(capfd, folder)
    assert f", {FRAMES} frames" in said and "1 of 2 parts cannot be read and are left out: part_1.mcap" in said


def test_an_mcap_that_is_packed_and_one_without_a_profile(tmp_path, street, frames, capfd):
    zstandard = pytest.importorskip("zstandard")
    path = drive_of(street, frames).write(tmp_path / "drive")
    packed = tmp_path / "drive.mcap.zstd"
    packed.write_bytes(zstandard.ZstdCompressor().compress(path.read_bytes()))
    assert f"{FRAMES} frames" in told_of(capfd, packed)
    from mcap.reader import make_reader
    from mcap.writer import Writer as McapWriter
    for name, profile, encoding in (("plain", "", "cdr"), ("ros1", "ros1", "ros1")):
        with open(path, "rb") as source, open(tmp_path / f"{name}.mcap", "wb") as target:
            writer = McapWriter(target, chunk_size=1 << 15)
            writer.start(profile=profile)
            schemas, channels = {}, {}
            for schema, channel, message in make_reader(source).iter_messages():
                if schema.name not in schemas:
                    schemas[schema.name] = writer.register_schema(schema.name, schema.encoding, schema.data)
                if channel.topic not in channels:
                    channels[channel.topic] = writer.register_channel(channel.topic, encoding, schemas[schema.name])
                writer.add_message(channels[channel.topic], message.log_time, message.data, message.publish_time)
            writer.finish()
    assert f", {FRAMES} frames" in told_of(capfd, tmp_path / "plain.mcap")
    refused(capfd, ["--bag", tmp_path / "ros1.mcap", *TOPICS, *SET], "ROS 1")
    whole = (tmp_path / "plain.mcap").read_bytes()
    at = whole.rindex(zstandard.FRAME_HEADER)  # of the last chunk
    (tmp_path / "torn.mcap").write_bytes(whole[:at] + bytes(4) + whole[at + 4:])
    said = told_of(capfd, tmp_path / "torn.mcap")
    assert "torn.mcap is cut or damaged (" in said and f", {FRAMES} frames" not in said


def test_topics_are_found_where_there_is_one_choice(tmp_path, street, frames, capfd):
    recording = drive_of(street, frames)
    path = recording.write(tmp_path / "drive")
    bag = bags.Bag(path)
    assert bag.images == ("/left/image_rect", "/right/image_rect")
    assert bags.Bag(path, right_topic="/right/image_rect").images == bag.images
    for name in ("left", "right"):
        recording.image(f"/front/{name}/image_rect", START, frames[0].left)
    refused(capfd, ["--bag", recording.write(tmp_path / "two"), *SET], "more than one pair of cameras", "/front/left/image_rect")


def test_rows_of_poses_are_of_no_bag_that_lost_images(tmp_path, street, frames, capfd):
    poses = tmp_path / "poses.txt"
    egosgm.write_poses(poses, np.stack([np.eye(4)] * FRAMES))
    for name, left_out, code in (("whole", (), 0), ("right", ((2, "left"),), 0), ("lost", ((1, "right"),), 2)):
        bag = record("mcap", tmp_path / name, street, frames, left_out=left_out)
        assert bag_program.main(["--bag", str(bag), *TOPICS, *SET, "--poses", str(poses), "--out", str(tmp_path / f"{name}.out")]) == code
        said = capfd.readouterr().err
        assert ("has images that are in no pair: give --pose-topic" in said) == (code == 2), said
        assert json.loads((tmp_path / f"{name}.out/report.json").read_text())["finished"] == (code == 0)


def test_poses_come_from_one_source(tmp_path, capfd):
    refused(capfd, ["--bag", tmp_path, "--pose-topic", "/odom", "--poses", "poses.txt", "--out", tmp_path / "out", *SET], "--pose-topic", "--poses")


def test_poses_of_another_unit_are_told(tmp_path, street, frames, capfd):
    recording = drive_of(street, frames)
    world_from_camera = np.eye(4)
    for i in range(FRAMES):
        if i:
            world_from_camera = world_from_camera @ np.linalg.inv(street.motion(i).current_from_previous)
        turn = ros_images.quaternion_of(world_from_camera[:3, :3])
        recording.pose(START + i * RATE_NS, START + i * RATE_NS, 1000 * world_from_camera[:3, 3], turn)
    said = told_of(capfd, recording.write(tmp_path / "drive"), "--pose-topic", "/odom", "--pose-axes", "optical")
    assert "the given poses contradict the images" in said and "millimetres" in said


def examined(capfd, path, *arguments):
    """Verdicts of `egosgm doctor` by check."""
    from egosgm.diagnostics import doctor
    code = doctor.main(["--bag", str(path), *map(str, arguments), "--json"])
    findings = {found["check"]: found for found in json.loads(capfd.readouterr().out)}
    assert code == (2 if any(found["verdict"] == "problem" for found in findings.values()) else 0)
    return findings


def test_a_bag_is_known_without_its_option(tmp_path, street, frames, capfd):
    from egosgm.diagnostics import doctor
    file, folder = record("mcap", tmp_path / "mcap", street, frames), record("sqlite", tmp_path / "sqlite", street, frames)
    for bag, out in ((file, "file"), (folder, "folder")):
        assert program(bag, *TOPICS, *SET, "--frames", ":1", "--out", tmp_path / out).returncode == 0
        assert json.loads((tmp_path / out / "report.json").read_text())["input"] == f"bag {bag.name}"
        doctor.main([str(bag), "--json"])
        assert '"check": "rows"' in capfd.readouterr().out
    assert egosgm._egosgm._is_bag(tmp_path / "drive.bag.zstd") and not egosgm._egosgm._is_bag(tmp_path)
    (tmp_path / "parts").mkdir()
    file.rename(tmp_path / "parts/part_0.mcap")
    assert egosgm._egosgm._is_bag(tmp_path / "parts")
    (tmp_path / "parts/left").mkdir()  # images, and the bag that they came from
    assert not egosgm._egosgm._is_bag(tmp_path / "parts")
    for option in (["--left-topic", "/left"], ["--pose-axes", "body"]):
        refused(capfd, [tmp_path, *option, "--out", tmp_path / "never"], f"{option[0]}: is of a bag")


def test_doctor_looks_at_bags(tmp_path, street, frames, capfd):
    pytest.importorskip("cv2")
    findings = examined(capfd, record("mcap", tmp_path / "good", street, frames))
    assert [found["verdict"] for found in findings.values() if found["check"] != "range"] == ["ok"] * 5
    assert "0.1 s between two frames" in findings["times"]["text"]
    findings = examined(capfd, drive_of(street, frames, rescaled(100)).write(tmp_path / "cm"))
    assert "centimetres" in findings["calibration"]["remedy"]

    class Swapped:
        def __init__(self, frame):
            self.left, self.right = frame.right, frame.left
    assert "swapped" in examined(capfd, drive_of(street, [Swapped(frame) for frame in frames]).write(tmp_path / "swapped"))["sides"]["remedy"]
    between = drive_of(street, frames, of_right=lambda i, time: time + RATE_NS // 2).write(tmp_path / "between")
    findings = examined(capfd, between, "--max-skew-ms", 50)
    assert findings["times"]["verdict"] == "problem" and "other moments" in findings["times"]["text"]
    assert list(findings) == ["images", "calibration", "times"]

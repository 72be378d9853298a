# SPDX-License-Identifier: Apache-2.0
"""Bags through the program: what a run writes, refuses and tells."""
import json
import os
import re
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from rosbags.highlevel import AnyReader

import egosgm
from egosgm import bag as bags
from egosgm.bag import outputs as bag_outputs
from egosgm.bag import program as bag_program
from egosgm.bag import ros_images
from egosgm.geometry import cloud as cloud_program
from bag_case import FRAMES, HEIGHT, OPTIONS, RATE_NS, SEED, SET, START, TOPICS, WIDTH, Recording, png_of, program, record, refused, told_of  # noqa: F401  some for the fixtures


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
        told = program("--bag", bag, *TOPICS, "--out", out, "--set", f"min_disparity={least}", "--set", f"disparities={disparities}", "--set", "paths=4", "--quiet")
        assert told.returncode == 0, told.stderr
        with AnyReader([out]) as reader:
            for connection, _, raw in reader.messages(connections=[c for c in reader.connections if c.topic == "/egosgm/disparity"]):
                message = reader.deserialize(raw, connection.msgtype)
                assert (message.min_disparity, message.max_disparity) == (max(0, least), least + disparities - 1)


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
    outputs, fails_at, moving = [], [], []

    class Viewer:
        def __init__(self, *file):
            self.calls = [file]
            outputs.append(self)

        def add(self, frame, maps, motion, calibration):
            if frame.number in fails_at:
                raise egosgm.IoError("the disk is full")
            assert frame.stamp_ns == START + frame.number * RATE_NS and (frame.left == frames[frame.number].left).all()
            assert maps.reason is not None and calibration.fx == pytest.approx(street.calibration.fx)
            moving.extend([frame.objects.moving] if hasattr(frame, "objects") else [])
            self.calls.append((frame.number, motion is not None))

        def finish(self):
            self.calls.append("finish")

        def give_up(self):
            self.calls.append("give up")

    monkeypatch.setattr(bag_program, "RerunOutput", Viewer)
    given = ["--bag", str(bag), *TOPICS, *SET, "--out", str(tmp_path / "out.rrd"), "--rerun"]
    assert bag_program.main(given) == 0
    assert [output.calls for output in outputs] == [[file, *((i, i > 0) for i in range(FRAMES)), "finish"] for file in ((tmp_path / "out.rrd",), ())]
    assert not moving
    written = ["--bag", str(bag), *TOPICS, *SET, "--out", str(tmp_path / "objects"), "--write", "objects", "--rerun"]
    assert bag_program.main(written) == 0 and moving == [[]] * FRAMES
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


def test_a_recording_that_cannot_be_made_is_named_as_it_was_given():
    outputs = bag_program.Outputs("/proc/self/drive.mcap", False)
    with pytest.raises(egosgm.IoError, match="^/proc/self/drive.mcap: cannot be written: .*choose a folder"):
        outputs.begin({}, None)


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
        assert told.returncode == 1 and told.stderr.startswith(f"egosgm: error: {tmp_path / out}") and told.stderr.count("\n") == 1, told.stderr
        assert sorted(os.listdir(tmp_path)) == left
    assert sorted(os.listdir(tmp_path / "out/disparity")) == ["000000.png", "000001.png"]


def test_a_recording_needs_a_bag(street_folder, tmp_path, capfd):
    refused(capfd, [street_folder, *SET, "--out", tmp_path / "out.mcap"], "have the stamps of a bag")

# SPDX-License-Identifier: Apache-2.0
"""Bags that people bring: what is refused of them in one line, and what is told."""
import json
import os
import re

import numpy as np
import pytest

import egosgm
from egosgm import bag as bags
from egosgm.bag import program as bag_program
from egosgm.bag import ros_images
from bag_case import FRAMES, HEIGHT, OPTIONS, RATE_NS, SEED, SET, START, TOPICS, WIDTH, drive_of, program, record, refused, told_of, with_a_broken_message  # noqa: F401  some for the fixtures


def changed(**fields):
    return lambda message: [setattr(message, name, value) for name, value in fields.items()]


def of_pose(**fields):
    return lambda message: [setattr(message.pose.orientation if name in "xyzw" else message.pose.position, name.removeprefix("at_"), value)
                            for name, value in fields.items()]


@pytest.mark.parametrize("topic, change, named", [
    ("/left/image_rect", changed(step=WIDTH - 1), "rows of"), ("/right/image_rect", changed(data=np.zeros(10, np.uint8)), "has 10 bytes"),
    ("/right/image_rect", changed(data=np.zeros(0, np.uint8)), "has 0 bytes"), ("/left/image_rect", changed(height=2**32 - 1), "4294967295"),
    ("/left/image_rect", changed(width=2**32 - 1, step=2**32 - 1), "4294967295"), ("/left/image_rect", changed(width=0), "an image of 0x96 px"),
    ("/left/image_rect", changed(height=0), "x0 px"), ("/left/image_rect", changed(height=HEIGHT - 1), "320x95 px, while the camera info is of 320x96: where all are, give their calibration by --calib"),
    ("/left/image_rect", changed(encoding="bayer_rgbg8"), "bayer_rgbg8"), ("/left/image_rect", changed(encoding="mono16", width=WIDTH // 2), "160x96"),
    ("/left/camera_info", changed(p=np.array([100.0, 52, 160, 0, 0, 100, 48, 0, 0, 0, 1, 0])), "/left/camera_info: P of the camera info has a skew of 52 px"),
    ("/left/camera_info", changed(p=np.array([-100.0, 0, 160, 0, 0, 100, 48, 0, 0, 0, 1, 0])), "P of the camera info has an fx of -100 px"),
    ("/left/camera_info", changed(p=np.zeros(12)), "P of the camera info is zero: the cameras were calibrated one by one, or not at all"), ("/right/camera_info", changed(p=np.full(12, np.nan)), "P of the camera info holds a value that is not finite"),
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


def test_a_broken_message_costs_its_pair(tmp_path, street, frames, capfd):
    recording = with_a_broken_message(street, frames)
    path = recording.write(tmp_path / "drive")
    said = told_of(capfd, path)
    assert "3 frames" in said and "1 broken message, whose pairs are left out: /right/image_rect at 1700000000.200000000 s: an image of 1x1 px" in said


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
    for times, verdict in (([0, 0, 1], "note"), ([0, 0, 0], "problem")):  # where most pairs have the stamp of another one, hardly any are left
        bag = record("mcap", tmp_path / verdict, street, frames, times=[START + time * RATE_NS for time in times])
        findings = examined(capfd, bag)
        assert findings["times"]["verdict"] == verdict and "the stamp of the one before" in findings["times"]["text"]


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

# SPDX-License-Identifier: Apache-2.0
"""Bags of robots: what is read equals the images that were recorded, in pairs by their stamps."""
import json
import shlex

import numpy as np
import pytest

import egosgm
from egosgm import bag as bags
from egosgm.program import run_tool
from bag_case import FRAMES, HEIGHT, OPTIONS, RATE_NS, SEED, SET, SIDES, START, TOPICS, WIDTH, Recording, drive_of, program, record, refused, told_of, with_a_broken_message  # noqa: F401  some for the fixtures
from refusals import expect_refused


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


def test_the_command_that_a_warning_names_works(tmp_path, street, frames, calib, capfd):
    path = record("mcap", tmp_path / "drive", street, frames)
    said = told_of(capfd, path, "--calib", calib, "--frames", ":1", "--set", "disparities=16")
    command = shlex.split(said[said.index("`egosgm doctor "):].split("`")[1])[1:]
    assert command[:2] == ["doctor", "--bag"] and command[-2:] == ["--calib", calib]
    assert run_tool([*command, "--disparities", "16"]) == 2 and "it clips" in capfd.readouterr().out


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
    assert "1 gap, the longest of 1.500 s before frame 2" in text and "steps back 1 time," in text
    expect_refused("nearest stamps differ by 2.000 ms: allow that by --max-skew-ms", lambda: list(bags.Bag(path, "/left/image_rect", "/right/image_rect").frames()))


def test_messages_that_were_received_out_of_order(tmp_path, street, frames):
    """Within a second they are sorted: no pair is made up, and none is lost."""
    recording = drive_of(street, [])
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
    assert bag.gaps.text() == "1 pair with the stamp of the one before, left out"


@pytest.mark.parametrize("unset", [SIDES, SIDES[:1], SIDES[1:]])
def test_without_stamps_the_times_of_the_recording_are_taken(unset, tmp_path, street, frames):
    recording = drive_of(street, [])
    for side, name in enumerate(SIDES):
        for i in range(FRAMES):
            received = START + i * RATE_NS + 1_000_000 * side
            recording.image(f"/{name}/image_rect", 0 if name in unset else received, (frames[i].left, frames[i].right)[side], received=received)
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
        recording = Recording(kind) if part else drive_of(street, [], kind=kind)
        for side, name in enumerate(SIDES):
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


@pytest.mark.parametrize("stamps, left, right, is_told", [
    (((0, 10), (1, 6), (1, 11), (0, 20), (1, 19), (1, 21), (0, 30)), 1, 2, True),
    (((0, 10), (1, 6), (1, 11), (0, 20), (0, 24), (1, 19)), 1, 1, False)])  # nothing that is left is further apart than the bound
def test_the_nearest_partner_is_taken(stamps, left, right, is_told):
    pairing, pairs = bags.Pairing(5), []
    for side, stamp in stamps:
        pairs += pairing.add(side, stamp, None)
    pairs += pairing.end()
    assert [(first[0], second[0]) for first, second in pairs] == [(10, 11), (20, 19)]
    assert (pairing.gaps.unpaired_left, pairing.gaps.unpaired_right) == (left, right)
    assert ("the nearest of them differ" in pairing.gaps.text()) == is_told


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
        assert (f"{without} frame outside of the poses' times" in bag.gaps.text()) == bool(without)
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


def test_a_silent_camera_costs_no_memory():
    pairing = bags.Pairing(5)
    for stamp in range(1000):
        assert list(pairing.add(0, 10 * stamp, None)) == []
    assert pairing.gaps.unpaired_left == 1000 - bags.Pairing.MOST_WAITING
    assert [(left[0], right[0]) for left, right in pairing.add(1, 9990, None)] == [(9990, 9990)]


def test_an_empty_distortion_and_an_unset_rotation(tmp_path, street, frames):
    def unset(info):
        info.d, info.r, info.distortion_model = np.zeros(0), np.zeros(9), "unknown"
    bag = bags.Bag(drive_of(street, frames, unset).write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect", rectify=True)
    assert len(list(bag.frames())) == FRAMES and bag.cameras.calibration.baseline_m == pytest.approx(street.calibration.baseline_m)


def test_the_first_infos_may_be_unset(tmp_path, street, frames):
    def unset(info):
        info.k, info.p, info.r = np.zeros(9), np.zeros(12), np.zeros(9)
    recording = drive_of(street, frames)
    recording.messages += [(START - 1, *message) for _, *message in drive_of(street, [], unset).messages]
    bag = bags.Bag(recording.write(tmp_path / "drive"), "/left/image_rect", "/right/image_rect")
    assert len(list(bag.frames())) == FRAMES and bag.cameras.calibration.fx == pytest.approx(street.calibration.fx)


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

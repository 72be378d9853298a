# SPDX-License-Identifier: Apache-2.0
"""egosgm run of videos: the maps are those of the sequence that egosgm rectify makes of them. run() and egosgm doctor read the same."""
import json
import pathlib
import shlex

import numpy as np
import pytest

import egosgm
from egosgm.bag import program as bag_program
from egosgm.program import run_tool
from refusals import expect_refused
cv2 = pytest.importorskip("cv2")

WIDTH, HEIGHT, FRAMES, SEED = 320, 96, 3, 7
SET = ["--set", "disparities=48", "--set", "paths=4"]


@pytest.fixture
def told(capfd):
    """Runs a command, which returns `code`: what it said."""
    def run(*words, code=0):
        assert run_tool([str(word) for word in words]) == code
        said = capfd.readouterr()
        return code and said.err or said.out
    return run


def files_of(folder):
    return {file.name: file.read_bytes() for file in [*sorted((folder / "disparity").iterdir()), folder / "poses.txt"]}


@pytest.mark.parametrize("is_one", [False, True])
@pytest.mark.parametrize("is_raw", [False, True])
def test_the_maps_are_those_of_the_rectified_sequence(is_one, is_raw, videos, calib, rig, tmp_path, told):
    calibration = ["--calib", rig if is_raw else calib]
    as_run, as_rectified = ([videos[2]], ["--side-by-side", videos[2]]) if is_one else (videos[:2], ["--left", videos[0], "--right", videos[1]])
    said = told("run", *as_run, *calibration, "--out", tmp_path / "out", *SET)
    assert ("the images are rectified here" in said) == is_raw and ("half of an image" in said) == is_one
    told("rectify", *as_rectified, *calibration, "--out", tmp_path / "sequence")
    told("run", tmp_path / "sequence", "--out", tmp_path / "expected", *SET)
    found = files_of(tmp_path / "out")
    assert found == files_of(tmp_path / "expected") and len(found) == FRAMES + 1
    assert len(list((tmp_path / "out/left").iterdir())) == FRAMES


def test_without_a_calibration_there_are_disparities_and_no_poses(videos, tmp_path, told):
    told("run", "--left", videos[0], "--right", videos[1], "--frames", "1:", "--out", tmp_path / "out", *SET)
    assert [file.name for file in sorted((tmp_path / "out/disparity").iterdir())] == ["000001.png", "000002.png"]
    said = told("run", *videos[:2], "--frames", "1:9", "--out", tmp_path / "fewer", *SET)
    assert "--frames asks for frame 9, and the last one is 2" in said, said
    assert not (tmp_path / "out/poses.txt").exists() and not (tmp_path / "out/calibration.txt").exists()
    assert egosgm.read_disparity(tmp_path / "out/disparity/000001.png").shape == (HEIGHT, WIDTH)


def test_a_video_of_one_camera_is_refused_with_the_command_that_reads_it(videos, tmp_path, told):
    file = str(tmp_path / "it's.avi")
    writer = cv2.VideoWriter(file, cv2.VideoWriter_fourcc(*"FFV1"), 4, (160, 90))
    writer.write(np.zeros((90, 160, 3), np.uint8))
    writer.release()
    said = told("run", file, "--out", tmp_path / "out", code=2)
    assert "160x90, as of one camera" in said and "egosgm rectify --side-by-side '" in said and said.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_video_is_one_input(videos, calib, tmp_path, told):
    for more, named in ((["--left", "x.png"], "--left x.png"), (["--odometry", "x"], "--odometry x"), (["--bag", "x.mcap"], "x.mcap")):
        assert "more than one input" in (said := told("run", videos[2], *more, "--out", tmp_path / "out", code=2)) and named in said


def test_two_videos_of_other_rates_are_told_of(videos, calib, tmp_path, told):
    assert "images a second" not in told("run", *videos[:2], "--out", tmp_path / "out", *SET)
    faster = str(tmp_path / "faster.avi")
    writer = cv2.VideoWriter(faster, cv2.VideoWriter_fourcc(*"FFV1"), 8, (WIDTH, HEIGHT))
    video = cv2.VideoCapture(videos[1])
    for _ in range(FRAMES):
        writer.write(video.read()[1])
    writer.release()
    named = f"left.avi says that it has 4 images a second, {faster} 8: if so, pairs are of other moments"
    assert named in told("run", videos[0], faster, "--out", tmp_path / "other", *SET)
    assert named in told("rectify", "--left", videos[0], "--right", faster, "--calib", calib, "--out", tmp_path / "sequence")
    assert named in next(finding["text"] for finding in json.loads(told("doctor", videos[0], faster, "--json", code=2)) if finding["verdict"] == "problem")


def test_the_command_that_a_warning_names_works(videos, calib, tmp_path, told):
    said = told("run", *videos[:2], "--calib", calib, "--frames", ":1", "--set", "disparities=16", "--out", tmp_path / "out")
    command = said[said.index("`egosgm doctor "):].split("`")[1]
    assert "--calib" in command and "range" in told(*shlex.split(command)[1:], "--disparities", "16", code=2)


def test_images_beyond_the_count_are_left_out_and_told(videos):
    source = bag_program.VideoSource(videos[0], videos[1], "")
    source.count = FRAMES - 1
    assert [source.next().number for _ in range(FRAMES - 1)] == [0, 1]
    assert source.next() is None and "more than the 2 images that it says" in source.notes()[0]


@pytest.mark.parametrize("is_raw", [False, True])
def test_python_reads_a_video_as_the_program_does(is_raw, videos, calib, rig, tmp_path, told):
    file = rig if is_raw else calib
    told("run", videos[2], "--calib", file, "--out", tmp_path / "out", "--write", "pfm", *SET)
    drive = egosgm.run(pathlib.Path(videos[2]), file, disparities=48, paths=4)
    assert len(drive) == FRAMES
    for _ in range(2):
        found = list(drive)
        assert len(found) == FRAMES and found[1].motion is not None
        for frame in found:
            assert (frame.disparity == egosgm.read_disparity(tmp_path / f"out/pfm/{frame.number:06d}.pfm")).all()
    assert [frame.motion for frame in egosgm.run(videos[2], disparities=48, paths=4)] == [None] * FRAMES
    first = next(iter(egosgm.run((pathlib.Path(videos[0]), videos[1]), file, disparities=48, paths=4)))
    assert (first.disparity == egosgm.read_disparity(tmp_path / "out/pfm/000000.pfm")).all()
    expect_refused("only a folder's", lambda: egosgm.run(videos[2], frames="1:"))


def test_doctor_looks_at_videos(videos, calib, rig, told):
    for words, check, named in (([videos[2], "--calib", calib], "calibration", "fx "), ([*videos[:2], "--calib", calib], "rows", "points in 3 frames"),
                                (["--left", videos[0], "--right", videos[1]], "sides", "0.0 %"), ([videos[2]], "calibration", "none was given"),
                                ([videos[2], "--calib", rig], "images", "3 pairs of 320x96, 8 bit, rectified here by"), ([videos[2]], "times", "no time stamps")):
        findings = {finding["check"]: finding["text"] for finding in json.loads(told("doctor", *words, "--json"))}
        assert named in findings[check] and set(findings) >= {"images", "calibration", "rows", "sides", "range", "times"}


def test_a_video_that_is_damaged_or_none_is_named_so(videos, tmp_path, told):
    cut, none = tmp_path / "cut.avi", tmp_path / "none.mp4"
    cut.write_bytes(pathlib.Path(videos[2]).read_bytes()[:300])
    none.write_text("no video")
    for file, named in ((cut, "is it damaged or cut"), (none, "named as a video, and does not begin like one")):
        for command in (["run", file, "--out", tmp_path / "out"], ["doctor", file]):
            assert named in told(*command, code=2), command
        expect_refused(named, lambda: egosgm.run(file))
    assert "named as a video" in told("run", none, videos[1], "--out", tmp_path / "out", code=2)
    assert "a video, and an input of its own" in told("doctor", videos[2], "--frames", "1:", code=2)


def test_a_bag_in_place_of_a_video_is_told_where_it_goes(calib, tmp_path, capsys):
    (tmp_path / "drive.mcap").write_bytes(b"\x89MCAP0\r\n")
    assert run_tool(["rectify", "--side-by-side", str(tmp_path / "drive.mcap"), "--calib", str(calib), "--out", str(tmp_path / "out")]) == 2
    assert "drive.mcap: it is a recording of ROS, which `egosgm run` and `doctor` read" in capsys.readouterr().err

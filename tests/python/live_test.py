# SPDX-License-Identifier: Apache-2.0
"""egosgm live, on sources that stand for cameras: nothing here waits for a time."""
import os
import pathlib
import re
import signal
import subprocess
import sys
import threading
import urllib.error
import urllib.request
import warnings

import numpy as np
import pytest

import egosgm
cv2 = pytest.importorskip("cv2")
from egosgm import live
from egosgm.calibration import raw_pairs
from egosgm.program import run_tool
from refusals import expect_refused

WIDTH, HEIGHT, FRAMES, SEED = 320, 96, 3, 7
OPTIONS = dict(disparities=48, paths=4)


class Camera:
    """In place of cv2.VideoCapture: images, then it calls `ends` and has none. What it is asked for goes into `asked`."""

    def __init__(self, name, images, asked, ends):
        self._name, self._images, self._asked, self._ends = name, list(images), asked, ends

    def isOpened(self):
        return True

    def grab(self):
        self._asked.append(f"grab {self._name}")
        if not self._images:
            self._ends()
        return bool(self._images)

    def retrieve(self):
        self._asked.append(f"decode {self._name}")
        return True, self._images.pop(0)

    def release(self):
        self._asked.append(f"release {self._name}")


class Cameras:
    def __init__(self, frames):
        self.ends = lambda: None  # called where camera 0 has no more images
        self.asked = []
        self.made = {0: Camera(0, [frame.left for frame in frames], self.asked, lambda: self.ends()), 1: Camera(1, [frame.right for frame in frames], self.asked, lambda: None)}


@pytest.fixture
def cameras(frames, monkeypatch):
    """Cameras 0 and 1, and no other one."""
    cameras = Cameras(frames)
    monkeypatch.setattr(raw_pairs.cv2, "VideoCapture", lambda source, *_: cameras.made[source])
    return cameras


def test_both_cameras_take_an_image_before_either_is_decoded_and_are_released(cameras):
    pairs = list(raw_pairs.open_pairs("0", "1", None, None, None, None, False))
    assert len(pairs) == FRAMES
    one = ["grab 0", "grab 1", "decode 0", "decode 1"]
    assert cameras.asked == [*one * FRAMES, "grab 0", "grab 1", "release 0", "release 1"]


def test_the_time_of_a_pair_is_when_the_camera_took_it_from_the_first_one_on(cameras, monkeypatch):
    clock = iter([50.0, 50.25, 51.0, 52.0])  # one for each image that is grabbed
    monkeypatch.setattr(raw_pairs.time, "monotonic", lambda: next(clock))
    cameras.made[0].retrieve = lambda: (True, np.zeros((4, 8), np.uint8))
    assert [pair.time_s for pair, _ in zip(raw_pairs.open_pairs(None, None, "0", None, None, None, False), range(FRAMES))] == [0.0, 0.25, 1.0]


def test_a_link_names_the_camera_that_it_leads_to(cameras, monkeypatch):
    monkeypatch.setattr(raw_pairs.os.path, "realpath", lambda path: {"/dev/v4l/by-id/usb-a": "/dev/video0", "by-path": "/dev/video1"}.get(path, path))
    assert len(list(raw_pairs.open_pairs("/dev/v4l/by-id/usb-a", "by-path", None, None, None, None, False))) == FRAMES
    expect_refused("are one camera", lambda: raw_pairs.open_pairs("/dev/v4l/by-id/usb-a", "0", None, None, None, None, False))
    expect_refused("by-id/typo: no camera", lambda: raw_pairs.open_pairs(None, None, "/dev/v4l/by-id/typo", None, None, None, False))


def test_pairs_that_nobody_asked_for_are_dropped_and_the_newest_is_given(frames, cameras, calib):
    ended = threading.Event()
    cameras.ends = ended.set
    pairs = live.LivePairs(0, 1, calib=calib)
    assert ended.wait(60)
    (left, right), = pairs
    np.testing.assert_array_equal(left, frames[-1].left)
    np.testing.assert_array_equal(right, frames[-1].right)
    assert pairs.dropped == FRAMES - 1 and "0 gives no more images" in pairs.note
    expect_refused("gives its pairs once", lambda: list(pairs))


def test_sources_and_calibrations_of_other_types_are_named(street, calib):
    expect_refused("right is -1: give a camera's number", lambda: live.LivePairs(0, -1, calib=calib))
    expect_refused("left is a ndarray: give a camera's number", lambda: live.LivePairs(np.zeros((2, 2)), 1, calib=calib))
    expect_refused("calib is a Calibration: give the name of a calibration's file", lambda: live.LivePairs(0, 1, calib=street.calibration))


def test_a_result_comes_before_the_next_pair_is_asked_for(street, cameras, calib):
    goes_on = threading.Event()
    cameras.ends = lambda: goes_on.wait(60)  # a camera that gives nothing more for now
    with live.LivePairs(0, 1, calib=calib) as pairs:
        found = iter(egosgm.run(pairs, pairs.calibration, lag=0, **OPTIONS))
        while next(found).number + pairs.dropped < FRAMES - 1:
            pass
        assert not goes_on.is_set()
        goes_on.set()
    assert list(found) == []


def test_no_page_is_told_of_where_nothing_can_be_matched(cameras, calib, capsys):
    assert run_tool(["live", "0", "1", "--calib", calib, "--device", "no such"]) == 2
    told = capsys.readouterr()
    assert told.out == "" and "no such" in told.err and told.err.count("\n") == 1


def test_an_error_of_the_source_comes_after_the_pairs_before_it(frames, cameras, calib):
    def breaks():
        raise OSError("unplugged")
    cameras.ends = breaks
    given = []
    with pytest.raises(OSError, match="unplugged"):
        for left, _ in live.LivePairs(0, 1, calib=calib):
            given.append(left)
    np.testing.assert_array_equal(given[-1], frames[-1].left)


def test_raw_pairs_are_rectified_on_the_way(frames, cameras, rig):
    ended = threading.Event()
    cameras.ends = ended.set
    pairs = live.LivePairs(0, 1, calib=rig)
    assert ended.wait(60)
    (left, right), = pairs
    expected = egosgm.Rectification(egosgm.read_opencv_rig(rig), WIDTH, HEIGHT)
    for image, truth in zip((left, right), expected.rectify(frames[-1].left, frames[-1].right)):
        np.testing.assert_array_equal(image, truth)
    assert pairs.calibration.baseline_m == pytest.approx(0.25)


@pytest.mark.parametrize("is_one", [False, True])
def test_videos_are_matched_shown_and_recorded(is_one, videos, calib, tmp_path, capsys, monkeypatch):
    shown = []
    monkeypatch.setattr(live.Page, "show", lambda page, picture, state: shown.append((picture, state)))
    source = ["--side-by-side", videos[2]] if is_one else videos[:2]
    words = ["live", *source, "--calib", calib, "--record", str(tmp_path / "a record"), "--set", "disparities=48", "--set", "constants.coarse_match.p1=7"]
    assert run_tool(words) == 0
    first, *states, last = capsys.readouterr().out.splitlines()
    assert first.startswith("http://127.0.0.1:") and f"egosgm run '{tmp_path}/a record' --out" in last
    matched, dropped = map(int, re.match(r"(\d+) pairs? matched, (\d+) dropped; ", last).groups())
    assert matched + dropped == FRAMES and states == [state for _, state in shown] and len(shown) == matched
    picture, state = shown[0]
    assert picture.shape == (2 * HEIGHT, WIDTH, 3) and picture[HEIGHT:].any() and "pairs/s" in state and "ms old" in state
    recorded = egosgm.open_folder(tmp_path / "a record")
    assert len(recorded.frames) == matched
    times = [float(row) for row in (tmp_path / "a record/times.txt").read_text().split()]
    assert times == sorted(times) and times[0] >= 0


def test_a_warning_is_a_line_of_the_program(cameras, calib, monkeypatch, capsys):
    def run(*_, **__):
        warnings.warn("density 5 % in the mean")
        yield from ()
    monkeypatch.setattr(live, "run", run)
    assert run_tool(["live", "--left", "0", "--right", "1", "--calib", calib]) == 0
    assert capsys.readouterr().err.startswith("egosgm: density 5 % in the mean\n")


class Viewer:
    """In place of Rerun."""

    made = []

    def __init__(self):
        self.frames, self.is_finished = 0, False
        Viewer.made.append(self)

    def add(self, *_):
        self.frames += 1

    def finish(self):
        self.is_finished = True


def test_the_terminal_says_the_rate_and_the_age_in_one_line_where_rerun_shows_the_pairs(cameras, calib, monkeypatch, capsys):
    monkeypatch.setattr(live, "RerunOutput", Viewer)
    monkeypatch.setattr(live.sys.stdout, "isatty", lambda: True, raising=False)
    assert run_tool(["live", "--left", "0", "--right", "1", "--calib", calib, "--rerun", "--set", "disparities=48", "--set", "paths=4"]) == 0
    states, last, _ = capsys.readouterr().out.split("\n")
    viewer = Viewer.made.pop()
    assert viewer.is_finished and 1 <= viewer.frames <= FRAMES and f"{viewer.frames} pair" in last
    assert states.count("\r\x1b[K") == states.count("pairs/s") == states.count("ms old") == viewer.frames


def test_the_process_ends_while_images_are_still_read(videos, calib):
    """Python's end stops threads, and one that is within OpenCV would abort the process."""
    program = "import sys\nfrom egosgm import live\nlive.LivePairs(sys.argv[1], sys.argv[2], calib=sys.argv[3])\n"
    assert subprocess.run([sys.executable, "-c", program, *videos[:2], calib], timeout=600).returncode == 0


def test_what_fails_at_the_end_leaves_nothing_open(cameras, calib, tmp_path, monkeypatch, capsys):
    def fails(*_):
        raise OSError("the disk is full")
    monkeypatch.setattr(live, "RerunOutput", Viewer)
    monkeypatch.setattr(live.SequenceFolder, "finish", fails)
    words = ["live", "--left", "0", "--right", "1", "--calib", calib, "--rerun", "--record", str(tmp_path / "record"), "--set", "disparities=48", "--set", "paths=4"]
    assert run_tool(words) == 1
    assert "the disk is full" in capsys.readouterr().err
    assert Viewer.made.pop().is_finished and {"release 0", "release 1"} <= set(cameras.asked)


def test_the_picture_tells_far_from_near_and_from_none():
    disparity = np.array([[egosgm.INVALID_DISPARITY, np.nan, -16, -1, 0, 46]], np.float32)
    colours = live.picture_of(np.zeros((1, 6), np.uint8), disparity, -16, 64)[1].astype(int)
    assert not colours[:2].any()
    is_near = colours[:, 0] > colours[:, 2]  # more red than blue
    assert is_near.tolist() == [False] * 5 + [True]
    assert len({tuple(colour) for colour in colours[2:]}) == 4 and colours[2:].any(axis=1).all()


def test_the_calibration_is_read_as_rectify_reads_it(cameras, tmp_path, monkeypatch):
    asked = []
    monkeypatch.setattr(live, "LivePairs", lambda *_, **options: asked.append(options) or (_ for _ in ()).throw(egosgm.InvalidArgument("seen")))
    assert run_tool(["live", "--left", "0", "--right", "1", "--calib", "a", "b", "--unit", "mm", "--fisheye"]) == 2
    assert (asked[0]["calib"], asked[0]["unit_m"], asked[0]["fisheye"]) == (["a", "b"], 0.001, True)


def test_an_interrupt_ends_it_and_what_was_recorded_is_whole(cameras, calib, tmp_path, monkeypatch):
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background ignores it
    shows, shown, late = live.Page.show, threading.Event(), []

    def show(*arguments):
        shows(*arguments)
        os.kill(os.getpid(), signal.SIGINT)
        shown.set()
    monkeypatch.setattr(live.Page, "show", show)
    cameras.ends = lambda: late.append(not shown.wait(60))  # a camera that stands still until its last pair is shown
    try:
        assert run_tool(["live", "--left", "0", "--right", "1", "--calib", calib, "--record", str(tmp_path / "record"), "--set", "disparities=48"]) == 0
    finally:
        signal.signal(signal.SIGINT, before)
    assert True not in late
    assert 1 <= len(egosgm.open_folder(tmp_path / "record").frames) <= 2


def test_a_run_shows_its_frames_and_writes_what_it_writes_alone(street_folder, tmp_path, monkeypatch, capfd):
    shown, closed, shows, closes = [], [], live.Page.show, live.Page.close
    monkeypatch.setattr(live.Page, "show", lambda page, picture, state: (shown.append((picture, state)), shows(page, picture, state)))
    monkeypatch.setattr(live.Page, "close", lambda page: (closed.append(page), closes(page)))
    words = ["run", str(street_folder), "--set", "disparities=48", "--set", "paths=4", "--set", "min_disparity=2"]
    assert run_tool([*words, "--out", str(tmp_path / "alone")]) == 0 and not shown
    assert run_tool([*words, "--out", str(tmp_path / "shown"), "--show"]) == 0
    assert re.search(r"egosgm: http://127.0.0.1:\d+/ shows the run", capfd.readouterr().err)
    alone, beside = ({file.relative_to(tmp_path / name): file.read_bytes() for file in (tmp_path / name).rglob("*") if file.is_file() and file.name != "report.json"}
                     for name in ("alone", "shown"))
    assert alone == beside and len(alone) == FRAMES + 1
    expected = list(egosgm.run(street_folder, outputs="disparity", min_disparity=2, **OPTIONS))
    assert len(shown) == FRAMES and len(closed) == 1
    for frame, (picture, state) in zip(expected, shown):
        np.testing.assert_array_equal(picture, live.picture_of(frame.left, frame.disparity, 2, 48))
        assert state.startswith(f"frame {frame.name}, density ")
    assert run_tool([*words, "--show"]) == 0 and len(shown) == 2 * FRAMES  # it writes nothing then
    assert run_tool([*words, "--show", "--write", "variance"]) == 2 and "--show: --write" in capfd.readouterr().err


def test_an_interrupt_ends_one_run_of_a_process_and_none_that_ignores_it(street_folder, monkeypatch):
    seen, words = [], ["run", str(street_folder), "--set", "disparities=48", "--set", "paths=4", "--show"]
    before = signal.getsignal(signal.SIGINT)
    try:
        for handler, code in ((lambda *_: seen.append(code), 130), (signal.SIG_IGN, 0), (lambda *_: seen.append(code), 130)):
            signal.signal(signal.SIGINT, handler)
            stops = iter([signal.SIGINT])  # a second one would end the process
            monkeypatch.setattr(live.Page, "show", lambda *_: [os.kill(os.getpid(), stop) for stop in stops])
            assert run_tool(words) == code and not seen
        os.kill(os.getpid(), signal.SIGINT)
        assert seen == [130]
    finally:
        signal.signal(signal.SIGINT, before)


def test_a_page_makes_no_other_maps_than_the_disparity(street_folder, monkeypatch):
    from egosgm.bag import program as bag_program
    taken = []
    monkeypatch.setattr(bag_program.Outputs, "take", lambda _, frame, maps, motion: taken.append((maps.disparity is None, maps.variance is None, maps.reason is None)))
    assert run_tool(["run", str(street_folder), "--set", "disparities=48", "--show"]) == 0
    assert set(taken) == {(False, True, True)}


def test_the_page_gives_each_newer_picture_once_and_ends(monkeypatch):
    asked, ended, answers = threading.Event(), threading.Event(), live.Page._answer

    def answer_after(page, request, after):
        if after == 2:
            asked.set()
        answers(page, request, after)
    monkeypatch.setattr(live.Page, "_answer", answer_after)
    page = live.Page()
    with urllib.request.urlopen(page.address) as answer:
        assert b"<img id=picture>" in answer.read()
    picture = np.zeros((8, 16, 3), np.uint8)
    picture[..., 0] = 255
    page.show(picture, "one")
    page.show(picture, "two")
    with urllib.request.urlopen(page.address + "picture?0") as answer:
        assert (answer.headers["number"], answer.headers["state"]) == ("2", "two")
        seen = cv2.imdecode(np.frombuffer(answer.read(), np.uint8), cv2.IMREAD_COLOR)
    assert seen.shape == picture.shape and seen[..., 2].min() > 200 and seen[..., 0].max() < 50  # red stays red

    def ask():
        with pytest.raises(urllib.error.HTTPError, match="410"):
            urllib.request.urlopen(page.address + "picture?2")
        ended.set()
    threading.Thread(target=ask, daemon=True).start()
    assert asked.wait(60)
    page.close()
    assert ended.wait(60)


def test_a_port_that_is_in_use_is_refused():
    page = live.Page()
    expect_refused("--port [0-9]+: .*choose another one", lambda: live.Page(int(page.address.split(":")[2][:-1])))
    page.close()


@pytest.mark.parametrize("words, says", [
    ([], "one input"), (["drive.avi"], "drive.avi: one camera: say how its views lie, by --side-by-side"), (["0", "1", "2"], "0 1 2: too many cameras"),
    (["0", "1", "--left", "0"], "0 1: too many cameras"), (["--left", "0"], "one input"), (["--left", "0", "--right", "0"], "are one camera"), (["--side-by-side", "97"], "no camera that OpenCV can open"),
    (["--side-by-side", "none.mp4"], "no such file"), (["--side-by-side", __file__], "neither an image nor a video"), (["--left", "0", "--right", "1", "--set", "paths"], "NAME=VALUE"),
    (["--left", "0", "--right", "1", "--set", "device=0"], 'no option named "device": choose from preset, '), (["--left", "0", "--right", "1", "--set", "paths=abc"], '"abc" is not'), (["--side-by-side", "rtsp://camera/1"], "is an address"),
    (["--left", "0", "--right", "1", "--record", str(pathlib.Path(__file__).parent)], "--record"), (["--left", "0", "--right", "1", "--port", "99999"], "--port 99999"),
    (["--left", "0", "--right", "1", "--unit", "inch"], "--unit inch"), (["--side-by-side", "/dev/v4l/by-id/none"], "no camera that OpenCV can open")])
def test_what_is_wrong_is_one_line(words, says, calib, capsys):
    assert run_tool(["live", *words, "--calib", calib]) == 2
    told = capsys.readouterr().err
    assert says in told and told.count("\n") == 1, told

# SPDX-License-Identifier: Apache-2.0
"""What eval-video and eval-poses read and draw."""
import json
import os
import struct

import egosgm
import numpy as np
import pytest

from egosgm import video_program
from egosgm.evaluation import plots
from refusals import expect_refused


def test_successors_differ_by_the_usual_distance():
    follow = video_program.find_successors
    assert follow(["000003", "000004", "000005", "000007", "000008"]) == [False, True, True, False, True]
    assert follow(["000000_10", "000001_10", "000001_11"]) == [False, False, True]
    assert follow(["0", "5", "10", "20"]) == [False, True, True, False], "every fifth frame"
    assert follow(["1403636579763555584", "1403636579813555456", "1403636579863555584"]) == [False, True, True], "nanoseconds"
    assert follow(["a", "b"]) == [False, False] and follow([]) == []


def test_names_are_in_the_order_of_their_numbers():
    assert sorted(["a10", "b1", "a9", "a009", "a"], key=video_program.in_order) == ["a", "a9", "a009", "a10", "b1"]


def flo(width, height, values):
    return b"PIEH" + struct.pack("<ii", width, height) + np.asarray(values, "<f4").tobytes()


def test_flow_is_read(tmp_path):
    file = tmp_path / "flow"
    file.write_bytes(flo(2, 1, [1.5, -2, 1e10, 0]))
    np.testing.assert_array_equal(video_program.read_flow(file), [[[1.5, -2], [np.nan, np.nan]]])
    cv2 = pytest.importorskip("cv2")
    stored = np.zeros((1, 2, 3), np.uint16)
    stored[0, 0] = 1, 32768 + 128, 32768 - 96  # valid, v, u: OpenCV has blue first
    cv2.imwrite(str(tmp_path / "kitti.png"), stored)
    np.testing.assert_array_equal(video_program.read_flow(tmp_path / "kitti.png"), [[[-1.5, 2], [np.nan, np.nan]]])
    cv2.imwrite(str(tmp_path / "kitti.png"), stored[..., ::-1])
    expect_refused("OpenCV writes BGR", lambda: video_program.read_flow(tmp_path / "kitti.png"))


@pytest.mark.parametrize("content, named", [(b"", "KITTI's PNG of 16 bits and .flo are"), (b"PIEH", "truncated"), (flo(2, 2, [0] * 6), "2x2 pixels do not fit"),
                                            (flo(-1, -1, [0, 0]), "truncated"), (b"\x89PNG\r\n\x1a\n", "truncated")])
def test_what_is_no_flow_is_refused(tmp_path, content, named):
    (tmp_path / "flow").write_bytes(content)
    expect_refused(named, lambda: video_program.read_flow(tmp_path / "flow"))
    expect_refused("nowhere", lambda: video_program.read_flow(tmp_path / "nowhere"))


@pytest.mark.parametrize("report", ["{", "[" * 100000])
def test_a_report_that_is_no_json_is_refused(tmp_path, report):
    (tmp_path / "report.json").write_text(report)
    expect_refused("report.json", lambda: egosgm._egosgm._frames_of_run(tmp_path))


def test_the_frames_of_a_run(tmp_path):
    (tmp_path / "report.json").write_text('{"frames": [{"frame": 7, "left": "l/a_7.png"}, {"frame": 8, "name": "x"}], '
                                          '"sequence": {"first_frame": 5, "last_frame": 8, "frames": 4}}')
    (tmp_path / "disparity").mkdir()
    run = egosgm._egosgm._frames_of_run(tmp_path / "disparity/000007.png")
    assert ([frame.number for frame in run.frames], run.frames[0].left.stem, run.frames[1].name, run.numbers) == ([7, 8], "a_7", "x", [5, 6, 7, 8])
    (tmp_path / "report.json").write_text('{"frames": [{"frame": true}]}')
    assert egosgm._egosgm._frames_of_run(tmp_path) is None


def corner(ahead_m, right_m, scale=1.0):
    """A right angle: forward, then to the right, in steps of a metre, from somewhere in the world."""
    start = np.eye(4)
    start[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(0.8), np.sin(0.8), -np.sin(0.8), np.cos(0.8)
    start[:3, 3] = 40, 2, -7
    poses = np.stack([np.eye(4)] * (ahead_m + right_m + 1))
    steps = np.arange(len(poses))
    poses[:, 0, 3], poses[:, 2, 3] = scale * np.maximum(steps - ahead_m, 0), scale * np.minimum(steps, ahead_m)
    return start @ poses


def test_both_paths_are_drawn_at_one_scale_from_one_point(tmp_path):
    pytest.importorskip("matplotlib")
    figure = plots.paths(corner(40, 20, 1.1), corner(40, 20))
    truth, estimate = (line.get_xydata() for line in figure.axes[0].lines)
    np.testing.assert_allclose(truth[[0, 40, 60]], [[0, 0], [0, 40], [20, 40]], atol=1e-9)
    np.testing.assert_allclose(estimate[[0, 40, 60]], [[0, 0], [0, 44], [22, 44]], atol=1e-9)
    assert figure.axes[0].get_aspect() == 1
    plots.write_plot(str(tmp_path / "path.svg"), figure)
    svg = (tmp_path / "path.svg").read_text()
    for text in (">truth<", ">estimate<", ">x [m]<", ">z [m]<", ">end drift 7.45 % of 60.0 m<"):
        assert text in svg
    plots.write_plot(str(tmp_path / "still.svg"), plots.paths(corner(0, 3, 0), corner(0, 3, 0)))
    assert "end drift 0.000 m" in (tmp_path / "still.svg").read_text()


def test_a_plot_replaces_no_file(tmp_path):
    pytest.importorskip("matplotlib")
    for name, named in (("a.gif", ".svg"), (".", "name must end"), ("nowhere/a.svg", "cannot be written")):
        with pytest.raises((egosgm.InvalidArgument, egosgm.IoError), match=named):
            plots.expect_plot("--plot", str(tmp_path / name))
    (tmp_path / "mine.svg").write_text("mine")
    expect_refused("is there already", lambda: plots.expect_plot("--plot", str(tmp_path / "mine.svg")))
    with pytest.raises(egosgm.IoError, match="has come there meanwhile"):
        plots.write_plot(str(tmp_path / "mine.svg"), plots.paths(corner(1, 1), corner(1, 1)))
    assert (tmp_path / "mine.svg").read_text() == "mine"
    os.mkfifo(tmp_path / "pipe.svg")  # nobody reads it
    with pytest.raises(egosgm.Error, match="pipe"):
        plots.expect_plot("--plot", str(tmp_path / "pipe.svg"))
        plots.write_plot(str(tmp_path / "pipe.svg"), plots.paths(corner(1, 1), corner(1, 1)))


def test_without_matplotlib_its_package_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    expect_refused("--plot needs matplotlib: pip install", lambda: plots.expect_plot("--plot", str(tmp_path / "new.svg")))


def test_curves_over_frames_and_density():
    pytest.importorskip("matplotlib")
    lines = plots.over_frames([("a", [float("nan"), 1, 2]), ("b", [float("nan")] * 3)]).axes[0].lines
    assert [line.get_label() for line in lines] == ["a"] and lines[0].get_ydata()[2] == 2
    for curves, named in (([("b", [float("nan")] * 3)], "nothing to plot"), ([("a", [1.0])], "at least two")):
        expect_refused(named, lambda: plots.over_frames(curves))
    truth = np.full((20, 20), 10, np.float32)
    estimate, variance = truth.copy(), np.ones_like(truth)
    estimate[:10], variance[:10] = 15, 2
    density = egosgm.evaluate_video([estimate], [truth], uncertainties=[variance]).density
    by_variance, oracle = plots.against_density(density).axes[0].lines
    assert by_variance.get_ydata()[-1] == oracle.get_ydata()[-1] == 50 and by_variance.get_ydata()[24] == 0
    expect_refused("variance", lambda: plots.against_density(None))


def test_what_has_no_map_for_a_frame_is_told(tmp_path, capfd):
    for folder, frames in (("estimate", range(4)), ("other", (0, 2)), ("flow", (0, 1, 2))):
        (tmp_path / folder).mkdir()
        for i in frames:
            name = str(tmp_path / folder / f"{i:06d}")
            if folder == "flow":
                (tmp_path / folder / f"{i:06d}.flo").write_bytes(flo(20, 4, [0.0] * 160))
            else:
                egosgm.write_disparity(name + ".png", np.full((4, 20), 10 + i, np.float32))
    estimate = str(tmp_path / "estimate")
    arguments = [estimate, estimate, "--against", str(tmp_path / "other"), "--flow", str(tmp_path / "flow")]
    assert video_program.main(arguments) == 0
    note = f"{tmp_path / 'other'} has nothing for 2 frames, the first is 000001: its figures are of the others"
    assert note in capfd.readouterr().out.splitlines()  # the last frame needs no flow
    assert video_program.main([*arguments, "--json"]) == 0 and json.loads(capfd.readouterr().out)["notes"] == [note]
    expect_refused("near -1 px", lambda: video_program.main([*arguments, "--near", "-1"]))

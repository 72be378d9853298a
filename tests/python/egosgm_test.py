# SPDX-License-Identifier: Apache-2.0
"""The Python module: same names, same bits, no copies, errors by kind."""
import importlib.util
import inspect
import json
import pathlib
import re
import signal
import sys
import threading
import time
import types

import numpy as np
import pytest

import egosgm
from egosgm import program
from egosgm.geometry import cloud
from refusals import expect_refused

SOURCE = pathlib.Path(__file__).resolve().parents[2]
WIDTH, HEIGHT, FRAMES = 160, 64, 3
SEED = 7
OPTIONS = dict(disparities=48, paths=4)


@pytest.fixture
def pipeline(shared_pipeline):
    """As if it were new."""
    shared_pipeline.reset()
    return shared_pipeline


def disparities_of(pipeline, street, pairs):
    return [pipeline.process(left, right, street.motion(i) if i else None).disparity for i, (left, right) in enumerate(pairs)]


def padded(image):
    """The same pixels with a gap after each row."""
    return np.pad(image, ((0, 0), (0, 13)))[:, :image.shape[1]]


def test_a_sequence_is_matched_and_predicted(pipeline, street, frames):
    results = [pipeline.process(f.left, f.right, street.motion(i) if i else None, "disparity") for i, f in enumerate(frames)]
    assert [r.report.searched_everything for r in results] == [True, False, False]
    assert results[0].report.unpredicted in ("first frame", "reset")
    assert results[-1].report.search_fraction < 0.5
    assert results[-1].variance is None
    assert "BandedSgm" in dict(results[-1].report.stages)
    metrics = egosgm.compare_disparity(results[-1].disparity, frames[-1].left_disparity).metrics
    assert metrics.density > 60 and metrics.bad_of_valid < 15


def test_any_stride_and_depth_gives_the_same_bits(pipeline, street, frames):
    plain = disparities_of(pipeline, street, [(f.left, f.right) for f in frames])
    assert plain[-1].dtype == np.float32 and plain[-1].shape == (HEIGHT, WIDTH)
    for change in (padded, lambda image: image[::-1].copy()[::-1], lambda image: np.repeat(image, 2, axis=1)[:, ::2],
                   np.asfortranarray):
        pipeline.reset()
        again = disparities_of(pipeline, street, [(change(f.left), change(f.right)) for f in frames])
        for a, b in zip(plain, again):
            np.testing.assert_array_equal(a, b)
    pipeline.reset()
    wide = disparities_of(pipeline, street, [(f.left.astype(np.uint16), f.right.astype(np.uint16)) for f in frames])
    assert (wide[0] != egosgm.INVALID_DISPARITY).mean() > 0.5


def test_outputs_fill_the_callers_arrays(pipeline, frames):
    whole = np.full((HEIGHT, WIDTH + 5), 7, np.float32)
    width = np.zeros((HEIGHT, WIDTH), np.uint16)
    result = pipeline.process(frames[0].left, frames[0].right, outputs={"disparity": whole[:, :WIDTH], "search_width": width})
    assert (whole[:, WIDTH:] == 7).all()
    np.testing.assert_array_equal(result.disparity, whole[:, :WIDTH])
    assert np.shares_memory(result.disparity, whole)
    assert (width == OPTIONS["disparities"]).mean() > 0.5
    pipeline.reset()
    made = pipeline.process(frames[0].left, frames[0].right)
    np.testing.assert_array_equal(made.disparity, whole[:, :WIDTH])
    assert (made.variance[made.disparity == egosgm.INVALID_DISPARITY] == 0).all()


def test_options_have_the_librarys_names_and_defaults(street):
    defaults, paper = egosgm.pipeline_options(), egosgm.pipeline_options("paper")
    assert isinstance(defaults["gate_px"], float) and isinstance(defaults["p2"], int)
    assert isinstance(defaults["coarse_match"], bool) and isinstance(defaults["cost"], str)
    assert defaults["gate_px"] != paper["gate_px"] == 0
    shown = inspect.signature(egosgm.Pipeline).parameters
    for name, value in defaults.items():
        assert shown[name.replace(".", "__")].default == value
        assert name.replace(".", "__") in egosgm.Pipeline.__doc__
    pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, preset="paper", disparities=np.int64(32), temporal=False, device=0,
                               p1=7, p2=97, search_sigmas=np.float32(2.7), cost="sad3x3")
    changed = {"disparities": 32, "temporal": False, "p1": 7, "p2": 97, "cost": "sad3x3"}
    options = pipeline.options
    assert options.pop("search_sigmas") == pytest.approx(2.7)
    assert options == {name: value for name, value in {**paper, **changed}.items() if name != "search_sigmas"}


@pytest.mark.parametrize("options, named", [
    (dict(p22=3), "choose from"), (dict(disparities=0), "1 to 4096"), (dict(disparities=2.5), "whole number"),
    (dict(cost="sad"), "census9x7"), (dict(preset="papers"), "default, paper"), (dict(device="no such"), "no such")])
def test_wrong_options_are_refused_by_name(street, options, named):
    with pytest.raises(egosgm.InvalidArgument, match=named) as refused:
        egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, **options)
    assert isinstance(refused.value, ValueError)


def test_programs_are_kept_where_the_pipeline_says(street, tmp_path, monkeypatch):
    monkeypatch.setenv("EGOSGM_CACHE", str(tmp_path / "variable"))
    for cache in (str(tmp_path / "kept"), "off"):
        egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, cache=cache, **OPTIONS)
    assert [entry.name for entry in tmp_path.iterdir()] == ["kept"]
    assert any((tmp_path / "kept").iterdir())


@pytest.mark.parametrize("image, named", [
    (np.zeros((HEIGHT, WIDTH, 2), np.uint8), "left is"), (np.zeros((HEIGHT, WIDTH), np.float32), "uint8 or uint16"),
    (np.zeros((HEIGHT, WIDTH + 1), np.uint8), str(WIDTH + 1)), (np.zeros((HEIGHT, WIDTH), np.uint16), "type"), (None, "no array"),
    (np.zeros((0, 0), np.uint8), ""), (np.ma.masked_equal(np.zeros((HEIGHT, WIDTH), np.uint8), 0), "left has a mask")])
def test_wrong_images_are_refused_and_change_nothing(pipeline, street, frames, image, named):
    expected = disparities_of(pipeline, street, [(f.left, f.right) for f in frames[:2]])[1]
    pipeline.reset()
    pipeline.process(frames[0].left, frames[0].right)
    expect_refused(named, lambda: pipeline.process(image, frames[1].right, street.motion(1)))
    np.testing.assert_array_equal(pipeline.process(frames[1].left, frames[1].right, street.motion(1)).disparity, expected)


def test_wrong_outputs_and_motions_are_refused(pipeline, frames):
    left, right = frames[0].left, frames[0].right
    read_only = np.zeros((HEIGHT, WIDTH), np.float32)
    read_only.flags.writeable = False
    for outputs, named in (("disparities", "choose from disparity"), ((5,), "choose from disparity"), (3, "outputs is a int: give names"), ({"disparity": read_only}, "read-only"),
                           ({"disparity": np.zeros((HEIGHT, WIDTH))}, "float32"), ({"variance": np.zeros((3, 4), np.float32)}, ""),
                           ({"disparity": [[1.0]]}, "no NumPy array"),
                           ({"disparity": np.zeros((HEIGHT, 2 * WIDTH), np.float32)[:, ::2]}, "contiguous")):
        expect_refused(named, lambda: pipeline.process(left, right, outputs=outputs))
    for motion, named in ((np.eye(3), "4x4"), (np.full((4, 4), np.nan), "finite"), (2 * np.eye(4), "otation"), ("forward", "matrix")):
        expect_refused(named, lambda: pipeline.process(left, right, motion))


def test_motion_may_be_a_matrix_or_a_motion(pipeline, street, frames):
    assert egosgm.Motion(np.eye(4), np.eye(6)).covariance.trace() == 6
    maps = []
    for motion in (street.motion(1), street.motion(1).current_from_previous):
        pipeline.reset()
        pipeline.process(frames[0].left, frames[0].right)
        maps.append(pipeline.process(frames[1].left, frames[1].right, motion).disparity)
    np.testing.assert_array_equal(*maps)


def test_other_threads_run_meanwhile(pipeline, frames):
    """A thread counts while a frame is processed: nothing but processing lets go of the interpreter's lock here."""
    counted, stop = [0], threading.Event()

    def count():
        while not stop.is_set():
            counted[0] += 1
            time.sleep(0)

    thread = threading.Thread(target=count)
    interval = sys.getswitchinterval()
    thread.start()
    sys.setswitchinterval(60)
    try:
        before = counted[0]
        for _ in range(3):
            pipeline.process(frames[0].left, frames[0].right)
        during = counted[0] - before
    finally:
        sys.setswitchinterval(interval)
        stop.set()
        thread.join()
    assert during > 0


def test_threads_that_share_a_pipeline_take_turns(street, frames):
    pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, temporal=False, vertical_alignment=False, **OPTIONS)
    pairs = [(frame.left, frame.right) for frame in frames]
    expected = [pipeline.process(*pair).disparity for pair in pairs]
    start, wrong = threading.Barrier(len(pairs)), []

    def process(pair, disparity):
        start.wait()
        for _ in range(10):
            if not np.array_equal(pipeline.process(*pair).disparity, disparity):
                wrong.append(1)

    threads = [threading.Thread(target=process, args=both) for both in zip(pairs, expected)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert not wrong


def test_odometry_finds_the_motion(street, frames):
    big = egosgm.SyntheticSequence(frames=2, width=480, height=160, seed=3)
    odometry = egosgm.StereoOdometry(big.calibration, ransac_iterations=300, learn_rectification=False)
    pairs = [big.render(i) for i in range(2)]
    first = odometry.process(pairs[0].left, pairs[0].right)
    assert first.motion is None and first.reason
    second = odometry.process(pairs[1].left, padded(pairs[1].right))
    assert second.inliers > 20 and second.reason == ""
    difference = second.motion.current_from_previous - big.motion(1).current_from_previous
    assert np.abs(difference[:3, 3]).max() < 0.1
    assert second.motion.covariance.shape == (6, 6) and second.motion.covariance.trace() > 0
    expect_refused("max_features", lambda: egosgm.StereoOdometry(big.calibration, max_feature=3))
    expect_refused("wrong type", lambda: egosgm.StereoOdometry(big.calibration, seed="x"))


def test_files_read_back(tmp_path, frames, street):
    truth = frames[0].left_disparity
    assert egosgm.write_disparity(tmp_path / "d.png", truth) == 0
    stored = egosgm.read_disparity(tmp_path / "d.png")
    assert np.abs(stored - truth).max() <= 1 / 256
    egosgm.write_pfm(tmp_path / "d.pfm", truth.astype(np.float64)[:, ::-1])
    np.testing.assert_array_equal(egosgm.read_disparity(str(tmp_path / "d.pfm")), truth[:, ::-1])
    egosgm.write_calibration(tmp_path / "c.toml", street.calibration)
    assert repr(egosgm.read_calibration(tmp_path / "c.toml")) == repr(street.calibration)
    poses = np.stack([frame.world_from_camera for frame in frames])
    egosgm.write_poses(tmp_path / "poses.txt", poses)
    np.testing.assert_allclose(egosgm.read_poses(tmp_path / "poses.txt"), poses, atol=1e-8)
    expect_refused("nowhere.png", lambda: egosgm.read_grey(tmp_path / "nowhere.png"))
    with pytest.raises(egosgm.IoError, match="d.pfm") as failed:
        egosgm.write_pfm(tmp_path / "d.png" / "d.pfm", truth)
    assert isinstance(failed.value, OSError)


def test_metrics_and_pictures(frames, street):
    truth = frames[0].left_disparity
    wrong = truth + 10
    counts = egosgm.compare_disparity(wrong, truth)
    assert counts.bad == counts.truth == truth.size and counts.metrics.mae_px == pytest.approx(10, abs=1e-3)
    assert (counts + egosgm.compare_disparity(truth, truth)).metrics.bad_or_missing == 50
    masked = np.ma.masked_greater(truth, 5)
    for compare in (egosgm.compare_disparity, lambda estimate, truth: egosgm.evaluate_video([estimate], [truth])):
        expect_refused("truths?:? has a mask", lambda: compare(wrong, masked))
        compare(wrong, masked.filled(egosgm.INVALID_DISPARITY))
    sixteenths = (16 * truth).astype(np.int16)  # as egosgm.Matcher and OpenCV's matchers give it
    for read in (lambda: egosgm.depth_from_disparity(sixteenths, street.calibration), lambda: egosgm.compare_disparity(sixteenths, truth),
                 lambda: egosgm.evaluate_video([sixteenths], [truth]), lambda: egosgm.evaluate_video([truth], [sixteenths]),
                 lambda: egosgm.evaluate_scene_flow([(sixteenths, truth, np.zeros((HEIGHT, WIDTH, 2)))], [(truth, truth, np.zeros((HEIGHT, WIDTH, 2)))])):
        expect_refused("int16, .* 16 steps a pixel: give it divided by 16", read)
    sky = egosgm.compare_disparity(wrong, np.zeros_like(truth))
    assert sky.sky == sky.sky_valid == truth.size and sky.metrics.wrong_of_all == sky.metrics.filled == 100
    poses = np.stack([street.render(i).world_from_camera for i in range(FRAMES)])
    assert egosgm.evaluate_poses(poses, poses).end_drift_m < 1e-9
    holes = truth.copy()
    holes[:, 10:20] = np.nan
    assert np.isfinite(egosgm.interpolate_background(holes)).all()
    depth = egosgm.depth_from_disparity(truth, street.calibration)
    np.testing.assert_allclose(depth, street.calibration.fx * street.calibration.baseline_m / truth, rtol=1e-5)
    near = np.where(truth == truth.max(), truth, 0)
    picture = egosgm.color_disparity(near, low=0)
    y, x = np.unravel_index(truth.argmax(), truth.shape)
    red, _, blue = picture[y, x].astype(int)
    assert picture.shape == (HEIGHT, WIDTH, 3) and red > blue
    assert egosgm.color_error(wrong, truth).shape == (HEIGHT, WIDTH, 3)


def test_sequences_are_read(tmp_path, frames, street):
    for i, frame in enumerate(frames[:2]):
        for side in ("left", "right"):
            egosgm.write_disparity(tmp_path / f"{side}_{i}.png", getattr(frame, side).astype(np.float32))
    egosgm.write_calibration(tmp_path / "c.toml", street.calibration)
    sequence = egosgm.open_patterns(str(tmp_path / "left_%d.png"), str(tmp_path / "right_%d.png"), tmp_path / "c.toml")
    assert len(sequence) == 2 and sequence.size == (WIDTH, HEIGHT) and sequence.frames[1].name == "000001"
    assert sequence.numbers == [0, 1] and sequence.note == ""
    assert egosgm.open_patterns(str(tmp_path / "left_%d.png"), str(tmp_path / "right_%d.png")).calibration is None
    names = str(tmp_path / "l*.png"), str(tmp_path / "r*.png"), tmp_path / "c.toml"
    expect_refused("no right image has the name", lambda: egosgm.open_patterns(*names))
    assert egosgm.open_patterns(*names, by_order=True).frames[1].right == sequence.frames[1].right
    left, right = sequence.frames[1].read()
    assert left.dtype == np.uint16
    np.testing.assert_array_equal(left // 256, frames[1].left)
    expect_refused("nowhere", lambda: egosgm.open_folder(tmp_path / "nowhere"))


def test_all_errors_are_errors_of_the_library_and_of_python():
    kinds = [(egosgm.InvalidArgument, ValueError), (egosgm.IoError, OSError), (egosgm.DeviceError, RuntimeError),
             (egosgm.BuildError, egosgm.DeviceError)]
    for kind, builtin in kinds:
        assert issubclass(kind, egosgm.Error) and issubclass(kind, builtin), kind
    with pytest.raises(egosgm.Error, match="fx"):
        egosgm.Calibration(fx=-1, fy=1, cx=0, cy=0, baseline_m=1)
    for given in ((np.eye(3), 0.3), ([[1, 0, 0], [0, 1, 0], [0, 0, 1]],), (460, 460, 319.5, 239.5), ("460", 460, 320, 240, 0.3)):
        expect_refused(r"give the numbers fx, fy, cx, cy .px. and baseline_m .m.; of a camera matrix K these are", lambda: egosgm.Calibration(*given))


def test_the_readmes_lines_run_where_nothing_is(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    exec((SOURCE / "README.md").read_text().split("```python\n")[1].split("```")[0], {})


def test_the_notebook_runs_and_keeps_no_outputs(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib").use("Agg")
    from matplotlib import pyplot
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(pyplot, "show", lambda: drawn.extend(pyplot.get_fignums()) or pyplot.close("all"))
    drawn, names = [], {}
    for cell in json.loads((SOURCE / "examples/tour.ipynb").read_text())["cells"]:
        if cell["cell_type"] == "code":
            assert (cell["outputs"], cell["execution_count"]) == ([], None)
            exec("".join(cell["source"]), names)
    assert names["bad_in_drive"] < names["bad_alone"] / 2 and names["errors_px"] == sorted(names["errors_px"])
    assert len(drawn) == 5 and names["frame"].objects.moving and (tmp_path / "cloud.ply").stat().st_size > 100_000


def test_scene_flow_is_the_truth_of_what_moves():
    street = egosgm.SyntheticSequence(frames=2, width=160, height=64, moving_object=True)
    frame, truth = street.render(0), street.scene_flow(0)
    assert truth.flow.shape == (64, 160, 2) and truth.next_disparity.shape == truth.seen_next.shape == (64, 160)
    np.testing.assert_array_equal(truth.objects > 0, frame.left_moving > 0)
    camera = street.calibration
    for thing in truth.moving:
        rows, columns = np.nonzero(truth.objects == thing.id)
        assert list(thing.box) == [columns.min(), rows.min(), columns.max(), rows.max()]
        y, x = rows[0], columns[0]
        depth = camera.fx * camera.baseline_m / frame.left_disparity[y, x]
        there = thing.next_from_current @ [(x - camera.cx) / camera.fx * depth, (y - camera.cy) / camera.fy * depth, depth, 1]
        np.testing.assert_allclose(truth.flow[y, x], [camera.fx * there[0] / there[2] + camera.cx - x, camera.fy * there[1] / there[2] + camera.cy - y], atol=1e-3)
        assert len(thing.centre_m) == len(thing.velocity_m) == 3


def test_the_dynamic_map_finds_what_moves_and_a_reason_tells_why():
    street = egosgm.SyntheticSequence(frames=8, moving_object=True)
    pipeline = egosgm.Pipeline(street.calibration, 640, 240)
    marked, moving, trusted = [], [], egosgm.REASONS.index("trusted")
    for k in range(8):
        frame = street.render(k)
        result = pipeline.process(frame.left, frame.right, street.motion(k) if k else None, outputs=["disparity", "dynamic", "reason"])
        assert result.dynamic.dtype == result.reason.dtype == np.uint8 and result.reason.max() < len(egosgm.REASONS)
        assert set(np.unique(result.dynamic)) <= ({0, 255} if k else {0}), "nothing was predicted in the first frame"
        assert (result.reason == trusted).mean() > 0.4 and (result.disparity[result.reason == trusted] != egosgm.INVALID_DISPARITY).all()
        assert (result.disparity[result.reason == egosgm.REASONS.index("unconfirmed")] == egosgm.INVALID_DISPARITY).all()
        marked.append(result.dynamic > 0)
        moving.append(frame.left_moving > 0)
    marked, moving = np.array(marked[1:]), np.array(moving[1:])
    assert marked[moving].mean() > 0.5, "but for a car that another one hides in between"
    assert marked[~moving].mean() < 0.01


def nameless_import_error(name, monkeypatch, folder):
    """A tool that loads the module `name`, which raises an error: by a line of its own, or, as one in C does, without."""
    if name == "by_hand":
        (folder / "by_hand.py").write_text("raise ImportError('too old')\n")
        monkeypatch.syspath_prepend(folder)
    else:
        loader = {"__name__": "importlib.of_c"}  # a frame of no module
        exec("def find_spec(name, *_):\n if name == 'in_c': raise ImportError('too old')", loader)
        monkeypatch.setattr(sys, "meta_path", [types.SimpleNamespace(find_spec=loader["find_spec"]), *sys.meta_path])
    tool = folder / f"tool_{name}.py"
    tool.write_text(f"def main(arguments):\n    import {name}\n")
    spec = importlib.util.spec_from_file_location(f"egosgm.{tool.stem}", tool)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.main


def test_a_defect_of_a_tool_is_told_in_one_line(monkeypatch, capfd, tmp_path):
    def broken(arguments):
        raise RuntimeError("one\ntwo")

    def without_a_library(arguments):
        raise ImportError("libGL.so.1: cannot open shared object file", name="cv2")

    monkeypatch.setattr(signal, "signal", lambda *_: None)
    monkeypatch.setattr(cloud, "main", without_a_library)
    assert program.run_tool(["cloud"]) == 1
    assert "cv2, which does not load (libGL.so.1: cannot open shared object file): pip install opencv-python-headless" in capfd.readouterr().err
    for name in ("by_hand", "in_c"):  # whose import errors name no module
        monkeypatch.setattr(cloud, "main", nameless_import_error(name, monkeypatch, tmp_path))
        assert program.run_tool(["cloud"]) == 1
        assert capfd.readouterr().err == f"egosgm: error: cloud: needs the Python module {name}, which does not load (too old): pip install {name}\n"
    monkeypatch.setattr(cloud, "main", broken)
    assert program.run_tool(["cloud"]) == 1
    assert re.fullmatch(r"egosgm: error: RuntimeError: one two \(egosgm_test.py:\d+; this is a defect of the program: please report it\)\n", capfd.readouterr().err)

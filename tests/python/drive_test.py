# SPDX-License-Identifier: Apache-2.0
"""run(), reports as dataclasses, what repr says, and the stub's parameters."""
import ast
import copy
import dataclasses
import inspect
import json
import os
import pathlib
import pickle
import re
import shutil
import sys
import unittest.mock

import numpy as np
import pytest

import egosgm
from egosgm import cpu_driver, viewer
from egosgm.diagnostics import examination
from refusals import expect_refused

WIDTH, HEIGHT, FRAMES = 320, 96, 3
SEED = 7
OPTIONS = dict(disparities=48, paths=4)


def test_a_folder_and_its_pairs_give_the_maps_of_the_pipeline(street_folder, shared_pipeline):
    drive = egosgm.run(street_folder, **OPTIONS, outputs=("disparity", "variance", "search_width"))
    assert len(drive) == FRAMES and "3 frames" in repr(drive)
    found = list(drive)
    assert [frame.number for frame in found] == [0, 1, 2] and [frame.name for frame in found] == ["000000", "000001", "000002"]
    odometry = egosgm.StereoOdometry(drive.calibration)
    shared_pipeline.reset()
    for frame, file in zip(found, drive.sequence.frames, strict=True):
        left, right = file.read()
        expected = shared_pipeline.process(left, right, odometry.process(left, right).motion)
        np.testing.assert_array_equal(frame.left, left)
        np.testing.assert_array_equal(frame.disparity, expected.disparity)
        np.testing.assert_array_equal(frame.variance, expected.variance)
        assert frame.maps.search_width.dtype == np.uint16 and frame.maps.predicted is None
        valid = frame.disparity > 0
        assert np.isnan(frame.depth[~valid]).all()
        np.testing.assert_allclose(frame.depth[valid], drive.calibration.fx * drive.calibration.baseline_m / frame.disparity[valid], rtol=1e-5)
    assert found[0].motion is None and found[0].odometry.reason and found[2].motion is not None
    again = [frame.disparity for frame in drive]  # from its start
    pairs = [frame.read() for frame in drive.sequence.frames]
    of_pairs = [frame.disparity for frame in egosgm.run(iter(pairs), drive.calibration, **OPTIONS)]
    for a, b, c in zip(found, again, of_pairs, strict=True):
        np.testing.assert_array_equal(a.disparity, b)
        np.testing.assert_array_equal(a.disparity, c)


def test_objects_are_those_of_a_tracker(tmp_path):
    street = egosgm.SyntheticSequence(width=480, height=180, frames=3, seed=3, moving_object=True, supersampling=1)
    pairs = [(frame.left, frame.right) for frame in map(street.render, range(3))]
    found = list(egosgm.run(pairs, street.calibration, objects=True, outputs="variance", disparities=64, paths=4))
    tracker = egosgm.ObjectTracker(street.calibration)
    for frame in found:
        own = tracker.process(frame.left, frame.disparity, frame.maps.dynamic, frame.motion)
        np.testing.assert_array_equal(frame.objects.labels, own.labels)
        assert [o.id for o in frame.objects.moving] == [o.id for o in own.moving] and frame.variance is not None
        flow = tracker.scene_flow()
        assert (frame.scene_flow is None) == (flow is None) == (frame is found[0])
        if flow is not None:
            np.testing.assert_array_equal(frame.scene_flow.flow, flow.flow)
            assert flow.flow.shape == (180, 480, 2) and flow.next_disparity.shape == flow.labels.shape == flow.disparity.shape == (180, 480)
            assert flow.camera.current_from_previous.shape == (4, 4)
    (bus,) = [o for o in found[2].objects.moving if o.age == 2]
    assert bus.box[0] < bus.box[2] and bus.pixels > 500 and bus.current_from_previous.shape == (4, 4) and "age 2" in repr(bus)
    assert np.linalg.norm(bus.velocity_m) == pytest.approx(1, abs=0.1) and bus.centre_m[2] > 5 and min(bus.velocity_sigma_m) > 0
    assert found[2].scene_flow.moving[0].id == bus.id
    expect_refused("do not belong together", lambda: tracker.process(found[0].left, found[0].disparity[1:], found[0].maps.dynamic, None))


def maps_of(frames):
    return [frame.disparity for frame in frames]


def test_what_a_path_names_is_what_the_program_makes_of_it(street_folder, calib, tmp_path):
    """Pictures, and a folder whose calibration is another file's."""
    expected = next(iter(egosgm.run(street_folder, **OPTIONS))).disparity
    pictures = [street_folder / f"image_{side}/000000.png" for side in (0, 1)]
    for names in ("left", "image_0"), ("right", "image_1"):
        shutil.copytree(street_folder / names[1], tmp_path / "rig" / names[0])
    (tmp_path / "rig/rig.json").write_text("{}")
    for source, calibration in ((pictures, None), (tuple(map(str, pictures)), calib), (tmp_path / "rig", calib), (tmp_path / "rig", egosgm.read_calibration(calib))):
        first = next(iter(egosgm.run(source, calibration, **OPTIONS)))
        assert (first.disparity == expected).all() and (first.calibration is None) == (calibration is None)
    expect_refused("rig.json", lambda: egosgm.run(tmp_path / "rig"))


def test_an_iteration_may_end_where_it_likes_and_two_may_run_at_once(street_folder):
    drive = egosgm.run(street_folder, **OPTIONS)
    expected = maps_of(drive)

    def ends_early(how):
        for _ in drive:
            if how is None:
                break
            raise how

    next(iter(drive))
    ends_early(None)
    for how in (KeyboardInterrupt(), ValueError("the caller's")):
        with pytest.raises(type(how)):
            ends_early(how)
    kept = iter(drive)
    next(kept)  # and stays where it is
    np.testing.assert_array_equal(maps_of(drive), expected)
    pairs = list(zip(drive, drive, strict=True))
    for side in (0, 1):
        np.testing.assert_array_equal([pair[side].disparity for pair in pairs], expected)
    np.testing.assert_array_equal(maps_of(kept), expected[1:])

    class Taken(list):  # what another thread takes between a look and a pop
        def __bool__(self):
            return True

    drive._spare = Taken()
    np.testing.assert_array_equal(maps_of(drive), expected)


def test_a_frame_comes_before_or_after_the_next_pair_is_asked_for(street, frames):
    events, maps = [], {}

    def camera():
        for number, frame in enumerate(frames):
            events.append(f"pair {number}")
            yield frame.left, frame.right

    for lag, expected in ((0, "pair 0, frame 0, pair 1, frame 1, pair 2, frame 2"), (1, "pair 0, pair 1, frame 0, pair 2, frame 1, frame 2")):
        events.clear()
        maps[lag] = []
        for frame in egosgm.run(camera(), street.calibration, lag=lag, **OPTIONS):
            events.append(f"frame {frame.number}")
            maps[lag].append(frame.disparity)
        assert ", ".join(events) == expected
    np.testing.assert_array_equal(maps[0], maps[1])
    drive = egosgm.run(camera(), street.calibration, **OPTIONS)
    assert len(list(drive)) == FRAMES
    expect_refused("gives them once: give a list", lambda: list(drive))


def test_the_last_good_frame_comes_before_the_error(street, frames):
    pairs = [(frame.left, frame.right) for frame in frames]
    broken = [*pairs[:2], (pairs[2][0], pairs[2][1][:9])]
    found = []
    with pytest.raises(egosgm.InvalidArgument, match="right"):
        for frame in egosgm.run(broken, street.calibration, **OPTIONS):
            found.append(frame.disparity)
    np.testing.assert_array_equal(found, maps_of(egosgm.run(pairs, street.calibration, **OPTIONS))[:2])


def test_a_pair_of_a_folder_that_cannot_be_read_costs_itself_alone(street_folder):
    drive, expected = egosgm.run(street_folder, **OPTIONS), maps_of(egosgm.run(street_folder, **OPTIONS))
    os.truncate(street_folder / "image_1/000002.png", 1000)
    with pytest.warns(UserWarning, match="frame 000002: left out: .*image_1/000002.png"):
        np.testing.assert_array_equal([frame.disparity for frame in drive], expected[:2])
    os.truncate(street_folder / "image_1/000001.png", 1000)
    found = []
    with pytest.warns(UserWarning, match="000001"), pytest.raises(egosgm.InvalidArgument, match="000002.png"):
        for frame in drive:
            found.append(frame.disparity)
    np.testing.assert_array_equal(found, expected[:1])


CAMERA = egosgm.Calibration(fx=100, fy=50, cx=2, cy=1, baseline_m=0.5, doffs_px=5)
GREY = np.random.default_rng(1).integers(0, 256, (HEIGHT, WIDTH), np.uint8)
SMALL = GREY[:40]


@pytest.mark.parametrize("given, words", [
    (dict(calibration=3), "calibration: is a int"), (dict(calibration=(700, 700, 320, 240, 0.1)), "calibration: is a tuple: give an egosgm.Calibration"),
    (dict(calibration=CAMERA, frames="1:2"), "frames='1:2'"), (dict(frames=3), "frames: is a int"), (dict(frames=(0, 1)), "frames: is a tuple"),
    (dict(odometry=dict(min_inliers=9)), "odometry: has options, but"), (dict(odometry=[1]), "odometry: is a list"), (dict(motion=np.eye(4)), "motion: is a ndarray"),
    (dict(source=None), "source: is a NoneType"), (dict(source=("left", None)), "give a path, or two"), (dict(source=b"left"), "give a path, or two"), (dict(source=""), "give the path of a folder"), (dict(source="missing"), "missing: no such folder"),
    (dict(calib="calib.txt"), 'no option named "calib": choose from calibration'), (dict(lag=2), "lag=2: choose 1.* or 0"), (dict(lag=np.arange(2)), "choose 1"),
    (dict(outputs=3), "outputs: is a int: give names"), (dict(outputs=None), "outputs: is a NoneType"), (dict(objects="no"), "objects: is a str: choose True"),
    (dict(objects=True), "objects=True"), (dict(objects=True, calibration=CAMERA, motion=False), "objects=True")], ids=str)
def test_what_is_wrong_is_said_before_a_pair_is_read(given, words):
    expect_refused(words, lambda: egosgm.run(**{"source": [], **given}))


def test_what_is_wrong_with_a_folder_is_said_before_a_frame_is_read(street_folder):
    for given, words in ((dict(p22=1), "choose from"), (dict(odometry=dict(min_inlier=1)), "min_inliers"),
                         (dict(motion=False, odometry=dict(min_inliers=9)), "odometry: has options, but")):
        expect_refused(words, lambda: egosgm.run(street_folder, **given))
    expect_refused("only a folder's are chosen here; open_folder", lambda: egosgm.run(egosgm.open_folder(street_folder), frames="1:2"))
    expect_refused('output "disparty"', lambda: next(iter(egosgm.run(street_folder, outputs="disparty", motion=False, **OPTIONS))))


@pytest.mark.parametrize("pairs, words", [
    ([GREY], "pair 0: is a ndarray"), ([(GREY, GREY), (GREY,)], "pair 1: is a tuple of 1"), ([(GREY, None)], "pair 0: holds None"), ([(GREY, GREY, 0.1)], "pair 0: is a tuple of 3"),
    ([(GREY, "right.png")], "pair 0: holds names"), ((["a.png"], ["b.png"]), "pair 0: holds names in place of images: one pair"), ((["a.png", "b.png"], ["c.png", "d.png"]), "pair 0: holds names"),
    ([(np.ma.masked_equal(GREY, GREY[0, 0]), GREY)], "left has a mask"),
    ([(GREY, GREY), (SMALL, SMALL)], r"pair 1: its left image is of the shape \(40, 320\).*\(96, 320\): all need one size")], ids=lambda value: value if isinstance(value, str) else "")
@pytest.mark.parametrize("motion", [True, False])
def test_what_is_no_pair_is_said(pairs, words, motion, street):
    expect_refused(words, lambda: list(egosgm.run(pairs, street.calibration, motion=motion, **OPTIONS)))


def test_a_frame_has_its_own_images(street, frames):
    buffers = np.zeros_like(frames[0].left), np.zeros_like(frames[0].right)

    def camera():
        for frame in frames:
            buffers[0][:], buffers[1][:] = frame.left, frame.right
            yield buffers

    for found, expected in zip(egosgm.run(camera(), street.calibration, **OPTIONS), frames, strict=True):
        np.testing.assert_array_equal(found.left, expected.left)
        np.testing.assert_array_equal(found.right, expected.right)


def test_without_motion_every_frame_is_searched_whole(street_folder):
    drive = egosgm.run(street_folder, frames="1:2", motion=False, **OPTIONS)
    reports = [frame.report for frame in egosgm.run(street_folder, frames="1:2", motion=False, device=np.int64(0), **OPTIONS)]
    assert [report.searched_everything for report in reports] == [True, True] and "no motion" in repr(drive)


def test_a_bar_is_shown_where_it_is_asked_for(street_folder, monkeypatch, capfd):
    monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    expect_refused("pip install tqdm", lambda: egosgm.run(street_folder, progress=True))
    assert len(list(egosgm.run(street_folder, motion=False, **OPTIONS))) == FRAMES
    calls = []

    class Module:
        @staticmethod
        def tqdm(frames, **options):
            calls.append(options)
            return frames

    monkeypatch.setitem(sys.modules, "tqdm", Module)
    monkeypatch.setitem(sys.modules, "tqdm.auto", Module)
    for progress, disable in ((None, None), (True, False)):
        assert len(list(egosgm.run(street_folder, progress=progress, motion=False, **OPTIONS))) == FRAMES
        assert calls.pop() == dict(total=FRAMES, unit=" frames", disable=disable)
    list(egosgm.run(street_folder, progress=False, motion=False, **OPTIONS))
    assert not calls


def test_reports_are_dataclasses(shared_pipeline, street, frames):
    report = shared_pipeline.process(frames[0].left, frames[0].right).report
    values = dataclasses.asdict(report)
    assert values["density"] == report.density and values["stages"] == report.stages
    assert json.loads(json.dumps(values))["stripes"] == report.stripes
    assert repr(report).startswith("FrameReport(unpredicted=") and f"density={report.density!r}" in repr(report)
    assert {field.name for field in dataclasses.fields(report)} == {name for name in dir(report) if not name.startswith("_")}
    same = egosgm.Calibration(**dataclasses.asdict(street.calibration))
    assert same == street.calibration and same != egosgm.Calibration(1, 1, 1, 1, 1) and same != 3
    assert eval(repr(same), vars(egosgm)) == same


def fields_of(value):
    """What a value tells, to be compared."""
    return {name: getattr(value, name) for name, member in vars(type(value)).items() if isinstance(member, property)}


def test_a_prior_is_a_motion_or_its_matrix(street, frames):
    def found(prior):
        odometry = egosgm.StereoOdometry(street.calibration)
        return [odometry.process(frame.left, frame.right, given) for frame, given in zip(frames, (None, prior))][1].motion.current_from_previous

    there = np.eye(4)
    there[2, 3] = -0.5
    np.testing.assert_array_equal(found(egosgm.Motion(there)), found(there))


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_results_leave_a_process(copied, street_folder):
    sequence = egosgm.open_folder(street_folder)
    for frame in egosgm.run(street_folder, **OPTIONS, frames="0:1", outputs=("disparity", "reason")):
        counts = egosgm.compare_disparity(frame.disparity, frame.disparity)
        for value in (frame.report, counts, counts.metrics, egosgm.devices()[0]):
            assert copied(value) == value
        for value in (frame.odometry, sequence, sequence.frames[1]):
            now, before = fields_of(copied(value)), fields_of(value)
            assert repr(now) == repr(before) and now.keys() == before.keys()
        taken = copied(frame)
        for name in ("disparity", "variance", "reason"):
            np.testing.assert_array_equal(getattr(taken.maps, name), getattr(frame.maps, name))
        assert taken.report == frame.report and taken.calibration == frame.calibration
        if frame.motion:
            np.testing.assert_array_equal(taken.motion.covariance, frame.motion.covariance)
            np.testing.assert_array_equal(taken.motion.current_from_previous, frame.motion.current_from_previous)


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, lambda value: pickle.loads(pickle.dumps(value))])
def test_objects_and_scene_flow_leave_a_process(copied):
    street = egosgm.SyntheticSequence(width=480, height=180, frames=3, seed=3, moving_object=True, supersampling=1)
    pairs = [(frame.left, frame.right) for frame in map(street.render, range(3))]
    *_, frame = egosgm.run(pairs, street.calibration, objects=True, disparities=64, paths=4)
    assert frame.objects.moving
    taken = copied(frame)
    np.testing.assert_array_equal(taken.objects.labels, frame.objects.labels)
    for name in ("disparity", "next_disparity", "flow", "labels"):
        np.testing.assert_array_equal(getattr(taken.scene_flow, name), getattr(frame.scene_flow, name))
    np.testing.assert_array_equal(taken.scene_flow.camera.current_from_previous, frame.scene_flow.camera.current_from_previous)
    for now, before in ((taken.objects, frame.objects), (taken.scene_flow, frame.scene_flow)):
        assert [repr(fields_of(copied(o))) for o in now.moving] == [repr(fields_of(o)) for o in before.moving]


def test_repr_says_what_it_is(shared_pipeline, street, frames):
    result = shared_pipeline.process(frames[0].left, frames[0].right, outputs="disparity")
    assert repr(result) == "<Frame of disparity>"
    assert "48 disparities" in repr(shared_pipeline) and f"{FRAMES} frames, {WIDTH}x{HEIGHT}" in repr(street)
    motion = np.eye(4)
    motion[:3, 3] = (0.1, 0, -0.8)
    assert repr(egosgm.Motion(motion)) == "<Motion to (-0.100, 0.000, 0.800) m>"
    assert "no motion: " in repr(egosgm.StereoOdometry(street.calibration).process(frames[0].left, frames[0].right))


def parameters_of(documented):
    """Their names, of the line that pybind11 writes over a function's text."""
    return [name for name in re.findall(r"[(,] *(\w+): ", documented.split("\n")[0]) if name != "self"]


def test_the_stub_has_the_parameters_of_the_module():
    stub = ast.parse((pathlib.Path(egosgm.__file__).parent / "__init__.pyi").read_text())
    compared = 0
    for node in stub.body:
        functions = [(egosgm, node)] if isinstance(node, ast.FunctionDef) else []
        if isinstance(node, ast.ClassDef):
            functions += [(getattr(egosgm, node.name), item) for item in node.body if isinstance(item, ast.FunctionDef)
                          and not item.decorator_list and (item.name == "__init__" or not item.name.startswith("_"))]
        for owner, function in functions:
            documented = getattr(owner, function.name).__doc__ or ""
            if not documented.startswith(f"{function.name}("):
                continue
            stubbed = [a.arg for a in function.args.args + function.args.kwonlyargs if a.arg != "self"]
            assert stubbed == parameters_of(documented), f"{owner.__name__}.{function.name}"
            compared += 1
    assert compared > 35
    assert "frames" in inspect.signature(egosgm.run).parameters


def test_what_the_page_shows_is_what_comes_out():
    import doctest
    page = pathlib.Path(__file__).resolve().parents[2] / "docs/use/python.md"
    failed, tried = doctest.testfile(str(page), module_relative=False, optionflags=doctest.ELLIPSIS)
    assert failed == 0 and tried > 10


def test_the_matcher_has_opencvs_values(street, frames):
    matcher = egosgm.Matcher(disparities=48, paths=4)
    found = matcher.compute(frames[0].left, frames[0].right)
    assert found.dtype == np.int16 and repr(matcher) == "<Matcher of 48 disparities from 0>"
    single = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, temporal=False, **OPTIONS).process(frames[0].left, frames[0].right).disparity
    valid = single != egosgm.INVALID_DISPARITY
    assert valid.any() and not valid.all()
    np.testing.assert_array_equal(found[valid], np.rint(16 * single[valid]))
    assert (found[~valid] == -16).all()
    np.testing.assert_array_equal(found, matcher.compute(*(np.dstack([image] * 3) for image in (frames[0].left, frames[0].right))))
    blue = np.dstack([frames[0].left, np.zeros((HEIGHT, WIDTH, 2), np.uint8)])  # as OpenCV has it; the least of a grey value
    np.testing.assert_array_equal(matcher.compute(blue, blue), matcher.compute(*[((3735 * blue[..., 0].astype(np.uint32) + (1 << 14)) >> 15).astype(np.uint8)] * 2))
    colours = [np.dstack([255 - image[::-1], image, image // 2, image[:, ::-1]]) for image in (frames[0].left, frames[0].right)]  # BGRA
    np.testing.assert_array_equal(matcher.compute(*colours), matcher.compute(*(image[..., :3] for image in colours)))
    expect_refused(f"left is {WIDTH}x{HEIGHT}, right 48x{HEIGHT}: give a pair of one size", lambda: matcher.compute(frames[0].left, frames[0].right[:, :48]))
    expect_refused("right is an array of float64: give uint8 or uint16, .* BGR", lambda: matcher.compute(frames[0].left, frames[0].right.astype(float)))
    assert matcher.compute(frames[0].left[:48], frames[0].right[:48]).shape == (48, WIDTH)
    eight, default = (egosgm.Matcher(disparities=48, **given).compute(frames[0].left, frames[0].right) for given in ({"paths": 8}, {}))
    np.testing.assert_array_equal(default, eight)
    assert (eight != found).any()
    np.testing.assert_array_equal(egosgm.Matcher(disparities=48, paths=4, temporal=False, device=0).compute(frames[0].left, frames[0].right), found)
    for call, named in ((lambda: egosgm.Matcher(2000, 128), "do not fit"), (lambda: egosgm.Matcher(temporal=True), "matches each pair alone"), (lambda: matcher.compute(np.zeros(4, np.uint8), None), "H x W"),
                        (lambda: matcher.compute(*[np.ma.masked_less(frames[0].left, 9)] * 2), "left has a mask"),
                        (lambda: egosgm.Matcher(numDisparities=64), "choose from"), (lambda: egosgm.Matcher(0, 64.5), "64.5"), (lambda: egosgm.Matcher(0, None), "None")):
        expect_refused(named, call)
    for name in ("disparities", "min_disparity", "paths"):
        with pytest.raises(AttributeError):
            setattr(matcher, name, 8)
    assert (matcher.min_disparity, matcher.disparities) == (0, 48)


def test_the_page_for_those_who_come_from_elsewhere_names_options_that_exist():
    page = (pathlib.Path(__file__).resolve().parents[2] / "docs/use/coming-from.md").read_text()
    names = {"disparities", "min_disparity", "cost", "p1", "p2", "left_right_px", "max_speckle_px", "paths"}
    assert names <= set(egosgm.pipeline_options())
    assert all(f"`{name}`" in page or f"`{name} = " in page for name in names)
    for cost in re.findall(r"`((?:census|sad)\d+x\d+)`", page):
        egosgm.Pipeline(egosgm.Calibration(100, 100, 32, 16, 0.1), 64, 32, disparities=16, cost=cost)


def test_colour_is_taken_where_grey_is(street, frames):
    random = np.random.default_rng(3)
    colour = random.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
    r, g, b = (colour[:, :, i].astype(np.uint32) for i in range(3))
    grey = ((9798 * r + 19235 * g + 3735 * b + (1 << 14)) >> 15).astype(np.uint8)
    pipeline = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, **OPTIONS)
    expected = pipeline.process(grey, grey, None, "disparity").disparity
    for shown in (colour, np.dstack([colour, grey]), np.asfortranarray(colour)):
        pipeline.reset()
        np.testing.assert_array_equal(pipeline.process(shown, shown, None, "disparity").disparity, expected)
    grey_motion, colour_motion = egosgm.StereoOdometry(street.calibration), egosgm.StereoOdometry(street.calibration)
    for frame in frames[:2]:
        of_grey = grey_motion.process(frame.left, frame.right)
        of_colour = colour_motion.process(*(np.dstack([image] * 3) for image in (frame.left, frame.right)))
    np.testing.assert_array_equal(of_colour.motion.current_from_previous, of_grey.motion.current_from_previous)
    expect_refused("left is .*: give a grey image", lambda: pipeline.process(np.zeros((3, HEIGHT, WIDTH), np.uint8), frames[0].right))


def test_a_look_at_what_is_nearer_takes_little_memory_whatever_the_shape():
    for shape in ((48, 16384), (16384, 48), (16384, 300), (2, 600), (600, 2)):
        image = np.zeros(shape, np.uint8)
        assert max(egosgm._egosgm._coarse_map(image, image, 0.0, 0, 16).shape) <= 256


def test_pairs_whose_views_were_exchanged_hide_nothing_that_is_nearer(street, frames):
    check = egosgm._egosgm._InputCheck(street.calibration, 0, 16)
    report = egosgm.Pipeline(street.calibration, WIDTH, HEIGHT, **OPTIONS).process(frames[0].left, frames[0].right).report
    for i in range(51):  # the first and the last of them are looked at
        left, right = (frames[0].left, frames[0].right) if i < 50 else (frames[0].right, frames[0].left)
        check.add(left, right, report, True)
    assert "nearer than the range" in check.text() and "farther" not in check.text()


@pytest.mark.filterwarnings("error")
def test_images_of_a_few_rows_or_columns_are_examined():
    for shape in ((1, 1), (1, 600), (2, 600), (3, 600), (600, 1), (600, 2)):
        left, right = np.random.default_rng(1).integers(0, 256, (2, *shape), np.uint8)
        for pair in ((left, right), (left, left)):
            looked = examination.Examination(None, 0, 16)
            looked.add(*pair)
            assert [finding.check for finding in looked.findings(1)][:2] == ["images", "calibration"]


def test_a_doubtful_drive_is_told(street, frames):
    swapped = [(frame.right, frame.left) for frame in frames]
    with pytest.warns(UserWarning, match="density|no motion"):
        list(egosgm.run(swapped, street.calibration, **OPTIONS))
    for baseline_m, told in ((54, "a baseline of 54 m"), (3, "few rigs .* decimetres .0.3 m.")):
        far = egosgm.Calibration(**{**dataclasses.asdict(street.calibration), "baseline_m": baseline_m})
        with pytest.warns(UserWarning, match=told):
            list(egosgm.run([(frames[0].left, frames[0].right)], far, motion=False, **OPTIONS))


def test_rows_that_no_alignment_mends_are_told(street, frames):
    apart = [(frame.left, np.roll(frame.right, 3, axis=0)) for frame in frames]
    with pytest.warns(UserWarning, match="rows of the two views lie 2 px apart, the most that is corrected"):
        list(egosgm.run(apart, street.calibration, **OPTIONS))


def test_the_packaged_cpu_driver_is_beside_what_is_registered(tmp_path, monkeypatch):
    registered, cache = tmp_path / "vendors", tmp_path / "cache/egosgm/vendors"
    registered.mkdir()
    (registered / "gpu.icd").write_text("libgpu.so\n")
    cache.mkdir(parents=True)
    (cache / "gone.icd").write_text("libgone.so\n")
    monkeypatch.setattr(os, "environ", {"XDG_CACHE_HOME": str(tmp_path / "cache")})  # what is set there ends with the test
    monkeypatch.setattr(cpu_driver, "_REGISTERED", registered)
    monkeypatch.setattr(cpu_driver, "packaged_library", lambda: "/pip/libcpu.so")
    cpu_driver.show()
    assert os.environ["OCL_ICD_VENDORS"] == str(cache)
    assert {file.name: file.read_text() for file in cache.iterdir()} == {"gpu.icd": "libgpu.so\n", "egosgm_cpu.icd": "/pip/libcpu.so\n"}
    os.environ["OCL_ICD_VENDORS"] = "/mine"
    cpu_driver.show()
    assert os.environ["OCL_ICD_VENDORS"] == "/mine"


def test_the_size_that_a_calibration_is_of_counts_where_that_one_is_taken(street, street_folder, frames, tmp_path):
    c = street.calibration
    for name, image in (("im0", frames[0].left), ("im1", frames[0].right)):
        egosgm.write_disparity(tmp_path / f"{name}.png", image.astype(np.float32))
    camera = f"[{c.fx} 0 {c.cx}; 0 {c.fy} {c.cy}; 0 0 1]"
    (tmp_path / "calib.txt").write_text(f"cam0={camera}\ncam1={camera}\ndoffs=0\nbaseline=540\nwidth=800\nheight=600\nndisp=64\n")
    for given in ((tmp_path,), (street_folder, tmp_path / "calib.txt")):
        expect_refused("is of images of 800x600, and these have 320x96", lambda: egosgm.run(*given))
    sequence = egosgm.open_folder(tmp_path)
    assert len(list(egosgm.run(sequence, c, progress=False, **OPTIONS))) == 1


def test_the_viewer_repeats_the_last_motion_where_none_was_found(street, frames, monkeypatch):
    monkeypatch.setitem(sys.modules, "rerun", unittest.mock.MagicMock())
    output, ahead = viewer.RerunOutput(), np.eye(4)
    ahead[2, 3] = -1
    frame = next(iter(egosgm.run([(frames[0].left, frames[0].right)], street.calibration, progress=False, **OPTIONS)))
    for motion in (None, ahead, None):
        output.add(frame, frame.maps, motion, frame.calibration)
    assert output._world_from_camera[2, 3] == 2


def test_the_viewer_takes_colour(street, frames, monkeypatch):
    rerun = unittest.mock.MagicMock()
    monkeypatch.setitem(sys.modules, "rerun", rerun)
    output, grey = viewer.RerunOutput(), frames[0]
    for channels, model in ((1, "L"), (3, "RGB"), (4, "RGBA")):
        left, right = (np.repeat(image[:, :, None], channels, axis=2) for image in (grey.left, grey.right))
        frame = next(iter(egosgm.run([(left, right)], street.calibration, progress=False, **OPTIONS)))
        output.add(frame, frame.maps, frame.motion, frame.calibration)
        assert rerun.Image.call_args.args[1] == model and rerun.Image.call_args.args[0].shape == left.shape

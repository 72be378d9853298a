# SPDX-License-Identifier: Apache-2.0
"""egosgm eval-flow against numbers that are counted by hand."""
import dataclasses
import json
import math
import struct

import numpy as np
import pytest

import egosgm
from egosgm.evaluation.flow_evaluation import count_outliers, match_objects
from egosgm.flow_program import _work, motion_errors, read_motions
from refusals import expect_refused

NO = math.nan


def row(*values):
    return np.array(values, np.float32).reshape(1, len(values), -1)


def counts(estimates, truths, moving=None):
    return {region: rows.tolist() for region, rows in count_outliers(estimates, truths, moving).items()}


def test_an_outlier_is_off_by_more_than_3_px_and_5_percent():
    disparity = row(10, 13, 13.25, 104, 105.25, 106, NO, 50), row(10, 10, 10, 100, 100, 100, 10, NO)
    next_disparity = row(20, NO, *[20] * 6), row(*[20] * 7, NO)
    flow = row(*[(0, 0)] * 6, (NO, NO), (3, 4)), row((3, 0), (0, 3.25), (2.25, 2.25), *[(0, 0)] * 4, (NO, NO))
    found = counts(*zip(disparity, next_disparity, flow), np.array([[0, 0, 1, 1, 0, 0, 0, 0]], bool))
    assert found["all"] == [[4, 7, 6], [1, 7, 6], [3, 7, 6], [5, 7, 5]]  # outliers, with truth, with both
    assert found["moving"] == [[1, 2, 2], [0, 2, 2], [1, 2, 2], [1, 2, 2]]
    assert found["static"] == [[3, 5, 4], [1, 5, 4], [2, 5, 4], [4, 5, 3]]


def test_each_measure_has_its_own_truth_and_all_of_them_that_of_sf():
    truths = row(10, NO, 10), row(10, 10, NO), row((0, 0), (0, 0), (0, 0))
    assert counts([row(*[NO] * 3), row(*[NO] * 3), row(*[(9, 0)] * 3)], truths) == {"all": [[2, 2, 0], [2, 2, 0], [3, 3, 3], [1, 1, 0]]}


def test_a_hole_is_right_where_nothing_is():
    sky, flow = row(1 / 256, 1 / 256), row((0, 0), (0, 0))
    assert counts([row(NO, 4), row(NO, 1), flow], [sky, sky, flow])["all"] == [[1, 2, 1], [0, 2, 1], [0, 2, 2], [1, 2, 1]]


def write(folder, disparity, next_disparity, flow):
    for name, value in (("disp_0", disparity), ("disp_1", next_disparity)):
        (folder / name).mkdir(parents=True, exist_ok=True)
        np.save(folder / name / "000003.npy", np.asarray(value, np.float32))
    (folder / "flow").mkdir(exist_ok=True)
    height, width = np.shape(flow)[:2]
    (folder / "flow/000003.flo").write_bytes(b"PIEH" + struct.pack("<ii", width, height) + np.asarray(flow, np.float32).tobytes())
    return folder


def test_folders_are_compared_frame_by_frame(tmp_path):
    truth = write(tmp_path / "truth", [[10, 10, 20, 0]], [[10, 10, 20, 20]], [[[1, 0]] * 4])
    estimate = write(tmp_path / "estimate", [[10, 14, 0, 5]], [[10, 10, 20, 20]], [[[5, 0]] + [[1, 0]] * 3])
    result = json.loads(_work([str(estimate), str(truth), "--json"]))
    figures = {name: (figure["outliers_percent"], figure["density_percent"], figure["truth_pixels"]) for name, figure in result["regions"]["all"].items()}
    assert figures == {"d1": (pytest.approx(200 / 3), pytest.approx(200 / 3), 3), "d2": (0, 100, 4), "fl": (25, 100, 4), "sf": (100, pytest.approx(200 / 3), 3)}
    assert (result["frames"], list(result["regions"]), result["over_frames"][0]["name"]) == (1, ["all"], "000003")
    text = _work(["--estimate", str(estimate), "--truth", str(tmp_path)])  # a sequence's folder
    assert "compared with itself" in _work([str(truth), str(truth)]) and "compared with itself" not in text
    assert "1 frame\n" in text and "SF" in text and text.splitlines()[2].split()[:3] == ["all", "66.67", "%"]


def test_arrays_give_what_folders_give(tmp_path):
    hole = egosgm.INVALID_DISPARITY
    truths = [([[10, 10, 20, hole]], [[10, 10, 20, 20]], [[[1, 0]] * 4]), ([[10, NO]], [[10, 10]], [[[0, 0]] * 2])]
    estimates = [([[10, 14, hole, 5]], [[10, 10, NO, 20]], [[[5, 0]] + [[1, 0]] * 3]), ([[10, 10]], [[20, 10]], [[[0, 0]] * 2])]
    folders = write(tmp_path / "estimate", *estimates[0]), write(tmp_path / "truth", *truths[0])
    result = json.loads(_work([*map(str, folders), "--json"]))
    of_one, of_both = (egosgm.evaluate_scene_flow(estimates[:n], truths[:n]) for n in (1, 2))
    assert {name: dataclasses.asdict(figures) for name, figures in of_one.regions.items()} == result["regions"] and of_one.objects is None
    assert of_both.over_frames[0] == of_one.regions
    both = of_both.regions["all"]
    assert (both.d1, both.d2.truth_pixels, both.sf.truth_pixels) == (egosgm.OutlierFigures(50.0, 75.0, 4), 6, 4)


def test_labels_of_arrays_tell_regions_and_objects():
    disparity, flow = np.full((20, 40), 10, np.float32), np.zeros((20, 40, 2), np.float32)
    true, own = np.zeros((2, 20, 40), np.uint8)
    true[:, :10], own[:, :9], own[:, 30:] = 5, 3, 8
    frame = disparity, disparity + 4 * (true > 0), flow
    found = egosgm.evaluate_scene_flow([frame] * 2, [(disparity, disparity, flow)] * 2, labels=[own, 0 * own], true_labels=[true] * 2)
    assert found.objects == egosgm.ObjectCounts(found=1, lost=1, false=1)
    assert {name: (figures.d2.outliers_percent, figures.d2.truth_pixels) for name, figures in found.regions.items()} == {"all": (25, 1600), "moving": (100, 400), "static": (0, 1200)}
    assert list(egosgm.evaluate_scene_flow([frame], [frame], labels=[own]).regions) == ["all"]
    for arguments, message in ((([], []), "no frames"), (([frame], []), "truths has 0 of 1 frames"), (([frame[:2]], [frame]), "estimates: 2 maps"),
                               (([frame], [(disparity, disparity[:9], flow)]), "frame 0: its maps differ in size: 40x20, 40x9"),
                               (([frame], [(disparity, disparity, disparity)]), "truths: an array of shape")):
        expect_refused(message, lambda: egosgm.evaluate_scene_flow(*arguments))
    expect_refused("40x20, 9x20", lambda: egosgm.evaluate_scene_flow([frame], [frame], true_labels=[true[:, :9]]))


def test_what_cannot_be_compared_is_named(tmp_path):
    truth = write(tmp_path / "truth", [[1, 2]], [[1, 2]], [[[0, 0]] * 2])
    small = write(tmp_path / "small", [[1, 2]], [[1, 2]], [[[0, 0]]])
    expect_refused("000003.flo.*1x1, 2x1", lambda: _work([str(small), str(truth)]))
    (small / "disp_1/000003.npy").rename(small / "disp_1/000004.npy")
    expect_refused("disp_1", lambda: _work([str(small), str(truth)]))
    (small / "disp_1/000004.npy").unlink()
    (small / "disp_1").rmdir()
    expect_refused("small: has no folder disp_1 or disp_occ_1", lambda: _work([str(small), str(truth)]))


def test_objects_are_found_lost_or_false_by_their_overlap():
    truth, own = np.zeros((2, 40, 40), np.uint8)
    truth[0:10, 0:20] = 1  # 200 px: own 7 has half of it
    truth[20:30, 0:20] = 2  # nobody has it: own 9 has a quarter
    truth[0:10, 30:39] = 3  # 90 px: too small to be asked for
    own[0:10, 0:10] = 7
    own[20:25, 0:10] = 9
    own[30:40, 20:40] = 8  # stands
    own[0:10, 30:39] = 4  # most of it moves
    assert match_objects(own, truth) == ({1: 7}, [2], [8])
    assert match_objects(np.zeros_like(own), truth) == ({}, [1, 2], [])
    assert match_objects(own, np.zeros_like(truth)) == ({}, [], [4, 7, 8, 9])


def test_motion_errors_are_those_of_the_centre():
    turned, true = np.eye(4), np.eye(4)
    turned[:2, :2] = [[0.6, -0.8], [0.8, 0.6]]
    true[:3, 3] = 0.5, 0, 0
    shift, turn = motion_errors(turned, true, np.array([1.0, 0, 2]))
    assert shift == pytest.approx(math.hypot(1.5 - 0.6, 0.8)) and turn == pytest.approx(math.degrees(math.acos(0.6)))


def test_motions_come_from_a_table_or_rows(tmp_path):
    names = ",".join(f"m{i}{j}" for i in range(3) for j in range(4))
    (tmp_path / "objects.csv").write_text(f"frame,id,{names},age\n000010,3,1,0,0,5,0,1,0,6,0,0,1,7,2\n")
    (key, motion), = read_motions(tmp_path).items()
    assert key == ("10", 3) and motion[:, 3].tolist() == [5, 6, 7, 1]
    (tmp_path / "objects.csv").rename(tmp_path / "old")
    assert read_motions(tmp_path) == {}
    (tmp_path / "motions.txt").write_text("10 3 1 0 0 5 0 1 0 6 0 0 1 7\n\n")
    assert list(read_motions(tmp_path)) == [("10", 3)]
    names = f"frame,id,{names}\n"
    for file, text in (("motions.txt", "10 3 1 0\n"), ("motions.txt", "10\n"), ("objects.csv", "000010,3,1,0,0,5\n000011,3,1,0,0,5\n"), ("objects.csv", names + "10,3,1,0,0\n"),
                       ("objects.csv", names + "10,3,1,0,0,5,0,1,0,6,0,0,nan,7\n")):
        (tmp_path / file).write_text(text)
        expect_refused("is damaged", lambda: read_motions(tmp_path))

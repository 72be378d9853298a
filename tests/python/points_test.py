# SPDX-License-Identifier: Apache-2.0
"""Depth and point clouds of frames."""
import types

import numpy as np
import pytest

import egosgm
from egosgm.bag import ros_images
from egosgm.geometry import points
from refusals import expect_refused

WIDTH, HEIGHT, FRAMES, SEED = 320, 96, 3, 7
OPTIONS = dict(disparities=48, paths=4)
CAMERA = egosgm.Calibration(fx=100, fy=50, cx=2, cy=1, baseline_m=0.5, doffs_px=5)


def test_depth_and_its_sigma_are_metres_or_nan():
    disparity = np.array([[5, 20, egosgm.INVALID_DISPARITY], [-5, -6, np.nan]], np.float32)
    variance = np.array([[4, 0.25, 0], [1, 1, 1]], np.float32)
    none = [np.nan] * 3
    depth, sigma = egosgm.depth_from_disparity(disparity, CAMERA), egosgm.depth_sigma_from_disparity(disparity, variance, CAMERA)
    np.testing.assert_allclose(depth, [[5, 2, np.nan], none], rtol=1e-6)      # 50 m px over 10 and 25 px
    np.testing.assert_allclose(sigma, [[1, 0.04, np.nan], none], rtol=1e-6)   # 5 m of 2 px in 10; 2 m of half a pixel in 25
    assert depth.dtype == sigma.dtype == np.float32
    np.testing.assert_allclose(ros_images.depth_maps(disparity, variance, CAMERA), (depth, sigma**2), rtol=1e-6)
    assert np.isnan(egosgm.depth_sigma_from_disparity(disparity, -variance - 1, CAMERA)).all()
    expect_refused("maps of one frame", lambda: egosgm.depth_sigma_from_disparity(disparity, variance[:1], CAMERA))


def test_a_frames_depth_says_how_sure_it_is(street_folder):
    frame = next(iter(egosgm.run(street_folder, **OPTIONS)))
    np.testing.assert_array_equal(frame.depth_sigma, egosgm.depth_sigma_from_disparity(frame.disparity, frame.variance, frame.calibration))
    assert (np.isnan(frame.depth_sigma) == ~(frame.disparity > 0)).all() and np.nanmin(frame.depth_sigma) > 0
    for outputs, asked in (("disparity", "depth_sigma"), ("variance", "depth")):
        expect_refused("name it too, outputs=", lambda: getattr(next(iter(egosgm.run(street_folder, **OPTIONS, outputs=outputs))), asked))
    uncalibrated, = egosgm.run([(frame.left, frame.right)], **OPTIONS)
    assert uncalibrated.calibration is None and uncalibrated.motion is None and (uncalibrated.disparity == frame.disparity).all()
    expect_refused("depth: a disparity is none without a calibration", lambda: uncalibrated.depth)


def frame_of(disparity, variance, reason=None, left=None):
    """As run() gives it, of maps by hand."""
    maps = types.SimpleNamespace(disparity=np.float32(disparity), variance=np.float32(variance), reason=reason)
    return egosgm.VideoFrame(0, "000000", np.full(np.shape(disparity), 90, np.uint8) if left is None else left, None, maps, None, None, CAMERA)


def test_a_cloud_has_the_points_that_are_sure(tmp_path):
    disparity, variance = np.full((4, 6), 5), np.full((4, 6), 0.01)
    variance[3, 1], variance[3, 2] = 1.02, 0.98  # of 10 px: a little above and below 10 %
    disparity[0, 0] = egosgm.INVALID_DISPARITY
    left = np.random.default_rng(1).integers(0, 256, (4, 6, 3)).astype(np.uint8)
    cloud = egosgm.point_cloud(frame_of(disparity, variance, left=left))
    assert cloud.points.shape == cloud.colors.shape == (22, 3)
    assert (cloud.points.dtype, cloud.colors.dtype) == (np.float32, np.uint8)
    np.testing.assert_allclose(cloud.points[-1], (0.15, 0.2, 5), rtol=1e-6)  # pixel (5, 3): 50 m px over 10 px
    np.testing.assert_array_equal(cloud.colors[-1], left[3, 5])
    assert cloud.left_out == {"far": 0, "uncertain": 1, "reason": 0, "alone": 0}
    assert len(egosgm.point_cloud(frame_of(disparity, variance), max_sigma=0.011).points) == 21
    assert egosgm.point_cloud(frame_of(disparity, variance), max_depth_m=4.9).left_out["far"] == 23
    colors = np.full((40, 60), 4095, np.uint16)
    colors[5, 5] = 65535  # a hot pixel makes nothing dark
    wide = egosgm.point_cloud(frame_of(np.full((40, 60), 5), np.full((40, 60), 0.01)), colors=colors)
    assert (wide.colors == 255).all()
    egosgm.write_ply(tmp_path / "cloud.ply", cloud.points, cloud.colors)
    header, body = (tmp_path / "cloud.ply").read_bytes().split(b"end_header\n", 1)
    assert b"element vertex 22\n" in header and len(body) == 22 * 15
    np.testing.assert_array_equal(np.frombuffer(body[-3:], np.uint8), left[3, 5])
    egosgm.write_ply(tmp_path / "plain.ply", [[1, 2, 3]], normals=[[0, 0, -1]])
    assert np.frombuffer((tmp_path / "plain.ply").read_bytes()[-24:], np.float32).tolist() == [1, 2, 3, 0, 0, -1]


def test_a_cloud_keeps_the_reasons_that_were_chosen():
    reason = np.zeros((4, 6), np.uint8)
    reason[1, 2], reason[2, 3] = egosgm.REASONS.index("flat"), egosgm.REASONS.index("predicted")
    frame = frame_of(np.full((4, 6), 5), np.full((4, 6), 0.01), reason)
    assert [len(egosgm.point_cloud(frame, reasons=kept).points) for kept in (None, "trusted", ("trusted", "flat"))] == [24, 22, 23]
    assert egosgm.point_cloud(frame, reasons="trusted").left_out["reason"] == 2
    expect_refused("has no reason: give run", lambda: egosgm.point_cloud(frame_of(np.full((4, 6), 5), np.full((4, 6), 0.01)), reasons="trusted"))
    for wrong, words in ((dict(reasons="sure"), 'no "sure": choose from trusted'), (dict(max_sigma=0), "max_relative_sigma"),
                         (dict(colors=np.zeros((4, 6, 2), np.uint8)), "colors is"), (dict(colors=np.zeros((4, 5), np.uint8)), "one size")):
        expect_refused(words, lambda: egosgm.point_cloud(frame, **wrong))
    expect_refused("frame is a ndarray: give a frame of run", lambda: egosgm.point_cloud(frame.disparity, CAMERA))


@pytest.mark.filterwarnings("error")
def test_what_is_no_map_makes_no_cloud():
    empty, image, map_ = np.zeros((0, 0), np.float32), np.zeros((2, 3), np.uint8), np.full((2, 3), 5, np.float32)
    for maps, kept, reason, words in (((empty, empty, empty.astype(np.uint8)), None, None, ""), ((map_, map_, empty.astype(np.uint8)), None, None, ""),
                                      ((map_, map_, image), "trusted", np.zeros(6, np.uint8), "reason"), ((map_, map_, image), "trusted", np.zeros((2, 3, 3), np.uint8), "reason")):
        expect_refused(words, lambda: points.cloud_of_maps(*maps, CAMERA, 0.1, kept, reason, 80, 1))
    for cloud, colors, words in (([[1, 2, 3]], np.zeros((2, 3), np.uint8), "as many colours"), ([[1, 2, 3]], [[0.1, 0.2, 0.3]], "uint8"), ([1, 2, 3], None, "N x 3"),
                                 (np.zeros((5, 3)), np.uint8(3), "colors are")):
        expect_refused(words, lambda: egosgm.write_ply("x.ply", cloud, colors))

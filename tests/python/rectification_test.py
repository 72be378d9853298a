# SPDX-License-Identifier: Apache-2.0
"""Rectification from Python: a rig given as arrays or read from a file."""
import numpy as np
import pytest

import egosgm

WIDTH, HEIGHT, BASELINE = 160, 64, 0.25
MATRIX = np.array([[150, 0, 79.5], [0, 150, 31.5], [0, 0, 1]])


def rig(**changes):
    return egosgm.StereoRig(**{"left_matrix": MATRIX, "left_distortion": np.zeros(5), "right_matrix": MATRIX.tolist(), "right_distortion": [0] * 4,
                               "R": np.eye(3), "T": [-BASELINE, 0, 0], **changes})


def test_cameras_that_are_turned_alike_give_the_images_turned():
    rectification = egosgm.Rectification(rig(), WIDTH, HEIGHT)
    assert rectification.calibration.baseline_m == pytest.approx(BASELINE)
    assert rectification.valid.shape == (HEIGHT, WIDTH) and rectification.valid.dtype == np.uint8
    x, y, width, height = rectification.valid_left
    assert (rectification.valid[y:y + height, x:x + width] == 255).all()
    ramp = np.repeat(np.arange(WIDTH, dtype=np.uint16)[None] * 100, HEIGHT, 0)
    left, right = rectification.rectify(ramp, ramp[:, ::-1][::-1])
    assert left.dtype == np.uint16 and left.shape == ramp.shape
    f, cx = rectification.calibration.fx, rectification.calibration.cx
    at = 150 * (np.arange(WIDTH) - cx) / f + 79.5  # where the raw camera has the column
    inside = (at > 1) & (at < WIDTH - 2)
    assert inside.sum() > WIDTH // 2
    assert np.abs(left[HEIGHT // 2].astype(float) - 100 * at)[inside].max() < 5
    assert np.abs(right[HEIGHT // 2].astype(float) - 100 * (WIDTH - 1 - at))[inside].max() < 5


def test_a_file_of_opencv_is_a_rig(tmp_path):
    def matrix(name, values):
        values = np.atleast_2d(values)
        return f"{name}: !!opencv-matrix\n   rows: {values.shape[0]}\n   cols: {values.shape[1]}\n   dt: d\n   data: {values.ravel().tolist()}\n"

    file = tmp_path / "rig.yml"
    text = "%YAML:1.0\n---\n" + "".join(matrix(name, value) for name, value in (
        ("K1", MATRIX), ("K2", MATRIX), ("D1", np.zeros((1, 5))), ("D2", np.zeros((1, 5))), ("R", np.eye(3)), ("T", [[-250.0], [0.0], [0.0]])))
    file.write_text(text + f"image_width: {WIDTH}\nimage_height: {HEIGHT}\n")
    read = egosgm.read_opencv_rig(file, unit_m=1e-3)
    assert read.size == (WIDTH, HEIGHT) and not read.is_fisheye
    assert egosgm.Rectification(read, WIDTH, HEIGHT).calibration.baseline_m == pytest.approx(BASELINE)
    with pytest.raises(egosgm.InvalidArgument, match="were calibrated"):
        egosgm.Rectification(read, WIDTH + 2, HEIGHT)
    (tmp_path / "calib.txt").write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    assert egosgm.read_opencv_rig(tmp_path / "calib.txt") is None
    with pytest.raises(egosgm.InvalidArgument, match="sensor.yaml"):
        egosgm.read_euroc_rig(tmp_path)


def test_what_is_no_rig_is_refused():
    for changes, named in (({"T": [BASELINE, 0, 0]}, "exchange left and right"), ({"T": [-1, 0]}, "T: needs 3x1"),
                           ({"left_matrix": np.eye(2)}, "M1: needs 3x3"), ({"R": 2 * np.eye(3)}, "R is no rotation"),
                           ({"left_distortion": np.zeros(3)}, "D1: needs 4"), ({"size": (1, 1)}, "1x1 were calibrated")):
        with pytest.raises(egosgm.InvalidArgument, match=named):
            egosgm.Rectification(rig(**changes), WIDTH, HEIGHT)
    with pytest.raises(egosgm.InvalidArgument, match="dimensions"):
        rig(R=np.zeros((1, 1, 1)))
    rectification = egosgm.Rectification(rig(), WIDTH, HEIGHT)
    image = np.zeros((HEIGHT, WIDTH + 1), np.uint8)
    with pytest.raises(egosgm.InvalidArgument, match="an image is 161x64"):
        rectification.rectify(image, image)


def test_points_of_rectified_images_lie_in_equal_rows():
    frame = egosgm.SyntheticSequence(frames=1, width=320, height=128, seed=5).render(0)
    matches = egosgm.match_pair(frame.left, frame.right)
    assert matches.ndim == 2 and matches.shape[1] == 4 and len(matches) > 50
    assert np.median(np.abs(matches[:, 1] - matches[:, 3])) < 0.2
    assert (matches[:, 0] - matches[:, 2] > -1).all()
    with pytest.raises(egosgm.InvalidArgument, match="one size"):
        egosgm.match_pair(frame.left, frame.right[:, :300])

# SPDX-License-Identifier: Apache-2.0
"""Rectification from Python: a rig given as arrays or read from a file."""
import numpy as np
import pytest

import egosgm
from refusals import expect_refused

cv2 = pytest.importorskip("cv2")

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


def test_points_of_rectified_images_lie_in_equal_rows():
    frame = egosgm.SyntheticSequence(frames=1, width=320, height=128, seed=5).render(0)
    matches = egosgm.match_pair(frame.left, frame.right)
    assert matches.ndim == 2 and matches.shape[1] == 4 and len(matches) > 50
    assert np.median(np.abs(matches[:, 1] - matches[:, 3])) < 0.2
    assert (matches[:, 0] - matches[:, 2] > -1).all()
    expect_refused("one size", lambda: egosgm.match_pair(frame.left, frame.right[:, :300]))


def turned(is_fisheye=False, **changes):
    """Turned and distorted cameras."""
    left, right = ([0.06, -0.02, 0.004, -0.001], [0.05, -0.015, 0.003, -0.0008]) if is_fisheye else \
        ([-0.12, 0.03, 0.001, -0.0005, 0], [-0.1, 0.02, -0.0008, 0.0006, 0])
    return egosgm.StereoRig(**{"left_matrix": [[150, 0, 82], [0, 148, 59], [0, 0, 1]], "left_distortion": left,
                               "right_matrix": [[146, 0, 77], [0, 149, 61], [0, 0, 1]], "right_distortion": right, "is_fisheye": is_fisheye,
                               "R": cv2.Rodrigues(np.array([0.02, -0.015, 0.01]))[0], "T": [-BASELINE, 0.004, -0.006], **changes})


def places(rectification):
    """Where each rectified pixel lies in the raw images: columns and rows, by remapping them."""
    columns = np.repeat(np.arange(160, dtype=np.uint16)[None] * 400, 120, 0)
    rows = np.repeat(np.arange(120, dtype=np.uint16)[:, None] * 400, 160, 1)
    return [np.stack(both, -1) / 400 for both in zip(rectification.rectify(columns, columns), rectification.rectify(rows, rows))]


@pytest.mark.parametrize("is_fisheye", (False, True))
def test_rays_of_a_row_meet_at_the_depth_of_the_disparity(is_fisheye):
    rig = turned(is_fisheye)
    rectification = egosgm.Rectification(rig, 160, 120)
    c = rectification.calibration
    assert c.baseline_m == pytest.approx(np.linalg.norm(rig.T), abs=1e-9) and c.doffs_px == pytest.approx(0, abs=1e-9)
    undistort = cv2.fisheye.undistortPoints if is_fisheye else cv2.undistortPoints
    left_places, right_places = places(rectification)

    def ray(place, matrix, distortion):
        return np.append(undistort(place.reshape(1, 1, 2), np.array(matrix), np.array(distortion)).ravel(), 1)

    for y in range(20, 100, 13):
        for x in range(40, 140, 17):
            for disparity in (4, 15):
                left = rig.R @ ray(left_places[y, x], rig.left_matrix, rig.left_distortion)
                right = ray(right_places[y, x - disparity], rig.right_matrix, rig.right_distortion)
                (a, b), *_ = np.linalg.lstsq(np.stack([left, -right], 1), -rig.T, rcond=None)  # a left + T = b right
                assert np.linalg.norm(a * left + rig.T - b * right) < 2e-3 * a
                distance = c.fx * c.baseline_m / disparity * np.linalg.norm([(x - c.cx) / c.fx, (y - c.cy) / c.fy, 1])
                assert a * np.linalg.norm(left) == pytest.approx(distance, rel=0.03)


@pytest.mark.parametrize("is_fisheye", (False, True))
def test_valid_is_what_the_raw_image_has(is_fisheye):
    rectification = egosgm.Rectification(turned(is_fisheye), 160, 120)
    white = np.full((120, 160), 60000, np.uint16)
    for image, (x, y, width, height) in zip(rectification.rectify(white, white), (rectification.valid_left, rectification.valid_right)):
        assert image.dtype == np.uint16 and width * height > 160 * 120 / 2
        assert (image[y:y + height, x:x + width] == 60000).all()
    wide = egosgm.Rectification(turned(is_fisheye), 160, 120, 1.0)
    x, y, width, height = wide.valid_left
    valid = wide.valid == 255
    assert valid[y:y + height, x:x + width].all() and not valid.all()
    sums = np.pad(valid.cumsum(0).cumsum(1), ((1, 0), (1, 0)))
    for rows in range(1, 121):
        for columns in range(width * height // rows + 1, 161):  # each rectangle that would be larger
            inside = sums[rows:, columns:] - sums[:-rows, columns:] - sums[rows:, :-columns] + sums[:-rows, :-columns]
            assert (inside < rows * columns).all()


def test_of_rectified_cameras_nothing_changes():
    matrix = np.array([[150, 0, 79.5], [0, 150, 59.5], [0, 0, 1]])
    left = np.hstack([matrix, np.zeros((3, 1))])
    right = np.hstack([matrix, [[-150 * BASELINE], [0], [0]]])
    rectification = egosgm.Rectification(rig(left_matrix=matrix, right_matrix=matrix, given=(np.eye(3), np.eye(3), left, right)), 160, 120)
    c = rectification.calibration
    assert (c.fx, c.cx, c.baseline_m) == (150, 79.5, BASELINE) and rectification.valid_left == (0, 0, 160, 120)
    image = np.random.default_rng(1).integers(0, 256, (120, 160, 3)).astype(np.uint8)
    assert (rectification.rectify(image, image)[1] == image).all()


def projection(fx=150, fy=150, cy=59.5):
    return np.array([[fx, 0, 79.5, -fx * BASELINE], [0, fy, cy, 0], [0, 0, 1, 0]])


def test_what_no_rig_has_is_named():
    for changes, named in (({"T": [1000 * -BASELINE, 0, 0]}, "unit_m 0.001"), ({"T": [0.004, -BASELINE, 0]}, "side by side"), ({"T": [0, 0, 0]}, "one place"),
                           ({"T": [[-BASELINE, 0, 0]]}, "T: needs 3x1"), ({"T": [BASELINE, 0, 0]}, "exchange left and right"),
                           ({"left_matrix": np.eye(2)}, "M1: needs 3x3"), ({"left_distortion": np.zeros(3)}, "D1: needs 4"), ({"size": (1, 1)}, "1x1 were calibrated"),
                           ({"R": [[1, 0, 0], [0, np.nan, 0], [0, 0, 1]]}, "R: needs 3x3"),
                           ({"right_matrix": np.zeros((3, 3))}, "M2 is no camera matrix"),
                           ({"left_matrix": projection()[:, :3].T}, "M1 is no camera matrix"), ({"left_matrix": projection(fx=-150)[:, :3]}, "M1 is no camera matrix"),
                           ({"right_matrix": np.diag([1.25, 1.25, 1]) @ turned().left_matrix}, "M1 and M2 are of images of two sizes: .* 1.25 times"),
                           ({"right_matrix": np.diag([0.5, 0.5, 1]) @ turned().left_matrix}, "two sizes: .* 2 times"), ({"R": np.diag([1, 1, -1])}, "R is no rotation"), ({"R": 2 * np.eye(3)}, "R is no rotation"), ({"R": np.diag([-1, -1, 1])}, "R turns by 180 degrees.*is it a vector in degrees"),
                           ({"given": (2 * np.eye(3), np.eye(3), np.eye(3, 4), np.eye(3, 4))}, "R1 is no rotation"),
                           ({"given": (np.eye(3),) * 3}, "belong together"),
                           *(({"given": (np.eye(3), np.eye(3), projection(), projection(**{name: value}))}, "P1 and P2 have different")
                             for name, value in (("fx", 151), ("fy", 151), ("cy", 60)))):
        expect_refused(named, lambda: egosgm.Rectification(turned(**changes), 160, 120))
    for size, alpha, named in (((160, 120), 1.5, "alpha 1.5"), ((0, 5), 0, "size 0x5")):
        expect_refused(named, lambda: egosgm.Rectification(turned(), *size, alpha))
    rectification = egosgm.Rectification(turned(), 160, 120)
    expect_refused("left: is float32", lambda: rectification.rectify(np.zeros((120, 160), np.float32), np.zeros((120, 160), np.uint8)))
    expect_refused("an image is 161x120", lambda: rectification.rectify(*[np.zeros((120, 161), np.uint8)] * 2))
    expect_refused("dimensions", lambda: turned(R=np.zeros((1, 1, 1))))


@pytest.mark.parametrize("name", ("rig.yml", "rig.xml", "rig.json"))
def test_what_opencv_writes_is_read(name, tmp_path):
    cameras = turned()

    def write(file, whole, rotation=cameras.R):
        storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
        for key, value in (("K1", cameras.left_matrix), ("D1", cameras.left_distortion), ("D2", cameras.right_distortion), ("R", rotation),
                           ("T", 1000 * cameras.T), *([("K2", cameras.right_matrix)] if whole else [])):
            storage.write(key, value)
        storage.write("image_width", 160)
        storage.write("image_height", 120)
        storage.release()

    write(tmp_path / name, True)
    read = egosgm.read_opencv_rig(tmp_path / name, 1e-3)
    for member in ("left_matrix", "right_matrix", "R"):
        np.testing.assert_allclose(getattr(read, member), getattr(cameras, member), atol=1e-9)
    for member in ("left_distortion", "right_distortion", "T"):
        np.testing.assert_allclose(np.ravel(getattr(read, member)), getattr(cameras, member), atol=1e-9)
    assert read.size == (160, 120) and read.given is None
    write(tmp_path / name, True, cv2.Rodrigues(cameras.R)[0])
    np.testing.assert_allclose(egosgm.read_opencv_rig(tmp_path / name).R, cameras.R, atol=1e-9)
    expect_refused("fisheye model has 4", lambda: egosgm.read_opencv_rig(tmp_path / name, 1, True))
    write(tmp_path / name, False)
    expect_refused("lacks right_matrix", lambda: egosgm.read_opencv_rig(tmp_path / name))
    expect_refused("nothing.yml", lambda: egosgm.read_opencv_rig(tmp_path / "nothing.yml"))
    (tmp_path / "calib.txt").write_text("P0: 1 0 0 0 0 1 0 0 0 0 1 0\n")
    assert egosgm.read_opencv_rig(tmp_path / "calib.txt") is None
    expect_refused("sensor.yaml", lambda: egosgm.read_euroc_rig(tmp_path))


def test_nesting_has_a_bound(tmp_path):
    yaml, json, xml = "%YAML:1.0\n---\nM1: ", '{"M1":', '<?xml version="1.0"?>\n<opencv_storage>'
    for start, part in ((yaml, "["), (yaml, "{data: "), (yaml, "a: "), (yaml, "- "), (yaml, "-\t"), (json, "["), (json, '{"data":'), (xml, "<a>"),
                        (xml, '<a b="1">')):
        (tmp_path / "nested.yml").write_text(start + 100000 * part)
        expect_refused("nested or named parts", lambda: egosgm.read_opencv_rig(tmp_path / "nested.yml"))

# SPDX-License-Identifier: Apache-2.0
"""A street, its frames and a pipeline for each file of tests, by the file's own WIDTH, HEIGHT, FRAMES, SEED and OPTIONS."""
import egosgm
import numpy as np
import pytest


@pytest.fixture(scope="module")
def street(request):
    file = request.module
    return egosgm.SyntheticSequence(frames=file.FRAMES, width=file.WIDTH, height=file.HEIGHT, seed=file.SEED)


@pytest.fixture(scope="module")
def frames(request, street):
    return [street.render(i) for i in range(request.module.FRAMES)]


@pytest.fixture(scope="module")
def shared_pipeline(request, street):
    return egosgm.Pipeline(street.calibration, request.module.WIDTH, request.module.HEIGHT, **request.module.OPTIONS)


@pytest.fixture
def street_folder(street, frames, tmp_path):
    """The street in the layout of KITTI odometry."""
    folder = tmp_path / "out/demo/street"
    for side in (0, 1):
        (folder / f"image_{side}").mkdir(parents=True)
        for i, frame in enumerate(frames):
            egosgm.write_disparity(folder / f"image_{side}/{i:06d}.png", (frame.left, frame.right)[side].astype(np.float32))
    c = street.calibration
    (folder / "calib.txt").write_text("".join(
        f"P{i}: {c.fx} 0 {c.cx} {-c.fx * c.baseline_m * (i % 2)} 0 {c.fy} {c.cy} 0 0 0 1 0\n" for i in range(4)))
    return folder


@pytest.fixture
def calib(street, tmp_path):
    file = tmp_path / "calib.txt"
    egosgm._egosgm._write_new_calibration(file, street.calibration)
    return str(file)


@pytest.fixture
def videos(frames, tmp_path):
    """Both cameras as videos without loss, and one of both views."""
    cv2 = pytest.importorskip("cv2")
    files = [str(tmp_path / name) for name in ("left.avi", "right.avi", "both.avi")]
    for file, of in zip(files, (lambda f: f.left, lambda f: f.right, lambda f: np.hstack([f.left, f.right]))):
        images = [cv2.cvtColor(of(frame), cv2.COLOR_GRAY2BGR) for frame in frames]
        writer = cv2.VideoWriter(file, cv2.VideoWriter_fourcc(*"FFV1"), 4, images[0].shape[1::-1])
        for image in images:
            writer.write(image)
        writer.release()
    return files


@pytest.fixture
def rig(tmp_path):
    """The calibration of cameras whose images are raw, as OpenCV writes it."""
    cv2 = pytest.importorskip("cv2")
    matrix = np.array([[300, 0, 170], [0, 300, 50], [0, 0, 1.0]])
    file = str(tmp_path / "rig.yml")
    storage = cv2.FileStorage(file, cv2.FILE_STORAGE_WRITE)
    values = dict(M1=matrix, D1=np.array([[-0.1, 0.02, 0, 0, 0]]), M2=matrix, D2=np.zeros((1, 5)), R=np.eye(3), T=np.array([[-0.25], [0.0], [0.0]]))
    for name, value in values.items():
        storage.write(name, value)
    storage.release()
    return file

# SPDX-License-Identifier: Apache-2.0
"""One rig, written as each program writes it, and what is to be read of it."""
import json
import math

import numpy as np
import pytest

import egosgm

yaml = pytest.importorskip("yaml")

F, CX, CY, B, WIDTH, HEIGHT = 460.0, 319.5, 239.5, 0.3, 640, 480
K = [[F, 0, CX], [0, F, CY], [0, 0, 1]]
P = [[F, 0, CX, 0], [0, F, CY, 0], [0, 0, 1, 0]]
RIGHT_P = [[F, 0, CX, -F * B], [0, F, CY, 0], [0, 0, 1, 0]]
EYE = np.eye(3).tolist()
SHIFT = [[1, 0, 0, -B], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
BACK = [[1, 0, 0, B], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
Q = [[1, 0, 0, -CX], [0, 1, 0, -CY], [0, 0, 0, F], [0, 0, 1 / B, 0]]
LENS = [-0.1, 0.05, 0.001, -0.001]


def flat(matrix):
    return np.ravel(matrix).tolist()


def ros(p, lens=(0, 0, 0, 0, 0)):
    matrix = lambda rows, columns, data: dict(rows=rows, cols=columns, data=flat(data))  # noqa: E731
    return yaml.safe_dump(dict(image_width=WIDTH, image_height=HEIGHT, camera_name="one", distortion_model="plumb_bob",
                               camera_matrix=matrix(3, 3, K), distortion_coefficients=matrix(1, 5, lens),
                               rectification_matrix=matrix(3, 3, EYE), projection_matrix=matrix(3, 4, p)))


def kalibr(lens=(0, 0, 0, 0), model="radtan", **second):
    camera = dict(camera_model="pinhole", distortion_coeffs=list(lens), distortion_model=model, intrinsics=[F, F, CX, CY],
                  resolution=[WIDTH, HEIGHT])
    return yaml.safe_dump(dict(cam0=camera, cam1=dict(camera, **(second or dict(T_cn_cnm1=SHIFT)))))


def opencv_yaml(**matrices):
    rows = ["%YAML:1.0", "---"]
    for name, value in matrices.items():
        value = np.atleast_2d(value)
        rows += [f"{name}: !!opencv-matrix", f"   rows: {value.shape[0]}", f"   cols: {value.shape[1]}", "   dt: d", f"   data: {flat(value)}"]
    return "\n".join(rows) + "\n"


RECTIFIED = {
    "own.txt": f"fx = {F}\nfy = {F}\ncx = {CX}\ncy = {CY}\nbaseline_m = {B}\n",
    "kitti.txt": f"P0: {' '.join(map(str, flat(P)))}\nP1: {' '.join(map(str, flat(RIGHT_P)))}\n",
    "camera.json": json.dumps(dict(extrinsic=dict(baseline=B, pitch=0.03), intrinsic=dict(fx=F, fy=F, u0=CX, v0=CY))),
    "flat.json": json.dumps(dict(width=WIDTH, height=HEIGHT, fx=F, fy=F, cx0=CX, cx1=CX, cy=CY, baseline_meters=B, depth_range=[1, 5])),
    "flat.yaml": yaml.safe_dump(dict(focal_length=F, ppx=CX, ppy=CY, baseline_mm=1000 * B)),
    "own.json": json.dumps(dict(fx=F, fy=F, cx=CX, cy=CY, baseline_m=B)),
    "cam_to_cam.yaml": yaml.safe_dump(dict(intrinsics=dict(cam0=dict(camera_matrix=[1, 2, 3, 4])), disparity_to_depth=dict(cams_12=Q))),
    "few.yaml": f"f: {F}\nB: {B}\ncx: {CX}\ncy: {CY}\n",
    "rendered.json": json.dumps(dict(image_size_x=WIDTH, image_size_y=HEIGHT, fov=math.degrees(2 * math.atan(WIDTH / 2 / F)), baseline=B)),
    "rendered.txt": f"# a camera of a simulator\nimage_size_x={WIDTH}\nimage_size_y={HEIGHT}\nhfov = {math.degrees(2 * math.atan(WIDTH / 2 / F))}\nB={B}\n",
    "rendered.yaml": yaml.safe_dump(dict(camera=dict(width=WIDTH, height=HEIGHT, vfov_deg=math.degrees(2 * math.atan(HEIGHT / 2 / F))), baseline=B)),
    "K.txt": " ".join(map(str, flat(K))) + f"\n{B}\n",
    "q.yml": opencv_yaml(Q=Q),
    "q_of_python.json": json.dumps(dict(Q=Q)),
    "orb_slam2.yaml": f"%YAML:1.0\nCamera.fx: {F}\nCamera.fy: {F}\nCamera.cx: {CX}\nCamera.cy: {CY}\nCamera.bf: {F * B}\n",
    "orb_slam3.yaml": f'%YAML:1.0\nFile.version: "1.0"\nCamera.type: "Rectified"\nCamera1.fx: {F}\nCamera1.fy: {F}\nCamera1.cx: {CX}\nCamera1.cy: {CY}\nStereo.b: {B}\n',
    "kalibr.yaml": kalibr(),
    "basalt.json": json.dumps(dict(value0=dict(T_imu_cam=[dict(px=x, py=0, pz=0, qx=0, qy=0, qz=0, qw=1) for x in (1.0, 1.0 + B)], resolution=[[WIDTH, HEIGHT]] * 2,
                                               intrinsics=[dict(camera_type="pinhole", intrinsics=dict(fx=F, fy=F, cx=CX, cy=CY))] * 2))),
    "kalibr_imu.yaml": kalibr(T_cam_imu=SHIFT).replace("cam1:", "cam1:", 1).replace("cam0:\n", f"cam0:\n  T_cam_imu: {np.eye(4).tolist()}\n"),
    "openvins.yaml": kalibr(T_imu_cam=np.linalg.inv(SHIFT).tolist()).replace("cam0:\n", f"cam0:\n  T_imu_cam: {np.eye(4).tolist()}\n"),
    "kalibr_none.yaml": kalibr(model="none", lens=()),
    "kalibr_of_others.yaml": kalibr().replace("cam1:", "cam2:").replace("cam0:", "cam1:"),
}
RAW = {
    "opencv.yml": opencv_yaml(M1=K, D1=LENS, M2=K, D2=LENS, R=EYE, T=[[-B], [0], [0]]),
    "nested.json": json.dumps(dict(K1=K, D1=[LENS], K2=K, D2=[LENS], R=EYE, T=[[-B], [0], [0]])),
    "nested.yaml": yaml.safe_dump(dict(K1=K, D1=LENS, K2=K, D2=LENS, R=EYE, T=[-B, 0, 0])),
    "names.yaml": yaml.safe_dump(dict(left_camera_matrix=K, left_distortion=LENS, right_camera_matrix=K, right_distortion=LENS, R=EYE, T=[-B, 0, 0])),
    "numbered.json": json.dumps(dict(left_camera_matrix=K, left_distortion=[LENS], mtx2=K, dist2=LENS, R=EYE, T=[[-B], [0], [0]])),
    "others.json": json.dumps(dict(mtx_l=K, dist_l=[LENS], mtx_r=K, dist_r=[LENS], rotation_matrix=EYE, translation_vector=[[-B], [0], [0]])),
    "in_groups.json": json.dumps(dict(left=dict(camera_matrix=K, dist_coeffs=LENS), right=dict(camera_matrix=K, dist_coeffs=LENS),
                                      stereo=dict(R=EYE, T=[-B, 0, 0]))),
    "kalibr_lens.yaml": kalibr(LENS),
    "oak.json": json.dumps(dict(boardName="OAK-D", cameraData=[
        [socket, dict(distortionCoeff=[*LENS, *[0] * 10], intrinsicMatrix=K, width=WIDTH, height=HEIGHT, extrinsics=dict(
            rotationMatrix=EYE, toCameraSocket=0, translation=dict(x=x, y=0, z=0)))] for socket, x in ((1, -5.0), (2, 100 * B - 5.0))]
        + [[0, dict(distortionCoeff=[0] * 14, intrinsicMatrix=K, extrinsics=dict(rotationMatrix=[], toCameraSocket=-1))]])),
    "orb_slam3_raw.yaml": "%YAML:1.0\nCamera.type: \"PinHole\"\n" + "".join(
        f"{camera}.{name}: {value}\n" for camera in ("Camera1", "Camera2")
        for name, value in dict(fx=F, fy=F, cx=CX, cy=CY, k1=LENS[0], k2=LENS[1], p1=LENS[2], p2=LENS[3]).items()) + opencv_yaml(
            **{"Stereo.T_c1_c2": BACK}).partition("---\n")[2],
}


def read(folder, name, text, **how):
    (folder / name).write_text(text)
    return egosgm.read_calibration(folder / name, **how)


def expect_rectified(found):
    assert [found.fx, found.fy, found.cx, found.cy, found.baseline_m, found.doffs_px] == pytest.approx([F, F, CX, CY, B, 0], abs=1e-9)


def expect_raw(found):
    assert isinstance(found, egosgm.StereoRig)
    expected = egosgm.Rectification(egosgm.StereoRig(K, LENS, K, LENS, np.eye(3), [-B, 0, 0]), WIDTH, HEIGHT)
    same = egosgm.Rectification(found, WIDTH, HEIGHT)
    assert same.calibration.baseline_m == pytest.approx(B) and same.calibration.fx == pytest.approx(expected.calibration.fx)
    image = np.random.default_rng(1).integers(0, 255, (HEIGHT, WIDTH)).astype(np.uint8)
    np.testing.assert_array_equal(same.rectify(image, image)[0], expected.rectify(image, image)[0])

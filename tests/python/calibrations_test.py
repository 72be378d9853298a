# SPDX-License-Identifier: Apache-2.0
"""Calibrations of other programs: what is read of them, and what is refused."""
import contextlib
import gzip
import json
import os
import random
import re

import numpy as np
import pytest

import egosgm
from calibration_case import (B, BACK, CX, CY, EYE, F, HEIGHT, K, LENS, P, Q, RAW, RECTIFIED, RIGHT_P, SHIFT, WIDTH, expect_raw, expect_rectified, flat, kalibr,
                              opencv_yaml, read, ros, yaml)
from refusals import expect_refused


@pytest.mark.parametrize("name", [*RECTIFIED, *RAW])
def test_of_each_program(name, tmp_path):
    text, expect = (RECTIFIED[name], expect_rectified) if name in RECTIFIED else (RAW[name], expect_raw)
    expect(read(tmp_path, name, text))


@pytest.mark.parametrize("name, text", [
    ("kalibr.yaml", kalibr()), ("left.yaml", ros(P)), ("orb_slam.yaml", RECTIFIED["orb_slam3.yaml"] + f"Camera.width: {WIDTH}\nCamera.height: {HEIGHT}\n"),
    ("flat.json", RECTIFIED["flat.json"]), ("q.json", json.dumps(dict(Q=Q, image_size=[WIDTH, HEIGHT]))),
    ("nested.json", json.dumps(dict(Q=Q, image_size=dict(width=WIDTH, height=HEIGHT)))), ("text.json", json.dumps(dict(Q=Q, resolution=f"{WIDTH}x{HEIGHT}"))),
    ("inner.json", json.dumps(dict(intrinsics=dict(fx=F, cx=CX, cy=CY, width=WIDTH, height=HEIGHT), baseline=B))),
    ("kitti.txt", RECTIFIED["kitti.txt"].replace("P", "P_rect_0") + f"S_rect_00: {WIDTH} {HEIGHT}\n"),
    ("middlebury.txt", f"cam0=[{F} 0 {CX}; 0 {F} {CY}; 0 0 1]\ncam1=[{F} 0 {CX}; 0 {F} {CY}; 0 0 1]\nbaseline={1000 * B}\nwidth={WIDTH}\nheight={HEIGHT}\n"),
], ids=lambda value: value if "." in value[:16] else "")
def test_of_rectified_images_of_another_size(name, text, tmp_path):
    (tmp_path / "right.yaml").write_text(ros(RIGHT_P))  # beside ROS's left.yaml
    expect_rectified(read(tmp_path, name, text, size=np.array([WIDTH, HEIGHT])))
    expect_refused(f"{name}.*is of images of 640x480, and these have 320x240", lambda: read(tmp_path, name, text, size=(WIDTH // 2, HEIGHT // 2)))


def test_a_size_is_a_width_and_a_height(tmp_path):
    expect_raw(read(tmp_path, "kalibr_lens.yaml", RAW["kalibr_lens.yaml"], size=(WIDTH, HEIGHT)))
    expect_refused("size 640: give .width, height.", lambda: read(tmp_path, "kalibr_lens.yaml", RAW["kalibr_lens.yaml"], size=WIDTH))


def test_two_files_of_ros_and_of_kimera(tmp_path):
    expect_refused("is the calibration of one camera", lambda: read(tmp_path, "left.yaml", ros(P)))
    (tmp_path / "right.yaml").write_text(ros(RIGHT_P).replace(str(WIDTH), "1280"))
    expect_refused("left.yaml.*of two resolutions, 640x480 and 1280x480", lambda: read(tmp_path, "left.yaml", ros(P)))
    (tmp_path / "right.yaml").write_text(ros(RIGHT_P))
    for given in ("left.yaml", "right.yaml", "."):
        expect_rectified(egosgm.read_calibration(tmp_path / given))
    lens = [*LENS, 0]
    (tmp_path / "right.yaml").write_text(ros(RIGHT_P, lens))
    assert isinstance(egosgm.read_calibration(tmp_path), egosgm.StereoRig)
    (tmp_path / "left.yaml").write_text(ros(P, lens))
    (tmp_path / "right.yaml").write_text(ros(RIGHT_P, lens))
    expect_raw(egosgm.read_calibration(tmp_path))
    folder = tmp_path / "kimera"
    folder.mkdir()
    for name, pose in (("Left", np.eye(4)), ("Right", np.array(BACK))):
        (folder / f"{name}CameraParams.yaml").write_text("%YAML:1.0\n" + yaml.safe_dump(dict(
            camera_id=name, T_BS=dict(rows=4, cols=4, data=flat(pose)), intrinsics=[F, F, CX, CY], distortion_model="radial-tangential",
            distortion_coefficients=LENS, resolution=[WIDTH, HEIGHT])))
    expect_raw(egosgm.read_calibration(folder / "LeftCameraParams.yaml"))


def echoed(p, lens):
    """A camera info as `ros2 topic echo` prints it."""
    return "---\n".join(["", yaml.safe_dump(dict(header=dict(frame_id="camera"), height=HEIGHT, width=WIDTH, distortion_model="plumb_bob", d=lens, k=flat(K),
                                                 r=flat(EYE), p=flat(p), binning_x=0, binning_y=0, roi=dict(x_offset=0, y_offset=0, height=0, width=0)))] * 2)


def test_a_file_for_each_camera_of_any_name(tmp_path):
    for lens, expect in (([0.0] * 5, expect_rectified), ([*LENS, 0], expect_raw)):
        for name, text in (("a.yaml", echoed(P, lens)), ("b.yaml", echoed(RIGHT_P, lens))):
            (tmp_path / name).write_text(text)
        expect(egosgm.read_calibration((tmp_path / "a.yaml", tmp_path / "b.yaml")))
    for change, named in ((("\nd:", "\nlens:"), "lacks distortion_coefficients"), (("d:\n- 0.0", "d:\n- x"), "d is not of finite numbers"),
                          (("r:\n- 1.0", "r:\n- x"), "r is not 9 finite numbers"), (("width: 640\n", ""), "lacks image_width or width")):
        (tmp_path / "edited.yaml").write_text(echoed(RIGHT_P, [0.0] * 5).replace(*change))
        expect_refused(f"edited.yaml: is a camera of ROS's calibrator,? and {named}", lambda: egosgm.read_calibration((tmp_path / "a.yaml", tmp_path / "edited.yaml")))
    (tmp_path / "b.yaml").write_text(echoed(2 * np.array(RIGHT_P), [0.0] * 5))
    (tmp_path / "c.yaml").write_text("a: 1\n")
    for names, named in (("ab", "a.yaml and .*b.yaml: camera info: P of both cameras have different focal lengths"), ("aaa", "one file, or one for each camera"),
                         ("aa", "a.yaml: is given for both cameras"), ("ac", "c.yaml: is not the calibration of one camera")):
        expect_refused(named, lambda: egosgm.read_calibration([tmp_path / f"{name}.yaml" for name in names]))


OAK = dict(RAW_OAK := json.loads(RAW["oak.json"]), cameraData=[
    [socket, dict(camera, width=1280, height=800, intrinsicMatrix=[[800, 0, 645], [0, 800, 394], [0, 0, 1]])] for socket, camera in RAW_OAK["cameraData"]])


@pytest.mark.parametrize("size, expected", [((1280, 800), (800, 645, 394)), ((640, 400), (400, 322.5, 197)), ((1280, 720), (800, 645, 354)), ((640, 360), (400, 322.5, 177)),
                                            ((640, 480), None), ((2560, 1600), None), ((1280, 801), None)])
def test_an_oak_is_read_for_the_sizes_of_its_streams(size, expected, tmp_path):
    (tmp_path / "oak.json").write_text(json.dumps(OAK))
    rig = egosgm.read_calibration(tmp_path / "oak.json", size=size)
    assert rig.size == (size if expected else (1280, 800))  # which Rectification refuses
    for k in (rig.left_matrix, rig.right_matrix) if expected else ():
        assert [k[0, 0], k[1, 1], k[0, 2], k[1, 2]] == pytest.approx([expected[0], *expected])


def cahv(place, turn, **others):
    """A camera whose axes are the rows of `turn`, as rovers describe it."""
    x, y, a = np.asarray(turn)
    vectors = dict(C=place, A=a, H=F * x + CX * a, V=F * y + CY * a, **others)
    return f"Model = CAHV = perspective, linear\nDimensions = {WIDTH} {HEIGHT}\n" + "".join(f"{name} = {' '.join(map(repr, flat(vector)))}\n" for name, vector in vectors.items())


def test_cameras_of_rovers(tmp_path):
    turn = np.array([[0.0, 1, 0], [0, 0, 1], [1, 0, 0]])  # the rover's x is ahead, its z down
    place = np.array([0.3, -0.2, -1.5])

    def read_both(left, right):
        (tmp_path / "right.cahv").write_text(right)
        return read(tmp_path, "left.cahv", left)

    expect_rectified(read_both(cahv(place, turn), cahv(place + B * turn[0], turn)))
    expect_rectified(egosgm.read_calibration((tmp_path / "left.cahv", tmp_path / "right.cahv")))
    expect_refused("of two resolutions, 640x480 and 1280x960", lambda: read_both(cahv(place, turn), cahv(place, turn).replace(f"{WIDTH} {HEIGHT}", "1280 960")))
    toed_in = np.array([[0.0, np.cos(0.01), np.sin(0.01)], [0, -np.sin(0.01), np.cos(0.01)], [1, 0, 0]])
    rig = read_both(cahv(place, turn), cahv(place + B * turn[0], toed_in))
    np.testing.assert_allclose(rig.R, toed_in @ turn.T, atol=1e-12)
    np.testing.assert_allclose(rig.T, toed_in @ (-B * turn[0]), atol=1e-12)
    lens = dict(O=turn[2], R=[0, -0.1, 0.05])
    assert read_both(cahv(place, turn, **lens), cahv(place + B * turn[0], turn, **lens)).left_distortion.tolist() == [-0.1, 0.05, 0, 0, 0]
    for others, named in ((dict(O=[1, 0, 0.01], R=[0, -0.1, 0]), "CAHVOR, whose lens has an axis O"), (dict(E=[0, 0, 0]), "CAHVORE"), (dict(R=[0, 1, 0]), "CAHVOR")):
        expect_refused(f"right.cahv: is a rover's camera .CAHV.*{named}", lambda: read_both(cahv(place, turn), cahv(place + B * turn[0], turn, **others)))


@pytest.mark.parametrize("name, text", [
    ("camera.yaml", f"%YAML:1.0\n---\nmodel_type: PINHOLE\nprojection_parameters:\n   fx: {F}\n   fy: {F}\n   cx: {CX}\n   cy: {CY}\n"),
    ("camera.json", json.dumps(dict(camera_matrix=K, dist_coeff=LENS))), ("camera.yml", opencv_yaml(K=K, D=LENS)), ("camera.npz", dict(K=np.array(K), T=np.eye(4))),
])
def test_two_cameras_that_do_not_say_how_they_stand(name, text, tmp_path):
    files = [tmp_path / f"{side}_{name}" for side in "ab"]
    for file in files:
        if isinstance(text, dict):
            np.savez(file, **text)
        else:
            file.write_text(text)
    expect_refused("each is the calibration of one camera alone, and neither says how the cameras stand", lambda: egosgm.read_calibration(files))


TRANSPOSED = np.transpose(K).tolist()


@pytest.mark.parametrize("text, named", [
    (RAW["nested.json"].replace(json.dumps(K), json.dumps(TRANSPOSED)), "M1"), (json.dumps(dict(Q=np.transpose(Q).tolist())), "Q"),
    (kalibr(T_cn_cnm1=np.transpose(SHIFT).tolist()), "T_cn_cnm1"), (RAW["oak.json"].replace(json.dumps(K), json.dumps(TRANSPOSED)), "intrinsicMatrix"),
    (f"cam0=[{F} 0 0; 0 {F} 0; {CX} {CY} 1]\ncam1=[{F} 0 0; 0 {F} 0; {CX} {CY} 1]\nbaseline={1000 * B}\n", "cam0"),
    (" ".join(map(str, flat(TRANSPOSED))) + f"\n{B}\n", "K"),
    (f"P0: {' '.join(map(str, flat(np.transpose(P))))}\nP1: {' '.join(map(str, flat(np.transpose(RIGHT_P))))}\n", "P0"),
])
def test_transposed_matrices_are_named(text, named, tmp_path):
    expect_refused(f"{named}:? is transposed, as MATLAB writes it", lambda: read(tmp_path, "calib.txt", text))


def test_vins_and_its_cameras(tmp_path):
    for i in (0, 1):
        (tmp_path / f"cam{i}.yaml").write_text("%YAML:1.0\n---\n" + yaml.safe_dump(dict(
            model_type="PINHOLE", image_width=WIDTH, image_height=HEIGHT, projection_parameters=dict(fx=F, fy=F, cx=CX, cy=CY),
            distortion_parameters=dict(zip(("k1", "k2", "p1", "p2"), LENS)))))
    (tmp_path / "config.yaml").write_text(opencv_yaml(body_T_cam0=np.eye(4), body_T_cam1=BACK)
                                          + f"num_of_cam: 2\ncam0_calib: cam0.yaml\ncam1_calib: cam1.yaml\nimage_width: {WIDTH}\nimage_height: {HEIGHT}\n")
    expect_raw(egosgm.read_calibration(tmp_path / "config.yaml"))
    expect_refused("is one camera of VINS", lambda: egosgm.read_calibration(tmp_path / "cam0.yaml"))


def test_a_zed_is_read_for_the_size_of_the_images(tmp_path):
    file = tmp_path / "SN1.conf"
    camera = "".join(f"{name}={value}\n" for name, value in dict(fx=F, fy=F, cx=CX, cy=CY, k1=LENS[0], k2=LENS[1], p1=LENS[2], p2=LENS[3]).items())
    file.write_text("".join(f"[{side}_CAM_{size}]\n{camera if size == 'VGA' else camera.replace(str(F), '1')}" for side in ("LEFT", "RIGHT") for size in ("HD", "VGA"))
                    + f"[STEREO]\nBaseline={1000 * B}\nTY=0.3\nTZ=-0.6\nRX_VGA=0.01\nCV_VGA=0.02\nRZ_VGA=-0.03\n")
    rig = egosgm.read_calibration(file, size=(672, 376))
    assert rig.size == (672, 376) and rig.T.tolist() == pytest.approx([-B, -0.0003, 0.0006])  # as Stereolabs' own samples rectify
    np.testing.assert_allclose(rig.left_matrix, K)
    np.testing.assert_allclose(rig.left_distortion[:4], LENS)
    np.testing.assert_allclose([rig.R[2, 1], rig.R[0, 2], rig.R[1, 0]], [0.01, 0.02, -0.03], atol=5e-4)
    for size, named in ((None, "nothing tells which"), ((640, 480), "images of 1280x720, 672x376, not of 640x480")):
        expect_refused(named, lambda: egosgm.read_calibration(file, size=size))


def test_virtual_kitti(tmp_path):
    (tmp_path / "intrinsic.txt").write_text("frame cameraID K[0,0] K[1,1] K[0,2] K[1,2]\n" + "".join(f"{i} {c} {F} {F} {CX} {CY}\n" for i in (0, 1) for c in (0, 1)))
    moved = np.array([[0, 0, 1, 5], [0, 1, 0, 2], [-1, 0, 0, 1], [0, 0, 0, 1.0]])
    rows = [f"{i} {c} {' '.join(map(str, flat((np.array(SHIFT) if c else np.eye(4)) @ moved)))}\n" for i in (0, 1) for c in (0, 1)]
    (tmp_path / "extrinsic.txt").write_text("frame cameraID r1,1 and so on\n" + "".join(rows))
    for name in ("intrinsic.txt", "extrinsic.txt"):
        expect_rectified(egosgm.read_calibration(tmp_path / name))


@pytest.mark.parametrize("content, named", [
    (b"\x80\x04\x95", "a pickle of Python"), (b"MATLAB 5.0 MAT-file", "a file of MATLAB"), (b"\x89HDF\r\n", "a file of MATLAB"),
    ("fx = 460\n".encode("utf-16"), "is UTF-16"), ("fx: 460\ncx: 320\n".encode("utf-16-le"), "is UTF-16"), (b"\x89PNG\r\n", "is a picture"), (b"<!DOCTYPE html>\n<html><body/></html>", "is a web page"),
])
def test_files_that_are_no_text(content, named, tmp_path):
    (tmp_path / "calib").write_bytes(content)
    expect_refused(named, lambda: egosgm.read_calibration(tmp_path / "calib"))


def test_arrays_of_numpy(tmp_path):
    arrays = dict(cam_mats_left=np.array(K), cam_mats_right=np.array(K), dist_coefs_left=np.array([LENS]), dist_coefs_right=np.array([LENS]),
                  rot_mat=np.eye(3), trans_vec=np.array([[-B], [0], [0]]))
    np.savez(tmp_path / "all.npz", **arrays)
    expect_raw(egosgm.read_calibration(tmp_path / "all.npz"))
    np.savez_compressed(tmp_path / "large.npz", M1=np.zeros(1 << 20))
    expect_refused("^[^:]*large.npz: holds more than 4 MiB", lambda: egosgm.read_calibration(tmp_path / "large.npz"))
    folder = tmp_path / "arrays"
    folder.mkdir()
    for name, array in arrays.items():
        np.save(folder / name, array)
    os.mkfifo(folder / "R_pipe.npy")  # which nobody writes to
    expect_raw(egosgm.read_calibration(folder))
    np.save(tmp_path / "Q.npy", np.array(Q))
    expect_rectified(egosgm.read_calibration(tmp_path / "Q.npy"))
    header = (tmp_path / "Q.npy").read_bytes()[:128].replace(b"(4, 4)", b"(90000, 90000)").replace(b" " * 8, b"", 1)
    (tmp_path / "large.npy").write_bytes(header + bytes(128))
    expect_refused("^[^[]*large.npy: is a calibration with a part that cannot be read .mmap length", lambda: egosgm.read_calibration(tmp_path / "large.npy"))
    expect_refused("None: give the name of a calibration's file", lambda: egosgm.read_calibration(None))


def test_what_is_packed(tmp_path):
    (tmp_path / "rig.yml.gz").write_bytes(gzip.compress(RAW["opencv.yml"].encode()))
    expect_raw(egosgm.read_calibration(tmp_path / "rig.yml.gz"))


def test_a_fisheye(tmp_path):
    for first in (0.01, 0):
        assert read(tmp_path, "chain.yaml", kalibr([first, 0, 0, 0], "equidistant")).is_fisheye
    lenses = dict(M1=np.array(K), D1=np.array(LENS), M2=np.array(K), D2=np.array(LENS), R=np.array(EYE), T=np.array([-B, 0, 0]))
    np.savez(tmp_path / "rig.npz", **lenses)
    assert egosgm.read_calibration(tmp_path / "rig.npz", is_fisheye=True).is_fisheye
    for name, text in {"radtan.yaml": kalibr(LENS), "own.txt": RECTIFIED["own.txt"], "q.yml": RECTIFIED["q.yml"]}.items():
        expect_refused(f"{name}: is of rectified images, or says itself what its lenses are", lambda: read(tmp_path, name, text, is_fisheye=True))
    oak = json.loads(RAW["oak.json"])
    oak["cameraData"][1][1]["width"] = 2 * WIDTH
    expect_refused("of two resolutions, 640x480 and 1280x480", lambda: read(tmp_path, "oak.json", json.dumps(oak)))
    oak["cameraData"][1][1]["width"] = WIDTH
    for kind in (1, 2):  # as DepthAI numbers its models of lenses
        for _, camera in oak["cameraData"][:2]:
            camera["cameraType"] = kind
        (tmp_path / f"oak{kind}.json").write_text(json.dumps(oak))
    rig = egosgm.read_calibration(tmp_path / "oak1.json")
    assert rig.is_fisheye and rig.left_distortion.tolist() == LENS
    expect_refused("lenses cameraType 2 and 2", lambda: egosgm.read_calibration(tmp_path / "oak2.json"))


@pytest.mark.parametrize("text, named", [
    (kalibr(camera_model="omni", T_cn_cnm1=SHIFT), "a camera chain of Kalibr, and cam1 is of the model \"omni\""),
    (kalibr(T_cn_cnm1=np.linalg.inv(SHIFT).tolist()), "the second camera stands left of the first"), (kalibr().replace("cam1:", "cam3:"), "of one camera: cam1 is missing"),
    (kalibr(rostopic="/right"), "lacks T_cn_cnm1"), (kalibr(model="fov", lens=[1.0]), "the model \"fov\""),
    (f"Camera.fx: {F}\nCamera.fy: {F}\nCamera.cx: {CX}\nCamera.cy: {CY}\n", "ORB-SLAM of one camera: it lacks Stereo.b or Camera.bf"),
    (json.dumps(dict(mtx=K, dist=LENS)), "lacks left_matrix, right_matrix"), ("- 1\n- 2\n", "not `key: value`"), ("a: [1, 2", "no YAML"),
    (" ".join(map(str, flat(K))), "a camera matrix alone"),
    (opencv_yaml(M1=K, D1=LENS, R=EYE, T=[[-B], [0], [0]]), "right_matrix"),
    (RAW["opencv.yml"].replace("D2:", "lens2:"), "lacks D2, the distortion: give zeros"), (kalibr("x"), "without coefficients of its distortion (radtan)"),
    (kalibr(LENS).replace("distortion_coeffs", "distortion"), "without coefficients of its distortion (radtan)"),
    (kalibr().replace("resolution", "resolutoin"), "resolutoin stands in place of resolution"),
    (kalibr([-0, 28, 0.07, 0.001, 0.002], "equidistant"), "distortion_coeffs of cam0 are 5 numbers, not 4: does a decimal comma"),
    (RECTIFIED["flat.json"].replace("width", "widht"), "the images' height alone"),
    (RAW["orb_slam3_raw.yaml"].replace("Camera2.k1", "Camera2.k"), "lacks Camera2.k1"),
    (f"f: {F}\nB: {B}\n", "lacks cx and cy, the principal point"), (f"f: {F}\nB: {B}\nwidth: 640\nheight: 480\n", "the middle would be cx 319.5, cy 239.5"),
    ("fov: 90\nbaseline: 0.3\n", "nothing tells the images' size"), ("fov: 1.5708\nbaseline: 0.3\nwidth: 640\nheight: 480\n", "in radians (90 degrees)"),
    (f"fx: {F}\nfy: 460,0\ncx: {CX}\ncy: {CY}\nbaseline: {B}\n", "its fy is '460,0', not one finite number"),
    (f"fx: {F}\ncx: {CX}\ncy: {CY}\nbaseline: 300 mm\n", "its baseline is '300 mm', not one finite number: write it with a decimal point and without a unit"),
    (RAW["nested.yaml"].replace("- - 460.0", "- - 460,0"), "its left_matrix and right_matrix are not of finite numbers"),
    *((kalibr(T_cn_cnm1=SHIFT, intrinsics=numbers), f"intrinsics {numbers} seem to be {order}") for numbers, order in (
        ([F, CX, F + 1, CY], "fx, cx, fy, cy"), ([CX, CY, F, F], "cx, cy, fx, fy"), ([F, CX, CY, F], "fx, cx, cy, fy"))),
    (kalibr(T_cn_cnm1=SHIFT, resolution=[1280, 960]), "of two resolutions, 640x480 and 1280x960"),
    (json.dumps(dict(K1=K, D1=LENS, K2=K, D2=LENS, R=[0, 12, 0], T=[-B, 0, 0])), "calib.yaml: R is a vector of the length 12, more than half a turn"),
    (json.dumps(dict(K1=K, D1=LENS, K2=K, D2=LENS, R=[0.5, -1.2, 0.3], T=[-B, 0, 0])), "calib.yaml: R turns by 76 degrees"),
    ("hfov: 69.7\nwidth: 640\nheight: 480\n", "lacks the baseline"),
    (RECTIFIED["orb_slam2.yaml"].replace(f"fx: {F}", "fx: -1"), "calib.yaml: calibration: fx is -1"),
    (json.dumps(dict(Q=[*Q[:3], [0, 0, -1 / B, 0]])), "a baseline of -0.3 m: are left and right swapped"), (json.dumps(dict(Q=[*Q[:3], [0, 0, 0, 0]])), "no baseline"),
])
def test_what_is_known_and_not_enough_is_named(text, named, tmp_path):
    expect_refused(re.escape(named), lambda: read(tmp_path, "calib.yaml", text))


ODD = ("", "nan", "1e400", "[]", "{}", "x", "null", "true", "0", "[[1], [2, 3]]", "{a: 1}", '"a"', "9" * 30)


def broken(text, rng):
    """With a word or a list of it replaced by something odd, or with a line less."""
    parts = list(re.finditer(rng.choice((r"[-\w.+]+", r"[\[{][^\[\]{}]*[\]}]")), text))
    if rng.random() < 0.1 or not parts:
        lines = text.splitlines(True)
        del lines[rng.randrange(len(lines))]
        return "".join(lines)
    part = rng.choice(parts)
    return text[:part.start()] + rng.choice(ODD) + text[part.end():]


def test_what_was_edited_is_read_or_refused(tmp_path):
    zed = "".join(f"[{side}_CAM_VGA]\nfx={F}\nfy={F}\ncx={CX}\ncy={CY}\nk1=0\n" for side in ("LEFT", "RIGHT")) + "[STEREO]\nBaseline=120\nRX_VGA=0.01\n"
    rng = random.Random(1)
    for name, text in {**RECTIFIED, **RAW, "zed.conf": zed}.items():
        for _ in range(40):
            with contextlib.suppress(egosgm.InvalidArgument):
                read(tmp_path, name, broken(text, rng), size=(672, 376))


def test_units_are_never_guessed(tmp_path):
    chain = kalibr(LENS, T_cn_cnm1=[[1, 0, 0, -30.0], *SHIFT[1:]])
    expect_refused("centimetres .0.3 m. or millimetres .0.03 m..*--unit cm.*--unit mm", lambda: read(tmp_path, "chain.yaml", chain))
    expect_raw(read(tmp_path, "chain.yaml", chain, unit_m=0.01))
    for name in ("own.txt", "q.yml"):
        expect_refused(f"{name}: is of rectified images.*leave --unit", lambda: read(tmp_path, name, RECTIFIED[name], unit_m=0.001))
        expect_rectified(read(tmp_path, name, RECTIFIED[name], unit_m=1))

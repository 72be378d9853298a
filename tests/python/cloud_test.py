# SPDX-License-Identifier: Apache-2.0
"""egosgm cloud: a run's frames in one cloud, of numbers by hand."""
import json

import numpy as np
import pytest

import egosgm
from egosgm.geometry import cloud
from egosgm.geometry.points import cloud_of_maps
from refusals import expect_refused

WIDTH, HEIGHT = 6, 4
CAMERA = dict(fx=100.0, fy=100.0, cx=2.0, cy=1.0, baseline_m=0.5, doffs_px=0.0)


@pytest.fixture
def run(tmp_path):
    """Two frames of a wall 5 m ahead; between them the camera goes 1 m to the right."""
    folder = tmp_path / "out"
    for kind in ("disparity", "variance"):
        (folder / kind).mkdir(parents=True)
    poses = np.stack([np.eye(4)] * 2)
    poses[1, 0, 3] = 1
    egosgm.write_poses(folder / "poses.txt", poses)
    for number in (0, 1):
        egosgm.write_disparity(folder / f"disparity/{number:06d}.png", np.full((HEIGHT, WIDTH), 10, np.float32))
        egosgm.write_pfm(folder / f"variance/{number:06d}.pfm", np.full((HEIGHT, WIDTH), 0.01, np.float32))
        image = np.full((HEIGHT, WIDTH), 51, np.float32)
        image[0, 0] = 255  # 16 bits are stretched to their maximum
        egosgm.write_disparity(tmp_path / f"left{number}.png", image)
    report = {"calibration": CAMERA, "frames": [{"frame": n, "left": str(tmp_path / f"left{n}.png")} for n in (0, 1)]}
    (folder / "report.json").write_text(json.dumps(report))
    return folder


def points_of(file, normals=False):
    header, body = file.read_bytes().split(b"end_header\n", 1)
    names = ["xyz"] + ["normal"] * normals + ["rgb"]
    rows = np.frombuffer(body, [(name, np.uint8 if name == "rgb" else "<f4", 3) for name in names])
    assert f"element vertex {len(rows)}\n".encode() in header
    return rows


def test_frames_meet_by_their_poses(run, capsys):
    assert cloud.main([str(run), "--voxel", "0.01", "--normals"]) == 0
    rows = points_of(run / "cloud.ply", normals=True)
    assert "48 points, of 100.0 %" in capsys.readouterr().out and len(rows) == 48
    np.testing.assert_allclose(rows["xyz"][:, 2], 5, rtol=1e-6)
    # Pixels 0 to 5 are -0.1 to 0.15 m of the axis; the second camera's, a metre more.
    np.testing.assert_allclose(np.unique(rows["xyz"][:, 0].round(4)), [*np.arange(-2, 4) * 0.05, *1 + np.arange(-2, 4) * 0.05], atol=1e-4)
    np.testing.assert_allclose(rows["normal"], np.tile([0, 0, -1], (48, 1)), atol=1e-6)
    corner = (np.abs(rows["xyz"] - (-0.1, -0.05, 5)).max(axis=1) < 1e-4) | (np.abs(rows["xyz"] - (0.9, -0.05, 5)).max(axis=1) < 1e-4)
    assert corner.sum() == 2 and (rows["rgb"][corner] == 255).all() and (rows["rgb"][~corner] == 51).all()
    (run / "left").mkdir()  # as a run of a bag writes them, before its folder is moved
    for number in (0, 1):
        (run.parent / f"left{number}.png").rename(run / f"left/{number:06d}.png")
    assert cloud.main([str(run), "--voxel", "0.01", "--normals", "--out", str(run / "moved.ply")]) == 0
    assert (run / "moved.ply").read_bytes() == (run / "cloud.ply").read_bytes()


def test_poses_that_stand_still_for_want_of_a_motion_are_told(run, capsys):
    report = json.loads((run / "report.json").read_text())
    for motion, is_told in ((None, True), ({"translation_m": [0, 0, 0]}, False)):
        for entry, own in zip(report["frames"], (None, motion)):  # a first frame has none
            entry["odometry"] = dict(source="estimated", motion=own)
        (run / "report.json").write_text(json.dumps(report))
        assert cloud.main([str(run), "--out", str(run / f"{is_told}.ply")]) == 0
        assert ("no motion in 1 frame," in capsys.readouterr().out) == is_told


def test_what_lies_in_one_cube_is_its_mean():
    grid = cloud.VoxelGrid(1)
    for x, colour in ((0.2, 10), (0.6, 20)):
        grid.add(np.array([[x, 0.5, 0.5], [x + 5 * x, 0.5, 0.5]]), np.full((2, 3), colour), np.array([[0, 0, -1.0], [0, 0, -1]]))
    grid.add(np.full((2, 3), 20.5), np.zeros((2, 3)), np.zeros((2, 3)))  # one frame's
    points, colors, normals = grid.means(2)
    np.testing.assert_allclose(points, [[0.4, 0.5, 0.5]])
    assert colors.tolist() == [[15, 15, 15]] and normals.tolist() == [[0, 0, -1]]
    assert len(grid.means(1)[0]) == 4


def test_a_long_drive_costs_little_more_than_its_frames(monkeypatch):
    sorted_rows, of = [], cloud.VoxelGrid._of
    monkeypatch.setattr(cloud.VoxelGrid, "_of", staticmethod(lambda keys, rows: sorted_rows.append(len(keys)) or of(keys, rows)))
    grid = cloud.VoxelGrid(1)
    for i in range(100):
        grid.add(np.array([[i + 0.5, 0, 0]]), np.zeros((1, 3)), np.zeros((1, 3)))
    assert len(grid.means(1)[0]) == 100 and sum(sorted_rows) < 1000  # all of them for each frame were 5000


def test_a_row_of_pixels_has_no_slope_across():
    camera = egosgm.Calibration(fx=100, fy=100, cx=2, cy=0, baseline_m=0.5)
    for shape in ((1, 5), (5, 1)):
        disparity = np.full(shape, 10, np.float32)
        cloud_points = cloud_of_maps(disparity, disparity * 0.001, np.zeros(shape, np.uint8), camera, 0.1, None, None, 80, 1).points
        np.testing.assert_allclose(cloud.normals_of(disparity, camera, cloud_points), np.tile([0, 0, -1], (5, 1)), atol=1e-6)


def test_normals_are_of_the_slope():
    camera = egosgm.Calibration(**CAMERA)
    y, x = np.mgrid[:20, :20]
    # The plane X + Z = 5: with X = (x - cx) Z / fx, d = f b / Z = 50 (1 + (x - 2) / 100) / 5.
    disparity = (10 * (1 + (x - 2) / 100)).astype(np.float32)
    depth = 50 / disparity
    points = np.stack([(x - 2) / 100 * depth, (y - 1) / 100 * depth, depth], axis=-1).reshape(-1, 3)
    np.testing.assert_allclose(cloud.normals_of(disparity, camera, points), np.tile([-(0.5**0.5), 0, -(0.5**0.5)], (400, 1)), atol=1e-3)


def test_what_is_missing_is_named(run):
    for words, breaks in (("no map of frame 000001.*--write variance", lambda: (run / "variance/000001.pfm").rename(run / "kept")),
                          ("has 1 poses and report.json 2 frames.*--resume", lambda: egosgm.write_poses(run / "poses.txt", np.stack([np.eye(4)]))),
                          ("poses.txt: no such file.*--calib", (run / "poses.txt").unlink), ("report.json: no such file", (run / "report.json").unlink)):
        breaks()
        expect_refused(words, lambda: cloud.main([str(run), "--voxel", "0.01"]))
        (run / "variance/000001.pfm").write_bytes((run / "variance/000000.pfm").read_bytes())
    assert not (run / "cloud.ply").exists()


def test_a_map_of_another_size_is_named(run):
    egosgm.write_pfm(run / "variance/000001.pfm", np.ones((3, 5), np.float32))
    expect_refused("of frame 000001 the disparity is 6x4, the variance 5x3 and .*left1.png 6x4", lambda: cloud.main([str(run)]))
    assert not (run / "cloud.ply").exists()


def test_a_name_of_another_format_is_refused(run):
    expect_refused("cloud.pcd: a cloud is a PLY file", lambda: cloud.main([str(run), "--out", str(run / "cloud.pcd")]))
    assert not (run / "cloud.pcd").exists()
    assert cloud.main([str(run), "--out", str(run / "CLOUD.PLY")]) == 0


@pytest.mark.parametrize("entry", [{"frame": 0, "left": None}, {"frame": 0, "left": 5}, {"frame": 0, "name": [1], "left": "left0.png"}, {"frame": "a", "left": "b"}, 3])
def test_an_edited_report_is_refused(run, entry):
    report = json.loads((run / "report.json").read_text())
    report["frames"][0] = entry
    (run / "report.json").write_text(json.dumps(report))
    expect_refused("report.json: is no report of a run, or was changed since|left0.png|No such file|no such file|no map of frame", lambda: cloud.main([str(run)]))
    assert not (run / "cloud.ply").exists()


@pytest.mark.filterwarnings("error")
def test_cubes_that_are_too_many_to_tell_apart_are_refused(run):
    for voxel in ("1e-12", "1e-300", "1e-308"):
        expect_refused("--voxel 1e-.*is too small for points that lie", lambda: cloud.main([str(run), "--voxel", voxel]))
    assert cloud.main([str(run), "--voxel", "1e300"]) == 0


def test_a_file_that_comes_while_it_works_stays(run, monkeypatch):
    means = cloud.VoxelGrid.means

    def slow_means(grid, least_frames):
        (run / "cloud.ply").write_text("mine")
        return means(grid, least_frames)

    monkeypatch.setattr(cloud.VoxelGrid, "means", slow_means)
    with pytest.raises(egosgm.IoError, match="has come there meanwhile"):
        cloud.main([str(run)])
    assert (run / "cloud.ply").read_text() == "mine"

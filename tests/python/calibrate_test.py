# SPDX-License-Identifier: Apache-2.0
"""egosgm calibrate: pictures of a board, rendered for known cameras."""
import contextlib
import io
import shutil
import types

import numpy as np
import pytest

import egosgm
from egosgm import program

cv2 = pytest.importorskip("cv2")
from egosgm.calibration.calibrate import _check_stance
from refusals import expect_refused

WIDTH, HEIGHT, SQUARE, BASELINE, FINER = 480, 360, 0.03, 0.12, 2


def camera(matrix, distortion):
    """Its matrix, and the rays of its pixels, FINER in a row and in a column of one."""
    v, u = np.mgrid[0:HEIGHT * FINER, 0:WIDTH * FINER]
    pixels = (np.stack([u, v], axis=-1).reshape(-1, 1, 2) + 0.5) / FINER - 0.5
    return matrix, np.dstack([cv2.undistortPoints(pixels, matrix, distortion), np.ones((len(pixels), 1))]).reshape(-1, 3)


LEFT = camera(np.array([[420.0, 0, 236], [0, 424.0, 183], [0, 0, 1]]), np.array([-0.12, 0.03, 0.0006, -0.0004, 0]))
RIGHT = camera(np.array([[414.0, 0, 245], [0, 417.0, 176], [0, 0, 1]]), np.array([-0.10, 0.02, -0.0005, 0.0007, 0]))
R = cv2.Rodrigues(np.array([0.01, -0.03, 0.006]))[0]
T = np.array([-BASELINE, 0.002, -0.003])
TEXELS = 40  # of a square's side


def chessboard(columns, rows):
    """Of inner corners; a white border around it."""
    squares = np.indices((rows + 1, columns + 1)).sum(0) % 2
    return np.pad(np.kron(squares * 200 + 25, np.ones((TEXELS, TEXELS))), TEXELS, constant_values=225).astype(np.uint8)


def charuco(columns, rows, marker):
    aruco = cv2.aruco
    if hasattr(aruco, "CharucoDetector"):
        words = aruco.getPredefinedDictionary(aruco.DICT_4X4_50)
        board = aruco.CharucoBoard((columns, rows), SQUARE, marker, words).generateImage((columns * TEXELS, rows * TEXELS))
    else:
        board = aruco.CharucoBoard_create(columns, rows, SQUARE, marker, aruco.Dictionary_get(aruco.DICT_4X4_50)).draw((columns * TEXELS, rows * TEXELS))
    return np.pad(board, TEXELS, constant_values=255)


def seen(texture, rays, turn, place, noise=1.5):
    """A picture of a board whose first inner corner lies at `place`, in the camera's frame, turned by `turn`."""
    normal = turn[:, 2]
    points = rays * ((normal @ place) / (rays @ normal))[:, None] - place
    texels = ((points @ turn)[:, :2] / SQUARE + 2) * TEXELS - 0.5
    x, y = (texels[:, i].reshape(HEIGHT * FINER, WIDTH * FINER).astype(np.float32) for i in (0, 1))
    picture = cv2.remap(texture, x, y, cv2.INTER_AREA, borderMode=cv2.BORDER_CONSTANT, borderValue=120)
    picture = cv2.GaussianBlur(cv2.resize(picture, (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA).astype(np.float32), (0, 0), 0.6)
    return np.clip(picture + np.random.default_rng(int(abs(place[0]) * 1e4)).normal(0, noise, picture.shape), 0, 255).astype(np.uint8)


def poses(count, columns, rows):
    """Turns, and where the first inner corner lies, so that the board's middle is in view of both cameras."""
    random = np.random.default_rng(3)
    for i in range(count):
        turn = cv2.Rodrigues(random.uniform([-0.5, -0.5, -0.3], [0.5, 0.5, 0.3]))[0]
        depth = random.uniform(0.45, 0.7)
        middle = np.array([random.uniform(-0.1, 0.22) * depth / 0.55 + BASELINE / 4, random.uniform(-0.1, 0.1) * depth / 0.55, depth])
        yield turn, middle - turn @ np.array([(columns - 1) / 2 * SQUARE, (rows - 1) / 2 * SQUARE, 0])


def write_pictures(folder, texture, columns, rows, count=12, spoilt=()):
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
    for i, (turn, place) in enumerate(poses(count, columns, rows)):
        cv2.imwrite(str(folder / f"left/{i}.png"), seen(texture, LEFT[1], turn, place))
        if i in spoilt:  # the board moved on before the right camera saw it
            place = place + [0.004, 0.003, 0.002]
        cv2.imwrite(str(folder / f"right/{i}.png"), seen(texture, RIGHT[1], R @ turn, R @ place + T))
    return folder


@pytest.fixture(scope="module")
def pictures(tmp_path_factory):
    folder = write_pictures(tmp_path_factory.mktemp("board") / "views", chessboard(7, 5), 7, 5, spoilt=(4,))
    shutil.copy(folder / "left/0.png", folder / "left/alone.png")
    return folder


def some_of(pictures, folder, count):
    """A folder of the first pairs."""
    for side in ("left", "right"):
        (folder / side).mkdir(parents=True)
        for i in range(count):
            shutil.copy(pictures / side / f"{i}.png", folder / side)
    return folder


def command(folder, out, board="7x5"):
    return ["calibrate", "--left", str(folder / "left/*.png"), "--right", str(folder / "right/*.png"), "--board", board, "--square", str(SQUARE), "--out", str(out)]


def calibrate(folder, out, capsys, *more, board="7x5"):
    code = program.run_tool([*command(folder, out, board), *more])
    said = capsys.readouterr()
    return code, said.out + said.err


@pytest.fixture(scope="module")
def calibrated(pictures, tmp_path_factory):
    """The folder with calib.yml and the drawn corners, and what was said."""
    folder, said = tmp_path_factory.mktemp("calibrated"), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        code = program.run_tool([*command(pictures, folder / "calib.yml"), "--pictures", str(folder / "corners")])
    assert code == 0, said.getvalue()
    return folder, said.getvalue()


def expect_the_cameras(file, within_px=4):
    rig = egosgm.read_calibration(file)
    for matrix, (expected, _) in ((rig.left_matrix, LEFT), (rig.right_matrix, RIGHT)):
        np.testing.assert_allclose(matrix, expected, atol=within_px)
    assert np.linalg.norm(rig.T) == pytest.approx(BASELINE, rel=0.02)
    np.testing.assert_allclose(rig.T, T, atol=0.003)
    np.testing.assert_allclose(rig.R, R, atol=0.006)
    assert rig.size == (WIDTH, HEIGHT)
    return rig


def test_a_chessboard_gives_the_cameras_and_a_view_of_another_moment_is_left_out(calibrated):
    folder, said = calibrated
    expect_the_cameras(folder / "calib.yml")
    assert "pairs (11 left, 12 right)" in said and said.count("left out") == 2 and "pair   4: left out" in said
    assert "note:  1 image without the other camera's left out, the first is " in said and "left/alone.png" in said
    rows = float(said.split("rows agree within ")[1].split()[0])
    assert rows < 0.3
    assert len(list((folder / "corners").iterdir())) == 12
    assert cv2.imread(str(folder / "corners/000000.png")).shape == (HEIGHT, 2 * WIDTH, 3)


def test_what_it_writes_rectifies(pictures, calibrated, tmp_path):
    code = program.run_tool(["rectify", "--left", str(pictures / "left/*.png"), "--right", str(pictures / "right/*.png"), "--calib", str(calibrated[0] / "calib.yml"),
                             "--out", str(tmp_path / "sequence")])
    assert code == 0
    left, right = (cv2.imread(str(tmp_path / f"sequence/image_{side}/000002.png"), cv2.IMREAD_GRAYSCALE) for side in (0, 1))
    corners = [cv2.findChessboardCornersSB(image, (7, 5))[1].reshape(-1, 2) for image in (left, right)]
    assert np.abs(corners[0][:, 1] - corners[1][:, 1]).max() < 0.5


def test_a_standard_output_that_is_full_costs_no_calibration(pictures, tmp_path, monkeypatch):
    def full(text):
        raise egosgm.IoError("the standard output cannot be written")

    monkeypatch.setattr("egosgm.calibration.calibrate.tell", full)
    assert program.run_tool(command(pictures, tmp_path / "calib.yml")) == 1
    expect_the_cameras(tmp_path / "calib.yml")


def test_of_the_many_views_of_a_video_some_are_taken(pictures, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("egosgm.calibration.calibrate._MOST_VIEWS", 6)
    code, said = calibrate(some_of(pictures, tmp_path / "some", 8), tmp_path / "calib.yml", capsys)
    assert code == 0 and "; 6 of them are taken, evenly chosen" in said and said.count("  pair ") == 6
    assert "  pair   0:" in said and "  pair   7:" in said


def test_a_charuco_board(tmp_path, capsys):
    pytest.importorskip("cv2.aruco")
    folder = write_pictures(tmp_path / "views", charuco(8, 6, 0.02), 7, 5, count=14)
    code, said = calibrate(folder, tmp_path / "calib.yml", capsys, "--marker", "0.02", board="8x6")
    assert code == 0, said
    expect_the_cameras(tmp_path / "calib.yml", within_px=8)
    for board in ("7x5", "6x8"):  # its inner corners, and rows first
        code, said = calibrate(folder, tmp_path / "wrong.yml", capsys, "--marker", "0.02", board=board)
        assert code == 2 and f"is it a ChArUco board of {board} squares" in said, said
        assert ("was found in 0 left and 0 right images" if cv2.__version__ >= "5" else "px, with which nothing can be rectified") in said, said
        assert not (tmp_path / "wrong.yml").exists()


@pytest.mark.parametrize("board, named", [("8x6", "one of 7x5 is there"), ("6x5", "one of 7x5 is there"), ("8x5", "one of 7x5 is there"), ("7", "--board 7:"), ("2x9", "--board 2x9")])
def test_a_wrong_size_of_the_board_is_named(board, named, pictures, tmp_path, capsys):
    code, said = calibrate(some_of(pictures, tmp_path / "three", 3), tmp_path / "calib.yml", capsys, board=board)
    assert code == 2 and named in said, said
    assert not (tmp_path / "calib.yml").exists()


def test_too_few_views_sides_and_units_are_named(pictures, tmp_path, capsys):
    few, some = some_of(pictures, tmp_path / "few", 4), some_of(pictures, tmp_path / "some", 7)
    for side in ("left", "right"):
        for i in (4, 5):
            cv2.imwrite(str(few / side / f"{i}.png"), np.full((HEIGHT, WIDTH), 90, np.uint8))
    code, said = calibrate(few, tmp_path / "calib.yml", capsys)
    assert code == 2 and "found in 4 left and 4 right images of 6 pairs" in said and "5 are needed" in said, said
    assert program.run_tool([*command(few, tmp_path / "calib.yml"), "--dictionary", "DICT_5X5_50"]) == 2
    assert "a chessboard has no markers: give --marker" in capsys.readouterr().err
    for side in ("left", "right"):
        for i in range(6):
            shutil.copy(pictures / side / f"{i % 2}.png", few / side / f"{i}.png")
    code, said = calibrate(few, tmp_path / "calib.yml", capsys)
    assert code == 2 and "the board stands in 2 places in the 6 views of it" in said, said
    swapped = ["calibrate", "--left", str(some / "right/*.png"), "--right", str(some / "left/*.png"), "--board", "7x5", "--out", str(tmp_path / "calib.yml")]
    assert program.run_tool([*swapped, "--square", "0.03"]) == 2
    assert "left and right are swapped" in capsys.readouterr().err
    assert program.run_tool([*swapped, "--square", "30"]) == 2
    assert "are these millimetres? Give 0.03" in capsys.readouterr().err
    (tmp_path / "there.yml").write_text("mine")
    assert calibrate(pictures, tmp_path / "there.yml", capsys)[0] == 2
    assert (tmp_path / "there.yml").read_text() == "mine"


@pytest.mark.parametrize("place", [(-2e-8, 1e-9, 0), (0, 0, 0), (np.nan, np.nan, np.nan)])
def test_cameras_in_one_place_are_refused(place):
    expect_refused("stand in one place", lambda: _check_stance(types.SimpleNamespace(translation_m=np.array(place))))

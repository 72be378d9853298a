# SPDX-License-Identifier: Apache-2.0
"""The figures that bench/accuracy reads off the maps."""
import pathlib
import sys

import numpy as np
import pytest

import egosgm

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[2] / "bench"))
import video_figures as figures  # noqa: E402

CAMERA = egosgm.Calibration(fx=100, fy=100, cx=20, cy=10, baseline_m=0.5)
NONE = egosgm.INVALID_DISPARITY


class Still:
    """A camera that stands: the motion is the identity."""

    calibration, size, numbers = CAMERA, (48, 24), range(2)

    def motion(self, k, since):
        return np.eye(4)


def test_flicker_is_the_mean_change(monkeypatch):
    first, second = np.full((24, 48), 4, np.float32), np.full((24, 48), 4, np.float32)
    second[:, :24] += 0.5
    second[0] = NONE
    frames = [(k, type("Frame", (), {"disparity": d})) for k, d in enumerate((first, second))]
    monkeypatch.setattr(figures, "play", lambda video, **options: frames)
    assert figures.flicker(Still(), 1) == pytest.approx(0.25, abs=1e-6)


def test_there_and_back_meets_the_same_images_moving_the_same_way():
    numbers = figures.there_and_back(500, 195)
    assert numbers[:3] == [0, 1, 2] and max(numbers) == 195 and numbers[195:198] == [195, 194, 193]
    assert set(np.abs(np.diff(numbers))) == {1}
    assert numbers[9:110] == numbers[399:500]


def test_a_long_run_starts_again_at_a_place(monkeypatch):
    played = []

    def play(video, numbers, **options):
        played.append(numbers)
        report = type("Report", (), {"search_fraction": 1})
        return [(k, type("Frame", (), {"disparity": np.full((24, 48), 5 if k == 2 else 10, np.float32), "report": report})) for k in numbers]
    monkeypatch.setattr(figures, "play", play)
    video = type("Video", (Still,), {"truth": lambda self, k: np.full((24, 48), 10, np.float32)})()
    through, fresh, resets = figures.long_run(video, [0, 1, 2, 1], 2)
    assert (through, fresh, resets) == ([0, 0, 100, 0], [100, 0], 3)
    assert played == [[0, 1, 2, 1], [2, 1]]


def test_thin_things_stand_out_from_both_sides():
    row = np.full((1, 40), 5.0)
    row[0, 10:13] = 20  # a pole
    row[0, 20:] = 20    # a wall
    assert np.flatnonzero(figures.thin(row)).tolist() == [10, 11, 12]


def test_bad_or_missing_counts_what_has_truth():
    truth = np.array([[5, 5, 5, NONE]], np.float32)
    assert figures.bad_or_missing(np.array([[5, 8.5, NONE, 1]], np.float32), truth) == (2, 3)
    assert figures.bad_or_missing(np.array([[5, 8, 2, 1]], np.float32), truth, np.array([[True, True, False, True]])) == (0, 2)
    assert figures.share([(1, 4), (2, 2)]) == 50
    assert np.isnan(figures.share([(0, 0)]))


def test_a_calibrated_variance_gives_one():
    random = np.random.default_rng(5)
    variance = random.uniform(0.05, 0.3, 20000)
    errors = random.normal(size=20000) * np.sqrt(variance)
    worth = figures.calibration_of_variance([(errors, variance)])
    assert worth["ratio"] == pytest.approx(1, abs=0.05)
    assert worth["flatness"] == pytest.approx(1, abs=0.2)
    assert np.isnan(worth["removed"]), "none is bad"


def test_a_variance_that_is_too_small_where_it_is_large():
    errors = np.repeat([1.0, 2.0], 50)
    worth = figures.calibration_of_variance([(errors, np.repeat([1.0, 2.0], 50))])
    assert worth["flatness"] == pytest.approx(2)


def test_errors_where_both_are_known():
    errors, y, x = figures.errors_of(np.array([[1, NONE, 3], [4, 5, 6]], np.float32), np.array([[NONE, 2, 2.5], [4, 9, NONE]], np.float32))
    assert errors.tolist() == [0.5, 0, -4]
    assert y.tolist() == [0, 1, 1] and x.tolist() == [2, 0, 1]


def test_the_worst_tenth_by_variance():
    errors, variance = np.zeros(100), np.ones(100)
    errors[:4] = 10, -10, 10, -10
    variance[[0, 1, 2]] = 9
    worth = figures.calibration_of_variance([(errors, variance)])
    assert worth["removed"] == 75
    assert worth["ratio"] == pytest.approx((3 * 9 / 9 + 9 / 1) / 100)
    assert worth["ratio_not_bad"] == 0


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_turns_are_rotations(axis):
    turn = figures.turned(axis, 1)
    np.testing.assert_allclose(turn[:3, :3] @ turn[:3, :3].T, np.eye(3), atol=1e-12)
    assert np.degrees(np.arccos((np.trace(turn[:3, :3]) - 1) / 2)) == pytest.approx(1)
    assert turn[axis, axis] == 1


def test_what_an_object_uncovers_has_an_age(monkeypatch):
    class Passing(Still):
        """An object 8 pixels wide that moves 4 pixels to the right a frame, before a wall."""

        size, numbers = (48, 4), range(4)

        def moving(self, k):
            mask = np.zeros((4, 48), bool)
            mask[:, 8 + 4 * k:16 + 4 * k] = True
            return mask

        def all_truth(self, k):
            return np.where(self.moving(k), 20, 5).astype(np.float32)

    ages = dict(figures.uncovered_ages(Passing(), 1))
    assert (ages[0] == -1).all()
    assert np.flatnonzero(ages[1][0] == 0).tolist() == [8, 9, 10, 11]
    assert np.flatnonzero(ages[2][0] == 1).tolist() == [8, 9, 10, 11]
    assert np.flatnonzero(ages[2][0] == 0).tolist() == [12, 13, 14, 15]
    assert (ages[3][0, 8:12] == -1).all(), "older than asked for"

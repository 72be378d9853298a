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
    for at in worth["bins"]:
        assert at["actual_px"] == pytest.approx(at["predicted_px"], rel=0.1)
    assert np.isnan(worth["removed"]), "none is bad"


def test_a_variance_that_is_too_small_where_it_is_large():
    errors = np.repeat([1.0, 2.0], 50)
    worth = figures.calibration_of_variance([(errors, np.repeat([1.0, 2.0], 50))])
    assert worth["flatness"] == pytest.approx(2)


def test_an_offset_that_all_pixels_share_can_be_left_out():
    random = np.random.default_rng(6)
    variance = random.uniform(0.02, 0.5, 20000)
    pairs = [(random.normal(size=20000) * np.sqrt(variance) + offset, variance) for offset in (0.5, -0.5)]
    assert figures.median_error(pairs[:1]) == pytest.approx(0.5, abs=0.02)
    assert figures.calibration_of_variance(pairs)["flatness"] > 2.5, "it weighs where the variance is small"
    assert figures.calibration_of_variance(figures.without_offset(pairs))["flatness"] == pytest.approx(1, abs=0.2)


def one_row(errors, variances):
    """Of pixels that lie side by side."""
    return [(errors, variances, np.zeros(len(errors), int), np.arange(len(errors)))]


def test_chance_alone_makes_tenths_differ():
    random = np.random.default_rng(7)
    variance = random.uniform(0.02, 0.5, 20000)
    independent = figures.flatness_by_chance(one_row(random.normal(size=20000) * np.sqrt(variance), variance), side=4)
    assert 1.05 < independent < 1.25
    assert figures.flatness_by_chance(one_row(random.normal(size=20000) * variance, variance), side=4) < 1.25, "how flat it is does not count"
    alike = np.repeat(random.normal(size=200) * 0.3, 100)
    of_a_block = np.repeat(random.uniform(0.02, 0.5, 200), 100)
    assert figures.flatness_by_chance(one_row(alike, of_a_block), side=100) > 1.5
    assert figures.flatness_by_chance(one_row(alike, of_a_block), side=4) < 1.5, "smaller blocks take pixels that are alike for independent"


def test_blocks_are_of_rows_and_columns():
    y, x = (part.ravel() for part in np.mgrid[:128, :256])
    random = np.random.default_rng(10)
    alike, variance = ((random.normal(size=(16, 32)) * 0.3)[y // 8, x // 8], random.uniform(0.02, 0.5, (16, 32))[y // 8, x // 8])
    by_side = [figures.flatness_by_chance([(alike, variance, y, x)], side=side) for side in (2, 8)]
    assert by_side[1] - 1 > 2 * (by_side[0] - 1)
    two_frames = figures.flatness_by_chance(2 * [(alike, variance, y, x)], side=8)
    assert two_frames - 1 < 0.85 * (by_side[1] - 1), "a block is of one frame"
    assert set(figures.medians_by_block(alike, y, x, side=8, least=1).values()) == set(alike)
    assert len(figures.medians_by_block(alike[64:], y[64:], x[64:], side=64, least=64 * 64)) == 7, "the first block lacks pixels"


def test_how_alike_the_errors_of_neighbours_are():
    random = np.random.default_rng(11)
    ones = np.repeat(random.uniform(size=2000) < 0.5, 10).astype(float)
    pairs = one_row(ones, np.ones(20000))
    assert figures.likeness(pairs, 1) == pytest.approx(0.9, abs=0.05)
    assert figures.likeness(pairs, 5) == pytest.approx(0.5, abs=0.05)
    assert figures.likeness(pairs, 10) == pytest.approx(0, abs=0.05)
    levels = np.repeat(np.linspace(0.02, 0.5, 10), 2000)
    assert figures.likeness(one_row(random.normal(size=20000) * np.sqrt(levels), levels), 1) == pytest.approx(0, abs=0.03), "nor is what the variance tells"


def test_errors_where_both_are_known():
    errors, y, x = figures.errors_of(np.array([[1, NONE, 3], [4, 5, 6]], np.float32), np.array([[NONE, 2, 2.5], [4, 9, NONE]], np.float32))
    assert errors.tolist() == [0.5, 0, -4]
    assert y.tolist() == [0, 1, 1] and x.tolist() == [2, 0, 1]


def test_what_matchers_share_is_a_quadratic_of_the_place():
    y, x = (part.ravel() for part in np.mgrid[:300:4, :1200:4])
    random = np.random.default_rng(12)

    def smooth(y, x):
        return -0.4 + 0.5 * x / 1000 - 3 * (y / 1000) ** 2 + 0.8 * (x / 1000) ** 2 + 2 * x * y / 1e6
    errors = smooth(y, x) + random.normal(size=len(y)) * 0.2
    wrong = random.uniform(size=len(y)) < 0.1
    errors[wrong] += 40
    found = figures.field(errors, y, x)
    assert np.abs(found(y, x) - smooth(y, x)).max() < 0.03, "a tenth that is wrong by far does not count"
    other_y, other_x = np.array([10, 299]), np.array([1100, 3])
    pairs = [(smooth(other_y, other_x) + 0.1, np.ones(2), other_y, other_x)]
    less, variances, *place = figures.without_field(pairs, [found])[0]
    assert less == pytest.approx(0.1, abs=0.03) and variances is pairs[0][1] and place == [other_y, other_x]


def test_the_least_that_a_curve_leaves():
    pytest.importorskip("scipy.optimize")
    variance = np.random.default_rng(8).uniform(0.02, 0.5, 20000)

    def scene(errors_squared):
        return [(np.sqrt(errors_squared), variance)]
    assert figures.least_flatness([scene(variance)]) < 1.02
    assert figures.least_flatness([scene(1 / (1 + 1 / variance**2))]) < 1.05, "a curve takes out what is one"
    assert figures.least_flatness([scene(variance), scene(7 * variance)]) < 1.02, "each may have a scale of its own"
    assert figures.least_flatness([scene(1 - variance)]) > 1.5, "none turns the order round"
    # Both rise from the first tenth to the last, one more than the other: one of them keeps the root of that.
    with_offset = figures.least_flatness([scene(variance), scene(variance + 0.3)])
    tenths = [part.mean() for part in np.array_split(np.sort(variance), 10)]
    apart = (tenths[9] / tenths[0]) / ((tenths[9] + 0.3) / (tenths[0] + 0.3))
    assert with_offset == pytest.approx(np.sqrt(apart), rel=0.03)


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

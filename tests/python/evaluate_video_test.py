# SPDX-License-Identifier: Apache-2.0
"""egosgm.evaluate_video against each formula in other lines of NumPy, and against answers that are known by hand."""
import dataclasses
import math

import numpy as np
import pytest

import egosgm
from egosgm.evaluation import video_counts
from refusals import expect_refused

NO = egosgm.INVALID_DISPARITY
HEIGHT, WIDTH = 20, 40
CAMERA = egosgm.Calibration(fx=50, fy=50, cx=19.5, cy=9.5, baseline_m=0.3)


def maps(*values):
    return [np.full((HEIGHT, WIDTH), value, np.float32) for value in values]


def poses(*forward_m):
    """Camera-to-world, along the view."""
    result = np.stack([np.eye(4)] * len(forward_m))
    result[:, 2, 3] = forward_m
    return result


def is_known(d):
    return np.isfinite(d) & (d > NO)


def noisy_video(frames=4, seed=5):
    """A slanted wall with a square before it that moves right; estimates are noisy, with holes. The camera goes forward, turns and sways."""
    rng = np.random.default_rng(seed)
    truths, estimates, moving, world_from_camera = [], [], [], []
    for k in range(frames):
        truth = np.tile(np.linspace(6, 9, WIDTH, dtype=np.float32), (HEIGHT, 1)) + 0.2 * k
        mask = np.zeros((HEIGHT, WIDTH), bool)
        mask[6:12, 5 + 4 * k:12 + 4 * k] = True
        truth[mask] = 18 + k
        estimate = (truth + rng.normal(0, 1.5, truth.shape)).astype(np.float32)
        estimate[rng.random(truth.shape) < 0.1] = NO
        truth[rng.random(truth.shape) < 0.2] = NO
        pose = np.eye(4)
        turn = np.radians(1.5 * k)
        pose[[0, 0, 2, 2], [0, 2, 0, 2]] = np.cos(turn), np.sin(turn), -np.sin(turn), np.cos(turn)
        pose[:3, 3] = 0.03 * k, 0.01 * k, 0.05 * k
        truths.append(truth), estimates.append(estimate), moving.append(mask), world_from_camera.append(pose)
    return estimates, truths, moving, np.stack(world_from_camera)


def move(d, motion):
    """Every known pixel of d moved: its target's row and column, its new disparity, and which pixels those are."""
    y, x = np.nonzero(is_known(d) & (d > 0))
    z = CAMERA.fx * CAMERA.baseline_m / d[y, x].astype(float)
    points = np.stack([(x - CAMERA.cx) / CAMERA.fx * z, (y - CAMERA.cy) / CAMERA.fy * z, z])
    points = motion[:3, :3] @ points + motion[:3, 3:]
    to_x, to_y = (np.rint(f * p / points[2] + c).astype(int) for f, p, c in ((CAMERA.fx, points[0], CAMERA.cx), (CAMERA.fy, points[1], CAMERA.cy)))
    inside = (points[2] > 0) & (to_x >= 0) & (to_x < WIDTH) & (to_y >= 0) & (to_y < HEIGHT)
    return to_y[inside], to_x[inside], (CAMERA.fx * CAMERA.baseline_m / points[2])[inside], y[inside], x[inside]


def moved_map(d, motion):
    to_y, to_x, moved, _, _ = move(d, motion)
    result = np.full(d.shape, NO)
    np.maximum.at(result, (to_y, to_x), moved)
    return result


def pairs(world_from_camera):
    for k in range(1, len(world_from_camera)):
        yield k, np.linalg.inv(world_from_camera[k]) @ world_from_camera[k - 1]


def forward(metres):
    motion = np.eye(4)
    motion[2, 3] = -metres
    return motion


def test_a_wall_comes_nearer():
    camera = egosgm.Calibration(fx=100, fy=100, cx=20, cy=10, baseline_m=0.5)
    wall = np.full((21, 41), 5.0, np.float32)  # 10 m away
    near = egosgm.move_map(wall, camera, forward(5))
    seen = near > NO
    np.testing.assert_allclose(near[seen], 10, rtol=1e-6)
    np.testing.assert_array_equal(egosgm.move_map(wall, camera, egosgm.Motion(forward(5))), near)
    expect_refused(r"current_from_previous: is an array of shape \(1, 4, 4\): give one motion, a Motion or a 4 x 4 array", lambda: egosgm.move_map(wall, camera, forward(5)[None]))
    expect_refused("is a str: give one motion", lambda: egosgm.move_map(wall, camera, "forward"))
    assert not seen[10, 21] and seen[10, 22], "points move apart, from the principal point on"


def test_the_nearest_surface_is_on_top():
    camera = egosgm.Calibration(fx=100, fy=100, cx=20, cy=10, baseline_m=0.5)
    points = np.full((21, 41), NO, np.float32)
    points[10, 24], points[10, 26] = 10, 5  # 5 and 10 m away; both land 8 pixels right of the centre
    near = egosgm.move_map(points, camera, forward(2.5))
    assert near[10, 28] == pytest.approx(20)
    assert (near > NO).sum() == 1


def test_flicker_is_of_pixels_that_have_both_and_tae_of_depths_in_both_directions():
    estimates, _, _, world_from_camera = noisy_video()
    differences, errors = [], []
    for k, motion in pairs(world_from_camera):
        for source, target, how in ((k - 1, k, motion), (k, k - 1, np.linalg.inv(motion))):
            moved = moved_map(estimates[source], how)
            both = is_known(moved) & is_known(estimates[target])
            depth, depth_moved = (CAMERA.fx * CAMERA.baseline_m / d[both].astype(float) for d in (estimates[target], moved))
            errors.append(np.mean(np.abs(depth - depth_moved) / depth))
            if target == k:
                differences.append(np.abs(estimates[k] - moved)[both])
    figures = egosgm.evaluate_video(estimates, calibration=CAMERA, world_from_camera=world_from_camera).figures
    assert figures.flicker_px == pytest.approx(np.concatenate(differences).mean(), rel=1e-5)
    assert figures.tae_vda_percent == pytest.approx(100 * np.mean(errors), rel=1e-5)
    assert math.isnan(figures.tepe_dynamicstereo_px), "no truth"


def test_tepe_of_filled_maps():
    estimates, truths, _, _ = noisy_video()
    dense = [egosgm.interpolate_background(e) for e in estimates]
    filled, own = egosgm.evaluate_video(estimates, truths).figures, egosgm.evaluate_video(dense, truths).figures
    assert filled.tepe_dynamicstereo_filled_px == own.tepe_dynamicstereo_px != filled.tepe_dynamicstereo_px
    assert filled.tepe_dynamicstereo_filled_above_3px_percent == own.tepe_dynamicstereo_above_3px_percent


def dynamicstereos_tepe(x, y, mask):
    """Their formula: (frames, 1, H, W) maps, estimate, truth and mask (0 or 1); sqrt of the sum of squares over the one channel; over the whole
    sequence, divided by the pixels whose error is not zero: mean, and percent above 1 and 3 px."""
    both = mask[:-1] * mask[1:]
    error = np.sqrt((both * ((x[:-1] - x[1:]) - (y[:-1] - y[1:]))**2).sum(axis=1))
    nonzero = np.count_nonzero(error)
    assert nonzero > 0.9999 * both.sum(), "else it divides by fewer pixels than it looks at"
    return error.sum(dtype=float) / nonzero, 100 * (error > 1).sum() / nonzero, 100 * (error > 3).sum() / nonzero


def test_tepe_by_dynamicstereos_own_formula():
    rng = np.random.default_rng(3)
    y = rng.uniform(5, 50, (6, 1, HEIGHT, WIDTH)).astype(np.float32)
    x, mask = (y + rng.normal(0, 2, y.shape)).astype(np.float32), (rng.random(y.shape) < 0.7).astype(np.float32)
    figures = egosgm.evaluate_video(list(x[:, 0]), [np.where(mask[k, 0] > 0, y[k, 0], NO) for k in range(len(y))]).figures
    ours = figures.tepe_dynamicstereo_px, figures.tepe_dynamicstereo_above_1px_percent, figures.tepe_dynamicstereo_above_3px_percent
    assert ours == pytest.approx(dynamicstereos_tepe(x, y, mask), rel=1e-4)


def test_tepe_along_the_motion_of_what_stands():
    estimates, truths, moving, world_from_camera = noisy_video()
    errors, changes = [], []
    for k, motion in pairs(world_from_camera):
        to_y, to_x, expected, y, x = move(np.where(moving[k - 1], NO, truths[k - 1]), motion)
        there = truths[k][to_y, to_x].astype(float)
        seen = is_known(there) & (np.abs(there - expected) <= 1) & ~moving[k][to_y, to_x]
        e = estimates[k - 1][y, x].astype(float), estimates[k][to_y, to_x].astype(float)
        good = seen & is_known(e[0]) & is_known(e[1])
        change = (there - truths[k - 1][y, x])[good]
        errors.append(np.abs((e[1] - e[0])[good] - change)), changes.append(change)
    error, change = np.concatenate(errors), np.concatenate(changes)
    assert len(error) > 500
    figures = egosgm.evaluate_video(estimates, truths, moving=moving, calibration=CAMERA, world_from_camera=world_from_camera).figures
    assert figures.tepe_codd_px == pytest.approx(error.mean(), rel=1e-5)
    assert figures.tepe_codd_mean_of_pairs_px == pytest.approx(np.mean([e.mean() for e in errors]), rel=1e-5)
    assert figures.tepe_codd_relative == pytest.approx(np.mean(error / (np.abs(change) + 1e-3)), rel=1e-4)
    assert figures.tepe_codd_relative_above_1_percent == pytest.approx(100 * np.mean(error / (np.abs(change) + 1e-3) > 1))
    assert figures.tepe_codd_above_3px_percent == pytest.approx(100 * np.mean(error > 3))


def random_flow(seed):
    flow = np.random.default_rng(seed).uniform(-6, 6, (HEIGHT, WIDTH, 2)).astype(np.float32)
    flow[::5, ::3] = np.nan
    return flow


def test_tepe_along_a_given_flow():
    estimates, truths, _, _ = noisy_video(2)
    flow = random_flow(1)
    errors = []
    for y in range(HEIGHT):
        for x in range(WIDTH):
            to_x, to_y = (np.rint(at + f) for at, f in ((x, flow[y, x, 0].astype(float)), (y, flow[y, x, 1].astype(float))))
            if not (0 <= to_x < WIDTH and 0 <= to_y < HEIGHT):
                continue
            values = [m[0][y, x] for m in (truths, estimates)] + [m[1][int(to_y), int(to_x)] for m in (truths, estimates)]
            if all(map(is_known, values)):
                d0, e0, d1, e1 = map(float, values)
                errors.append(abs((e1 - e0) - (d1 - d0)))
    figures = egosgm.evaluate_video(estimates, truths, flows=[flow, None]).figures
    assert figures.tepe_codd_px == pytest.approx(np.mean(errors), rel=1e-6)


def test_opw_and_rtc_of_depths():
    estimates, _, _, _ = noisy_video(2)
    flow, depths = random_flow(2), []
    rng = np.random.default_rng(9)
    images = [rng.integers(100, 130, (HEIGHT, WIDTH)).astype(np.uint8) for _ in range(2)]
    depth = [CAMERA.fx * CAMERA.baseline_m / np.where(is_known(e), e, np.nan).astype(float) for e in estimates]

    def bilinear(image, y, x):
        top, left = int(np.floor(y)), int(np.floor(x))
        dy, dx = y - top, x - left
        return sum(w * image[top + j, left + i] for j, i, w in ((0, 0, (1 - dy) * (1 - dx)), (0, 1, (1 - dy) * dx), (1, 0, dy * (1 - dx)),
                                                                (1, 1, dy * dx)) if w)
    for y in range(HEIGHT):
        for x in range(WIDTH):
            to_x, to_y = x + float(flow[y, x, 0]), y + float(flow[y, x, 1])
            if 0 <= to_x <= WIDTH - 1 and 0 <= to_y <= HEIGHT - 1:
                difference = np.sqrt(3) * abs(bilinear(images[1].astype(float), to_y, to_x) - images[0][y, x]) / 255
                if np.exp(-50 * difference) > 0.01:
                    depths.append((depth[0][y, x], bilinear(depth[1], to_y, to_x)))
    a, b = np.array([pair for pair in depths if np.isfinite(pair).all()]).T
    figures = egosgm.evaluate_video(estimates, calibration=CAMERA, flows=[flow, None], images=images).figures
    assert 100 < len(a) < HEIGHT * WIDTH
    assert figures.opw_nvds_m == pytest.approx(np.mean(np.abs(a - b)), rel=1e-5)
    ratio = np.maximum(a / b, b / a)
    assert figures.rtc_1_01_percent == pytest.approx(100 * np.mean(ratio < 1.01))
    assert figures.rtc_1_25_percent == pytest.approx(100 * np.mean(ratio < 1.25))


def test_harm_and_help():
    estimates, truths, _, _ = noisy_video()
    others = [np.where(is_known(e), e + np.random.default_rng(k).normal(0, 2, e.shape), NO).astype(np.float32) for k, e in enumerate(estimates)]
    a, b, t = (np.concatenate([m.ravel() for m in values]).astype(float) for values in (estimates, others, truths))
    known = is_known(a) & is_known(b) & is_known(t)
    changed = known & (np.abs(a - b) > 1)
    figures = egosgm.evaluate_video(estimates, truths, against=others).figures
    assert figures.changed_percent == pytest.approx(100 * changed.sum() / known.sum())
    assert figures.harm_percent == pytest.approx(100 * np.mean((np.abs(a - t) > np.abs(b - t))[changed]))
    assert figures.help_percent == pytest.approx(100 * np.mean((np.abs(a - t) < np.abs(b - t))[changed]))


def test_gained_lost_and_trusted():
    estimate, against, truth = (np.float32([row]) for row in ([10, 20, 20, NO, NO, 10, NO, 2, 5], [NO, NO, 10, 10, 20, 20, 0, NO, NO], [10] * 6 + [0] * 3))
    flat = egosgm.REASONS.index("flat")
    reasons = np.uint8([[0, 0, flat] + [0] * 5 + [flat]])
    result = egosgm.evaluate_video([estimate], [truth], against=[against], reasons=[reasons])
    figures = result.figures
    assert (figures.gained_percent, figures.gained_right_percent, figures.lost_right_percent) == pytest.approx((400 / 9, 50, 200 / 9))
    assert (figures.wrong_of_trusted_percent, figures.trusted_of_wrong_percent) == pytest.approx((25, 100 / 3))
    assert (result.regions["sky"].filled, result.regions["all"].wrong_of_all, result.regions["sky"].gained_right_percent) == pytest.approx((200 / 3, 100 / 3, 50))


def half_up(value):
    return int(np.floor(value + 0.5))


def test_equal_density_and_ause():
    estimates, truths, _, _ = noisy_video()
    rng = np.random.default_rng(4)
    variances = [np.abs(e - t).astype(np.float32) * rng.uniform(0.5, 2, e.shape).astype(np.float32) for e, t in zip(estimates, truths)]
    shares = np.arange(2, 101, 2)
    sums = {"order": np.zeros((50, 3)), "oracle": np.zeros((50, 3))}
    at = np.zeros((11, 2))
    for e, t, v in zip(estimates, truths, variances):
        known = is_known(e) & is_known(t)
        error, variance = np.abs(t - e)[known], v[known]
        by_variance = error[np.argsort(variance, kind="stable")]
        for name, ordered in (("order", by_variance), ("oracle", np.sort(error))):
            for i, share in enumerate(shares):
                kept = ordered[:half_up(len(error) * share / 100)]
                sums[name][i] += len(kept), kept.astype(float).sum(), (kept > 3).sum()
        for i, density in enumerate(range(50, 101, 5)):
            kept = by_variance[:half_up(is_known(t).sum() * density / 100)]
            at[i] += len(kept), (kept > 3).sum()
    evaluation = egosgm.evaluate_video(estimates, truths, uncertainties=variances)
    density = evaluation.density
    np.testing.assert_allclose(density.kept_bad_percent, 100 * sums["order"][:, 2] / sums["order"][:, 0])
    np.testing.assert_allclose(density.oracle_bad_percent, 100 * sums["oracle"][:, 2] / sums["oracle"][:, 0])
    np.testing.assert_allclose(density.bad_percent, 100 * at[:, 1] / at[:, 0])
    np.testing.assert_allclose(density.reached_percent, 100 * at[:, 0] / sum(is_known(t).sum() for t in truths))
    area = np.trapezoid if hasattr(np, "trapezoid") else np.trapz
    for name, column, unit in (("ause_px", 1, 1), ("ause_bad_percent", 2, 100)):
        gap = sums["order"][:, column] / sums["order"][:, 0] - sums["oracle"][:, column] / sums["oracle"][:, 0]
        assert getattr(evaluation.figures, name) == pytest.approx(unit * area(gap, shares / 100))


def test_known_answers():
    """A constant shift is calm, a jump in time is not, a hole is no pixel, a square that moves is no flicker of the rest."""
    shifted = egosgm.evaluate_video(maps(14, 15), maps(10, 11)).figures
    assert shifted.tepe_dynamicstereo_px == 0
    jump = egosgm.evaluate_video(maps(10, 12, 10), maps(10, 10, 10))
    assert jump.figures.tepe_dynamicstereo_px == 2
    assert [frame.tepe_dynamicstereo_px for frame in jump.frames[1:]] == [2, 2] and math.isnan(jump.frames[0].tepe_dynamicstereo_px)
    assert egosgm.evaluate_video(maps(10, 11), maps(10, 10)).figures.tepe_dynamicstereo_above_1px_percent == 0, "exactly 1 px is not above it"
    holes = maps(10, 12)
    holes[1][:, :30] = np.nan
    holes[1][:, 30:] = 10
    assert egosgm.evaluate_video(holes, maps(10, 10)).figures.tepe_dynamicstereo_px == 0
    assert egosgm.evaluate_video(maps(7.5, 15), calibration=CAMERA, world_from_camera=poses(0, 1)).figures.flicker_px == pytest.approx(0, abs=1e-5)
    square = maps(5, 5)
    square[0][5:10, 5:10] = square[1][5:10, 9:14] = 20
    still = egosgm.evaluate_video(square, square, calibration=CAMERA, world_from_camera=poses(0, 0)).figures
    assert still.flicker_px == pytest.approx(2 * 20 * 15 / (HEIGHT * WIDTH)), "flicker knows nothing of what moves"
    assert still.tepe_dynamicstereo_px == 0 and still.tepe_codd_px == 0


def changed(map_, row, column, height, width, value):
    """A copy with a block of another value."""
    copy = map_.copy()
    copy[row:row + height, column:column + width] = value
    return copy


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("hole", [np.inf, np.nan])
def test_holes_of_any_value_are_holes(hole):
    estimates, truths, moving, world_from_camera = noisy_video()
    given = dict(moving=moving, calibration=CAMERA, world_from_camera=world_from_camera)
    expected = egosgm.evaluate_video(estimates, truths, against=truths, **given)
    with_hole = [[np.where(d == NO, np.float32(hole), d) for d in each] for each in (estimates, truths)]
    assert str(egosgm.evaluate_video(*with_hole, against=with_hole[1], **given)) == str(expected)


def test_what_moves_or_is_hidden_is_not_along_the_motion():
    moving = [np.zeros((HEIGHT, WIDTH), bool) for _ in range(2)]
    moving[0][0, :4] = True
    moving[1][1, :2] = True
    hidden = changed(maps(10)[0], 5, 10, 1, 3, 15)  # something new in front
    figures = egosgm.evaluate_video([maps(10)[0], changed(maps(11)[0], 8, 8, 2, 10, 14)], [maps(10)[0], hidden], moving=moving, calibration=CAMERA,
                                    world_from_camera=poses(0, 0)).figures
    pixels = HEIGHT * WIDTH - 4 - 2 - 3
    assert figures.tepe_codd_px == pytest.approx((pixels + 20 * 3) / pixels)
    assert figures.tepe_codd_above_3px_percent == pytest.approx(100 * 20 / pixels)


def test_a_given_next_truth_stands_for_the_next_frames_own():
    """A square of 4x3 pixels moves by (3, 1) and comes nearer by 2 px; its estimate by 5."""
    square = [changed(maps(5)[0], 2, 2, 3, 4, 20), changed(maps(5)[0], 3, 5, 3, 4, 22), changed(maps(5)[0], 3, 5, 3, 4, 25)]
    flow = np.full((HEIGHT, WIDTH, 2), np.nan, np.float32)
    flow[2:5, 2:6] = 3.4, 0.6
    estimates, truths = [square[0], square[2]], [square[0], square[1]]
    own = egosgm.evaluate_video(estimates, truths, flows=[flow, None]).figures
    assert (own.tepe_codd_px, own.tepe_codd_above_3px_percent, own.tepe_codd_relative_above_1_percent) == (3, 0, 100)
    for second in (truths[1], None):
        given = egosgm.evaluate_video(estimates, [truths[0], second], flows=[flow, None], next_truths=[maps(24)[0], None]).figures
        assert given.tepe_codd_px == 1, "disp_1 needs no truth of the next frame's own"


def test_opw_leaves_out_what_does_not_look_alike():
    flow = np.zeros((HEIGHT, WIDTH, 2), np.float32)

    def opw(grey, disparity):
        images = [np.full((HEIGHT, WIDTH), 100, np.uint8), changed(np.full((HEIGHT, WIDTH), 100, np.uint8), 0, 0, 10, WIDTH, grey)]
        return egosgm.evaluate_video([maps(10)[0], changed(maps(12)[0], 0, 0, 10, WIDTH, disparity)], flows=[flow, None], images=images).figures.opw_nvds_px
    assert opw(113, 50) == (2 + 40) / 2, "sqrt(3) * 13 / 255 = 0.0883: exp(-4.4) = 0.012"
    assert opw(114, 50) == 2, "0.0951: exp(-4.75) = 0.0086"
    far = flow.copy()
    far[0, :2, 0] = 250.5
    assert egosgm.evaluate_video(maps(10, 12), flows=[far, None]).figures.opw_nvds_px == 2


def test_the_order_is_that_of_a_stable_sort():
    values = np.random.default_rng(8).normal(0, 1e3, 5000).round().astype(np.float32)
    values[::7], values[::11] = 0.0, -0.0
    np.testing.assert_array_equal(video_counts._order(values), np.argsort(values, kind="stable"))


def test_regions_by_hand():
    """The camera moves to the right: a wall of 10 px goes 5 px to the left, what stands before it (40 px) 20 px."""
    before, now = changed(maps(10)[0], 2, 24, 4, 3, 40), changed(maps(10)[0], 2, 4, 4, 3, 40)
    moving = np.zeros((HEIGHT, WIDTH), bool)
    moving[15, :7] = True
    world_from_camera = np.stack([np.eye(4)] * 2)
    world_from_camera[1, 0, 3] = 0.15
    estimate = changed(maps(10)[0], 2, 4, 2, 3, 44)  # of what is near in the later frame, half; and the wall in the place of the rest
    regions = egosgm.evaluate_video([maps(10)[0], estimate], [before, now], moving=[None, moving], calibration=CAMERA, world_from_camera=world_from_camera).regions
    assert (regions["near"].bad_of_valid, regions["far"].bad_of_valid) == (100, 0)
    pixels = {name: region.truth_pixels for name, region in regions.items()}
    # Five columns enter on the right; behind the near thing, columns 19 to 21 of rows 2 to 5 were hidden. Within 3 pixels of the
    # jumps, which have no corners, are 11 columns of rows 0 to 8, and 9 of row 9.
    assert pixels == {"all": 2 * 800, "near": 2 * 12, "far": 2 * 788, "moving": 7, "still": 793, "uncovered": 5 * HEIGHT + 12,
                      "edges": 2 * (11 * 9 + 9)}


def test_maps_may_be_read_when_they_are_needed():
    class Lazy:
        def __len__(self):
            return 64

        def __getitem__(self, i):
            if i >= 64:
                raise IndexError
            return maps(10 + i % 2)[0]
    result = egosgm.evaluate_video(Lazy(), [maps(10)[0]] * 64)
    assert result.figures.tepe_dynamicstereo_px == 1 and len(result.frames) == 64
    assert dataclasses.asdict(result)["figures"]["tepe_dynamicstereo_above_1px_percent"] == 0


@pytest.mark.parametrize("arguments, named", [
    (dict(estimates=iter(maps(1))), "estimates is a list_iterator: give a list of maps"), (dict(estimates=maps(1), truths=iter(maps(1))), "truths is a list_iterator"),
    (dict(estimates=[]), "no frames"), (dict(estimates=maps(1), truths=[np.zeros((3, 4))]), "4x3"),
    (dict(estimates=maps(1, 1), flows=[np.zeros((HEIGHT, WIDTH)), None]), "H x W x 2"),
    (dict(estimates=maps(1, 1), world_from_camera=poses(0, 1)), "no calibration"),
    (dict(estimates=maps(1, 1), world_from_camera=poses(0), calibration=CAMERA), "1 poses of 2 frames"),
    (dict(estimates=[np.zeros(3)]), "estimates"), (dict(estimates=[CAMERA]), "estimates is no array"), (dict(estimates=maps(1, 1), truths=maps(1)), "truths has 1 of 2 frames"),
    (dict(estimates=maps(1, 1), truths=maps(1, 1, 1)), "truths has 3 of 2 frames"), (dict(estimates=maps(1), reasons=[]), "reasons has 0 of 1"),
    (dict(estimates=maps(1, 1), world_from_camera=np.zeros((2, 4, 4)), calibration=CAMERA), "world_from_camera: matrix 0 is no rotation")])
def test_wrong_input_is_refused(arguments, named):
    expect_refused(named, lambda: egosgm.evaluate_video(**arguments))


def test_an_error_of_the_callers_own_comes_through():
    class Broken(list):
        def __getitem__(self, i):
            raise KeyError("the disk is gone")
    with pytest.raises(KeyError, match="the disk is gone"):
        egosgm.evaluate_video(Broken(maps(1, 1, 1)))

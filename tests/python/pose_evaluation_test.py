# SPDX-License-Identifier: Apache-2.0
"""egosgm.evaluate_poses on paths whose errors are known."""
import math

import egosgm
import numpy as np
import pytest
from refusals import expect_refused


def drive(frames, step_m, turn_rad=0.0):
    """Straight on, so many metres and radians (about y) a frame."""
    motion = np.eye(4)
    motion[[0, 0, 2, 2], [0, 2, 0, 2]] = math.cos(turn_rad), math.sin(turn_rad), -math.sin(turn_rad), math.cos(turn_rad)
    motion[2, 3] = step_m
    poses = [np.eye(4)]
    for _ in range(frames - 1):
        poses.append(poses[-1] @ motion)
    return np.stack(poses)


def test_equal_poses_have_no_error():
    result = egosgm.evaluate_poses(drive(40, 1, 0.02), drive(40, 1, 0.02))
    assert len(result.motions) == 39
    assert result.path_length_m == pytest.approx(39)
    for figure in (result.end_drift_percent, result.segment_translation_percent, result.segment_rotation_deg_per_m):
        assert figure == pytest.approx(0, abs=1e-9)


def test_the_first_pose_does_not_matter():
    away = np.eye(4)
    away[1:3, 1:3] = [[math.cos(1), -math.sin(1)], [math.sin(1), math.cos(1)]]
    away[:3, 3] = 5, 6, 7
    assert egosgm.evaluate_poses(away @ drive(30, 1, 0.01), drive(30, 1, 0.01)).end_drift_m == pytest.approx(0, abs=1e-9)


def test_a_wrong_scale_is_drift():
    result = egosgm.evaluate_poses(drive(51, 1.02), drive(51, 1))
    assert (result.end_drift_m, result.end_drift_percent, result.translation_rmse_m, result.translation_mean_m) == pytest.approx((1, 2, 0.02, 0.02))
    assert result.motions[7].translation_m == pytest.approx(0.02)
    assert result.short_segments and len(result.segments) == 9, "50 m needs a frame beyond 50 m"
    first = result.segments[0]  # it ends at the first frame beyond its length: 6 m for 5 m, so 0.12 m of error for 5 m
    assert (first.length_m, first.segments, first.translation_percent) == (5, 45, pytest.approx(2.4))


def test_a_wrong_turn_is_rotation():
    result = egosgm.evaluate_poses(drive(1001, 1, 0.001), drive(1001, 1))
    assert (result.rotation_rmse_rad, result.rotation_mean_rad) == pytest.approx((0.001, 0.001))
    assert result.rotation_end_drift_deg == pytest.approx(math.degrees(1))
    assert not result.short_segments and len(result.segments) == 8
    first = result.segments[0]
    assert (first.length_m, first.segments) == (100, 90), "starts at 0, 10, ... 890; 900 would need frame 1001"
    assert first.rotation_deg_per_m == pytest.approx(101 * math.degrees(0.001) / 100)
    weights = [segment.segments for segment in result.segments]
    assert result.segment_rotation_deg_per_m == pytest.approx(np.average([s.rotation_deg_per_m for s in result.segments], weights=weights))


def test_a_half_turn_has_an_angle():
    turned = drive(2, 1)
    turned[1, [0, 2], [0, 2]] = -1
    assert egosgm.evaluate_poses(turned, drive(2, 1)).rotation_mean_rad == pytest.approx(math.pi)


def test_mean_and_root_mean_square_differ():
    estimate = drive(5, 1)
    estimate[2:, 2, 3] += 0.4  # one motion of four
    result = egosgm.evaluate_poses(estimate, drive(5, 1))
    assert (result.translation_mean_m, result.translation_rmse_m) == pytest.approx((0.1, 0.2))


def test_standing_still_has_no_percent():
    result = egosgm.evaluate_poses(drive(5, 0), drive(5, 0))
    assert math.isnan(result.end_drift_percent) and math.isnan(result.segment_translation_percent) and result.segments == []


@pytest.mark.parametrize("estimate, truth, named", [(drive(3, 1), drive(4, 1), "3 estimated and 4 true"), (drive(1, 1), drive(1, 1), "at least two"),
                                                    (np.zeros((3, 3, 4)), drive(3, 1), "N, 4, 4"), ("a", drive(3, 1), "no array of numbers"), (drive(3, math.nan), drive(3, 1), "not finite"),
                                                    (drive(3, 1), drive(3, 1) * [[[1], [2], [1], [1]]], "truth: matrix 0 is no rotation"), (np.zeros((3, 4, 4)), drive(3, 1), "estimate: matrix 0"),
                                                    (drive(3, 1) * [[[1]], [[-1]], [[1]]], drive(3, 1), "estimate: matrix 1"),
                                                    (drive(3, 1) + [[[0]], [[0]], [[1e200]]], drive(3, 1), "estimate: matrix 2")])
def test_wrong_input_is_refused(estimate, truth, named):
    expect_refused(named, lambda: egosgm.evaluate_poses(estimate, truth))


def test_as_evo_has_it():
    """evo's relative pose error from frame to frame."""
    pytest.importorskip("evo")
    from evo.core import metrics, trajectory
    rng = np.random.default_rng(2)
    estimate, truth = drive(80, 1, 0.01), drive(80, 1)
    estimate[:, :3, 3] += rng.normal(0, 0.05, (80, 3))
    found = egosgm.evaluate_poses(estimate, truth)
    for relation, own in ((metrics.PoseRelation.translation_part, found.translation_rmse_m), (metrics.PoseRelation.rotation_angle_rad, found.rotation_rmse_rad)):
        rpe = metrics.RPE(relation, 1, metrics.Unit.frames)
        rpe.process_data(tuple(trajectory.PosePath3D(poses_se3=list(poses)) for poses in (truth, estimate)))
        assert rpe.get_statistic(metrics.StatisticsType.rmse) == pytest.approx(own)

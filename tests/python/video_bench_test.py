# SPDX-License-Identifier: Apache-2.0
"""What bench/accuracy --video compares with: averages in time, and wrong motions."""
import pathlib
import re
import sys
import types

import numpy as np
import pytest

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / "bench" / folder) for folder in ("accuracy", "")]
import video  # noqa: E402
import video_figures as figures  # noqa: E402

NO = figures.egosgm.INVALID_DISPARITY


def test_an_average_keeps_what_jumps_and_what_is_behind_a_hole():
    before, now = np.float32([[10, 10, 10, NO, NO]]), np.float32([[10.5, 11, NO, 7, NO]])
    np.testing.assert_allclose(video.averaged(figures, before, now, False, 20 / 32), [[10.2, 11, 10, 7, NO]], rtol=1e-6)
    np.testing.assert_allclose(video.averaged(figures, before, now, True, 20), [[10.2, 10.4, NO, 7, NO]], rtol=1e-6)


@pytest.mark.parametrize("degrees, metres", [(0, 0), (1, 0), (0, 0.1), (0.5, 0.02)])
def test_every_motion_is_off_by_so_much(degrees, metres):
    poses = np.stack([np.eye(4)] * 4)
    poses[:, 2, 3] = 0, 1, 3, 4
    wrong = video.disturbed(np, poses, degrees, metres)
    for k in range(1, len(poses)):
        true_motion, motion = (np.linalg.inv(p[k]) @ p[k - 1] for p in (poses, wrong))
        off = motion @ np.linalg.inv(true_motion)
        assert np.degrees(np.arccos(np.clip((np.trace(off[:3, :3]) - 1) / 2, -1, 1))) == pytest.approx(degrees, abs=1e-5)
        assert np.linalg.norm(off[:3, 3]) == pytest.approx(metres, abs=1e-12)
        np.testing.assert_allclose(off[:3, :3] @ off[:3, :3].T, np.eye(3), atol=1e-12)


def test_maps_of_an_earlier_build_are_no_figures_of_this_one(tmp_path):
    left = tmp_path / "video/street/EgoSGM"
    left.mkdir(parents=True)
    video.video_tables(types.SimpleNamespace(work=tmp_path, data=tmp_path), re.compile("no video"))
    assert not left.exists()

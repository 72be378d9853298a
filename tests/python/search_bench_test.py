# SPDX-License-Identifier: Apache-2.0
"""What bench/accuracy --search tries, and when it takes a constant."""
import pathlib
import sys

import numpy as np
import pytest

import egosgm

sys.path[:0] = [str(pathlib.Path(__file__).resolve().parents[2] / folder) for folder in ("bench/accuracy", "bench")]
import inputs  # noqa: E402
import search  # noqa: E402
import video_figures  # noqa: E402
from ablation import Case  # noqa: E402


def test_every_constant_of_the_stages_is_one_that_a_pipeline_takes():
    found = search.default_constants()
    stages = {name: value for name, value in found.items() if not name.startswith("EGOSGM_")}
    assert stages["banded_sgm.p1"] == 16 and stages["search_band.neighbour_min_count"] == 144 and stages["consistency.update_px"] == 2.0
    assert isinstance(found["EGOSGM_EVIDENCE_TRUSTED"], int) and isinstance(found["EGOSGM_LONE_PX"], float)
    calibration = egosgm.Calibration(fx=100, fy=100, cx=32, cy=16, baseline_m=0.5)
    egosgm.Pipeline(calibration, 64, 32, disparities=32, **{f"constants.{name}": value for name, value in stages.items()})


@pytest.mark.parametrize("value, tried", [(16, [24, 11]), (1, [2, 0]), (0, []), (0.05, [0.075, 0.033]), (3.0, [4.5, 2.0]), (-1, [])])
def test_a_number_is_tried_above_and_below(value, tried):
    assert search.steps_from(value) == tried
    assert all(type(found) is type(value) for found in search.steps_from(value))


def test_kinds_count_alike_however_many_inputs_they_have():
    assert search.score_of([("streets", 1.0), ("streets", 0.8), ("KITTI", 1.2)]) == pytest.approx((0.9 + 1.2) / 2)


def test_one_input_does_not_decide():
    start = [("streets", 1.0), ("streets", 1.0), ("KITTI", 1.0)]
    assert search.is_better([("streets", 0.97), ("streets", 0.98), ("KITTI", 0.99)], start)
    assert not search.is_better([("streets", 0.5), ("streets", 1.01), ("KITTI", 1.01)], start)
    assert not search.is_better([("streets", 0.9995), ("streets", 0.9995), ("KITTI", 0.9995)], start)


def test_ratios_weigh_figures_and_cells():
    start = {"bad_or_missing": 5.0, "bad_of_valid": 2.0, "interpolated": 4.0, "search": 10.0}
    assert search.ratio_to(start, start) == pytest.approx(1)
    assert search.ratio_to(start, start | {"bad_of_valid": 3.0}) == pytest.approx((1 + 2 * 1.5 + 2) / 5)
    assert search.ratio_to(start, start | {"search": 20.0}) == pytest.approx(1 + search.SEARCH_WEIGHT)
    place = {"wrong_of_all": 1.0, "filled": 50.0, "search": 10.0}
    assert search.ratio_to(place, place | {"wrong_of_all": 3.0, "filled": 25.0}) == pytest.approx((2 + 2) / 2)


def test_sequences_of_ones_own_need_truth(tmp_path):
    with pytest.raises(inputs.Failed, match="no such folder"):
        list(search.sequences_of(video_figures, [tmp_path / "none"]))
    for side in ("image_0", "image_1", "truth/left_disp_noc"):
        (tmp_path / side).mkdir(parents=True)
    (tmp_path / "calib.txt").write_text("P0: 100 0 32 0 0 100 16 0 0 0 1 0\nP1: 100 0 32 -50 0 100 16 0 0 0 1 0\n")
    grey = np.random.default_rng(1).integers(0, 65536, (32, 64)).astype(np.float32) / 256
    for k in range(5):
        for side in ("image_0", "image_1"):
            egosgm.write_disparity(tmp_path / side / f"{k:06d}.png", grey)
    with pytest.raises(inputs.Failed, match="no truth from frame 3 on"):
        list(search.sequences_of(video_figures, [tmp_path]))
    egosgm.write_disparity(tmp_path / "truth/left_disp_noc/000004.png", grey)
    assert [case.scored for case in search.sequences_of(video_figures, [tmp_path])] == [[4]]


class Video:
    """Two frames that a pipeline matches at their true disparity of 8 px."""
    size, calibration = (96, 48), egosgm.Calibration(fx=100, fy=100, cx=48, cy=24, baseline_m=0.5)

    def __init__(self):
        self.texture = np.random.default_rng(1).integers(0, 256, (48, 104), dtype=np.uint8)

    def images(self, k):
        return self.texture[:, :96], self.texture[:, 8:]

    def motion(self, k, since):
        return np.eye(4)

    def truth(self, k):
        return np.where(np.arange(96) < 48, np.float32(8), np.float32(20)) * np.ones((48, 1), np.float32)

    def moving(self, k):
        return np.arange(96) * np.ones((48, 1)) >= 72


def test_figures_of_a_video():
    case = Case("streets", "street, moving", Video(), range(4), [3])
    figures = search.figures_of(case, *search.counts_of(video_figures, case, {"disparities": 32}))
    assert figures["bad_or_missing"] > 50 and figures["interpolated"] == pytest.approx(50, abs=1)
    assert figures["moving_off_or_missing"] == pytest.approx(25)
    assert 0 < figures["search"] <= 100
